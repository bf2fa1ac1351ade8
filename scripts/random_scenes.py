#!/usr/bin/env python3
"""Checks the gradients of scenes that nobody thought of: random shapes, materials, lights, sensors and media, every parameter of
each through `reynolds check --all`. Prints a line per scene and per gradient that is WRONG, and at the end how often what was
refused. A WRONG may be a kink, or noise: look again with more samples, other seeds and steps.

usage: random_scenes.py [--reynolds BINARY] [--first SEED] [--count N] [--spp N] [--media SHARE] [--folder DIR]"""
import argparse
import collections
import json
import math
import os
import random
import re
import struct
import subprocess
import sys


# ---- files that the scenes share -----------------------------------------------------------------------------------

def write_ppm(path, pixels):
    """8 x 8 pixels (r, g, b), 0 to 255."""
    with open(path, "wb") as f:
        f.write(b"P6 8 8 255\n" + bytes(v for pixel in pixels for v in pixel))


def write_vol(path, size, values):
    with open(path, "wb") as f:
        f.write(b"VOL\3" + struct.pack("<5i6f", 1, size, size, size, 1, 0, 0, 0, 1, 1, 1) + struct.pack("<%df" % len(values), *values))


def write_gem(path, rng):
    """A dented ball of 80 triangles."""
    t = (1 + 5 ** 0.5) / 2
    points = [(-1, t, 0), (1, t, 0), (-1, -t, 0), (1, -t, 0), (0, -1, t), (0, 1, t), (0, -1, -t), (0, 1, -t), (t, 0, -1), (t, 0, 1),
              (-t, 0, -1), (-t, 0, 1)]
    coarse = [(0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9), (5, 11, 4), (11, 10, 2), (10, 7, 6), (7, 1, 8),
              (3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8), (3, 8, 9), (4, 9, 5), (2, 4, 11), (6, 2, 10), (8, 6, 7), (9, 8, 1)]
    middles, faces = {}, []

    def middle(a, b):
        key = (min(a, b), max(a, b))
        if key not in middles:
            points.append(tuple(x + y for x, y in zip(points[a], points[b])))
            middles[key] = len(points) - 1
        return middles[key]
    for a, b, c in coarse:
        d, e, f = middle(a, b), middle(b, c), middle(c, a)
        faces += [(a, d, f), (b, e, d), (c, f, e), (d, e, f)]
    with open(path, "w") as f:
        f.write("ply\nformat ascii 1.0\nelement vertex %d\nproperty float x\nproperty float y\nproperty float z\n"
                "element face %d\nproperty list uchar int vertex_indices\nend_header\n" % (len(points), len(faces)))
        for p in points:
            size = rng.uniform(0.9, 1.1) / math.sqrt(sum(x * x for x in p))
            f.write("%f %f %f\n" % tuple(size * x for x in p))
        for face in faces:
            f.write("3 %d %d %d\n" % face)


def write_rope(path, rng):
    phase, turns = rng.uniform(0, 6), rng.uniform(1.5, 3.5)
    with open(path, "w") as f:
        for i in range(7):
            t = i / 6 - 0.5
            f.write("%f %f %f %f\n" % (2 * t, 0.4 * math.sin(phase + turns * t), 0.4 * math.cos(phase + turns * t),
                                       rng.uniform(0.08, 0.16)))


def write_files(folder):
    rng = random.Random(3)
    os.makedirs(folder, exist_ok=True)
    write_ppm(os.path.join(folder, "picture.ppm"), [[rng.randrange(40, 230) for _ in range(3)] for _ in range(64)])
    write_ppm(os.path.join(folder, "normals.ppm"), [[rng.randrange(110, 146), rng.randrange(110, 146), 252] for _ in range(64)])
    with open(os.path.join(folder, "sky.pfm"), "wb") as f:
        f.write(b"PF\n16 8\n-1\n" + struct.pack("<384f", *(rng.uniform(0.2, 1.5) for _ in range(384))))
    write_vol(os.path.join(folder, "smoke.vol"), 6, [rng.random() * (rng.random() > 0.3) for _ in range(216)])
    write_gem(os.path.join(folder, "gem.ply"), rng)
    write_rope(os.path.join(folder, "rope.txt"), rng)


