#!/usr/bin/env python3
"""A folder of src/ includes only what stands to its left in the plan of the house."""
import os
import re
import sys

KINDS = {"shape", "bsdf", "emitter", "medium", "sensor"}
LEFT = {"base": set(), "math": {"base"}, "scene": {"base", "math"}}
for kind in KINDS:
    # The emitters of shapes are sampled through them; kinds otherwise know nothing of each other.
    LEFT[kind] = {"base", "math", "scene"} | ({"shape"} if kind in ("emitter", "sensor") else set())
LEFT["accel"] = {"base", "math", "scene"} | KINDS
LEFT["integrator"] = LEFT["accel"] | {"accel"}
LEFT["backend"] = LEFT["integrator"] | {"integrator"}
LEFT["render"] = LEFT["backend"] | {"backend"}
LEFT["io"] = {"base", "math", "scene"} | KINDS
LEFT["fit"] = LEFT["render"] | {"render", "io"}
LEFT["api"] = LEFT["fit"] | {"fit"}


def main():
    root = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..")
    source = os.path.join(root, "src")
    wrong = []
    for folder, _, names in os.walk(source):
        for name in names:
            path = os.path.join(folder, name)
            own = os.path.relpath(path, source).split(os.sep)[0]
            own = "api" if own == "api.c" else own
            if not name.endswith((".c", ".h", ".inl")) or own not in LEFT:
                continue
            with open(path) as f:
                for number, line in enumerate(f, 1):
                    found = re.match(r'\s*#\s*include\s+"([a-z]+)/', line)
                    if found and found.group(1) not in LEFT[own] | {own, "reynolds"}:
                        wrong.append("%s:%d: %s must not include %s" % (os.path.relpath(path, root), number, own,
                                                                        found.group(1)))
    print("\n".join(wrong) if wrong else "includes: every folder looks to its left only")
    return 1 if wrong else 0


sys.exit(main())
