#!/usr/bin/env python3
"""Writes what the milk example is made of: four slabs that a projector lights with a narrow beam each, at four angles, and a
camera on either side of each; and the projector's picture.

usage: make_assets.py FOLDER"""
import math
import os
import struct
import sys
import zlib

ANGLES = (0, 25, 45, 60)  # between a beam and its slab's normal [degrees]
AWAY, ASIDE = 12, 2.6     # of the slabs from the projector, along its axis and across
HALF = (1.5, 1.5, 0.5)    # of a slab's sides
SIZE, FOV = 256, 36       # of the projector's picture
BEAM = 0.18               # standard deviation of a beam


def add(a, b, scale=1):
    return [x + scale * y for x, y in zip(a, b)]


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def unit(a):
    length = math.sqrt(sum(x * x for x in a))
    return [x / length for x in a]


def turn(v, axis, degrees):
    """Turns v about a unit axis that is normal to it."""
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return add([c * x for x in v], cross(axis, v), s)


def corners():
    return [(x, y) for y in (-ASIDE, ASIDE) for x in (-ASIDE, ASIDE)]


def frames():
    """Of each slab: its centre, its normal, and the axis that it is tilted about."""
    for (x, y), angle in zip(corners(), ANGLES):
        centre = [x, y, AWAY]
        back = unit([-c for c in centre])
        axis = unit(cross([0, 1, 0], back))
        axis = cross(back, axis) if x > 0 else [-c for c in cross(back, axis)]
        yield centre, turn(back, axis, angle), axis


def numbers(values):
    return ", ".join("%.6f" % v for v in values)


def write_slabs(path):
    with open(path, "w") as f:
        f.write('<scene version="3.0.0">\n')
        for i, (centre, normal, axis) in enumerate(frames()):
            across = cross(axis, normal)
            rows = ["%.6f %.6f %.6f %.6f" % (HALF[0] * across[k], HALF[1] * axis[k], HALF[2] * normal[k], centre[k])
                    for k in range(3)]
            f.write('    <shape type="cube" id="slab_%d">\n'
                    '        <transform name="to_world"><matrix value="%s 0 0 0 1"/></transform>\n'
                    '        <bsdf type="null"/>\n        <ref name="interior" id="milk"/>\n    </shape>\n' % (i, " ".join(rows)))
        f.write("</scene>\n")


def write_cameras(path):
    with open(path, "w") as f:
        f.write('<scene version="3.0.0">\n')
        for i, (centre, normal, axis) in enumerate(frames()):
            for side in (0, 1):
                towards = turn(normal, axis, -20) if side == 0 else [-c for c in turn(normal, axis, 15)]
                f.write("""    <sensor type="perspective" id="camera_%d_%s">
        <float name="fov" value="24"/>
        <transform name="to_world"><lookat origin="%s" target="%s" up="%s"/></transform>
        <film type="hdrfilm">
            <integer name="width" value="16"/>
            <integer name="height" value="16"/>
            <string name="component_format" value="float32"/>
            <rfilter type="box"/>
        </film>
        <sampler type="independent"><integer name="sample_count" value="64"/></sampler>
    </sensor>
""" % (i, ("front", "back")[side], numbers(add(centre, towards, 5)), numbers(centre), numbers(axis)))
        f.write("</scene>\n")


def write_beams(path):
    """Four dots where the slabs' centres are seen: the projector is a camera that looks along z, whose x goes to the left."""
    edge = math.tan(math.radians(FOV / 2)) * AWAY
    rows = b""
    for j in range(SIZE):
        rows += b"\0"
        for i in range(SIZE):
            x, y = edge * (1 - 2 * (i + 0.5) / SIZE), edge * (1 - 2 * (j + 0.5) / SIZE)
            value = sum(math.exp(-((x - cx) ** 2 + (y - cy) ** 2) / (2 * BEAM * BEAM)) for cx, cy in corners())
            rows += bytes([round(255 * min(1, value))])

    def chunk(name, data):
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
    with open(path, "wb") as f:
        f.write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", SIZE, SIZE, 8, 0, 0, 0, 0)) +
                chunk(b"IDAT", zlib.compress(rows, 9)) + chunk(b"IEND", b""))


def main():
    folder = sys.argv[1] if len(sys.argv) > 1 else os.path.dirname(os.path.abspath(__file__))
    write_slabs(os.path.join(folder, "slabs.xml"))
    write_cameras(os.path.join(folder, "cameras.xml"))
    write_beams(os.path.join(folder, "beams.png"))


if __name__ == "__main__":
    main()
