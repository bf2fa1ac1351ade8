// case_lights.c: random lights for the kind tests.
#include "cases.h"

#include "emitter/emitter.h"
#include "emitter/table.h"
#include "emitter/update.h"
#include "math/colour.h"
#include "shape/shape.h"

const char *const light_names[LIGHT_COUNT] = {"rectangle", "sphere", "disk", "cylinder", "point",
                                               "constant", "envmap", "spot", "projector", "directional"};

static const ParamDesc radiance = {PARAM_SPEC, "radiance", 1, 0, INFINITY, "", ""};

// A rotation by a random axis and angle, row-major 3 x 3 [Rodrigues].
static void random_rotation(Random *r, double m[9]) {
    double a[3], angle = between(r, 0, 6);
    random_direction(r, a);
    double s = sin(angle), t = 1 - cos(angle);
    const double k[9] = {0, -a[2], a[1], a[2], 0, -a[0], -a[1], a[0], 0};
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            m[3 * i + j] = (i == j) * (1 - t) + t * a[i] * a[j] + s * k[3 * i + j];
        }
    }
}

static void add_fixed(KindCase *c, const double *values, int n) {
    for (int i = 0; i < n; i++) {
        c->theta[c->theta_count] = (double)(float)values[i];
        c->owner[c->theta_count] = -1;
        c->low[c->theta_count] = -INFINITY;
        c->high[c->theta_count++] = INFINITY;
    }
}

static void make_rectangle(KindCase *c, const double rotation[9], const double scale[2]) {
    static const int32_t triangles[6] = {0, 1, 2, 2, 3, 0};
    static const double uvs[8] = {0, 0, 1, 0, 1, 1, 0, 1};
    CaseShape *s = c->shapes;
    *s = (CaseShape){.kind = SHAPE_MESH, .flags = SHAPE_HAS_UVS, .triangle_count = 2, .positions = c->theta_count,
                     .area_cdf = 0, .area = 4 * scale[0] * scale[1]};
    for (int v = 0; v < 4; v++) {
        double x = (2 * uvs[2 * v] - 1) * scale[0], y = (2 * uvs[2 * v + 1] - 1) * scale[1];
        double p[3];
        for (int k = 0; k < 3; k++) {
            p[k] = rotation[3 * k] * x + rotation[3 * k + 1] * y;
        }
        add_fixed(c, p, 3);
    }
    s->uvs = c->theta_count;
    add_fixed(c, uvs, 8);
    memcpy(c->triangles, triangles, sizeof triangles);
    c->tables[0] = 0.5;
    c->tables[1] = 1;
}

static void make_sphere(KindCase *c, const double rotation[9], double radius) {
    c->shapes[0] = (CaseShape){.kind = SHAPE_SPHERE, .area = 4 * 3.14159265358979323846 * radius * radius};
    c->tables[3] = radius; // at the origin
    memcpy(c->tables + 4, rotation, 9 * sizeof *rotation);
}

static void make_disk(KindCase *c, const double rotation[9], double radius) {
    c->shapes[0] = (CaseShape){.kind = SHAPE_DISK, .area = 3.14159265358979323846 * radius * radius};
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            c->tables[4 * i + j] = rotation[3 * i + j] * radius;
            c->tables[12 + 4 * i + j] = rotation[3 * j + i] / radius;
        }
    }
}

// An elliptic one, so that its points are not uniform over the area.
static void make_cylinder(KindCase *c, const double rotation[9], const double scale[2]) {
    const double s[3] = {0.5 * scale[0], 0.3 * scale[0], 0.5 * scale[1]};
    c->shapes[0] = (CaseShape){.kind = SHAPE_CYLINDER, .area = 1};
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            c->tables[4 * i + j] = rotation[3 * i + j] * s[j];
            c->tables[12 + 4 * i + j] = rotation[3 * j + i] / s[i];
        }
    }
}

// Rows of the inverse of a 4 x 4 pose, without a float's rounding.
static void invert_pose(const double *m, double *inverse) {
    double determinant = 0;
    for (int i = 0; i < 3; i++) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        determinant += m[i] * (m[4 + j] * m[8 + k] - m[4 + k] * m[8 + j]);
        for (int row = 0; row < 3; row++) {
            int a = (row + 1) % 3, b = (row + 2) % 3;
            inverse[4 * i + row] = m[4 * a + j] * m[4 * b + k] - m[4 * a + k] * m[4 * b + j];
        }
    }
    for (int i = 0; i < 3; i++) {
        inverse[4 * i + 3] = 0;
        for (int row = 0; row < 3; row++) {
            inverse[4 * i + row] /= determinant;
            inverse[4 * i + 3] -= inverse[4 * i + row] * m[4 * row + 3];
        }
    }
}

