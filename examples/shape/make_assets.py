#!/usr/bin/env python3
"""Writes what the example consists of: start.ply, a sphere; truth.ply, a lumpy creature; scene.xml and truth.xml, which differ
in the mesh only, with 12 cameras around it. make_targets.sh photographs the truth."""
import math
import os
import struct

FOLDER = os.path.dirname(os.path.abspath(__file__))
PHI = (1 + 5 ** 0.5) / 2
# Lumps of the truth: direction, height, sharpness.
LUMPS = (((0.5, 0.3, 0.9), 0.55, 9), ((-0.5, 0.3, 0.9), 0.55, 9), ((0, -1, 0.15), 0.4, 6), ((0.9, 0.2, -0.4), 0.3, 5),
         ((-0.9, 0.2, -0.4), 0.3, 5), ((0, 0.8, -0.6), 0.35, 4), ((0, -0.4, -1), -0.25, 4))


def icosphere(levels):
    points = [(0, s, t * PHI) for s in (-1, 1) for t in (-1, 1)]
    points = [p[k:] + p[:k] for k in range(3) for p in points]
    faces = [(a, b, c) for a in range(12) for b in range(12) for c in range(12)
             if a < min(b, c) and b != c and
             all(abs(math.dist(points[i], points[j]) - 2) < 1e-6 for i, j in ((a, b), (b, c), (c, a)))]
    volume = lambda f: sum(points[f[0]][k] * (points[f[1]][(k + 1) % 3] * points[f[2]][(k + 2) % 3] -
                                              points[f[1]][(k + 2) % 3] * points[f[2]][(k + 1) % 3]) for k in range(3))
    faces = [f for f in faces if volume(f) > 0]
    for _ in range(levels):
        middle = {}

        def between(a, b):
            key = (min(a, b), max(a, b))
            if key not in middle:
                middle[key] = len(points)
                points.append(tuple((points[a][k] + points[b][k]) / 2 for k in range(3)))
            return middle[key]
        faces = [t for a, b, c in faces for ab, bc, ca in ((between(a, b), between(b, c), between(c, a)),)
                 for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
    return [tuple(x / math.hypot(*p) for x in p) for p in points], faces


def lumpy(p):
    radius = 0.85
    for direction, height, sharpness in LUMPS:
        length = math.hypot(*direction)
        cosine = sum(a * b for a, b in zip(p, direction)) / length
        radius += height * math.exp(sharpness * (cosine - 1))
    return tuple(radius * x for x in p)


def write_ply(name, points, faces):
    with open(os.path.join(FOLDER, name), "wb") as f:
        f.write(("ply\nformat binary_little_endian 1.0\nelement vertex %d\nproperty float x\nproperty float y\nproperty float z\n"
                 "element face %d\nproperty list uchar int vertex_indices\nend_header\n" % (len(points), len(faces))).encode())
        for p in points:
            f.write(struct.pack("<3f", *p))
        for t in faces:
            f.write(struct.pack("<B3i", 3, *t))


SCENE = """<!-- A %s seen by 12 cameras; written by make_assets.py. -->
<scene version="3.0.0">
    <integrator type="path"><integer name="max_depth" value="2"/></integrator>
%s    <shape type="ply" id="creature">
        <string name="filename" value="%s"/>
        <boolean name="face_normals" value="true"/>
        <bsdf type="diffuse"><rgb name="reflectance" value="0.7, 0.6, 0.5"/></bsdf>
    </shape>
    <emitter type="directional"><vector name="direction" value="-1, 1.5, -1.2"/>\
<rgb name="irradiance" value="3.2, 3.0, 2.8"/></emitter>
    <emitter type="directional"><vector name="direction" value="1.4, -0.6, 0.8"/>\
<rgb name="irradiance" value="1.0, 1.2, 1.6"/></emitter>
    <emitter type="constant"><rgb name="radiance" value="0.06, 0.07, 0.09"/></emitter>
</scene>
"""
SENSOR = """    <sensor type="perspective">
        <float name="fov" value="36"/>
        <transform name="to_world"><lookat origin="%.4f, %.4f, %.4f" target="0, 0, 0" up="%s"/></transform>
        <film type="hdrfilm">
            <integer name="width" value="96"/>
            <integer name="height" value="96"/>
            <string name="component_format" value="float16"/>
            <rfilter type="box"/>
        </film>
        <sampler type="independent"><integer name="sample_count" value="64"/></sampler>
    </sensor>
"""


def main():
    start, faces = icosphere(3)
    write_ply("start.ply", start, faces)
    fine, faces = icosphere(5)
    write_ply("truth.ply", [lumpy(p) for p in fine], faces)
    eyes, _ = icosphere(0)
    sensors = "".join(SENSOR % (*(4.2 * x for x in eye), "1, 0, 0" if abs(eye[2]) > 0.8 else "0, 0, 1") for eye in eyes)
    for name, what, mesh in (("scene.xml", "sphere", "start.ply"), ("truth.xml", "lumpy creature", "truth.ply")):
        with open(os.path.join(FOLDER, name), "w") as f:
            f.write(SCENE % (what, sensors, mesh))


main()
