#!/usr/bin/env python3
"""Proves that the tests of derivatives can fail.

In every function that carries derivatives terms are dropped, signs flipped, and factors and calls of adjoints left out
(scripts/mutants.py), one at a time. The tests that the table below names must fail for each. All mutants are compiled into
one copy of the sources, for one SIMD width; the environment variable REY_MUTANT turns one of them on, so that nothing is
rebuilt between them. Finite differences, which no mutant changes, are kept from run to run.
Usage: scripts/mutate.py [--file PART] [--sample N] [--seed N] [--tree DIR] [--quick] [--effort SHARE] [--again] [--list]
The tree (default: build-mutate) keeps build, differences and verdicts: a run goes on where the last one ended; --again
tries survivors once more. Exit status 1 when a mutant survives that scripts/equivalent_mutants.txt does not list."""
import argparse
import collections
import fnmatch
import json
import os
import pathlib
import random
import re
import subprocess
import sys
import threading
import time

import mutants

ROOT = pathlib.Path(__file__).resolve().parent.parent
ADJOINTS = r"\w*_adj(_\w+)?|\w*_scatter_[A-Z]+|\w*_slopes?|\w*_slide|slide_\w+"
# Files, and which of their functions are mutated.
FILES = [("src/bsdf/*.h", ADJOINTS), ("src/math/fresnel.h", ADJOINTS), ("src/math/microfacet.h", ADJOINTS),
         ("src/emitter/*.h", ADJOINTS), ("src/medium/*.h", ADJOINTS), ("src/sensor/*.h", ADJOINTS),
         ("src/scene/volume.h", ADJOINTS + "|volume_to_world_adj"), ("src/scene/texture*.h", ADJOINTS),
         ("src/scene/attribute.h", ADJOINTS), ("src/shape/*.h", ADJOINTS + r"|curve_twist|pose_\w+_inverse|matrix_\w+"),
         ("src/shape/normals_adj.c", r"\w+"), ("src/integrator/path_adj.h", r"\w+"),
         ("src/integrator/kept.h", r"(?!kept_replay)kept_\w+"),
         ("src/integrator/path_move.h", r"\w+"), ("src/integrator/passage_move.h", r"\w+"),
         ("src/integrator/flight_adj.h", r"\w+"), ("src/integrator/border.h", r"\w+"),
         ("src/integrator/collision_adj.h", r"\w+"), ("src/integrator/walk_adj.h", r"\w+"),
         ("src/integrator/probe.h", r"\w+"), ("src/integrator/particle_adj.h", r"(?!particle_replay)\w+"),
         ("src/integrator/boundary/*.h", r"\w+")]

# What should kill the mutants of files that begin so: programs with arguments, the quickest first. BOUNDARY: all motions
# of test_boundary in rooms that begin so, one at a time; {stem}: the kind that a file is named after.
BOUNDARY = "test_boundary"
LOCAL = ["test_differences materials.xml", "test_differences shapes.xml", "test_differences layers.xml",
         "test_differences lights.xml", "test_differences tiles.xml", "test_differences edges.xml"]
MOVING = ["test_chains chains_sky.xml", "test_chains chains_lens.xml", "test_chains chains_coat.xml", "test_chains chains_bowl.xml",
          "test_differences moving_ball.xml", "test_differences moving_box.xml", "test_differences moving_disk.xml"]
MEDIA = ["test_fog", BOUNDARY + " media_box.xml", BOUNDARY + " media_cloud.xml puff.sigma_t", BOUNDARY + " air_beam", BOUNDARY + " media_tiles",
         "test_differences fog.xml", "test_differences smoke.xml"]
SEEN = [BOUNDARY + " boundary_lamp.xml ball", BOUNDARY + " boundary_plan", BOUNDARY + " boundary_view.xml camera.to_world",
        BOUNDARY + " boundary_bulb.xml crate"]
EDGES = SEEN + [BOUNDARY + " boundary_lamp.xml lamp", BOUNDARY + " boundary_lamp.xml camera.to_world", BOUNDARY + " boundary_bulb.xml bulb",
                BOUNDARY + " boundary_lamp.xml card", BOUNDARY + " boundary_sky.xml camera", BOUNDARY + " meeting_view.xml crate",
                BOUNDARY + " meeting_slide.xml ball", BOUNDARY + " meeting_lamp.xml bulb", BOUNDARY + " turning_lamp.xml ball",
                BOUNDARY + " turning_light.xml ball.positions", BOUNDARY + " mirror_wall", BOUNDARY + " air_beam.xml bulb",
                BOUNDARY + " marks_bump.xml tile"]
