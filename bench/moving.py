"""Gradients of what moves beside Mitsuba 3's projective integrators: standard deviation of the gradient over seeds, and
time, of one scalar: the mean of the picture times a ramp from 0 to 2 over its width, under a shift in x. The number that
counts is variance times time. Mitsuba warmed up, its guiding as it comes.

usage: moving.py [REYNOLDS [CASE...]]   (run by the interpreter that has mitsuba)"""
import json
import os
import resource
import statistics
import subprocess
import sys
import time

import numpy as np

import scenes

SEEDS, SIZE, SPP = 12, 64, 64
FOLDER = "build/bench"
SMALL = """<scene version="3.0.0">
<integrator type="path"><integer name="max_depth" value="2"/></integrator>
<sensor type="perspective"><float name="fov" value="40"/>
<transform name="to_world"><lookat origin="0, -5, 4" target="0, 0, 0.3" up="0, 0, 1"/></transform>
<sampler type="independent"><integer name="sample_count" value="16"/></sampler>
<film type="hdrfilm"><integer name="width" value="64"/><integer name="height" value="64"/><rfilter type="box"/></film></sensor>
<shape type="rectangle"><transform name="to_world"><scale value="4"/></transform><bsdf type="diffuse"/></shape>
%s</scene>
"""
LAMP = ('<shape type="rectangle"><transform name="to_world"><scale value="0.5"/><rotate x="1" angle="180"/>'
        '<translate z="4"/></transform><emitter type="area"><rgb name="radiance" value="20"/></emitter></shape>')
OCCLUDER = ('<shape type="obj" id="mover"><string name="filename" value="tree.obj"/><boolean name="face_normals" value="true"/>'
            '<transform name="to_world"><scale value="1.5"/><translate z="0.5"/></transform><bsdf type="twosided">'
            '<bsdf type="diffuse"/></bsdf></shape>')


def write_cases():
    with open(os.path.join(FOLDER, "box_70k.xml")) as f:
        box = f.read().replace('<shape type="ply">', '<shape type="ply" id="mover">').replace('value="512"', 'value="64"')
    cases = {}
    for name, text in {"box+70k, depth 2": box.replace('name="max_depth" value="8"', 'name="max_depth" value="2"'),
                       "box+70k, depth 8": box, "tree under a lamp": SMALL % (OCCLUDER + LAMP),
                       "tree under a sky": SMALL % (OCCLUDER + '<emitter type="constant"/>')}.items():
        cases[name] = os.path.join(FOLDER, "moving_%d.xml" % len(cases))
        with open(cases[name], "w") as f:
            f.write(text)
    return cases


def ramp():
    return np.tile(np.linspace(0, 2, SIZE, dtype=np.float32)[None, :, None], (SIZE, 1, 3))


def ours(reynolds, path, seed):
    out = subprocess.run([reynolds, "grad", path, "--param", "mover.positions:translate=1,0,0", "--mode", "reverse",
                          "--adjoint", os.path.join(FOLDER, "ramp.npy"), "--spp", str(SPP), "--seed", str(seed),
                          "--terms", "interior,primary,indirect", "--json"],
                         check=True, capture_output=True, text=True).stdout
    result = json.loads(out)
    return result["value"], result["seconds"], result["peak_rss_mb"]


def peer(path, depth, kind):
    import drjit as dr
    import mitsuba as mi
    scene = mi.load_file(path)
    integrator = mi.load_dict({"type": kind, **({"max_depth": depth} if kind.startswith("prb") else {})})
    params = mi.traverse(scene)
    key = "mover.vertex_positions"
    start_positions = mi.Float(params[key])
    weights = mi.TensorXf(ramp())

    def gradient(seed):
        theta = mi.Float(0)
        dr.enable_grad(theta)
        moved = dr.unravel(mi.Point3f, start_positions) + mi.Point3f(theta, 0, 0)
        params[key] = dr.ravel(moved)
        params.update()
        start = time.time()
        image = mi.render(scene, params, integrator=integrator, spp=SPP, seed=2 * seed, seed_grad=2 * seed + 1)
        dr.backward(dr.mean(image * weights, axis=None))
        value = dr.grad(theta)[0]
        return value, time.time() - start

    gradient(1000)
    return gradient


def main():
    reynolds = os.path.abspath(sys.argv[1] if len(sys.argv) > 1 else "build/bin/reynolds")
    import mitsuba as mi
    mi.set_variant("llvm_ad_rgb")
    scenes.make(FOLDER)
    # The command's value is the derivative of the sum of adjoint times picture.
    np.save(os.path.join(FOLDER, "ramp.npy"), ramp() / (SIZE * SIZE * 3))
    print("%-20s %-24s %12s %12s %9s %12s" % ("case", "who", "value", "deviation", "time [s]", "variance x time"))
    for name, path in write_cases().items():
        if sys.argv[2:] and name not in sys.argv[2:]:
            continue
        depth = 8 if name.endswith("8") else 2
        theirs = peer(path, depth, "prb_projective" if depth > 2 else "direct_projective")
        rows = {"Reynolds": [], "Mitsuba 3": []}
        memory = 0
        for seed in range(SEEDS):
            value, seconds, mb = ours(reynolds, path, seed)
            memory = max(memory, mb)
            rows["Reynolds"].append((value, seconds))
            rows["Mitsuba 3"].append(theirs(seed))
        cost = {}
        for who, samples in rows.items():
            values = [float(v) for v, _ in samples]
            seconds = min(t for _, t in samples)
            cost[who] = statistics.variance(values) * seconds
            print("%-20s %-24s %12.5g %12.3g %9.2f %12.3g" % (name, who, statistics.mean(values), statistics.stdev(values),
                                                              seconds, cost[who]), flush=True)
        print("%-20s %-24s %.3g; memory %d MB against %d MB" % (
            name, "ratio", cost["Mitsuba 3"] / cost["Reynolds"], memory,
            resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024), flush=True)


main()
