#!/usr/bin/env python3
"""Runs the jobs in examples/, prints the table of each, and fails where what was found is further from the truth than here.

usage: examples.py [--reynolds PROGRAM] [EXAMPLE...]"""
import argparse
import glob
import json
import math
import os
import struct
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
    "milk": {"milk.sigma_a": 0.05, "milk.reduced_sigma_s": 0.08},
    "milk/dictionary": {},
    "hidden": {},
    "shadow_1": {},
}
LEAST_POINTS = {"shape": 5000}
LEAST_PSNR = {"smoke": 30}  # of every view that is held out [dB]
COSINES = (-0.3, 0, 0.3, 0.6, 0.9)  # of the functions in milk/dictionary.xml
MOST_COSINE_ERROR, MOST_SHAPE_ERROR = 0.02, 0.05
MOST_DENSITY_ERROR = 0.2  # of hidden: sum of errors over sum of densities
MOST_SHIFT_ERROR = 0.05   # of shadow_1, along each axis


def floats(path):
    """The numbers of an .npy file of 32-bit floats."""
    with open(path, "rb") as f:
        data = f.read()
    begin = 10 + struct.unpack("<H", data[8:10])[0]
    return struct.unpack("<%df" % ((len(data) - begin) // 4), data[begin:])


def shape_error(reynolds, folder, weights):
    """How far the other shape, rendered with these weights, is from the truth: root of the sum of squares, relative."""
    pictures = []
    for name, more in (("truth", []), ("found", ["-D", "weights=" + ", ".join("%.9g" % w for w in weights)])):
        path = os.path.join(folder, name + ".npy")
        subprocess.run([reynolds, "render", os.path.join(ROOT, "examples/milk/shape.xml"), "--spp", "8192", "-o", path] + more,
                       check=True, stderr=subprocess.DEVNULL)
        pictures.append(floats(path))
    truth, found = pictures
    return math.sqrt(sum((a - b) ** 2 for a, b in zip(truth, found)) / sum(a * a for a in truth))


def judge_dictionary(reynolds, folder, result):
    """Mean cosine, and a picture of another shape."""
    row = next(p for p in result["parameters"] if p["name"] == "milk.phase_function.weights")
    mean = [sum(w * g for w, g in zip(row[key], COSINES)) / sum(row[key]) for key in ("truth", "found")]
    off = shape_error(reynolds, folder, row["found"])
    print("  weights %s: mean cosine %.4f, truth %.4f; another shape is off by %.2f %%" % (
        " ".join("%.3f" % w for w in row["found"]), mean[1], mean[0], 100 * off))
    wrong = []
    if not abs(mean[1] - mean[0]) <= MOST_COSINE_ERROR:
        wrong.append("milk/dictionary: the mean cosine is %g, expected %g within %g" % (mean[1], mean[0], MOST_COSINE_ERROR))
    if not off <= MOST_SHAPE_ERROR:
        wrong.append("milk/dictionary: another shape is off by %g, expected at most %g" % (off, MOST_SHAPE_ERROR))
    return wrong


def voxels(path):
    """The numbers of a .vol file of 32-bit floats."""
    with open(path, "rb") as f:
        data = f.read()
    return struct.unpack("<%df" % ((len(data) - 48) // 4), data[48:])


def judge_hidden(reynolds, folder, result):
    found = voxels(glob.glob(os.path.join(folder, "hidden", "recovered_data", "*.vol"))[0])
    truth = voxels(os.path.join(ROOT, "examples/hidden/truth.vol"))
    off = sum(abs(a - b) for a, b in zip(found, truth)) / sum(truth)
    print("  densities: sum of errors over sum %.3f" % off)
    return [] if off <= MOST_DENSITY_ERROR else ["hidden: the densities are off by %g, expected at most %g" % (off, MOST_DENSITY_ERROR)]


def judge_shadow(reynolds, folder, result):
    row = result["parameters"][0]
    off = [abs(row["found"][i] - row["truth"][i]) for i in (3, 7, 11)]
    print("  found at %s, off by %s" % (" ".join("%.4f" % row["found"][i] for i in (3, 7, 11)), " ".join("%.4f" % x for x in off)))
    return ["shadow_1: off by %g, expected at most %g" % (x, MOST_SHIFT_ERROR) for x in off if not x <= MOST_SHIFT_ERROR]


JUDGES = {"milk/dictionary": judge_dictionary, "hidden": judge_hidden, "shadow_1": judge_shadow}


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
            job = os.path.join(ROOT, "examples", name + ".yaml" if "/" in name else os.path.join(name, "job.yaml"))
            output = os.path.join(folder, name.replace("/", "_"))
            run = subprocess.run([options.reynolds, "fit", job, "-o", output, "--json"], stdout=subprocess.PIPE,
                                 stderr=subprocess.PIPE, text=True)
            if run.returncode:
                wrong.append("%s: exit code %d: %s" % (name, run.returncode, run.stderr[-400:]))
                continue
            result = json.loads(run.stdout)
            show(name, result)
            wrong += judge(name, result)
            if name in JUDGES:
                wrong += JUDGES[name](options.reynolds, folder, result)
    print("\n".join(wrong) if wrong else "examples: all found")
    return 1 if wrong else 0


sys.exit(main())