DROPPED = ["test_dropped test_densities", "test_differences sieve.xml", "test_differences dropped.xml", "test_dropped"]
TESTS = [("src/integrator/kept.h", DROPPED), ("src/emitter/envmap.h", ["test_lights test_adjoints"] + LOCAL[3:4] + DROPPED[1:2]),
         ("src/bsdf/principled", ["test_kinds_adjoint principled", "test_kinds_adjoint principledthin"]),
         ("src/bsdf/", ["test_kinds_adjoint {stem}", "test_kinds_adjoint"] + LOCAL + MOVING[:4]),
         ("src/math/", ["test_math_leaves", "test_kinds_adjoint"]),
         ("src/emitter/", ["test_lights test_adjoints"] + LOCAL[3:4] + [BOUNDARY + " boundary_bulb", BOUNDARY + " air_", "test_chains chains_sky.xml"]),
         ("src/medium/", ["test_phases test_adjoint", "test_media test_adjoint", "test_volumes_move"]),
         ("src/sensor/", ["test_cameras", "test_chains chains_sky.xml", BOUNDARY + " boundary_view"]),
         ("src/scene/volume.h", ["test_volumes_move", "test_media test_adjoint", "test_phases test_adjoint", BOUNDARY + " media_"]),
         ("src/scene/", ["test_kinds_adjoint"] + LOCAL),
         ("src/shape/normals_adj.c", ["test_normals", BOUNDARY + " boundary_bulb.xml hat"]),
         ("src/shape/", ["test_moves"] + LOCAL[:2] + ["test_differences tiles.xml"] + MOVING),
         ("src/integrator/path_adj.h", LOCAL[:1] + MOVING[4:6] + LOCAL[3:4] + MOVING[:4] + LOCAL[1:3] + LOCAL[4:] + MEDIA[5:]),
         ("src/integrator/path_move.h", ["test_places", "test_terminator"] + MOVING[:4] + EDGES + MOVING[4:]),
         ("src/integrator/particle_adj.h", ["test_terminator", "test_particle_gradients"]),
         ("src/integrator/boundary/airborne.h", [BOUNDARY + " air_"]),
         ("src/integrator/boundary/meeting.h", [BOUNDARY + " meeting_"]),
         ("src/integrator/boundary/facet.h", ["test_edge_curves", BOUNDARY + " turning_"]),
         ("src/integrator/boundary/segments.h", [BOUNDARY + " boundary_near"] + EDGES),
         ("src/integrator/boundary/edge.h", ["test_edge_points", "test_edge_curves"] + EDGES),
         ("src/integrator/boundary/round.h", ["test_edge_points", BOUNDARY + " boundary_rope.xml lamp", BOUNDARY + " boundary_rope.xml camera",
                                              BOUNDARY + " boundary_group.xml camera"] + EDGES),
         ("src/integrator/boundary/view.h", ["test_edge_points"] + EDGES),
         ("src/integrator/boundary/turning.h", [BOUNDARY + " turning_"]),
         ("src/integrator/boundary/chained.h", [BOUNDARY + " mirror_"]),
         ("src/integrator/boundary/upstream.h", [BOUNDARY + " mirror_"]),
         ("src/integrator/boundary/primary.h", ["test_edge_moves"] + EDGES),
         ("src/integrator/boundary/rim_", ["test_rim test_sharp"]),
         ("src/integrator/boundary/indirect.h", ["test_segment_moves"] + EDGES),
         ("src/integrator/boundary/", EDGES),
         ("src/integrator/border.h", ["test_places"] + MEDIA),
         ("src/integrator/", MEDIA)]

COARSE = {BOUNDARY, "test_chains", "test_fog"} # know --effort
RENDERS = COARSE | {"test_differences", "test_particle_gradients"}

# One of several alike in a function has a number.
Mutant = collections.namedtuple("Mutant", "file line function text kind number site")
KINDS = {"flip": (-1, 0), "drop": (0, 0), "one": (0, 1)}
MOST_SITES = 1000 # of a file
DECLARED = "extern int rey_times[], rey_plus[];\n"
CHOOSE = """#include <stdlib.h>
int rey_times[SIZE], rey_plus[SIZE];
__attribute__((constructor)) static void choose(void) {
    int site, times, plus;
    for (int i = 0; i < SIZE; i++) {
        rey_times[i] = 1;
    }
    const char *text = getenv("REY_MUTANT");
    if (text && sscanf(text, "%d,%d,%d", &site, &times, &plus) == 3) {
        rey_times[site] = times;
        rey_plus[site] = plus;
    }
}
"""