static void update_blackbodies(KindCase *c) {
    for (int i = 0; i < c->texture_count; i++) {
        const TextureNode *t = c->textures + i;
        if (t->kind != TEXTURE_BLACKBODY) {
            continue;
        }
        double *numbers = c->theta + t->theta, temperature = c->theta[c->textures[t->child[0]].theta];
        if (numbers[BLACKBODY_BUILT] != temperature) {
            rey_blackbody_to_rgb(temperature, 0, 1000, numbers, numbers + BLACKBODY_SLOPE);
            numbers[BLACKBODY_BUILT] = temperature;
        }
    }
}

void case_update_light(KindCase *c) {
    const CaseEmitter *e = &c->emitter;
    update_blackbodies(c);
    if (e->table < 0) {
        return;
    }
    float theta[CASE_THETA], tables[CASE_TABLES] = {0};
    for (int i = 0; i < c->theta_count; i++) {
        theta[i] = (float)c->theta[i];
    }
    EmitterRecord record = {.kind = e->kind, .table = e->table};
    memcpy(record.slot, e->slot, sizeof record.slot);
    rey_scene scene = {0};
    scene.view.theta = theta;
    scene.view.tables = tables;
    scene.view.textures = c->textures;
    scene.view.emitters = &record;
    assert_int_equal(rey_emitter_update(&scene, 0), REY_OK);
    for (int i = 0; i < CASE_TABLES; i++) {
        c->tables[i] = (double)tables[i];
    }
    for (int i = 0; i < MAX_EMITTER_SLOTS; i++) {
        if (e->places >> i & 1) {
            invert_pose(c->theta + e->slot[i], c->tables);
        }
    }
    if (e->kind == EMITTER_PROJECTOR) {
        const TextureNode *t = c->textures + e->slot[SLOT(Projector, irradiance)];
        double x_fov = c->theta[c->textures[e->slot[SLOT(Projector, x_fov)]].theta];
        double *extent = c->tables + PROJECTOR_EXTENT;
        extent[0] = tan(x_fov * (3.14159265358979323846 / 360));
        extent[1] = extent[0] * (t->kind == TEXTURE_BITMAP ? (double)t->height / t->width : 1);
    }
}

static int32_t add_pose(KindCase *c, const double rotation[9], const double position[3]) {
    int32_t at = c->theta_count;
    double m[16] = {[15] = 1};
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            m[4 * i + j] = rotation[3 * i + j];
        }
        m[4 * i + 3] = position[i];
    }
    add_fixed(c, m, 16);
    memcpy(c->theta + at, m, sizeof m); // a float's rounding would move directions near an environment's poles
    return at;
}

// A pose of what lies beyond the scene: it turns, scales, shears and sometimes mirrors.
static int32_t add_sky_pose(KindCase *c, Random *r, const double rotation[9]) {
    const double zero[3] = {0}, shear = between(r, -0.4, 0.4), scale[3] = {between(r, 0.4, 2.5), between(r, 0.4, 2.5),
                                                                           uniform(r) < 0.5 ? -1.3 : 0.7};
    double m[9];
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            m[3 * i + j] = (rotation[3 * i + j] + (j == 1 ? shear * rotation[3 * i] : 0)) * scale[j];
        }
    }
    return add_pose(c, m, zero);
}

static int32_t add_image(KindCase *c, Random *r, int owner) {
    // Some rows have several blocks of the distribution, and a part of one.
    bool wide = below(r, 6) == 0;
    int width = wide ? 17 + below(r, 30) : 3 + below(r, 6), height = 2 + below(r, wide ? 2 : 5), id = c->texture_count++;
    c->textures[id] = (TextureNode){.kind = TEXTURE_BITMAP, .width = width, .height = height, .channels = 3,
                                    .filter = FILTER_BILINEAR, .to_uv = -1};
    c->textures[id].theta = case_values(c, r, &radiance, 3 * width * height, owner);
    return id;
}

// A number of a light. Angles are kept inside their ranges, a beam within its cutoff.
static int32_t add_number(KindCase *c, Random *r, const EmitterParam *row, int owner) {
    static const ParamDesc number = {PARAM_REAL, "number", 1, 0, INFINITY, "", ""};
    int id = case_texture(c, r, &number, owner, false), at = c->textures[id].theta;
    if (row->type == EMITTER_PARAM_FRACTION) {
        c->theta[at] = c->theta[at - 1] * between(r, 0.2, 0.9);
    } else if (strcmp(row->unit, "degrees") == 0) {
        c->theta[at] = between(r, 25, 60);
    }
    return id;
}

