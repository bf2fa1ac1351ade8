#!/usr/bin/env python3
"""Proves that the tests of derivatives can fail.

Every line in a function named *_adj (and in the scatter macro) that assigns or accumulates a derivative is mutated:
its contribution is dropped, or its sign is flipped. The tests of kinds, lights and leaves must fail for each.
Usage: scripts/mutate.py [--sample N] [--seed N] [--file PART] [--part K/N]
Works in a copy of the tree; exit status 1 when a mutant survives that is not listed as equivalent below."""
import argparse
import pathlib
import random
import re
import shutil
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
FILES = ["src/bsdf/*.h", "src/math/fresnel.h", "src/math/microfacet.h", "src/math/vec.h", "src/emitter/emitter.h",
         "src/scene/texture.h", "src/scene/sink.h"]
TESTS = ["test_kinds_adjoint", "test_lights", "test_math_leaves"]
OBJECTS = ["kind_cases", *(f"{name}_kernels_{kind}" for name in ("kind", "leaf")
                           for kind in ("w1", "w8", "w16", "double"))]

FUNCTION = re.compile(r"^(?:KFN|static NOINLINE) .*?\b(\w+_adj|sink_add\w*)\(")
# x = x + rest;  or  x = x - rest;  or  x += rest;
ACCUMULATE = re.compile(r"^(\s*)(\*?[\w>.\[\]-]+) = \2 ([+-]) (.*);(\s*//.*)?$")
ADD_TO = re.compile(r"^(\s*)(.*\S) \+= (.*);$")
# v3_acc(a, b);  spec_acc(a, b);
ACC = re.compile(r"^(\s*)(v3|spec)_acc\((&?[\w>.-]+), (.*)\);$")
# sink_add(s, at, d, m);
SINK = re.compile(r"^(\s*)(sink_add\w*)\((.*), ([^,]+(?:\([^()]*\))?[^,]*), m\);$")
# x_adj(...);  dropped only
CALL = re.compile(r"^(\s*)(\w+_adj)\(.*\);$")
# Float dx = expression;
DECLARE = re.compile(r"^(\s*)(Float|Spec|Vec3) (d\w+|g\w?) = ([^,]*(?:\(.*\))?[^,]*);$")

# Mutants that change nothing: part of the line, and why.
EQUIVALENT = {}


def mutants_of(path):
    lines = path.read_text().split("\n")
    inside = False
    for number, line in enumerate(lines):
        if FUNCTION.match(line):
            inside = not line.rstrip().endswith(";")
        elif line.startswith("}"):
            inside = False
        if not inside or FUNCTION.match(line):
            continue
        m = ACCUMULATE.match(line)
        if m:
            other = "-" if m[3] == "+" else "+"
            yield number, "drop", f"{m[1]}UNUSED({m[4]});"
            yield number, "flip", f"{m[1]}{m[2]} = {m[2]} {other} ({m[4]});"
            continue
        m = ADD_TO.match(line)
        if m:
            yield number, "drop", f"{m[1]}UNUSED({m[3]});"
            yield number, "flip", f"{m[1]}{m[2]} -= {m[3]};"
            continue
        m = ACC.match(line)
        if m:
            yield number, "drop", f"{m[1]}UNUSED({m[4]});"
            yield number, "flip", f"{m[1]}{m[2]}_acc({m[3]}, {m[2]}_scale({m[4]}, f_set(-1)));"
            continue
        m = SINK.match(line)
        if m:
            yield number, "drop", f"{m[1]}{m[2]}({m[3]}, 0.0f * ({m[4]}), m);"
            yield number, "flip", f"{m[1]}{m[2]}({m[3]}, -({m[4]}), m);"
            continue
        m = CALL.match(line)
        if m:
            yield number, "drop", f"{m[1]}if (0) {line.strip()}"
            continue
        m = DECLARE.match(line)
        if m and m[2] == "Float" and not re.search(r", \w+ =", m[4]):
            yield number, "flip", f"{m[1]}Float {m[3]} = -({m[4]});"


def run(command, cwd, limit):
    try:
        return subprocess.run(command, cwd=cwd, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=limit,
                              text=True)
    except subprocess.TimeoutExpired:
        return None


def build(tree, first=False):
    """The tests compile the leaves themselves: after the first time, the library they link is left as it is."""
    if first:  # twice: CMake takes note of included headers when a target is visited again
        for _ in range(2):
            result = run(["make", "-C", "build", "-j2", *TESTS], tree, 3600)
        return result
    for names in OBJECTS, TESTS:
        result = run(["make", "-C", "build", "-j2", *(f"{name}/fast" for name in names)], tree, 1200)
        if result is None or result.returncode != 0:
            break
    return result


def killed_by(tree):
    for test in TESTS:
        result = run([str(tree / "build/bin" / test)], tree, 300)
        if result is None or result.returncode != 0:
            return test
    return None


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sample", type=int, default=0, help="this many mutants, drawn at random (default: all)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--file", default="", help="only files whose path contains this")
    parser.add_argument("--part", default="1/1", help="K/N: every N-th mutant from the K-th")
    parser.add_argument("--list", action="store_true", help="print the mutants and stop")
    args = parser.parse_args()
    mutants = []
    for pattern in FILES:
        for path in sorted(ROOT.glob(pattern)):
            name = str(path.relative_to(ROOT))
            if args.file in name:
                mutants += [(name, *mutant) for mutant in mutants_of(path)]
    if args.sample and args.sample < len(mutants):
        mutants = random.Random(args.seed).sample(mutants, args.sample)
    part, parts = map(int, args.part.split("/"))
    mutants = mutants[part - 1::parts]
    if args.list:
        for name, number, kind, line in mutants:
            print(f"{name}:{number + 1}: {kind}: {line.strip()}")
        print(f"{len(mutants)} mutants")
        return 0
    tree = pathlib.Path(tempfile.mkdtemp(prefix="reynolds_mutants_"))
    try:
        shutil.copytree(ROOT, tree, dirs_exist_ok=True, ignore=shutil.ignore_patterns("build", ".git", "build-*"))
        # The renderer itself is rebuilt but not run: no time for optimising it. Unused numbers are no errors here.
        cmake = tree / "CMakeLists.txt"
        cmake.write_text(cmake.read_text().replace(" -Werror", "").replace(" -O3 ", " -O0 ").replace("-O2 -g1", "-O1"))
        run(["cmake", "-S", ".", "-B", "build"], tree, 300)
        result = build(tree, first=True)
        if result is None or result.returncode != 0 or killed_by(tree):
            print("the tests must pass before anything is mutated", file=sys.stderr)
            return 1
        survivors = broken = 0
        for name, number, kind, line in mutants:
            path = tree / name
            original = path.read_text()
            lines = original.split("\n")
            before, lines[number] = lines[number].strip(), line
            path.write_text("\n".join(lines))
            result = build(tree)
            if result is None or result.returncode != 0:
                verdict, broken = "does not compile", broken + 1
            else:
                test = killed_by(tree)
                known = [why for part, why in EQUIVALENT.items() if part in before]
                verdict = f"killed by {test}" if test else f"equivalent: {known[0]}" if known else "SURVIVED"
                survivors += verdict == "SURVIVED"
            path.write_text(original)
            print(f"{name}:{number + 1}: {kind}: {before}: {verdict}", flush=True)
        print(f"{len(mutants)} mutants, {survivors} survived, {broken} did not compile")
        return 1 if survivors else 0
    finally:
        shutil.rmtree(tree, ignore_errors=True)


if __name__ == "__main__":
    sys.exit(main())
