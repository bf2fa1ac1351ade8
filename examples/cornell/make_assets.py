#!/usr/bin/env python3
"""Generates the data of the Cornell example with the standard library alone: box walls (OBJ, the published dimensions),
a torus knot (PLY), the floor's picture and the environment of the truth, and the plain starting values.

usage: make_assets.py [FOLDER] [SEED]     SEED redraws the truth and the start; without it, the shipped ones.
"""
import math
import os
import random
import struct
import sys

# The measured Cornell box [mm]: https://www.graphics.cornell.edu/online/box/data.html
QUADS = {
    "floor": [(552.8, 0, 0), (0, 0, 0), (0, 0, 559.2), (549.6, 0, 559.2)],
    "ceiling": [(556, 548.8, 0), (556, 548.8, 559.2), (0, 548.8, 559.2), (0, 548.8, 0)],
    "back": [(549.6, 0, 559.2), (0, 0, 559.2), (0, 548.8, 559.2), (556, 548.8, 559.2)],
    "right": [(0, 0, 559.2), (0, 0, 0), (0, 548.8, 0), (0, 548.8, 559.2)],
    "left": [(552.8, 0, 0), (549.6, 0, 559.2), (556, 548.8, 559.2), (556, 548.8, 0)],
    "light": [(343, 548.3, 227), (343, 548.3, 332), (213, 548.3, 332), (213, 548.3, 227)],
}
SHORT_BLOCK = [
    [(130, 165, 65), (82, 165, 225), (240, 165, 272), (290, 165, 114)],
    [(290, 0, 114), (290, 165, 114), (240, 165, 272), (240, 0, 272)],
    [(130, 0, 65), (130, 165, 65), (290, 165, 114), (290, 0, 114)],
    [(82, 0, 225), (82, 165, 225), (130, 165, 65), (130, 0, 65)],
    [(240, 0, 272), (240, 165, 272), (82, 165, 225), (82, 0, 225)],
]
UV = [(1, 0), (0, 0), (0, 1), (1, 1)]


def write_obj(path, quads):
    with open(path, "w") as f:
        for quad in quads:
            for p in quad:
                f.write("v %g %g %g\n" % p)
            for u in UV:
                f.write("vt %g %g\n" % u)
        for i in range(len(quads)):
            f.write("f " + " ".join("%d/%d" % (4 * i + k + 1, 4 * i + k + 1) for k in range(4)) + "\n")


def add(a, b, s=1.0):
    return tuple(x + s * y for x, y in zip(a, b))


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def unit(a):
    n = math.sqrt(sum(x * x for x in a))
    return tuple(x / n for x in a)


def knot(t):
    """Centre line of a (2, 3) torus knot."""
    r = 2 + math.cos(3 * t)
    return (r * math.cos(2 * t), 1.15 * math.sin(3 * t), r * math.sin(2 * t))


def write_knot(path, along=360, around=32, tube=0.52, scale=27.0, centre=(186, 211, 169)):
    vertices, faces = [], []
    for i in range(along):
        t = 2 * math.pi * i / along
        c, d = knot(t), unit(add(knot(t + 1e-4), knot(t - 1e-4), -1))
        n = unit(cross(d, unit(c)))
        b = cross(n, d)
        for j in range(around):
            a = 2 * math.pi * j / around
            normal = add(tuple(math.cos(a) * x for x in n), b, math.sin(a))
            p = add(c, normal, tube)
            vertices.append(add(centre, p, scale) + normal)
            k, l = (i + 1) % along, (j + 1) % around
            faces.append((i * around + j, k * around + j, k * around + l))
            faces.append((i * around + j, k * around + l, i * around + l))
    with open(path, "wb") as f:
        f.write(("ply\nformat binary_little_endian 1.0\nelement vertex %d\n" % len(vertices)
                 + "".join("property float %s\n" % n for n in ("x", "y", "z", "nx", "ny", "nz"))
                 + "element face %d\nproperty list uchar int vertex_indices\nend_header\n" % len(faces)).encode())
        for v in vertices:
            f.write(struct.pack("<6f", *v))
        for t in faces:
            f.write(struct.pack("<B3i", 3, *t))


