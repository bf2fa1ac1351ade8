"""Reynolds beside Mitsuba 3 (llvm_ad_rgb): the same scenes, depths and roulette, in turn; the peer warmed up and at its
best sample count per call. A ratio is printed only when both pictures agree within their noise."""
import json
import os
import resource
import statistics
import subprocess
import sys
import time

import numpy as np

import scenes

REPEATS = 3
REYNOLDS = os.path.abspath(sys.argv[1] if len(sys.argv) > 1 else "build/bin/reynolds")

COLD = """
import mitsuba as mi
mi.set_variant('llvm_ad_rgb')
scene = mi.load_file('%s')
mi.util.write_bitmap('%s', mi.render(scene, spp=16))
"""


def reynolds(*arguments):
    return json.loads(subprocess.run([REYNOLDS, *arguments, "--json"], check=True, capture_output=True, text=True).stdout)


def timed(function):
    start = time.time()
    function()
    return time.time() - start


def agree(ours, theirs):
    """Means within 1 %, and most blocks of 16 x 16 pixels within 10 %."""
    a, b = (x.reshape(32, 16, 32, 16, 3).mean((1, 3, 4)) for x in (ours, theirs))
    near = np.abs(a - b) <= 0.1 * np.maximum(np.abs(b), 0.02)
    return abs(ours.mean() / theirs.mean() - 1) < 0.01 and near.mean() > 0.95


def main():
    import mitsuba as mi
    mi.set_variant("llvm_ad_rgb")
    import drjit as dr
    folder = "build/bench"
    print("Mitsuba %s against Reynolds, %d threads" % (mi.__version__, os.cpu_count()))
    print("%-10s %-28s %12s %12s %8s" % ("scene", "what", "peer Mp/s", "ours Mp/s", "ratio"))
    for name, (path, _) in scenes.make(folder).items():
        if name == "million":
            continue  # its sky is a NumPy array, which the peer does not read
        scene = mi.load_file(path)
        pixels = 512 * 512

        def render(spp, seed):
            image = mi.render(scene, spp=spp, seed=seed)
            dr.eval(image)
            dr.sync_thread()
            return image

        best = 0
        for spp in (16, 64):
            render(spp, 0)
            best = max(best, max(pixels * spp / timed(lambda s=s: render(spp, s)) / 1e6 for s in range(1, 4)))
            dr.flush_malloc_cache()
        out = os.path.join(folder, "ours.npy")
        ours = statistics.median(reynolds("render", path, "-o", out, "--spp", "16")["paths_per_second"] / 1e6
                                 for _ in range(REPEATS))
        theirs = np.array(render(64, 9))[..., :3]
        reynolds("render", path, "-o", out, "--spp", "64", "--seed", "9")
        same = agree(np.load(out), theirs)
        print("%-10s %-28s %12.2f %12.2f %8s" % (name, "primal", best, ours, "%.2f" % (ours / best) if same else "differs"))

        # Reverse mode with respect to all albedos (or the roughness), and forward with respect to a roughness.
        parameters = mi.traverse(scene)
        keys = [k for k in parameters.keys() if k.endswith("reflectance.value") and k.split(".")[0] in ("white", "red", "green")]
        alpha = [k for k in parameters.keys() if k.endswith("alpha.value")]
        integrator = mi.load_dict({"type": "prb", "max_depth": 8, "rr_depth": 5})
        for what, chosen in (("reverse, albedos", keys if name == "cornell" else []), ("reverse, roughness", alpha)):
            if not chosen:
                continue
            for k in chosen:
                dr.enable_grad(parameters[k])
            parameters.update()

            def reverse(seed):
                for k in chosen:
                    dr.set_grad(parameters[k], 0)
                image = mi.render(scene, parameters, integrator=integrator, spp=16, spp_grad=16, seed=seed)
                dr.backward(dr.sum(image, axis=None))
                dr.eval(*[dr.grad(parameters[k]) for k in chosen])
                dr.sync_thread()

            def primal(seed):
                with dr.suspend_grad():
                    image = mi.render(scene, integrator=integrator, spp=16, seed=seed)
                    dr.eval(image)
                    dr.sync_thread()

            reverse(0)
            primal(0)
            # The render call above runs a primal pass first; only the derivative's own time counts for the peer.
            seconds = min(timed(lambda s=s: reverse(s)) for s in range(1, 4)) - min(timed(lambda s=s: primal(s)) for s in range(1, 4))
            rate = pixels * 16 / max(seconds, 1e-3) / 1e6
            arguments = [x for k in chosen for x in ("--param", k)]
            grads = [reynolds("grad", path, *arguments, "--mode", "reverse", "--adjoint", "1", "--spp", "16")
                     for _ in range(REPEATS)]
            mine = statistics.median(g["paths"] / g["seconds"] for g in grads) / 1e6
            print("%-10s %-28s %12.2f %12.2f %8.2f" % (name, what, rate, mine, mine / rate))
            for k in chosen:
                dr.disable_grad(parameters[k])

    path = os.path.join(folder, "cold.xml")
    with open(os.path.join(folder, "box_70k.xml")) as f:
        text = f.read().replace('name="width" value="512"', 'name="width" value="256"')
    with open(path, "w") as f:
        f.write(text.replace('name="height" value="512"', 'name="height" value="256"'))
    code = COLD % (path, os.path.join(folder, "peer.exr"))
    peer = statistics.median(timed(lambda: subprocess.run([sys.executable, "-c", code], check=True)) for _ in range(REPEATS))
    ours = statistics.median(timed(lambda: subprocess.run([REYNOLDS, "render", path, "-o", os.path.join(folder, "ours.exr")],
                                                          check=True, capture_output=True)) for _ in range(REPEATS))
    print("%-10s %-28s %11.2fs %11.2fs %8.2f" % ("box+70k", "cold process, 256 x 256 x 16", peer, ours, peer / ours))
    print("peak memory: peer %.0f MB" % (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024))


if __name__ == "__main__":
    main()
