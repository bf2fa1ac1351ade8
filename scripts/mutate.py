#!/usr/bin/env python3
"""Proves that the tests of derivatives can fail.

Every statement in a function named *_adj (and in the sink and the backward sweep) that assigns or accumulates a
derivative is mutated: its contribution is dropped, or its sign is flipped. The tests of leaves, kinds, lights or whole
renders must fail for each. All mutants are compiled into one program, in which the environment variable REY_MUTANT
turns one of them on: nothing is rebuilt between them.
Usage: scripts/mutate.py [--sample N] [--seed N] [--file PART] [--part K/N] [--jobs N] [--tree DIR] [--quick] [--list]
Works in a copy of the tree, which --tree keeps for further runs; exit status 1 when a mutant survives that is not listed
as equivalent below."""
import argparse
import json
import os
import pathlib
import random
import re
import shutil
import subprocess
import sys
import tempfile
import threading

ROOT = pathlib.Path(__file__).resolve().parent.parent
FILES = ["src/bsdf/*.h", "src/math/fresnel.h", "src/math/microfacet.h", "src/math/vec.h", "src/emitter/emitter.h",
         "src/scene/texture.h", "src/scene/texture_gradient.h", "src/scene/sink.h", "src/shape/*.h",
         "src/integrator/path_adj.h"]
LEAVES, RENDERS = ["test_math_leaves", "test_kinds_adjoint", "test_lights"], ["test_gradients", "test_differences"]

FUNCTION = re.compile(r"^(?:KFN|static|static NOINLINE) (\w+) .*?\b(\w+_adj|\w+_adj_real|sink_add\w*|path_backward|forward_flush|"
                      r"slot_adjoint|surface_values)\(")
# x = x + rest;  or  x = x - rest;  or  x += rest;
ACCUMULATE = re.compile(r"^(\s*)(\*?[\w>.\[\]-]+) = \2 ([+-]) (.*);(\s*//.*)?$")
ADD_TO = re.compile(r"^(\s*)(.*\S) \+= (.*);$")
# v3_acc(a, b);  spec_acc(a, b);
ACC = re.compile(r"^(\s*)(v3|spec)_acc\((&?[\w>.-]+), (.*)\);$")
# sink_add(s, at, d, m);
SINK = re.compile(r"^(\s*)(sink_add\w*)\((.*)\);$")
# x_adj(...);  dropped only
CALL = re.compile(r"^(\s*)(\w+_adj(?:_real)?)\(.*\);$")
# Float dx = expression;
DECLARE = re.compile(r"^(\s*)(Float|Spec|Vec3) (d\w*|g\w?|l|weight|both) = ([^,]*(?:\(.*\))?[^,]*);$")
# return expression;  of an adjoint that returns it
RETURN = re.compile(r"^(\s*)return (.*);$")
FLIPPED = {"Float": "({sign}) * ({x})", "Spec": "spec_scale({x}, f_set({sign}))", "Vec3": "v3_scale({x}, f_set({sign}))"}

# Mutants that change nothing: part of the line, and why.
EQUIVALENT = {}


def statements(lines):
    """The one-line form of the statements inside of functions that carry derivatives: first line, number of lines, text
    without its comment, and the type that the function returns."""
    inside, number = None, 0
    while number < len(lines):
        line = lines[number]
        header = FUNCTION.match(line)
        count = 1
        if header:
            while not lines[number + count - 1].rstrip().endswith(("{", ";", "}")):
                count += 1
            inside = header[1] if lines[number + count - 1].endswith("{") else None
        elif line.startswith("}"):
            inside = None
        elif inside:
            text = re.sub(r"\s*//.*", "", line)
            while text.strip() and not text.endswith((";", "{", "}", ":", "\\")) and not text.lstrip().startswith("#"):
                text += " " + re.sub(r"\s*//.*", "", lines[number + count]).strip()
                count += 1
            if text.endswith(";"):
                yield number, count, text, inside
        number += count


