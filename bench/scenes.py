"""The benchmark scenes: Cornell box, the same by light tracing, box with a 70,000-triangle rough-metal mesh, a million triangles
under a sky, 16 principled spheres under a sky, a forest of 100,000 instances, a cloud of 64^3 cells, the box with fog in
it, and the matpreview scene of the conformance folder."""
import collections
import importlib.util
import math
import os
import random
import struct

HERE = os.path.dirname(os.path.abspath(__file__))
spec = importlib.util.spec_from_file_location("assets", os.path.join(HERE, "../examples/cornell/make_assets.py"))
assets = importlib.util.module_from_spec(spec)
spec.loader.exec_module(assets)

HEAD = """<scene version="3.0.0">
<integrator type="%(integrator)s"><integer name="max_depth" value="%(depth)d"/>\
<integer name="rr_depth" value="%(rr_depth)d"/></integrator>
<sensor type="perspective"><float name="fov" value="39.3"/><float name="near_clip" value="%(near)g"/>\
<float name="far_clip" value="5000"/>
<transform name="to_world"><lookat origin="%(origin)s" target="%(target)s" up="%(up)s"/></transform>
<sampler type="independent"><integer name="sample_count" value="16"/></sampler>
<film type="hdrfilm"><integer name="width" value="%(size)d"/><integer name="height" value="%(size)d"/>\
<rfilter type="box"/></film></sensor>
"""
WALLS = """<bsdf type="diffuse" id="white"><rgb name="reflectance" value="0.725 0.71 0.68"/></bsdf>
<bsdf type="diffuse" id="red"><rgb name="reflectance" value="0.63 0.065 0.05"/></bsdf>
<bsdf type="diffuse" id="green"><rgb name="reflectance" value="0.14 0.45 0.091"/></bsdf>
""" + "".join('<shape type="obj"><string name="filename" value="%s.obj"/><ref id="%s"/></shape>\n' % w for w in (
    ("floor", "white"), ("ceiling", "white"), ("back", "white"), ("left", "red"), ("right", "green"))) + """
<shape type="obj"><string name="filename" value="light.obj"/><bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf>
<emitter type="area"><rgb name="radiance" value="18 15 9"/></emitter></shape>
"""
SKY = '<emitter type="envmap"><string name="filename" value="sky.exr"/></emitter>'
# The sky above scenes whose ground is z = 0.
SKY_Z = ('<emitter type="envmap"><string name="filename" value="sky.exr"/>'
         '<transform name="to_world"><rotate x="1" angle="90"/></transform></emitter>')
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


def write_tree(path):
    """A conifer of 240 triangles: six cones of 20 sides."""
    sides, cones = 20, 6
    with open(path, "w") as f:
        for c in range(cones):
            base, radius = 0.15 * c, 0.35 * (1 - c / (cones + 1))
            f.write("v 0 0 %g\n" % (base + 0.3))
            for i in range(sides):
                phi = 2 * math.pi * i / sides
                f.write("v %g %g %g\n" % (radius * math.cos(phi), radius * math.sin(phi), base))
        for c in range(cones):
            first = c * (sides + 1) + 1
            for i in range(sides):
                f.write("f %d %d %d\n" % (first, first + 1 + i, first + 1 + (i + 1) % sides))
                f.write("f %d %d %d\n" % (first, first + 1 + (i + 1) % sides, first + 1 + i))


def spheres():
    """A 4 x 4 board of spheres; every parameter of `principled` varies over it."""
    text = ['<shape type="rectangle"><transform name="to_world"><scale value="12"/></transform>'
            '<bsdf type="diffuse"><rgb name="reflectance" value="0.4"/></bsdf></shape>']
    rng = random.Random(5)
    for i in range(16):
        row, column = divmod(i, 4)
        numbers = {"roughness": 0.1 + 0.2 * row, "metallic": column / 3, "specular": 0.5, "clearcoat": rng.random(),
                   "clearcoat_gloss": rng.random(), "sheen": rng.random(), "anisotropic": 0.8 * rng.random(),
                   "spec_tint": rng.random()}
        text.append('<shape type="sphere" id="ball%d"><point name="center" x="%g" y="%g" z="1"/><float name="radius" value="0.9"/>'
                    '<bsdf type="principled"><rgb name="base_color" value="%g, %g, %g"/>%s</bsdf></shape>' % (
                        i, 2 * column - 3, 2 * row - 3, rng.random(), rng.random(), rng.random(),
                        "".join('<float name="%s" value="%g"/>' % x for x in numbers.items())))
    return "\n".join(text) + SKY_Z


def forest(count=100000):
    rng = random.Random(7)
    side = math.sqrt(count)
    text = ['<shape type="rectangle"><transform name="to_world"><scale value="%g"/></transform>'
            '<bsdf type="diffuse"><rgb name="reflectance" value="0.3, 0.25, 0.2"/></bsdf></shape>' % side,
            '<shape type="shapegroup" id="tree"><shape type="obj"><string name="filename" value="tree.obj"/>'
            '<boolean name="face_normals" value="true"/><bsdf type="diffuse" id="leaf">'
            '<rgb name="reflectance" value="0.15, 0.4, 0.1"/></bsdf></shape></shape>']
    for _ in range(count):
        text.append('<shape type="instance"><ref id="tree"/><transform name="to_world"><rotate z="1" angle="%.1f"/>'
                    '<scale value="%.3f"/><translate x="%.3f" y="%.3f"/></transform></shape>' % (
                        360 * rng.random(), 0.6 + 0.8 * rng.random(), side * (rng.random() - 0.5), side * (rng.random() - 0.5)))
    return "\n".join(text) + SKY_Z


