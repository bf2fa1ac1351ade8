#!/usr/bin/env python3
"""Files stay readable: at most 500 lines (tables exempt), lines of C of 132 columns, functions under 60, citations exist,
nothing is left to do."""
import os
import re
import subprocess
import sys

LONGEST = 500
LONGEST_FUNCTION = 59
WIDEST = 132


def functions(lines):
    """The functions of a C file as (name, number of the first line, number of lines): what stands at the left margin, up
    to the brace that closes it."""
    first = None
    for number, line in enumerate(lines, 1):
        if re.match(r"[A-Za-z_]", line) and "(" in line and not line.rstrip().endswith(";"):
            first = (re.search(r"(\w+)\(", line).group(1), number)
        elif line.startswith("}"):
            if first and line == "}":
                yield first[0], first[1], number - first[1] + 1
            first = None


def main():
    root = os.path.abspath(os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
    files = subprocess.run(["git", "ls-files"], cwd=root, capture_output=True, text=True, check=True).stdout.split("\n")
    with open(os.path.join(root, "docs/references.bib")) as f:
        keys = set(re.findall(r"@\w+\{(\w+),", f.read()))
    wrong = []
    for name in files:
        if not name.endswith((".c", ".h", ".inl", ".py", ".sh")) or name == "scripts/check_files.py":
            continue
        with open(os.path.join(root, name), errors="replace") as f:
            lines = f.read().split("\n")
        if len(lines) - 1 > LONGEST and not name.endswith(".inl"):
            wrong.append("%s: %d lines, expected at most %d" % (name, len(lines) - 1, LONGEST))
        for function, number, count in functions(lines) if name.endswith((".c", ".h")) else ():
            if count > LONGEST_FUNCTION:
                wrong.append("%s:%d: %s has %d lines, expected at most %d" % (name, number, function, count,
                                                                             LONGEST_FUNCTION))
        for number, line in enumerate(lines, 1):
            if len(line) > WIDEST and name.endswith((".c", ".h")):
                wrong.append("%s:%d: %d columns, expected at most %d" % (name, number, len(line), WIDEST))
            if re.search(r"\b(TODO|FIXME|XXX|HACK)\b", line):
                wrong.append("%s:%d: something is left to do" % (name, number))
            if name.startswith("src/"):
                for key in re.findall(r"\[([a-z]+[12][0-9]{3}[a-z]?)[ \]]", line):
                    if key not in keys:
                        wrong.append("%s:%d: [%s] is not in docs/references.bib" % (name, number, key))
    print("\n".join(wrong) if wrong else "files: readable, cited, finished")
    return 1 if wrong else 0


sys.exit(main())