def arguments_of(text):
    """What commas outside of brackets separate."""
    parts, depth = [""], 0
    for letter in text:
        depth += (letter in "([") - (letter in ")]")
        if letter == "," and depth == 0:
            parts.append("")
        else:
            parts[-1] += letter
    return [part.strip() for part in parts]


def mutations(text, returns):
    """Kind and text of the mutated statement; SIGN stands for a factor of 1 or -1."""
    m = ACCUMULATE.match(text)
    if m:
        other = "-" if m[3] == "+" else "+"
        return [("drop", f"UNUSED({m[4]});"), ("flip", f"{m[2]} = {m[2]} {other} ({m[4]});")]
    m = ADD_TO.match(text)
    if m:
        return [("drop", f"UNUSED({m[3]});"), ("flip", f"{m[2]} -= {m[3]};")]
    m = ACC.match(text)
    if m:
        return [("drop", f"UNUSED({m[4]});"), ("flip", f"{m[2]}_acc({m[3]}, {m[2]}_scale({m[4]}, f_set(-1)));")]
    m = SINK.match(text)
    if m:
        sink, at, d, mask = arguments_of(m[3])
        return [(kind, f"{m[2]}({sink}, {at}, {factor} * ({d}), {mask});") for kind, factor in (("drop", "0.0f"), ("flip", "-1.0f"))]
    if CALL.match(text):
        return [("drop", ";")]
    m = DECLARE.match(text)
    if m and not re.search(r", \w+ =", m[4]) and not m[4].endswith(("_zero()", "f_set(0)")):
        return [("sign", f"{m[2]} {m[3]} = " + FLIPPED[m[2]].format(sign="SIGN", x=m[4]) + ";")]
    m = RETURN.match(text)
    if m and returns in FLIPPED and not m[2].endswith("_zero()"):
        return [("sign", "return " + FLIPPED[returns].format(sign="SIGN", x=m[2]) + ";")]
    return []


def mutants_of(path):
    """The statements of a file that are mutated: first line, number of lines, text, mutations."""
    lines = path.read_text().split("\n")
    for number, count, text, returns in statements(lines):
        found = mutations(text, returns)
        if found:
            yield number, count, text, found


def combine(text, numbered):
    """The statement that is one of its mutants when REY_MUTANT says so."""
    indent = text[:len(text) - len(text.lstrip())]
    kind, mutated, number = numbered[0]
    if kind == "sign":
        return indent + mutated.replace("SIGN", f"rey_mutant == {number} ? -1.0f : 1.0f")
    out = indent
    for _, mutated, number in numbered:
        out += f"if (rey_mutant == {number}) {{ {mutated} }} else "
    return out + f"{{ {text.strip()} }}"


def instrument(tree):
    """Writes all mutants into the sources of a tree; returns them as (file, line, kind, statement)."""
    mutants = []
    for pattern in FILES:
        for path in sorted(tree.glob(pattern)):
            name = str(path.relative_to(tree))
            lines = path.read_text().split("\n")
            for number, count, text, found in reversed(list(mutants_of(path))):
                numbered = []
                for kind, mutated in found:
                    mutants.append((name, number + 1, kind, text.strip()))
                    numbered.append((kind, mutated, len(mutants)))
                lines[number:number + count] = [combine(text, numbered)] + [""] * (count - 1)
            path.write_text("\n".join(lines))
    with open(tree / "src/base/platform.h", "a") as f:
        f.write("extern int rey_mutant;\n")
    with open(tree / "src/base/context.c", "a") as f:
        f.write("int rey_mutant;\n__attribute__((constructor)) static void choose(void) {\n"
                '    const char *text = getenv("REY_MUTANT");\n    rey_mutant = text ? atoi(text) : 0;\n}\n')
    return mutants


def fails(tree, test, arguments, mutant, limit=3600):
    """Whether a test fails; it is stopped at its first complaint."""
    process = subprocess.Popen([str(tree / "build/bin" / test), *arguments], stdout=subprocess.DEVNULL,
                               stderr=subprocess.PIPE, text=True, errors="replace",
                               env=dict(os.environ, REY_MUTANT=str(mutant)))
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


