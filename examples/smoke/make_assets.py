#!/usr/bin/env python3
"""Writes what the smoke example is made of: the cameras, the grid that the recovery starts with, and the smoke itself.

usage: make_assets.py FOLDER    (the smoke goes to FOLDER/truth.vol, which only make_targets.sh needs)"""
import array
import math
import os
import random
import struct
import sys

CELLS, COARSE = 64, 8
VIEWS, HELD_OUT = 20, 4


def write_vol(path, n, values):
    """One channel of floats from -1 to 1 along each axis, x fastest."""
    with open(path, "wb") as f:
        f.write(b"VOL\x03" + struct.pack("<5i6f", 1, n, n, n, 1, -1, -1, -1, 1, 1, 1) + values.tobytes())


def lattice_noise(rng, n):
    """Smooth numbers from -1 to 1 on [0, 1]^3, n waves along each axis, without derivatives' jumps."""
    values = [rng.uniform(-1, 1) for _ in range((n + 1) ** 3)]

    def at(x, y, z):
        cell, blend = [], []
        for v in (x, y, z):
            v = min(max(v, 0), 0.999999) * n
            k = int(v)
            cell.append(k)
            v -= k
            blend.append(v * v * (3 - 2 * v))
        total = 0
        for corner in range(8):
            weight, index = 1, 0
            for axis in (2, 1, 0):
                up = corner >> axis & 1
                weight *= blend[axis] if up else 1 - blend[axis]
                index = index * (n + 1) + cell[axis] + up
            total += weight * values[index]
        return total
    return at


def smoke():
    """A plume that rises and curls: puffs along a widening helix, stirred by noise."""
    rng = random.Random(4)
    stir = [lattice_noise(rng, 4) for _ in range(3)]
    ripple = lattice_noise(rng, 9)
    puffs = []
    for i in range(26):
        t = i / 25
        turn = 5.5 * t
        away = 0.06 + 0.42 * t
        puffs.append((away * math.cos(turn), -0.8 + 1.5 * t, away * math.sin(turn), 0.10 + 0.16 * t, 1.25 - 0.8 * t))
    values = array.array("f")
    for k in range(CELLS):
        for j in range(CELLS):
            for i in range(CELLS):
                p = [(c + 0.5) / CELLS for c in (i, j, k)]
                q = [2 * c - 1 + 0.13 * s(*p) for c, s in zip(p, stir)]
                density = sum(h * math.exp(-((q[0] - x) ** 2 + (q[1] - y) ** 2 + (q[2] - z) ** 2) / (r * r))
                              for x, y, z, r, h in puffs)
                density *= 0.85 + 0.5 * ripple(*p)
                values.append(max(0, 5 * (density - 0.12)))
    return values


def camera(i, azimuth, elevation):
    a, e = math.radians(azimuth), math.radians(elevation)
    origin = [4.6 * math.cos(e) * math.cos(a), 4.6 * math.sin(e), 4.6 * math.cos(e) * math.sin(a)]
    return """    <sensor type="perspective" id="camera_%d">
        <float name="fov" value="32"/>
        <transform name="to_world"><lookat origin="%.4f, %.4f, %.4f" target="0, 0, 0" up="0, 1, 0"/></transform>
        <film type="hdrfilm">
            <integer name="width" value="64"/>
            <integer name="height" value="64"/>
            <string name="component_format" value="float16"/>
            <rfilter type="box"/>
        </film>
        <sampler type="independent"><integer name="sample_count" value="64"/></sampler>
    </sensor>
""" % (i, *origin)


def write_cameras(path):
    """Sixteen around the smoke at three heights; four that are held out, between them."""
    around = [(360 * i / 16, (-12, 14, 38)[i % 3]) for i in range(VIEWS - HELD_OUT)]
    between = [(101.25, 0), (191.25, 25), (281.25, 8), (11.25, 30)]
    with open(path, "w") as f:
        f.write('<scene version="3.0.0">\n')
        for i, (azimuth, elevation) in enumerate(around + between):
            f.write(camera(i, azimuth, elevation))
        f.write("</scene>\n")


def main():
    folder = sys.argv[1] if len(sys.argv) > 1 else os.path.dirname(os.path.abspath(__file__))
    write_cameras(os.path.join(folder, "cameras.xml"))
    write_vol(os.path.join(folder, "start.vol"), COARSE, array.array("f", [1] * COARSE ** 3))
    write_vol(os.path.join(folder, "truth.vol"), CELLS, smoke())


if __name__ == "__main__":
    main()
