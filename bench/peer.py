"""Reynolds beside Mitsuba 3 (llvm_ad_rgb): the same scenes, depths and roulette, in turn; the peer warmed up and at its
best sample count per call. A ratio is printed only when both pictures agree within their noise.

usage: peer.py [--rows loading,cold,...] [REYNOLDS [SCENE...]]"""
import argparse
import json
import os
import statistics
import subprocess
import sys
import time

import numpy as np

import scenes

REPEATS = 3
SPP = 16
FOLDER = "build/bench"
ROWS = ("primal", "volpathmis", "equal_error", "gradients", "albedos", "density", "cold", "loading")
parser = argparse.ArgumentParser()
parser.add_argument("--rows", default=",".join(ROWS))
parser.add_argument("reynolds", nargs="?", default="build/bin/reynolds")
parser.add_argument("scenes", nargs="*")
OPTIONS = parser.parse_args()
REYNOLDS = os.path.abspath(OPTIONS.reynolds)
ROW = "%-11s %-34s %12s %12s %8s"

COLD = """
import mitsuba as mi
mi.set_variant('llvm_ad_rgb')
scene = mi.load_file('%s', **%r)
mi.util.write_bitmap('%s', mi.render(scene, spp=%d))
print([line.split()[1] for line in open('/proc/self/status') if line.startswith('VmHWM')][0])
"""

LOAD = """
import time
import mitsuba as mi
mi.set_variant('%s')
import drjit as dr
start = time.time()
scene = mi.load_file('%s', **%r)
dr.sync_thread()
print(time.time() - start)
"""


def reynolds(*arguments):
    return json.loads(subprocess.run([REYNOLDS, *arguments, "--json"], check=True, capture_output=True, text=True).stdout)


def reynolds_value(path, name):
    return next(p["value"] for p in reynolds("params", path)["parameters"] if p["name"] == name)


def defines(scene):
    return [x for k, v in scene.defines.items() for x in ("-D", "%s=%s" % (k, v))]


def timed(function):
    start = time.time()
    function()
    return time.time() - start


def best(function):
    function(0)
    return min(timed(lambda s=s: function(s)) for s in range(1, REPEATS + 1))


def process(command, kilobytes):
    """Wall seconds of a process, and its peak memory [MB], which `kilobytes` finds in its output."""
    start = time.time()
    output = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    return time.time() - start, kilobytes(output) / 1e3