def killed_by(tree, name, mutant, quick=False):
    attempts = [(test, []) for test in LEAVES]
    stem = pathlib.Path(name).stem.replace("_adj", "").replace("_lobes", "")
    if name.startswith("src/bsdf/") and mutant:
        attempts.insert(0, ("test_kinds_adjoint", [stem]))
    if name.startswith(("src/shape/", "src/integrator/")):
        attempts = []
    for test, arguments in attempts + [(test, []) for test in RENDERS if not quick]:
        if fails(tree, test, arguments, mutant):
            return test
    return None


def prepare(tree, jobs):
    """Copies, instruments and builds; the mutants, or null when the tests fail without any."""
    shutil.copytree(ROOT, tree, dirs_exist_ok=True, ignore=shutil.ignore_patterns("build", ".git", "build-*"))
    mutants = instrument(tree)
    # Unused numbers are no errors here.
    cmake = tree / "CMakeLists.txt"
    cmake.write_text(cmake.read_text().replace(" -Werror", " -w").replace(" -O3 ", " -O1 ").replace("-O2 -g1", "-O1"))
    subprocess.run(["cmake", "-S", ".", "-B", "build"], cwd=tree, stdout=subprocess.DEVNULL, check=True)
    result = subprocess.run(["make", "-C", "build", f"-j{jobs}", *LEAVES, *RENDERS], cwd=tree, capture_output=True, text=True)
    if result.returncode != 0:
        print(result.stderr[-4000:], file=sys.stderr)
        return None
    if killed_by(tree, "", 0):
        print("the tests must pass before anything is mutated", file=sys.stderr)
        return None
    (tree / "mutants.json").write_text(json.dumps(mutants))
    return mutants


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sample", type=int, default=0, help="this many mutants, drawn at random (default: all)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--file", default="", help="only files whose path contains this")
    parser.add_argument("--part", default="1/1", help="K/N: every N-th mutant from the K-th")
    parser.add_argument("--jobs", type=int, default=2, help="compilers at a time")
    parser.add_argument("--quick", action="store_true", help="only the tests of leaves, kinds and lights")
    parser.add_argument("--tree", default="", help="where to build, kept and used again (default: a temporary folder)")
    parser.add_argument("--list", action="store_true", help="print the mutants and stop")
    args = parser.parse_args()
    tree = pathlib.Path(args.tree or tempfile.mkdtemp(prefix="reynolds_mutants_"))
    try:
        if (tree / "mutants.json").exists():
            mutants = json.loads((tree / "mutants.json").read_text())
        elif args.list:
            shutil.copytree(ROOT / "src", tree / "src", dirs_exist_ok=True)
            mutants = instrument(tree)
        else:
            mutants = prepare(tree, args.jobs)
        if mutants is None:
            return 1
        chosen = [(number, *mutant) for number, mutant in enumerate(mutants, 1) if args.file in mutant[0]]
        if args.sample and args.sample < len(chosen):
            chosen = random.Random(args.seed).sample(chosen, args.sample)
        part, parts = map(int, args.part.split("/"))
        survivors = 0
        for number, name, line, kind, text in chosen[part - 1::parts]:
            verdict = ""
            if not args.list:
                test = killed_by(tree, name, number, args.quick)
                known = [why for part_of_line, why in EQUIVALENT.items() if part_of_line in text]
                verdict = f": killed by {test}" if test else f": equivalent: {known[0]}" if known else ": SURVIVED"
                survivors += verdict == ": SURVIVED"
            print(f"{number} {name}:{line}: {kind}: {text}{verdict}", flush=True)
        print(f"{len(chosen[part - 1::parts])} mutants, {survivors} survived")
        return 1 if survivors else 0
    finally:
        if not args.tree:
            shutil.rmtree(tree, ignore_errors=True)


if __name__ == "__main__":
    sys.exit(main())
