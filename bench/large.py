#!/usr/bin/env python3
"""Large scenes: seconds to load and to render, and the most memory held, each in a process of its own: five million
triangles (PLY and OBJ), a sky (EXR) and a texture (PNG) of 16k x 8k pixels, a forest of 100,000 instances, two
mirrors that face each other, to depth 64, and fog of 1024^3 voxels (VOL and NanoVDB). The files take 8 GB.

usage: large.py [--reynolds BINARY] [--folder DIR] [--divide N] [SCENE...]"""
import argparse
import json
import math
import os
import struct
import subprocess
import zlib

import grids
import scenes

MIRRORS = "".join(
    '<shape type="rectangle"><transform name="to_world">%s<translate z="%g"/></transform><bsdf type="conductor">'
    '<string name="material" value="none"/><float name="specular_reflectance" value="0.98"/></bsdf></shape>' % (turn, z)
    for turn, z in (("", -1), ('<rotate y="1" angle="180"/>', 1)))
CORRIDOR = MIRRORS + (
    '<shape type="sphere"><point name="center" x="0.3" y="-0.3" z="0"/><float name="radius" value="0.2"/></shape>'
    '<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="90"/><scale value="0.3"/><translate y="0.9"/>'
    '</transform><emitter type="area"><rgb name="radiance" value="5"/></emitter></shape>')


def write_once(path, write, *arguments):
    if not os.path.exists(path):
        write(path + ".part", *arguments)
        os.rename(path + ".part", path)


def write_obj(path, ply):
    """The mesh of a file of scenes.write_blob as text."""
    with open(ply, "rb") as f, open(path, "w") as out:
        counts = [int(line.split()[-1]) for line in iter(f.readline, b"end_header\n") if line.startswith(b"element")]
        for _ in range(counts[0]):
            out.write("v %.6g %.6g %.6g\n" % struct.unpack("<3f", f.read(12)))
        for _ in range(counts[1]):
            out.write("f %d %d %d\n" % tuple(i + 1 for i in struct.unpack("<B3i", f.read(13))[1:]))


def write_sky(path, width, height):
    """Bands of 64 brightnesses, and a sun of a fifth of a degree."""
    bands = [struct.pack("<f", 0.2 + 0.8 * i / 64) * width for i in range(64)]
    sun = slice(4 * (width // 4), 4 * (width // 4 + max(1, width // 1800)))
    bright = struct.pack("<f", 5e4) * ((sun.stop - sun.start) // 4)

    def row(y):
        planes = [bytearray(bands[(y // 16 + 20 * k) % 64]) for k in range(3)]
        for plane in planes:
            if height // 3 <= y < height // 3 + max(1, width // 1800):
                plane[sun] = bright
        return b"".join(planes)

    scenes.assets.write_exr_rows(path, height, width, row)


def write_texture(path, width, height):
    def chunk(name, data):
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    rows = [b"\0" + bytes((x * (k + 1) // 7 + 40 * c) % 256 for x in range(width) for c in range(3)) for k in range(16)]
    pack = zlib.compressobj(1)
    data = b"".join(pack.compress(rows[y % 16]) for y in range(height)) + pack.flush()
    with open(path, "wb") as f:
        f.write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">2I5B", width, height, 8, 2, 0, 0, 0)))
        f.write(chunk(b"IDAT", data) + chunk(b"IEND", b""))


def mesh(kind):
    return ('<shape type="%s"><string name="filename" value="blob.%s"/></shape><emitter type="constant"/>' % (kind, kind))


def fog(file):
    """Fog of a file's density in the unit cube."""
    return ('<emitter type="constant"/><shape type="cube"><transform name="to_world"><translate x="1" y="1" z="1"/>'
            '<scale value="0.5"/></transform><bsdf type="null"/><medium name="interior" type="heterogeneous" id="fog">'
            '<volume name="sigma_t" type="gridvolume"><string name="filename" value="%s"/></volume>'
            '<float name="scale" value="30"/><float name="albedo" value="0.95"/></medium></shape>' % file)


def make(folder, divide):
    """Writes the scenes, every number in them divided by `divide`; returns {name: path}."""
    os.makedirs(folder, exist_ok=True)
    side, width = round(1581 / math.sqrt(divide)), 16384 // divide
    write_once(os.path.join(folder, "blob.ply"), scenes.write_blob, side, side, (0, 0, 0), 1)
    write_once(os.path.join(folder, "blob.obj"), write_obj, os.path.join(folder, "blob.ply"))
    write_once(os.path.join(folder, "sky16k.exr"), write_sky, width, width // 2)
    write_once(os.path.join(folder, "texture16k.png"), write_texture, width, width // 2)
    voxels = max(1, round(128 / divide ** (1 / 3))) * 8
    write_once(os.path.join(folder, "fog.vol"), grids.write_vol, voxels)
    write_once(os.path.join(folder, "fog.nvdb"), grids.write_nvdb, voxels)
    scenes.write_tree(os.path.join(folder, "tree.obj"))
    write_sky(os.path.join(folder, "sky.exr"), 64, 32)
    view = {"origin": "0, 1, -4", "target": "0, 0, 0", "up": "0, 1, 0", "near": 0.01, "depth": 8, "size": 256,
            "integrator": "path"}
    bodies = {
        "mesh_ply": (view, mesh("ply")),
        "mesh_obj": (view, mesh("obj")),
        "sky": (view, '<shape type="sphere"/>' + scenes.SKY.replace("sky.exr", "sky16k.exr")),
        "texture": (view, '<shape type="sphere"><bsdf type="diffuse"><texture type="bitmap" name="reflectance"><string '
                    'name="filename" value="texture16k.png"/></texture></bsdf></shape><emitter type="constant"/>'),
        "forest": (dict(view, origin="0, -60, 12", up="0, 0, 1"), scenes.forest(100000 // divide)),
        "fog_vol": (dict(view, integrator="volpath", origin="-1.5, 1.4, 2.5", target="0.5, 0.5, 0.5"), fog("fog.vol")),
        "fog_nvdb": (dict(view, integrator="volpath", origin="-1.5, 1.4, 2.5", target="0.5, 0.5, 0.5"), fog("fog.nvdb")),
        "corridor": (dict(view, origin="-0.6, 0.2, -0.9", target="0.3, 0, 1", depth=64), CORRIDOR),
    }
    for name, (head, body) in bodies.items():
        with open(os.path.join(folder, name + ".xml"), "w") as f:
            f.write(scenes.HEAD % dict(head, rr_depth=head["depth"]) + body + "\n</scene>\n")
    return {name: os.path.join(folder, name + ".xml") for name in bodies}


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--reynolds", default="build/bin/reynolds")
    parser.add_argument("--folder", default="build/bench-large")
    parser.add_argument("--divide", type=int, default=1, help="make everything this many times smaller")
    parser.add_argument("scenes", nargs="*")
    options = parser.parse_args()
    print("%-10s %9s %9s %10s %9s" % ("scene", "load s", "render s", "Mpaths/s", "peak MB"))
    for name, path in make(options.folder, options.divide).items():
        if options.scenes and name not in options.scenes:
            continue
        command = [os.path.abspath(options.reynolds), "render", path, "-o", os.path.join(options.folder, "out.exr"), "--spp", "16",
                   "--json"]
        r = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
        print("%-10s %9.2f %9.2f %10.2f %9.0f" % (name, r["load_seconds"], r["seconds"], r["paths_per_second"] / 1e6,
                                                  r["peak_rss_mb"]), flush=True)


if __name__ == "__main__":
    main()