def write_exr_rows(path, height, width, row):
    """A picture of floats, without compression; row(y): the floats of row y, all of B, then G, then R.
    https://openexr.com/en/latest/OpenEXRFileLayout.html"""
    def attribute(name, kind, data):
        return ("%s\0%s\0" % (name, kind)).encode() + struct.pack("<I", len(data)) + data

    box = struct.pack("<4i", 0, 0, width - 1, height - 1)
    channels = b"".join(c + b"\0" + struct.pack("<4i", 2, 0, 1, 1) for c in (b"B", b"G", b"R")) + b"\0"
    head = struct.pack("<2I", 20000630, 2) + attribute("channels", "chlist", channels)
    head += attribute("compression", "compression", b"\0") + attribute("dataWindow", "box2i", box)
    head += attribute("displayWindow", "box2i", box) + attribute("lineOrder", "lineOrder", b"\0")
    head += attribute("pixelAspectRatio", "float", struct.pack("<f", 1))
    head += attribute("screenWindowCenter", "v2f", struct.pack("<2f", 0, 0))
    head += attribute("screenWindowWidth", "float", struct.pack("<f", 1)) + b"\0"
    row_bytes = 12 * width
    with open(path, "wb") as f:
        f.write(head + b"".join(struct.pack("<Q", len(head) + 8 * height + y * (8 + row_bytes)) for y in range(height)))
        for y in range(height):
            f.write(struct.pack("<2i", y, row_bytes) + row(y))


def write_exr(path, height, width, pixel):
    def row(y):
        colours = [pixel((x + 0.5) / width, (y + 0.5) / height) for x in range(width)]
        return b"".join(struct.pack("<%df" % width, *(c[k] for c in colours)) for k in (2, 1, 0))

    write_exr_rows(path, height, width, row)


def smooth(edge, x, width):
    t = min(1.0, max(0.0, (x - edge) / width + 0.5))
    return t * t * (3 - 2 * t)


def mix(a, b, t):
    return tuple(x + (y - x) * t for x, y in zip(a, b))


def floor_picture(rng):
    """A round window of petals and rings on a warm ground."""
    petals, turn = rng.choice([6, 8, 10]), rng.uniform(0, 1)
    ground, petal, ring, heart = [(rng.uniform(*r), rng.uniform(*g), rng.uniform(*b)) for r, g, b in (
        ((0.55, 0.75), (0.45, 0.6), (0.3, 0.45)), ((0.15, 0.4), (0.3, 0.5), (0.55, 0.75)),
        ((0.6, 0.8), (0.25, 0.4), (0.15, 0.25)), ((0.7, 0.85), (0.65, 0.8), (0.3, 0.5)))]

    def pixel(u, v):
        x, y = 2 * u - 1, 2 * v - 1
        r, a = math.hypot(x, y), math.atan2(y, x)
        wave = 0.5 + 0.5 * math.cos(petals * a + 6.28 * turn)
        c = mix(ground, petal, smooth(0.0, 0.30 + 0.45 * wave - r, 0.06))
        c = mix(c, ring, smooth(0.0, 0.045 - abs(r - 0.86), 0.04))
        c = mix(c, heart, smooth(0.0, 0.17 - r, 0.05))
        tiles = 0.06 * math.cos(12 * math.pi * u) * math.cos(12 * math.pi * v)
        return tuple(min(0.95, max(0.05, k * (1 + tiles))) for k in c)
    return pixel


