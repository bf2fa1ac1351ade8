"""Runs a compiler's front end over every source as a build folder would compile it: all of its warnings, and nothing is built.
usage: warnings.py BUILD, a folder of cmake with CMAKE_EXPORT_COMPILE_COMMANDS."""
import concurrent.futures
import json
import os
import shlex
import subprocess
import sys


def check(entry):
    words = shlex.split(entry["command"])
    at = words.index("-o")
    words[at:at + 2] = ["-fsyntax-only"]
    run = subprocess.run(words, cwd=entry["directory"], capture_output=True, text=True)
    return run.returncode, run.stderr


def main():
    with open(os.path.join(sys.argv[1], "compile_commands.json")) as f:
        entries = json.load(f)
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        results = list(pool.map(check, entries))
    failed = [text for code, text in results if code]
    print("".join(failed), end="", file=sys.stderr)
    print("front end: %d of %d files without warnings" % (len(entries) - len(failed), len(entries)))
    sys.exit(1 if failed or not entries else 0)


main()
