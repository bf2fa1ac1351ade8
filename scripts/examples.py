#!/usr/bin/env python3
"""Runs the jobs in examples/, prints the table of each, and fails where what was found is further from the truth than here.

usage: examples.py [--reynolds PROGRAM] [EXAMPLE...]"""
import argparse
import json
import os
import subprocess
import sys
import tempfile

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
# Largest error of each parameter, as the final table has it: relative; of poses over their largest entry; of meshes the
# Chamfer distance over the diagonal.
LIMITS = {
    "pose": {"bracket.to_world": 0.02},
    "camera": {"camera.to_world": 0.01, "camera.x_fov": 0.01},
    "glass": {"pebble.to_world": 0.02, "group.shape_0.bsdf.eta.value": 0.01},
    "shape": {"creature.positions": 0.004},
    "smoke": {},
}
LEAST_POINTS = {"shape": 5000}
LEAST_PSNR = {"smoke": 30}  # of every view that is held out [dB]



def judge(name, result):
    wrong = []
    found = {p["name"]: p for p in result["parameters"]}
    for parameter, limit in LIMITS[name].items():
        error = found[parameter]["error"]
        if error is None or not error <= limit:
            wrong.append("%s: %s is off by %s, expected at most %g" % (name, parameter, error, limit))
        if found[parameter]["count"] < 3 * LEAST_POINTS.get(name, 0):
            wrong.append("%s: %s has %d numbers" % (name, parameter, found[parameter]["count"]))
    if name in LEAST_PSNR and not result["held_out"]:
        wrong.append("%s: no view was held out" % name)
    for view in result["held_out"]:
        if not view["psnr"] >= LEAST_PSNR.get(name, 0):
            wrong.append("%s: view %d, held out, has a PSNR of %g dB, expected %g" % (name, view["view"], view["psnr"],
                                                                                   LEAST_PSNR[name]))
    return wrong


def show(name, result):
    print("%s: %d iterations, %.0f s, loss %.3g" % (name, result["iterations"], result["seconds"], result["loss"]))
    for p in result["parameters"]:
        text = lambda key: " ".join("%.4g" % x for x in p[key]) if key in p and len(p[key]) < 4 else "%d numbers" % p["count"]
        print("  %-34s truth %-12s start %-12s found %-12s error %.3f %%" % (p["name"], text("truth"), text("start"), text("found"),
                                                                          100 * (p["error"] or 0)))
    for view in result["held_out"]:
        print("  view %d, held out: PSNR %.1f dB" % (view["view"], view["psnr"]))
    sys.stdout.flush()


def main():
    options = argparse.ArgumentParser()
    options.add_argument("--reynolds", default=os.path.join(ROOT, "build/bin/reynolds"))
    options.add_argument("examples", nargs="*", default=sorted(LIMITS))
    options = options.parse_args()
    wrong = []
    with tempfile.TemporaryDirectory() as folder:
        for name in options.examples:
            job = os.path.join(ROOT, "examples", name, "job.yaml")
            run = subprocess.run([options.reynolds, "fit", job, "-o", os.path.join(folder, name), "--json"], stdout=subprocess.PIPE,
                                 stderr=subprocess.PIPE, text=True)
            if run.returncode:
                wrong.append("%s: exit code %d: %s" % (name, run.returncode, run.stderr[-400:]))
                continue
            result = json.loads(run.stdout)
            show(name, result)
            wrong += judge(name, result)
    print("\n".join(wrong) if wrong else "examples: all found")
    return 1 if wrong else 0


sys.exit(main())