# ---- scenes --------------------------------------------------------------------------------------------------------

def number(name, value):
    return '<float name="%s" value="%.4g"/>' % (name, value)


def bitmap(name, file, more=""):
    return '<texture type="bitmap" name="%s"><string name="filename" value="%s"/>%s</texture>' % (name, file, more)


RAW = '<boolean name="raw" value="true"/>'


class Scene:
    def __init__(self, seed, media):
        self.rng = random.Random(seed)
        self.media = self.rng.random() < media
        self.air = ""  # what names the medium around
        self.count = 0

    def colour(self, low=0.1, high=0.9):
        return ", ".join("%.4g" % self.rng.uniform(low, high) for _ in range(3))

    def rgb(self, name, low=0.1, high=0.9):
        return '<rgb name="%s" value="%s"/>' % (name, self.colour(low, high))

    def id(self, letter):
        self.count += 1
        return "%s%d" % (letter, self.count)

    def texture(self, name):
        kind = self.rng.random()
        if kind < 0.6:
            return self.rgb(name)
        if kind < 0.75:
            return '<texture type="checkerboard" name="%s">%s%s<transform name="to_uv"><scale value="%g"/></transform></texture>' % (
                name, self.rgb("color0"), self.rgb("color1"), self.rng.choice([1, 2, 3.3]))
        return bitmap(name, "picture.ppm", '<string name="filter_type" value="%s"/>' %
                         self.rng.choice(["bilinear", "bilinear", "nearest"]))

    def bsdf(self, nested=False):
        kinds = ["diffuse"] * 5 + ["roughconductor", "conductor", "roughdielectric", "dielectric", "plastic", "roughplastic",
                                   "principled", "thindielectric"]
        kind = self.rng.choice(kinds if nested else kinds + ["blendbsdf", "mask", "twosided", "normalmap", "bumpmap"])
        alpha = number("alpha", self.rng.choice([0.1, 0.2, 0.3, 0.5]))
        inside = {
            "diffuse": lambda: self.texture("reflectance"),
            "roughconductor": lambda: alpha,
            "roughdielectric": lambda: '<string name="distribution" value="ggx"/>' + alpha + number("int_ior", 1.5),
            "dielectric": lambda: number("int_ior", self.rng.choice([1.33, 1.5])),
            "plastic": lambda: self.texture("diffuse_reflectance"),
            "roughplastic": lambda: alpha + self.texture("diffuse_reflectance"),
            "principled": lambda: self.texture("base_color") + number("roughness", self.rng.uniform(0.2, 0.8)) +
            number("metallic", self.rng.random()),
            "blendbsdf": lambda: number("weight", self.rng.random()) + self.bsdf(True) + self.bsdf(True),
            "mask": lambda: (number("opacity", self.rng.uniform(0.3, 0.9)) if self.rng.random() < 0.6
                             else bitmap("opacity", "picture.ppm", RAW)) + self.bsdf(True),
            "twosided": lambda: '<bsdf type="diffuse">%s</bsdf>' % self.texture("reflectance"),
            "normalmap": lambda: bitmap("normalmap", "normals.ppm", RAW) + '<bsdf type="diffuse"/>',
            "bumpmap": lambda: bitmap("bump", "picture.ppm", RAW) + number("scale", 0.1) + '<bsdf type="diffuse"/>',
        }
        return '<bsdf type="%s">%s</bsdf>' % (kind, inside.get(kind, str)())

    def medium(self, attributes, size):
        """size: of the body, whose extinction falls with it."""
        scale = number("scale", self.rng.uniform(0.3, 2) / size)
        more = self.rgb("albedo", 0.3, 0.95) + scale + self.rng.choice(
            ["", "", '<phase type="hg">%s</phase>' % number("g", self.rng.uniform(-0.5, 0.7)), '<phase type="rayleigh"/>'])
        if self.rng.random() < 0.6:
            return '<medium type="homogeneous" %s>%s%s</medium>' % (attributes, self.rgb("sigma_t", 0.4, 1), more)
        return ('<medium type="heterogeneous" %s><volume type="gridvolume" name="sigma_t"><string name="filename" value="smoke.vol"/>'
                '<transform name="to_world"><translate x="-0.5" y="-0.5" z="-0.5"/><scale value="%g"/></transform></volume>%s</medium>'
                % (attributes, 2.4 * size, more))

    def place(self):
        size = self.rng.uniform(0.3, 0.8)
        factors = [size] * 3 if self.rng.random() < 0.7 else [size * self.rng.uniform(0.5, 1.3) for _ in range(3)]
        axis = [self.rng.uniform(-1, 1) for _ in range(3)]
        at = [self.rng.uniform(-1.2, 1.2), self.rng.uniform(-1.2, 1.2), self.rng.uniform(0.2, 1.6)]
        return ('<transform name="to_world"><scale x="%.4g" y="%.4g" z="%.4g"/><rotate x="%.4g" y="%.4g" z="%.4g" angle="%.4g"/>'
                '<translate x="%.4g" y="%.4g" z="%.4g"/></transform>' % (*factors, *axis, self.rng.uniform(0, 360), *at))

    def shape(self):
        name = self.id("s")
        kind = self.rng.choice(["rectangle", "cube", "cube", "sphere", "sphere", "disk", "cylinder", "facets", "gem", "rope", "instance"])
        inside = self.bsdf()
        if self.media and kind in ("cube", "sphere", "facets", "gem") and self.rng.random() < 0.4:
            border = self.rng.choice(["null", "null", "dielectric", "roughdielectric"])
            inside = '<bsdf type="%s"/>' % border + self.medium('name="interior"', 1) + self.air.replace("NAME", "exterior")
        if kind == "instance":
            what = self.rng.choice(["cube", "sphere", "rectangle", "cylinder"])
            return ('<shape type="shapegroup" id="group_%s"><shape type="%s">%s</shape></shape>\n<shape type="instance" id="%s">'
                    '<ref id="group_%s"/>%s</shape>' % (name, what, inside, name, name, self.place()))
        files = {"facets": ("ply", "gem.ply", '<boolean name="face_normals" value="true"/>'), "gem": ("ply", "gem.ply", ""),
                 "rope": ("bsplinecurve", "rope.txt", "")}
        plugin, file, more = files.get(kind, (kind, "", ""))
        more = '<string name="filename" value="%s"/>' % file + more if file else ""
        return '<shape type="%s" id="%s">%s%s%s</shape>' % (plugin, name, more, self.place(), inside)

    def light(self, sky):
        name = self.id("l")
        kind = self.rng.choice(["area"] * 8 + ["point", "spot", "directional"] * 2 + ["projector"] + ["constant", "envmap"] * (2 * sky))
        at = [self.rng.uniform(-1.5, 1.5), self.rng.uniform(-1.5, 1.5), self.rng.uniform(2.2, 3.5)]
        look = '<lookat origin="%.4g, %.4g, %.4g" target="%.3g, %.3g, 0" up="0, 1, 0.1"/>' % (
            *at, self.rng.uniform(-0.3, 0.3), self.rng.uniform(-0.3, 0.3))
        if kind == "area":
            radiance = self.rgb("radiance", 3, 9) if self.rng.random() < 0.8 else bitmap("radiance", "picture.ppm")
            return '<shape type="%s" id="%s"><transform name="to_world"><scale value="%.4g"/>%s</transform><emitter type="area">%s' \
                   '</emitter></shape>' % (self.rng.choice(["rectangle", "disk", "sphere", "cylinder", "cube"]), name,
                                           self.rng.uniform(0.2, 0.6), look, radiance)
        pose = '<transform name="to_world">%s</transform>' % look
        inside = {
            "point": lambda: '<point name="position" x="%.4g" y="%.4g" z="%.4g"/>' % tuple(at) + self.rgb("intensity", 8, 15),
            "spot": lambda: pose + self.rgb("intensity", 10, 20) + number("cutoff_angle", self.rng.uniform(15, 40)),
            "directional": lambda: '<vector name="direction" x="%.4g" y="%.4g" z="-1"/>' % (
                self.rng.uniform(-1, 1), self.rng.uniform(-1, 1)) + self.rgb("irradiance", 1, 3),
            "constant": lambda: self.rgb("radiance", 0.3, 1),
            "envmap": lambda: '<string name="filename" value="sky.pfm"/>',
            "projector": lambda: pose + bitmap("irradiance", "picture.ppm") + number("scale", 20) +
            number("fov", self.rng.uniform(20, 50)),
        }
        return '<emitter type="%s" id="%s">%s</emitter>' % (kind, name, inside[kind]())

    def sensor(self):
        kind = self.rng.choice(["perspective"] * 4 + ["thinlens", "orthographic"])
        more = {"thinlens": number("aperture_radius", 0.1) + number("focus_distance", 5), "orthographic": ""}.get(kind, "")
        more += number("fov", self.rng.uniform(25, 50)) if kind != "orthographic" else ""
        return ('<sensor type="%s" id="camera">%s<transform name="to_world">%s<lookat origin="%.4g, -4.5, %.4g" target="0, 0, 0.6" '
                'up="0, 0, 1"/></transform><film type="hdrfilm"><integer name="width" value="16"/><integer name="height" value="16"/>'
                '<rfilter type="%s"/></film>%s</sensor>' % (
                    kind, more, '<scale value="2"/>' if kind == "orthographic" else "", self.rng.uniform(-3, 3), self.rng.uniform(1, 4),
                    self.rng.choice(["box", "tent", "gaussian", "gaussian", "mitchell"]), self.air.replace("NAME", "medium")))

    def text(self):
        lines = ['<integrator type="%s"><integer name="max_depth" value="%d"/></integrator>' % (
            "volpath" if self.media else "path", self.rng.choice([2, 3, 4, 6]))]
        if self.media and self.rng.random() < 0.35:
            self.air = '<ref id="air" name="NAME"/>'
            lines += [self.medium('id="air"', 6), '<shape type="cube" id="room"><transform name="to_world"><scale value="7"/></transform>'
                      '<bsdf type="null"/><ref id="air" name="interior"/></shape>']
        lines.append(self.sensor())
        if self.rng.random() < 0.85:
            lines.append('<shape type="rectangle" id="floor"><transform name="to_world"><scale value="3"/></transform>%s</shape>' %
                         self.bsdf())
        lines += [self.shape() for _ in range(self.rng.choice([1, 2, 2, 3]))]
        lines += [self.light(i == 0) for i in range(self.rng.choice([1, 1, 2]))]
        return '<scene version="3.0.0">\n%s\n</scene>\n' % "\n".join(lines)