def instrument(files):
    """Writes all mutants into the sources, texts by name, and returns them."""
    found, at = [], 0
    source = mutants.Source(text for name, text in files.items() if name.endswith((".c", ".h")))
    for pattern, wanted in FILES:
        for name in sorted(fnmatch.filter(files, pattern)):
            text, sites, seen = files[name], [], collections.Counter()
            for number, (begin, end, type, kinds, function) in enumerate(mutants.sites_of(text, source, wanted)[0], at):
                own = re.sub(r"\s+", " ", text[begin:end])
                seen[function, own] += 1
                line = text.count("\n", 0, begin) + 1
                found += [Mutant(name, line, function, own, kind, seen[function, own], number) for kind in kinds]
                sites.append((begin, end, type, number))
            if sites:
                text = re.sub(r"^#(include|pragma once\n)", lambda m: DECLARED + m[0] if m[1] == "include" else m[0] + DECLARED,
                              mutants.rewrite(text, sites), count=1, flags=re.M)
            files[name] = text
            at += MOST_SITES # other files' numbers stay when a file changes
    files["src/base/context.c"] += CHOOSE.replace("SIZE", str(at))
    return found


def narrow(files):
    """One width, quickly compiled."""
    text = files["CMakeLists.txt"].replace("foreach(lanes 1 8 16)", "foreach(lanes 8)")
    files["CMakeLists.txt"] = text.replace("kernel_options -O3", "kernel_options -O1 -w")
    files["src/backend/cpu.c"] = re.sub(r"\(w(?:1|16)\)", "(w8)", files["src/backend/cpu.c"])
    for name in ("tests/CMakeLists.txt", "tests/kinds/CMakeLists.txt"):
        files[name] = "add_compile_options(-w)\n" + files[name].replace("if(REYNOLDS_SANITIZE OR REYNOLDS_TSAN)", "if(TRUE)")


def prepare(tree):
    """Writes what differs of the mutated sources; returns the mutants."""
    listed = subprocess.run(["git", "ls-files", "-co", "--exclude-standard"], cwd=ROOT, capture_output=True, text=True, check=True)
    files = {name: (ROOT / name).read_bytes().decode("latin-1") for name in listed.stdout.split("\n")[:-1]}
    found = instrument(files)
    narrow(files)
    for name, text in files.items():
        path, data = tree / name, text.encode("latin-1")
        path.parent.mkdir(parents=True, exist_ok=True)
        if not path.exists() or path.read_bytes() != data:
            path.write_bytes(data)
    return found


def build(tree, jobs):
    programs = sorted({command.split()[0] for _, commands in TESTS for command in commands})
    subprocess.run(["cmake", "-S", ".", "-B", "build"], cwd=tree, stdout=subprocess.DEVNULL, check=True)
    subprocess.run(["make", "-C", "build", f"-j{jobs}", *programs], cwd=tree, stdout=subprocess.DEVNULL, check=True)


