#!/usr/bin/env python3
"""Files stay readable: at most 500 lines (tables and tests of formats exempt), citations exist, nothing is left to do."""
import os
import re
import subprocess
import sys

LONGEST = 500
EXEMPT = {"tests/test_io_xml.c"}


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
        if len(lines) - 1 > LONGEST and not name.endswith(".inl") and name not in EXEMPT:
            wrong.append("%s: %d lines, expected at most %d" % (name, len(lines) - 1, LONGEST))
        for number, line in enumerate(lines, 1):
            if re.search(r"\b(TODO|FIXME|XXX|HACK)\b", line):
                wrong.append("%s:%d: something is left to do" % (name, number))
            if name.startswith("src/"):
                for key in re.findall(r"\[([a-z]+[12][0-9]{3}[a-z]?)[ \]]", line):
                    if key not in keys:
                        wrong.append("%s:%d: [%s] is not in docs/references.bib" % (name, number, key))
    print("\n".join(wrong) if wrong else "files: readable, cited, finished")
    return 1 if wrong else 0


sys.exit(main())