def agree(ours, theirs):
    """Means within 1 %, and most of 32 x 32 blocks of pixels within 10 %."""
    a, b = (x.reshape(32, len(x) // 32, 32, len(x) // 32, 3).mean((1, 3, 4)) for x in (ours, theirs))
    near = np.abs(a - b) <= 0.1 * np.maximum(np.abs(b), 0.02)
    return abs(ours.mean() / theirs.mean() - 1) < 0.01 and near.mean() > 0.95


def error(image, reference):
    """Mean squared error relative to the picture, without the worst 0.1 % of pixels."""
    e = np.sort((((image - reference) ** 2).sum(2) / ((reference ** 2).sum(2) + 1e-4)).ravel())
    return e[:int(0.999 * e.size)].mean()


class Pair:
    """One scene in both programs."""

    def __init__(self, mi, dr, name, scene):
        self.mi, self.dr, self.name, self.scene = mi, dr, name, scene
        self.loaded = mi.load_file(scene.path, **scene.defines)
        self.out = os.path.join(FOLDER, "ours.npy")
        self.pixels = scene.size ** 2
        self.same = True

    def row(self, what, theirs, ours):
        ratio = "%.2f" % (ours / theirs) if self.same else "differs"
        print(ROW % (self.name, what, "%.2f" % theirs, "%.2f" % ours, ratio), flush=True)

    def render(self, spp, seed, **more):
        image = self.mi.render(self.loaded, spp=spp, seed=seed, **more)
        self.dr.eval(image)
        self.dr.sync_thread()
        return image

    def ours(self, spp, seed, *more):
        result = reynolds("render", self.scene.path, *defines(self.scene), "-o", self.out, "--spp", str(spp), "--seed",
                          str(seed), *more)
        return result, np.load(self.out)

    def loading(self):
        """From the file to a scene that can be rendered, the first time in a process, in two of the peer's variants."""
        mine = statistics.median(reynolds("info", self.scene.path, *defines(self.scene))["load_seconds"] for _ in range(REPEATS))
        for variant in ("scalar_rgb", "llvm_ad_rgb"):
            command = [sys.executable, "-c", LOAD % (variant, self.scene.path, self.scene.defines)]
            theirs = statistics.median(float(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
                                       for _ in range(REPEATS))
            self.row("loading [1/s], %s, %.0f and %.0f ms" % (variant[:4], 1e3 * theirs, 1e3 * mine), 1 / theirs, 1 / mine)

    def primal(self, what="primal", **integrator):
        rate = 0
        for spp in (SPP, 4 * SPP):
            rate = max(rate, self.pixels * spp / best(lambda s: self.render(spp, s, **integrator)) / 1e6)
            self.dr.flush_malloc_cache()
        mine = statistics.median(self.pixels * SPP / self.ours(SPP, s)[0]["seconds"] / 1e6 for s in range(REPEATS))
        self.same = agree(self.ours(64, 9)[1], np.array(self.render(64, 9, **integrator))[..., :3])
        self.row(what + " [Mpaths/s]", rate, mine)

    def integrator(self, kind):
        return self.mi.load_dict({"type": kind, "max_depth": self.scene.depth, "rr_depth": self.scene.rr_depth})

    def volpathmis(self):
        """The peer's other integrator of media; ours is the same for both names."""
        if self.name == "cloud":
            self.primal("primal, volpathmis", integrator=self.integrator("volpathmis"))

    def equal_error(self):
        reference = sum(self.ours(256, s, "--sampler", "sobol")[1] for s in (101, 102)) / 2
        spp = 64
        seconds = best(lambda s: self.render(spp, s))
        theirs = error(np.array(self.render(spp, 5))[..., :3], reference) * seconds
        results = [self.ours(spp, s, "--sampler", "sobol") for s in range(REPEATS)]
        mine = statistics.median(r["seconds"] for r, _ in results) * statistics.mean(error(i, reference) for _, i in results)
        self.row("1 / (error x time)", 1 / theirs, 1 / mine)

    def albedos(self):
        """All albedos of the box around the mesh."""
        if self.name == "box+70k":
            self.gradients([c + ".reflectance.value" for c in ("white", "red", "green")], "three albedos: ")

    def density(self):
        """Variance times time of the derivative by a factor on the cloud's density, in reverse mode, over independent seeds. The
        peer has it as the gradient of all voxels times the voxels."""
        if self.name != "cloud":
            return
        spp, seeds, voxels = 4, 12, "air.interior_medium.sigma_t.data"
        parameters = self.mi.traverse(self.loaded)
        values = np.array(parameters[voxels], dtype=float).ravel()
        integrator = self.integrator("prbvolpath")
        ones = self.dr.ones(self.mi.TensorXf, (self.scene.size, self.scene.size, 3))
        self.dr.enable_grad(parameters[voxels])
        parameters.update()
        theirs, seconds = [], []
        for seed in range(seeds + 1):
            start = time.time()
            integrator.render_backward(self.loaded, parameters, ones, seed=seed, spp=spp)
            gradient = np.array(self.dr.grad(parameters[voxels]), dtype=float)
            seconds.append(time.time() - start)
            theirs.append(gradient.ravel() @ values)
            self.dr.set_grad(parameters[voxels], 0)
        self.dr.disable_grad(parameters[voxels])
        name = "air.interior_medium.scale.value"
        results = [reynolds("grad", self.scene.path, "--param", name, "--mode", "reverse", "--adjoint", "1", "--spp", str(spp),
                            "--seed", str(seed)) for seed in range(4 * seeds)]
        scale = reynolds_value(self.scene.path, name)
        mine = [scale * r["value"] for r in results]
        print(ROW % (self.name, "derivative by overall density", "%.0f" % np.mean(theirs[1:]), "%.0f" % np.mean(mine),
                     "+- %.0f %.0f" % tuple(np.std(x, ddof=1) / len(x) ** 0.5 for x in (theirs[1:], mine))))
        time_of_ours = statistics.median(r["seconds"] for r in results)
        costs = (np.var(theirs[1:], ddof=1) * min(seconds[1:]), np.var(mine, ddof=1) * time_of_ours)
        self.row("its 1 / (relative variance x time)", *(np.mean(mine) ** 2 / c for c in costs))

    def gradients(self, of=None, prefix=""):
        mi, dr = self.mi, self.dr
        parameters = mi.traverse(self.loaded)
        keys = [k for k in of or self.scene.parameters if k in parameters]
        kind = "ptracer" if self.name == "particles" else "prbvolpath" if self.name in ("cloud", "fog") else "prb"
        integrator = self.integrator(kind)
        for k in keys:
            dr.enable_grad(parameters[k])
        parameters.update()
        ones = dr.ones(mi.TensorXf, (self.scene.size, self.scene.size, 3))

        def finish():
            dr.eval(*[dr.grad(parameters[k]) for k in keys])
            dr.sync_thread()
            for k in keys:
                dr.set_grad(parameters[k], 0)

        def backward(seed):
            integrator.render_backward(self.loaded, parameters, ones, seed=seed, spp=SPP)
            finish()

        def both(seed):
            dr.backward(dr.sum(mi.render(self.loaded, parameters, integrator=integrator, spp=SPP, spp_grad=SPP, seed=seed),
                               axis=None))
            finish()

        def forward(seed):
            for k in keys:
                dr.set_grad(parameters[k], 1)
            dr.eval(integrator.render_forward(self.loaded, parameters, seed=seed, spp=SPP))
            dr.sync_thread()

        paths = self.pixels * SPP / 1e6
        arguments = [x for k in keys for x in ("--param", k)] + ["--spp", str(SPP)] + defines(self.scene)
        grads = [reynolds("grad", self.scene.path, *arguments, "--mode", "reverse", "--adjoint", "1") for _ in range(REPEATS)]
        reverse = statistics.median(paths / g["seconds"] for g in grads)
        grads = [reynolds("grad", self.scene.path, *arguments) for _ in range(REPEATS)]
        mine = statistics.median(paths / g["seconds"] for g in grads)
        picture = statistics.median(paths / self.ours(SPP, s)[0]["seconds"] for s in range(REPEATS))
        self.row(prefix + "reverse, adjoint given [Mpaths/s]", paths / best(backward), reverse)
        self.row(prefix + "picture, then reverse [Mpaths/s]", paths / best(both), 1 / (1 / picture + 1 / reverse))
        try:
            self.row(prefix + "forward [Mpaths/s]", paths / best(forward), mine)
        except RuntimeError as failure: # its plugins that prepare tables from a parameter know no forward mode in `prb`
            print(ROW % (self.name, prefix + "forward [Mpaths/s]", "fails", "%.2f" % mine, ""), str(failure).splitlines()[0])
        for k in keys:
            dr.disable_grad(parameters[k])

    def cold(self):
        """A process from nothing to a 256 x 256 picture: what a user waits for, and the memory that it takes."""
        size = 256
        path = os.path.join(FOLDER, "cold.xml") if not self.scene.defines else self.scene.path
        settings = {k: str(size) if k in ("width", "height") else v for k, v in self.scene.defines.items()}
        if not settings:
            with open(self.scene.path) as f:
                text = f.read()
            for side in ("width", "height"):
                text = text.replace('name="%s" value="%d"' % (side, self.scene.size), 'name="%s" value="%d"' % (side, size))
            with open(path, "w") as f:
                f.write(text)
        code = COLD % (path, settings, os.path.join(FOLDER, "peer.exr"), SPP)
        scene = scenes.Scene(path, settings, [])
        command = [REYNOLDS, "render", path, *defines(scene), "--spp", str(SPP), "-o", os.path.join(FOLDER, "ours.exr"), "--json"]
        theirs = [process([sys.executable, "-c", code], lambda text: 1.024 * float(text.split()[-1])) for _ in range(REPEATS)]
        mine = [process(command, lambda text: 1e3 * json.loads(text)["peak_rss_mb"]) for _ in range(REPEATS)]
        seconds = [statistics.median(x[0] for x in runs) for runs in (theirs, mine)]
        memory = [statistics.median(x[1] for x in runs) for runs in (theirs, mine)]
        self.row("cold process [1/s], %.2f s and %.2f s" % tuple(seconds), 1 / seconds[0], 1 / seconds[1])
        print(ROW % (self.name, "its peak memory [MB]", "%.0f" % memory[0], "%.0f" % memory[1],
                     "%.2f" % (memory[0] / memory[1])), flush=True)


def main():
    import mitsuba as mi
    mi.set_variant("llvm_ad_rgb")
    import drjit as dr
    print("Mitsuba %s beside Reynolds, %d threads; a ratio above 1 is in favour of Reynolds" % (mi.__version__, os.cpu_count()))
    print(ROW % ("scene", "what", "peer", "ours", "ratio"))
    for name, scene in scenes.make(FOLDER).items():
        if OPTIONS.scenes and name not in OPTIONS.scenes:
            continue
        pair = Pair(mi, dr, name, scene)
        for row in OPTIONS.rows.split(","):
            getattr(pair, row)()
        del pair
        dr.flush_malloc_cache()


if __name__ == "__main__":
    main()