def write_cloud(path, n=64):
    """A VOL file of densities in [0, 1]: a ball of waves, empty towards the corners."""
    values = []
    for k in range(n):
        for j in range(n):
            for i in range(n):
                x, y, z = (2 * (v + 0.5) / n - 1 for v in (i, j, k))
                waves = math.sin(5 * x + 3 * y) * math.sin(4 * y - 5 * z) + 0.6 * math.sin(11 * z + 7 * x) * math.sin(9 * y)
                values.append(min(1, max(0, 1.1 - 1.4 * (x * x + y * y + z * z) + 0.35 * waves)))
    with open(path, "wb") as f:
        f.write(struct.pack("<3sB5i6f", b"VOL", 3, 1, n, n, n, 1, 0, 0, 0, 1, 1, 1))
        f.write(struct.pack("<%df" % len(values), *values))


CLOUD = """<shape type="cube" id="air"><bsdf type="null"/><medium name="interior" type="heterogeneous" id="cloud">
<volume name="sigma_t" type="gridvolume"><string name="filename" value="cloud.vol"/>
<transform name="to_world"><scale value="2"/><translate value="-1"/></transform></volume>
<rgb name="albedo" value="0.97 0.98 0.99"/><float name="scale" value="20"/><phase type="hg">\
<float name="g" value="0.5"/></phase></medium></shape>
<emitter type="constant"><rgb name="radiance" value="0.4 0.5 0.7"/></emitter>
<emitter type="directional"><vector name="direction" value="0.3 -1 0.5"/><rgb name="irradiance" value="3 2.8 2.5"/></emitter>
"""
# Between the walls, under the lamp.
FOG = """<shape type="cube" id="air"><transform name="to_world"><scale x="270" y="270" z="274"/>\
<translate x="277" y="273" z="279"/></transform>
<bsdf type="null"/><medium name="interior" type="homogeneous" id="fog"><rgb name="sigma_t" value="0.003"/>\
<rgb name="albedo" value="0.9"/></medium></shape>
"""

# path and definitions of a scene, what its derivatives are taken with respect to, its depths, and its width and height.
Scene = collections.namedtuple("Scene", "path defines parameters depth rr_depth size", defaults=(8, 5, 512))


def conformance():
    here = os.environ.get("REYNOLDS_CONFORMANCE_DIR", os.path.join(HERE, "../../shared/conformance"))
    path = os.path.join(here, "data/scenes/matpreview/matpreview.xml")
    return {"matpreview": Scene(path, {"max_depth": "8", "width": "512", "height": "512"},
                                ["bsdf-matpreview.diffuse_reflectance.value"])} if os.path.exists(path) else {}


def make(folder):
    """Writes the scenes; returns {name: Scene}."""
    os.makedirs(folder, exist_ok=True)
    for name, quad in assets.QUADS.items():
        assets.write_obj(os.path.join(folder, name + ".obj"), [quad])
    assets.write_obj(os.path.join(folder, "block.obj"), assets.SHORT_BLOCK)
    write_blob(os.path.join(folder, "blob70k.ply"), 186, 188, (300, 170, 280), 140)
    if not os.path.exists(os.path.join(folder, "blob1m.ply")):
        write_blob(os.path.join(folder, "blob1m.ply"), 700, 714, (0, 0, 0), 1)
    write_tree(os.path.join(folder, "tree.obj"))
    write_cloud(os.path.join(folder, "cloud.vol"))
    assets.write_exr(os.path.join(folder, "sky.exr"), 256, 512, assets.environment(random.Random(3)))
    box = {"origin": "278, 273, -800", "target": "278, 273, 0", "up": "0, 1, 0", "near": 10, "depth": 8, "rr_depth": 5,
           "size": 512, "integrator": "path"}
    air = dict(box, integrator="volpath", size=256, depth=64, rr_depth=64)
    board = dict(box, origin="0, -13, 9", target="0, 0, 0.3", up="0, 0, 1", near=0.01)
    cornell = (WALLS + '<shape type="obj"><string name="filename" value="block.obj"/><boolean name="face_normals" value="true"/>'
               '<ref id="white"/></shape>')
    walls = [c + ".reflectance.value" for c in ("white", "red", "green")]
    scenes = {
        "cornell": (box, cornell, walls),
        "particles": (dict(box, integrator="ptracer"), cornell, walls),
        "box+70k": (box, WALLS + METAL + '<shape type="ply"><string name="filename" value="blob70k.ply"/>'
                    '<ref id="metal"/></shape>', ["metal.alpha.value"]),
        "million": (dict(box, origin="0, 1, -4", target="0, 0, 0", near=0.01), METAL + '<shape type="ply">'
                    '<string name="filename" value="blob1m.ply"/><ref id="metal"/></shape>' + SKY, ["metal.alpha.value"]),
        "spheres": (board, spheres(), ["ball%d.bsdf.roughness.value" % i for i in range(16)]),
        "forest": (dict(board, origin="0, -60, 12", target="0, 0, 0"), forest(), ["leaf.reflectance.value"]),
        "cloud": (dict(air, origin="0, 1, -4.5", target="0, 0, 0", near=0.01), CLOUD, ["air.interior_medium.sigma_t.data"]),
        "fog": (dict(air, depth=16), cornell + FOG, ["air.interior_medium.sigma_t.value.value"]),
    }
    made = {}
    for name, (head, body, parameters) in scenes.items():
        path = os.path.join(folder, name.replace("+", "_") + ".xml")
        with open(path, "w") as f:
            f.write(HEAD % head + body + "\n</scene>\n")
        made[name] = Scene(path, {}, parameters, head["depth"], head["rr_depth"], head["size"])
    made.update(conformance())
    return made
