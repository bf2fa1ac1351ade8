#!/usr/bin/env python3
"""Writes what the example of hidden inclusions is made of: twelve cameras around the block, the densities that the recovery starts
with, and the block's own.

usage: make_assets.py FOLDER"""
import array
import math
import os
import struct
import sys

CELLS = 12
BACKGROUND, INCLUSION, START = 2, 8, 3
INCLUSIONS = [((2, 6), (5, 9)), ((7, 2), (10, 5))]  # first and last corners in voxels, 3 x 3 each
VIEWS = 12


def write_vol(path, values):
    """One channel of floats, constant along z, x fastest."""
    with open(path, "wb") as f:
        f.write(b"VOL\x03" + struct.pack("<5i6f", 1, CELLS, CELLS, 1, 1, 0, 0, 0, 1, 1, 1) + array.array("f", values).tobytes())


def density(i, j):
    inside = any(low[0] <= i < high[0] and low[1] <= j < high[1] for low, high in INCLUSIONS)
    return INCLUSION if inside else BACKGROUND


def write_cameras(path):
    """Each side of the block is seen from three directions, as 16 strips a little wider than a voxel."""
    with open(path, "w") as f:
        f.write('<scene version="3.0.0">\n')
        for i in range(VIEWS):
            angle = 2 * math.pi * i / VIEWS
            f.write("""    <sensor type="orthographic" id="camera_%d">
        <transform name="to_world">
            <scale x="0.71" y="0.71"/>
            <lookat origin="%.6f, %.6f, 0" target="0, 0, 0" up="0, 0, 1"/>
        </transform>
        <film type="hdrfilm">
            <integer name="width" value="16"/>
            <integer name="height" value="4"/>
            <string name="component_format" value="float32"/>
            <rfilter type="box"/>
        </film>
        <sampler type="independent"><integer name="sample_count" value="64"/></sampler>
    </sensor>
""" % (i, 2 * math.cos(angle), 2 * math.sin(angle)))
        f.write("</scene>\n")


def main():
    folder = sys.argv[1] if len(sys.argv) > 1 else os.path.dirname(os.path.abspath(__file__))
    write_cameras(os.path.join(folder, "cameras.xml"))
    write_vol(os.path.join(folder, "start.vol"), [START] * CELLS ** 2)
    write_vol(os.path.join(folder, "truth.vol"), [density(i, j) for j in range(CELLS) for i in range(CELLS)])


if __name__ == "__main__":
    main()
