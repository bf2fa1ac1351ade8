# Writes principled.json: values and densities of Mitsuba 3's principled and principledthin (scalar_rgb), evaluated here.
# usage: python principled.py > principled.json
import json, random
import mitsuba as mi

mi.set_variant("scalar_rgb")
random.seed(4)
COMMON = ["roughness", "anisotropic", "spec_trans", "spec_tint", "sheen", "sheen_tint", "flatness"]
OWN = {"principled": ["metallic", "clearcoat", "clearcoat_gloss"], "principledthin": ["diff_trans"]}
RATES = {"principled": ["main_specular", "clearcoat", "diffuse_reflectance"],
         "principledthin": ["specular_reflectance", "specular_transmittance", "diffuse_transmittance",
                            "diffuse_reflectance"]}


def number(name):
    u = random.random()
    if name == "roughness":
        return round(random.choice([0.2, 0.5, 1.0, random.uniform(0.15, 1)]), 3)
    high = 2.0 if name == "diff_trans" else 1.0
    return 0.0 if u < 0.2 else high if u < 0.35 else round(high * random.random(), 3)


def values(kind, n):
    v = {"base_color": [round(random.random(), 3) for _ in range(3)] if n != 3 else [0.0, 0.0, 0.0]}
    for name in COMMON + OWN[kind]:
        if n and (n > 3 or random.random() < 0.7):  # the first case has nothing but defaults
            v[name] = number(name)
    if n and kind == "principledthin":
        v["eta"] = round(random.uniform(0.7, 2.2), 3)
    elif n:
        v["eta" if n % 2 else "specular"] = round(random.uniform(0.7, 2.2), 3) if n % 2 else number("specular")
    if n == 5:
        v.pop("eta", None), v.pop("spec_trans", None)
        v["specular"] = 0.0  # no interface: no main lobe without spec_trans ...
        v["metallic"] = 0.5
    if n == 6:
        v["specular"], v["spec_trans"] = 0.0, 0.7  # ... and an index close to 1 with it
    if n % 3 == 2:
        for rate in RATES[kind]:
            v[rate + "_sampling_rate"] = round(random.uniform(0.2, 2), 2)
    if kind == "principledthin":
        v.pop("metallic", None), v.pop("specular", None)
    return v


def direction():
    z = random.uniform(-1, 1)
    d = mi.warp.square_to_uniform_sphere([random.random(), random.random()])
    return mi.Vector3f(d.x, d.y, d.z) if abs(d.z) > 0.02 else direction()


def rows(bsdf):
    out, context = [], mi.BSDFContext()
    for i in range(8):
        si = mi.SurfaceInteraction3f()
        si.wi = direction()
        if i % 4 < 3:
            si.wi.z = abs(si.wi.z)
        if i % 2:
            sample, _ = bsdf.sample(context, si, random.random(), [random.random(), random.random()])
            wo = sample.wo if sample.pdf > 0 else direction()
        else:
            wo = direction()
        f, pdf = bsdf.eval(context, si, wo), bsdf.pdf(context, si, wo)
        out.append([float("%.9g" % x) for x in list(si.wi) + list(wo)] + [float("%.7g" % x) for x in list(f) + [pdf]])
    return out


cases = []
for kind in OWN:
    for n in range(20):
        v = values(kind, n)
        d = {k: {"type": "rgb", "value": x} if k == "base_color" else x for k, x in v.items()}
        cases.append((kind, v, rows(mi.load_dict({"type": kind, **d}))))
print('{"about": "values of Mitsuba %s: rows of wi, wo, f cos_o, density",\n "cases": [' % mi.__version__)
print(",\n".join('  {"kind": "%s", "values": %s,\n   "rows": [\n    %s]}' %
                 (k, json.dumps(v), ",\n    ".join(json.dumps(r) for r in t)) for k, v, t in cases))
print("]}")
