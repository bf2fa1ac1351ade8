#!/usr/bin/env python3
"""Writes what the glass example is made of: a smooth pebble (an ellipsoid with a dent) as OBJ, and the pattern of the wall.

usage: make_assets.py FOLDER"""
import math
import os
import struct
import sys
import zlib

ACROSS, DOWN = 64, 32  # quads of the pebble
SIZE = 64              # texels of the pattern


def pebble(theta, phi):
    """A point of the surface; the poles lie on z."""
    s = math.sin(theta)
    x, y, z = s * math.cos(phi), s * math.sin(phi), math.cos(theta)
    dent = 1 - 0.22 * math.exp(-6 * ((x - 0.6) ** 2 + (z - 0.5) ** 2))
    return 1.0 * x * dent, 0.62 * y * dent, 0.8 * z * dent


def write_pebble(path):
    rows = ["# A glass pebble. Made by make_assets.py."]
    points = [pebble(0, 0)]
    for j in range(1, DOWN):
        points += [pebble(math.pi * j / DOWN, 2 * math.pi * i / ACROSS) for i in range(ACROSS)]
    points.append(pebble(math.pi, 0))
    rows += ["v %.6f %.6f %.6f" % p for p in points]
    last = len(points)
    for i in range(ACROSS):
        k = (i + 1) % ACROSS
        rows.append("f 1 %d %d" % (2 + i, 2 + k))
        for j in range(DOWN - 2):
            a, b = 2 + j * ACROSS, 2 + (j + 1) * ACROSS
            rows.append("f %d %d %d" % (a + i, b + i, b + k))
            rows.append("f %d %d %d" % (a + i, b + k, a + k))
        begin = 2 + (DOWN - 2) * ACROSS
        rows.append("f %d %d %d" % (begin + i, last, begin + k))
    with open(path, "w") as f:
        f.write("\n".join(rows) + "\n")


def colour(u, v):
    """Soft waves whose lengths differ, so that every place of the wall looks different."""
    def wave(a, b, c):
        return 0.5 + 0.42 * math.sin(2 * math.pi * (a * u + b * v) + c)
    return wave(3, 1, 0.3) * wave(-1, 2, 1), wave(1, -3, 2) * wave(2, 2, 0.5), wave(-2, 2, 4) * wave(1, 3, 2.5)


def write_pattern(path):
    rows = b""
    for y in range(SIZE):
        rows += b"\0"
        for x in range(SIZE):
            rows += bytes(round(255 * min(1, 0.08 + 0.9 * c)) for c in colour((x + 0.5) / SIZE, (y + 0.5) / SIZE))

    def chunk(name, data):
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
    with open(path, "wb") as f:
        f.write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", SIZE, SIZE, 8, 2, 0, 0, 0)) +
                chunk(b"IDAT", zlib.compress(rows, 9)) + chunk(b"IEND", b""))


def main():
    folder = sys.argv[1] if len(sys.argv) > 1 else os.path.dirname(os.path.abspath(__file__))
    write_pebble(os.path.join(folder, "pebble.obj"))
    write_pattern(os.path.join(folder, "pattern.png"))


if __name__ == "__main__":
    main()
