#!/usr/bin/env python3
"""Every key that --json writes stands in docs/cli.md, every key of a job in docs/fit.md, between backquotes."""
import glob
import os
import re
import sys

ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..")
WRITTEN = r'json_(?:object|array|string|number|integer|bool|values|terms)\([^";]*"([a-z_]+)"'
READ = r'\.key = "([a-z_0-9]+)"|WEIGHT\(([a-z_]+),|KEY\("([a-z_]+)'


def words_of(name):
    with open(os.path.join(ROOT, name)) as f:
        quoted = re.findall(r"`([^`]+)`", re.sub(r"(?ms)^```.*?^```$", "", f.read()))
    return {word for text in quoted for word in re.findall(r"[A-Za-z_0-9]+", text)}


def keys_of(pattern, expression):
    keys = set()
    for path in glob.glob(os.path.join(ROOT, pattern)):
        with open(path) as f:
            keys.update(key for found in re.findall(expression, f.read())
                        for key in (found if isinstance(found, tuple) else (found,)) if key)
    return keys


def main():
    wrong = []
    for pattern, expression, page in (("cli/*.c", WRITTEN, "docs/cli.md"), ("src/fit/job*.c", READ, "docs/fit.md")):
        for key in sorted(keys_of(pattern, expression) - words_of(page)):
            wrong.append("%s: the key %s is not described" % (page, key))
    print("\n".join(wrong) if wrong else "keys: all are described")
    return 1 if wrong else 0


sys.exit(main())