class Runner:
    """Runs tests on mutants, those first that have killed before, and keeps what no mutant changes."""

    def __init__(self, tree, quick, effort):
        self.tree, self.quick, self.effort = tree, quick, effort
        self.kills, self.seconds = collections.Counter(), {}
        self.keep = tree / "kept"
        self.keep.mkdir(exist_ok=True)
        rows = re.findall(r'\{"(\w+\.xml)", "([\w.]+)", (?:SHIFT|TURN|GROW|ADD|SHEAR)', (tree / "tests/render/motions.h").read_text())
        self.rows = list(dict.fromkeys(rows))

    def commands(self, name):
        begin, commands = next(row for row in TESTS if name.startswith(row[0]))
        stem = re.sub(r"_(adj|lobes)$", "", pathlib.Path(name).stem)
        out = []
        for command in commands:
            program, *rest = command.split(" ", 1)
            if self.quick and program in RENDERS:
                continue
            if program == BOUNDARY:
                out += [(program, f"{room} {param}") for room, param in self.rows if f"{room} {param}".startswith(rest[0])]
            else:
                out.append((program, *[part.format(stem=stem) for part in rest]))
        return list(dict.fromkeys(out))

    def fails(self, command, mutant, limit):
        """Whether a test fails; it is stopped at its first complaint."""
        changed = "{},{},{}".format(mutant.site, *KINDS[mutant.kind]) if mutant else ""
        environment = dict(os.environ, REY_MUTANT=changed, REYNOLDS_TEST_KEEP=str(self.keep))
        if command[0] in COARSE:
            environment["REYNOLDS_TEST_EFFORT"] = str(self.effort)
        process = subprocess.Popen([str(self.tree / "build/bin" / command[0]), *command[1:]], stdout=subprocess.DEVNULL,
                                   stderr=subprocess.PIPE, text=True, errors="replace", env=environment)
        timer = threading.Timer(limit, process.kill)
        timer.start()
        try:
            for line in process.stderr:
                if line.strip() and not re.match(r"\[(=| +PASSED| +SKIPPED|-| *\w+ *\] *\d+ test)", line.strip()):
                    process.kill()
                    return True
            return process.wait() != 0
        finally:
            timer.cancel()
            process.kill()
            process.wait()

    def passes_unchanged(self, command):
        """Whether the test passes without a mutant, which it must; the second run shows how long it takes."""
        for _ in range(2 if command not in self.seconds else 0):
            begin = time.monotonic()
            failed = self.fails(command, None, 1800)
            self.seconds[command] = None if failed else time.monotonic() - begin
            if failed:
                print(f"{' '.join(command)} fails without a mutant and is left out", file=sys.stderr)
                break
        return self.seconds[command] is not None

    def killer(self, mutant):
        order = sorted(self.commands(mutant.file), key=lambda command: -self.kills[mutant.file, command])
        for command in order:
            if self.passes_unchanged(command) and self.fails(command, mutant, 20 + 10 * self.seconds[command]):
                self.kills[mutant.file, command] += 1
                return " ".join(command)
        return None


def equivalent():
    """Mutants that change nothing, by name, and why."""
    why, found = "", {}
    for line in (ROOT / "scripts/equivalent_mutants.txt").read_text().splitlines():
        if line.startswith("# "):
            why = line[2:]
        else:
            found[line] = why
    return found


def name_of(mutant):
    which = f" ({mutant.number})" if mutant.number > 1 else ""
    return f"{mutant.file}: {mutant.function}: {mutant.text}{which}: {mutant.kind}"


def judge(chosen, tree, runner, again):
    """Prints a verdict on each mutant; how many survive."""
    path, survivors, harmless = tree / "verdicts.jsonl", 0, equivalent()
    path.touch()
    verdicts = dict(json.loads(line) for line in path.read_text().splitlines())
    for mutant in chosen:
        key = name_of(mutant)
        if key not in harmless and (key not in verdicts or (again and not verdicts[key])):
            killer = runner.killer(mutant)
            if killer or not runner.quick:
                verdicts[key] = killer
                with path.open("a") as f:
                    f.write(json.dumps([key, killer]) + "\n")
        verdict = f"killed by {verdicts[key]}" if verdicts.get(key) else f"equivalent: {harmless[key]}" if key in harmless else "SURVIVED"
        survivors += verdict == "SURVIVED"
        print(f"{mutant.line}: {key}: {verdict}", flush=True)
    return survivors


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--file", default="", help="only files whose path contains this")
    parser.add_argument("--sample", type=int, default=0, help="this many mutants, drawn at random (default: all)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2, help="compilers at a time")
    parser.add_argument("--tree", default=str(ROOT / "build-mutate"))
    parser.add_argument("--quick", action="store_true", help="without whole renders")
    parser.add_argument("--effort", type=float, default=1, help="share of the usual samples of renders")
    parser.add_argument("--again", action="store_true", help="try survivors once more")
    parser.add_argument("--list", action="store_true", help="print the mutants and stop")
    args = parser.parse_args()
    tree = pathlib.Path(args.tree)
    chosen = [mutant for mutant in prepare(tree) if args.file in mutant.file]
    total = len(chosen)
    if args.sample and args.sample < total:
        chosen = random.Random(args.seed).sample(chosen, args.sample)
    if args.list:
        print("\n".join(f"{mutant.line}: {name_of(mutant)}" for mutant in chosen))
        return 0
    build(tree, args.jobs)
    survivors = judge(chosen, tree, Runner(tree, args.quick, args.effort), args.again)
    print(f"{len(chosen)} of {total} mutants, {survivors} survived")
    return 1 if survivors else 0


if __name__ == "__main__":
    sys.exit(main())
