#!/usr/bin/env python3
"""Reynolds against itself: rates, ratios of widths, threads and modes, loading and memory, as medians of interleaved
repeats in one run. All are ratios of wall time.

usage: bench.py [--reynolds BINARY] [--repeats N] [--folder DIR]"""
import argparse
import json
import os
import statistics
import subprocess

import scenes


def run(reynolds, *arguments):
    return json.loads(subprocess.run([reynolds, *arguments, "--json"], check=True, capture_output=True, text=True).stdout)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--reynolds", default="build/bin/reynolds")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--folder", default="build/bench")
    options = parser.parse_args()
    reynolds = os.path.abspath(options.reynolds)
    print("%-11s %10s %10s %8s %8s %8s %8s %8s %8s %9s %8s" % (
        "scene", "Mpaths/s", "Mrays/s", "embree", "w16/w1", "w8/w1", "2t/1t", "rev/pri", "fwd/pri", "load ms", "MB"))
    for name, scene in scenes.make(options.folder).items():
        path = scene.path
        defines = [x for k, v in scene.defines.items() for x in ("-D", "%s=%s" % (k, v))]
        settings = ["--spp", "16"] + defines
        render = ["render", path, "-o", os.path.join(options.folder, "out.exr")] + settings
        grad = ["grad", path, "--param", scene.parameters[0]] + settings
        commands = {"w16": render, "w8": render + ["--lanes", "8"], "w1": render + ["--lanes", "1"],
                    "one": render + ["-t", "1"], "reverse": grad + ["--mode", "reverse", "--adjoint", "1"],
                    "forward": grad}
        results = {key: [] for key in commands}
        start = []
        for _ in range(options.repeats):
            for key, command in commands.items():
                results[key].append(run(reynolds, *command))
            start.append(run(reynolds, "info", path, *defines)["load_seconds"])
        median = {key: statistics.median(r["seconds"] for r in rows) for key, rows in results.items()}
        first = results["w16"][0]
        rate = first["paths"] / median["w16"] / 1e6
        print("%-11s %10.2f %10.2f %8.2f %8.2f %8.2f %8.2f %8.2f %8.2f %9.0f %8.0f" % (
            name, rate, first["rays"] / median["w16"] / 1e6,
            statistics.median(r["trace_share"] for r in results["w16"]), median["w1"] / median["w16"],
            median["w1"] / median["w8"], median["one"] / median["w16"], median["reverse"] / median["w16"],
            median["forward"] / median["w16"], 1e3 * statistics.median(start), first["peak_rss_mb"]))


if __name__ == "__main__":
    main()
