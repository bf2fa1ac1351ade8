"""The benchmark scenes: Cornell box, box with a 70,000-triangle rough-metal mesh, a million triangles under a sky."""
import importlib.util
import math
import os
import struct

HERE = os.path.dirname(os.path.abspath(__file__))
spec = importlib.util.spec_from_file_location("assets", os.path.join(HERE, "../examples/cornell/make_assets.py"))
assets = importlib.util.module_from_spec(spec)
spec.loader.exec_module(assets)

HEAD = """<scene version="3.0.0">
<integrator type="path"><integer name="max_depth" value="%(depth)d"/><integer name="rr_depth" value="5"/></integrator>
<sensor type="perspective"><float name="fov" value="39.3"/><float name="near_clip" value="%(near)g"/><float name="far_clip" value="5000"/>
<transform name="to_world"><lookat origin="%(origin)s" target="%(target)s" up="0, 1, 0"/></transform>
<sampler type="independent"><integer name="sample_count" value="16"/></sampler>
<film type="hdrfilm"><integer name="width" value="%(size)d"/><integer name="height" value="%(size)d"/><rfilter type="box"/></film></sensor>
"""
WALLS = """<bsdf type="diffuse" id="white"><rgb name="reflectance" value="0.725 0.71 0.68"/></bsdf>
<bsdf type="diffuse" id="red"><rgb name="reflectance" value="0.63 0.065 0.05"/></bsdf>
<bsdf type="diffuse" id="green"><rgb name="reflectance" value="0.14 0.45 0.091"/></bsdf>
""" + "".join('<shape type="obj"><string name="filename" value="%s.obj"/><ref id="%s"/></shape>\n' % w for w in (
    ("floor", "white"), ("ceiling", "white"), ("back", "white"), ("left", "red"), ("right", "green"))) + """
<shape type="obj"><string name="filename" value="light.obj"/><bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf>
<emitter type="area"><rgb name="radiance" value="18 15 9"/></emitter></shape>
"""
METAL = """<bsdf type="roughconductor" id="metal"><rgb name="eta" value="0.2 0.92 1.1"/><rgb name="k" value="3.9 2.45 2.14"/>
<string name="distribution" value="ggx"/><float name="alpha" value="0.2"/></bsdf>
"""


def write_blob(path, rows, columns, centre, radius):
    """A bumpy sphere of 2 * rows * columns triangles."""
    with open(path, "wb") as f:
        f.write(("ply\nformat binary_little_endian 1.0\nelement vertex %d\nproperty float x\nproperty float y\n"
                 "property float z\nelement face %d\nproperty list uchar int vertex_indices\nend_header\n"
                 % ((rows + 1) * columns, 2 * rows * columns)).encode())
        for i in range(rows + 1):
            theta = math.pi * (0.001 + 0.998 * i / rows)
            for j in range(columns):
                phi = 2 * math.pi * j / columns
                r = radius * (1 + 0.12 * math.sin(7 * theta) * math.cos(5 * phi) + 0.02 * math.sin(40 * theta + 31 * phi))
                f.write(struct.pack("<3f", centre[0] + r * math.sin(theta) * math.cos(phi),
                                    centre[1] + r * math.cos(theta), centre[2] - r * math.sin(theta) * math.sin(phi)))
        for i in range(rows):
            for j in range(columns):
                a, b = i * columns + j, i * columns + (j + 1) % columns
                f.write(struct.pack("<B3iB3i", 3, a, a + columns, b, 3, b, a + columns, b + columns))


def make(folder):
    """Writes the scenes; returns {name: (path, spp)}."""
    os.makedirs(folder, exist_ok=True)
    for name, quad in assets.QUADS.items():
        assets.write_obj(os.path.join(folder, name + ".obj"), [quad])
    assets.write_obj(os.path.join(folder, "block.obj"), assets.SHORT_BLOCK)
    write_blob(os.path.join(folder, "blob70k.ply"), 186, 188, (300, 170, 280), 140)
    if not os.path.exists(os.path.join(folder, "blob1m.ply")):
        write_blob(os.path.join(folder, "blob1m.ply"), 700, 714, (0, 0, 0), 1)
    assets.write_npy(os.path.join(folder, "sky.npy"), 256, 512, assets.environment(__import__("random").Random(3)))
    box = {"origin": "278, 273, -800", "target": "278, 273, 0", "near": 10}
    scenes = {
        "cornell": (dict(box, depth=8, size=512), WALLS + '<shape type="obj"><string name="filename" value="block.obj"/>'
                    '<boolean name="face_normals" value="true"/><ref id="white"/></shape>', 16),
        "box+70k": (dict(box, depth=8, size=512), WALLS + METAL + '<shape type="ply">'
                    '<string name="filename" value="blob70k.ply"/><ref id="metal"/></shape>', 16),
        "million": (dict(origin="0, 1, -4", target="0, 0, 0", near=0.01, depth=8, size=512), METAL +
                    '<shape type="ply"><string name="filename" value="blob1m.ply"/><ref id="metal"/></shape>'
                    '<emitter type="envmap"><string name="filename" value="sky.npy"/></emitter>', 16),
    }
    paths = {}
    for name, (head, body, spp) in scenes.items():
        path = os.path.join(folder, name.replace("+", "_") + ".xml")
        with open(path, "w") as f:
            f.write(HEAD % head + body + "\n</scene>\n")
        paths[name] = (path, spp)
    return paths