# ---- checks --------------------------------------------------------------------------------------------------------

def check(options, seed, refusals):
    """Whether nothing was found."""
    path = os.path.join(options.folder, "%d.xml" % seed)
    with open(path, "w") as f:
        f.write(Scene(seed, options.media).text())
    done = subprocess.run([options.reynolds, "check", path, "--all", "--spp", str(options.spp), "--json"], capture_output=True, text=True)
    try:
        rows = json.loads(done.stdout)["directions"]
    except (ValueError, KeyError):
        print("%s: exit status %d, %s" % (path, done.returncode, done.stderr.strip()), flush=True)
        return False
    verdicts = collections.Counter(row["verdict"] for row in rows)
    print("%s: %s" % (path, ", ".join("%d %s" % (n, v) for v, n in verdicts.most_common())), flush=True)
    for row in rows:
        if row["verdict"] == "refused":
            refusals[re.sub(r"'[^' ]*'|\b[sl]\d+\.\S*|\b(camera|floor|room)\.\S*", "...", row["why"])] += 1
        elif row["verdict"] == "WRONG":
            print("    WRONG %s: derivative %g, difference %g +- %g, worst z %.1f, sum z %.1f" % (
                row["param"], row["derivative"], row["difference"], row["standard_error"], row["worst_z"], row["sum_z"]), flush=True)
    return verdicts["WRONG"] == 0


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--reynolds", default="build/bin/reynolds")
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--spp", type=int, default=128)
    parser.add_argument("--media", type=float, default=0.3, help="share of the scenes with participating media")
    parser.add_argument("--folder", default="build/random_scenes")
    options = parser.parse_args()
    write_files(options.folder)
    refusals = collections.Counter()
    good = sum(check(options, seed, refusals) for seed in range(options.first, options.first + options.count))
    for why, n in refusals.most_common():
        print("%4d refused: %s" % (n, why))
    print("%d of %d scenes without a finding" % (good, options.count))
    sys.exit(0 if good == options.count else 1)


main()