static int add_blackbody(KindCase *c, Random *r, int owner) {
    static const ParamDesc number = {PARAM_REAL, "temperature", 1, 1100, 1700, "", ""};
    const double numbers[BLACKBODY_NUMBERS] = {0};
    int id = c->texture_count++, child = case_texture(c, r, &number, owner, false);
    c->textures[id] = (TextureNode){.kind = TEXTURE_BLACKBODY, .theta = c->theta_count, .width = 1, .height = 1, .channels = 3,
                                    .to_uv = -1, .child = {child, -1}};
    add_fixed(c, numbers, BLACKBODY_NUMBERS);
    return id;
}

static void add_rows(KindCase *c, Random *r, bool textured, const double rotation[9]) {
    const EmitterKind *kind = rey_emitter_kinds + c->emitter.kind;
    const double position[3] = {0.3, -0.2, 0.5};
    for (int i = 0; i < kind->param_count; i++) {
        const EmitterParam *row = kind->params + i;
        int32_t *slot = &c->emitter.slot[i];
        switch (row->type) {
        case EMITTER_PARAM_SPECTRUM:
        case EMITTER_PARAM_EMISSION:
            *slot = uniform(r) < 0.15 ? add_blackbody(c, r, i) : case_texture(c, r, &radiance, i, textured);
            break;
        case EMITTER_PARAM_COLOUR:
            *slot = case_texture(c, r, &radiance, i, textured);
            break;
        case EMITTER_PARAM_IMAGE:
            *slot = add_image(c, r, i);
            break;
        case EMITTER_PARAM_FOV:
        case EMITTER_PARAM_REAL:
        case EMITTER_PARAM_FRACTION:
            *slot = add_number(c, r, row, i);
            break;
        case EMITTER_PARAM_POSITION:
            *slot = c->theta_count;
            add_fixed(c, position, 3);
            break;
        default:
            *slot = row->type == EMITTER_PARAM_POSE ? add_pose(c, rotation, position) : add_sky_pose(c, r, rotation);
        }
        c->emitter.places |= (row->type >= EMITTER_PARAM_POSITION) << i;
    }
}

// Whether lights like this one come in families.
static bool can_gather(const KindCase *c, int light) {
    bool can = light != LIGHT_CYLINDER && light != LIGHT_CONSTANT && light != LIGHT_ENVMAP;
    const EmitterKind *kind = rey_emitter_kinds + c->emitter.kind;
    for (int i = 0; i < kind->param_count; i++) {
        EmitterParamType type = kind->params[i].type;
        const TextureNode *t = c->textures + c->emitter.slot[i];
        if (type <= EMITTER_PARAM_COLOUR) {
            can &= (t->kind == TEXTURE_CONSTANT && t->channels == 3) || t->kind == TEXTURE_BLACKBODY;
        }
    }
    return can;
}

void case_make_light(KindCase *c, Random *r, int light, bool textured) {
    static const char *const kinds[LIGHT_COUNT] = {"area",     "area",   "area", "area",      "point",
                                                   "constant", "envmap", "spot", "projector", "directional"};
    bool surface = light <= LIGHT_CYLINDER;
    *c = (KindCase){.coat_eta = -1, .coat_alpha = -1, .emitter_count = 1, .shape_count = 1};
    c->emitter = (CaseEmitter){.kind = rey_emitter_kind_find(kinds[light]), .shape = surface ? 0 : -1, .table = -1};
    double rotation[9], scale[2] = {between(r, 0.3, 2), between(r, 0.3, 2)};
    random_rotation(r, rotation);
    add_rows(c, r, textured && (surface || light == LIGHT_SPOT || light == LIGHT_PROJECTOR), rotation);
    if (!surface) {
        const EmitterRecord record = {.slot = {c->emitter.slot[0]}};
        c->emitter.table = rey_emitter_kinds[c->emitter.kind].table_size(c->textures, &record) > 0 ? 0 : -1;
        case_update_light(c);
    } else if (light == LIGHT_RECTANGLE) {
        make_rectangle(c, rotation, scale);
    } else if (light == LIGHT_SPHERE) {
        make_sphere(c, rotation, scale[0]);
    } else if (light == LIGHT_DISK) {
        make_disk(c, rotation, scale[0]);
    } else {
        make_cylinder(c, rotation, scale);
    }
    update_blackbodies(c);
    c->emitter.gathered = can_gather(c, light) && uniform(r) < 0.6;
}