def environment(rng):
    """A sky, a ground, and three soft blobs of light on the side of the opening (-z)."""
    blobs = [(rng.uniform(-0.7, 0.7), rng.uniform(-0.2, 0.7), rng.uniform(0.12, 0.3),
              tuple(rng.uniform(0.8, 2.5) for _ in range(3))) for _ in range(3)]
    horizon, zenith, earth = (0.9, 0.95, 1.1), (0.35, 0.55, 1.0), (0.45, 0.38, 0.3)

    def pixel(u, v):
        phi, theta = 2 * math.pi * u, math.pi * v
        d = (math.sin(theta) * math.sin(phi), math.cos(theta), -math.sin(theta) * math.cos(phi))
        c = mix(earth, mix(horizon, zenith, max(0.0, d[1])), smooth(0.0, d[1], 0.25))
        for x, y, size, colour in blobs:
            axis = unit((x, y, -1.0))
            c = add(c, colour, math.exp((sum(p * q for p, q in zip(axis, d)) - 1) / (size * size)))
        return c
    return pixel


def values(rng, shipped):
    """Numbers of the truth and of the start, for the XML files."""
    truth = {"white": (0.725, 0.71, 0.68), "red": (0.63, 0.12, 0.1), "green": (0.16, 0.45, 0.13),
             "radiance": (18.0, 15.0, 9.0), "alpha": 0.3}
    start = {"white": (0.4, 0.4, 0.4), "red": (0.4, 0.4, 0.4), "green": (0.4, 0.4, 0.4),
             "radiance": (6.0, 6.0, 6.0), "alpha": 0.6}
    if not shipped:
        for name in ("white", "red", "green"):
            truth[name] = tuple(min(0.8, max(0.08, x * rng.uniform(0.7, 1.3))) for x in truth[name])
            start[name] = tuple(rng.uniform(0.2, 0.7) for _ in range(3))
        truth["radiance"] = tuple(x * rng.uniform(0.6, 1.5) for x in truth["radiance"])
        start["radiance"] = tuple(rng.uniform(4, 30) for _ in range(3))
        truth["alpha"], start["alpha"] = rng.uniform(0.2, 0.35), rng.uniform(0.5, 0.7)
    return truth, start


def write_scene(folder, name, v, floor, sky):
    with open(os.path.join(os.path.dirname(os.path.abspath(__file__)), "scene.in.xml")) as f:
        text = f.read()
    for key, value in v.items():
        numbers = value if isinstance(value, tuple) else (value,)
        text = text.replace("@%s@" % key, " ".join("%.6g" % x for x in numbers))
    with open(os.path.join(folder, name), "w") as f:
        f.write(text.replace("@floor@", floor).replace("@environment@", sky))


def main():
    here = os.path.dirname(os.path.abspath(__file__))
    folder = sys.argv[1] if len(sys.argv) > 1 else here
    shipped = len(sys.argv) < 3
    rng = random.Random(7 if shipped else int(sys.argv[2]))
    data = os.path.join(folder, "data")
    os.makedirs(data, exist_ok=True)
    for name, quad in QUADS.items():
        write_obj(os.path.join(data, name + ".obj"), [quad])
    write_obj(os.path.join(data, "block.obj"), SHORT_BLOCK)
    write_knot(os.path.join(data, "knot.ply"))
    write_exr(os.path.join(data, "floor_truth.exr"), 128, 128, floor_picture(rng))
    write_exr(os.path.join(data, "environment_truth.exr"), 32, 64, environment(rng))
    write_exr(os.path.join(data, "floor_start.exr"), 128, 128, lambda u, v: (0.5, 0.5, 0.5))
    write_exr(os.path.join(data, "environment_start.exr"), 32, 64, lambda u, v: (0.5, 0.5, 0.5))
    truth, start = values(rng, shipped)
    write_scene(folder, "truth.xml", truth, "floor_truth.exr", "environment_truth.exr")
    write_scene(folder, "scene.xml", start, "floor_start.exr", "environment_start.exr")


if __name__ == "__main__":
    main()
