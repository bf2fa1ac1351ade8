// cases.c: random scenes for the kind tests.
#include "cases.h"

#include "emitter/table.h"
#include "emitter/update.h"
#include "math/colour.h"
#include "shape/update.h"
#include "shape/shape.h"

static const double roughness_extremes[] = {1e-3, 0.05, 0.5, 1};

static double metal_value(Random *r) {
    return uniform(r) < 0.3 ? between(r, 0.05, 1) : between(r, 1, 8);
}

static double random_value(Random *r, const ParamDesc *p) {
    bool roughness = p->type == PARAM_ALPHA_U || p->type == PARAM_ALPHA_V ||
                     (p->type == PARAM_REAL && p->low > 0 && p->high <= 1);
    if (roughness) {
        return uniform(r) < 0.5 ? roughness_extremes[below(r, 4)] : exp(between(r, log(1e-3), 0));
    }
    switch (p->type) {
    case PARAM_IOR:
    case PARAM_SMOOTH_IOR:
        return uniform(r) < 0.3 ? between(r, 0.6, 0.95) : between(r, 1.05, 2.5);
    case PARAM_SPECULAR: // as eta and as specular alike; 1, or 0 as specular, is no interface
        return uniform(r) < 0.3 ? between(r, 0.6, 0.95) : between(r, 1.05, 2.5);
    case PARAM_RATE:
        return between(r, 0.2, 3);
    case PARAM_METAL_ETA:
    case PARAM_METAL_K:
        return metal_value(r);
    case PARAM_NORMAL:
        return uniform(r);
    case PARAM_HEIGHT:
        return between(r, -0.3, 0.3);
    case PARAM_HEIGHT_SCALE:
        return between(r, -2, 2);
    default: {
        double low = (double)p->low, high = isinf(p->high) ? low + 5 : (double)p->high, x = uniform(r);
        return x < 0.15 ? low : x < 0.3 ? high : between(r, low, high);
    }
    }
}

static int add_values(KindCase *c, Random *r, const ParamDesc *p, int n, int owner) {
    int at = c->theta_count;
    c->theta_count += n;
    assert_true(c->theta_count <= CASE_THETA);
    for (int i = at; i < at + n; i++) {
        c->theta[i] = (double)(float)random_value(r, p);
        c->low[i] = (double)p->low;
        c->high[i] = (double)p->high;
        c->owner[i] = owner;
    }
    return at;
}

static int add_to_uv(KindCase *c, Random *r) {
    int at = c->theta_count;
    c->theta_count += 9;
    const double identity[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    for (int i = 0; i < 9; i++) {
        c->theta[at + i] = (double)(float)(identity[i] + (i < 6 ? between(r, -0.4, 0.9) : 0));
        c->low[at + i] = -INFINITY;
        c->high[at + i] = INFINITY;
        c->owner[at + i] = -1;
    }
    return at;
}

int case_texture(KindCase *c, Random *r, const ParamDesc *p, int owner, bool textured) {
    bool colour = p->type == PARAM_SPEC || p->type == PARAM_METAL_ETA || p->type == PARAM_METAL_K ||
                  p->type == PARAM_NORMAL;
    int id = c->texture_count++;
    assert_true(c->texture_count <= CASE_TEXTURES);
    TextureNode t = {.kind = TEXTURE_CONSTANT, .to_uv = -1, .width = 1, .height = 1, .channels = colour ? 3 : 1};
    double sort = textured ? uniform(r) : 1;
    if (textured && uniform(r) < 0.3) {
        t.channels = 4 - t.channels; // colours read as numbers and the other way round
    }
    if (sort < 0.2) {
        t.kind = TEXTURE_CHECKERBOARD;
        t.to_uv = uniform(r) < 0.5 ? add_to_uv(c, r) : -1;
        t.child[0] = case_texture(c, r, p, owner, uniform(r) < 0.5);
        t.child[1] = case_texture(c, r, p, owner, p->type == PARAM_HEIGHT);
        t.channels = 3;
    } else if (sort < 0.85) {
        t.kind = TEXTURE_BITMAP;
        t.width = 1 + below(r, 4);
        t.height = 1 + below(r, 3);
        t.filter = uniform(r) < 0.75 ? FILTER_BILINEAR : FILTER_NEAREST;
        t.wrap = below(r, 3);
        t.to_uv = uniform(r) < 0.5 ? add_to_uv(c, r) : -1;
    }
    if (t.kind != TEXTURE_CHECKERBOARD) {
        t.theta = add_values(c, r, p, t.width * t.height * t.channels, owner);
    }
    c->textures[id] = t;
    return id;
}

int case_variants(int kind) {
    int n = 1;
    for (int i = 0; i < rey_bsdf_kinds[kind].config_count; i++) {
        n *= 2; // every switch has two positions
    }
    return n;
}

// What a kind derives from its parameters, by the library's own update.
static void derive_table(KindCase *c, const BsdfNode *node) {
    float theta[CASE_THETA], tables[CASE_TABLES] = {0};
    for (int i = 0; i < c->theta_count; i++) {
        theta[i] = (float)c->theta[i];
    }
    rey_scene scene = {0};
    scene.view.theta = theta;
    scene.view.tables = tables;
    scene.view.textures = c->textures;
    scene.view.bsdfs = c->bsdfs;
    assert_int_equal(rey_bsdf_update(&scene, (int32_t)(node - c->bsdfs)), REY_OK);
    for (int i = 0; i < CASE_TABLES; i++) {
        c->tables[i] = (double)tables[i];
    }
}

static int add_bsdf(KindCase *c, Random *r, int kind, int variant, bool textured, bool root) {
    const BsdfKind *k = rey_bsdf_kinds + kind;
    int id = c->bsdf_count++;
    BsdfNode *node = c->bsdfs + id;
    *node = (BsdfNode){.kind = kind, .child = {-1, -1}, .table = -1};
    bool derives = rey_bsdf_table_size(kind) > 0;
    for (int i = 0; i < k->param_count; i++) {
        const ParamDesc *p = k->params + i;
        // Numbers behind a derived table and those that steer sampling are constants; of many slots a few are textured.
        bool constant = (derives && p->type != PARAM_SPEC) || p->type == PARAM_RATE ||
                        (k->param_count > 8 && uniform(r) < 0.6);
        int first = c->theta_count;
        node->slot[i] = case_texture(c, r, p, root ? i : -1, textured && !constant);
        if (derives && constant) {
            c->theta[first] = fmax(c->theta[first], p->type == PARAM_REAL ? 0.01 : 0);
            c->coat_eta = p->type == PARAM_IOR ? first : c->coat_eta;
            c->coat_alpha = p->type == PARAM_REAL ? first : c->coat_alpha;
        }
    }
    for (int i = 0; i < k->config_count; i++) {
        node->config[i] = variant >> i & 1;
    }
    if (derives) {
        node->table = 0;
        c->coat_base[0] = c->theta[c->coat_alpha];
        c->coat_base[1] = c->theta[c->coat_eta];
        derive_table(c, node);
    }
    return id;
}

void case_make(KindCase *c, Random *r, int kind, int variant, bool textured) {
    static const char *const nested[] = {"diffuse", "roughconductor", "roughdielectric"};
    static const char *const deltas[] = {"conductor", "dielectric", "thindielectric", "plastic"};
    const BsdfKind *k = rey_bsdf_kinds + kind;
    *c = (KindCase){.coat_eta = -1, .coat_alpha = -1};
    c->root = add_bsdf(c, r, kind, variant, textured, true);
    bool sides = k->most_children > k->fewest_children; // one function per side: each scatters on one side only
    int children = k->fewest_children + below(r, k->most_children - k->fewest_children + 1);
    for (int i = 0; i < children; i++) {
        // Two rough refractions of different indices have no common index, which tests of reciprocity ask for.
        const char *name = nested[below(r, sides || i > 0 ? 2 : 3)];
        if (!sides && uniform(r) < 0.4) {
            name = deltas[below(r, COUNT_OF(deltas))];
        }
        int child = add_bsdf(c, r, rey_bsdf_kind_find(name), below(r, 4), textured, false);
        c->bsdfs[c->root].child[i] = child;
    }
    Random own = {r->state + 1}; // the other kinds keep their cases
    const double surface[6] = {between(&own, 0.5, 2), between(&own, -1, 1), uniform(&own) < 0.2 ? -1 : 1.3,
                               between(&own, -0.5, 0.5), between(&own, -0.5, 0.5), 1};
    memcpy(c->surface, surface, sizeof surface);
}

void case_set(KindCase *c, const char *name, double value) {
    const BsdfKind *k = rey_bsdf_kinds + c->bsdfs[c->root].kind;
    for (int i = 0; i < c->theta_count; i++) {
        if (c->owner[i] >= 0 && strcmp(k->params[c->owner[i]].name, name) == 0) {
            c->theta[i] = value;
        }
    }
}

// ---- lights ------------------------------------------------------------------------------------------------------

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
        if (t->kind == TEXTURE_BLACKBODY) {
            double *numbers = c->theta + t->theta;
            rey_blackbody_to_rgb(c->theta[c->textures[t->child[0]].theta], 0, 1000, numbers, numbers + BLACKBODY_SLOPE);
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

static int32_t add_image(KindCase *c, Random *r, int owner) {
    int width = 3 + below(r, 6), height = 2 + below(r, 5), id = c->texture_count++;
    c->textures[id] = (TextureNode){.kind = TEXTURE_BITMAP, .width = width, .height = height, .channels = 3,
                                    .filter = FILTER_BILINEAR, .to_uv = -1};
    c->textures[id].theta = add_values(c, r, &radiance, 3 * width * height, owner);
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
    const double zero[3] = {0}, position[3] = {0.3, -0.2, 0.5};
    for (int i = 0; i < kind->param_count; i++) {
        const EmitterParam *row = kind->params + i;
        int32_t *slot = &c->emitter.slot[i];
        switch (row->type) {
        case EMITTER_PARAM_EMISSION:
            *slot = uniform(r) < 0.3 ? add_blackbody(c, r, i) : case_texture(c, r, &radiance, i, textured);
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
            *slot = add_number(c, r, row, row->type == EMITTER_PARAM_FOV ? -1 : i);
            break;
        case EMITTER_PARAM_POSITION:
            *slot = c->theta_count;
            add_fixed(c, position, 3);
            break;
        default:
            *slot = add_pose(c, rotation, row->type == EMITTER_PARAM_POSE ? position : zero);
        }
        c->emitter.places |= (row->type >= EMITTER_PARAM_POSITION) << i;
    }
}

// Whether lights like this one come in families.
static bool can_gather(const KindCase *c, int light) {
    bool can = light != LIGHT_CYLINDER && light != LIGHT_CONSTANT && light != LIGHT_ENVMAP;
    for (int i = 0; i < c->texture_count; i++) {
        can &= c->textures[i].kind == TEXTURE_CONSTANT || c->textures[i].kind == TEXTURE_BLACKBODY;
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

// ---- directions and reports --------------------------------------------------------------------------------------

void random_direction(Random *r, double v[3]) {
    double z = between(r, -1, 1), phi = between(r, 0, 6.283185307179586);
    if (uniform(r) < 0.25) {
        z *= 0.05;
    }
    double s = sqrt(1 - z * z);
    v[0] = s * cos(phi);
    v[1] = s * sin(phi);
    v[2] = z;
}

bool case_turns(const KindCase *c) {
    const BsdfKind *k = rey_bsdf_kinds + c->bsdfs[c->root].kind;
    bool turns = false;
    for (int i = 0; i < k->param_count; i++) {
        turns |= k->params[i].type == PARAM_NORMAL || k->params[i].type == PARAM_HEIGHT;
    }
    return turns;
}

void case_print(const KindCase *c, const Query *q) {
    const BsdfNode *node = c->bsdfs + c->root;
    const BsdfKind *k = rey_bsdf_kinds + node->kind;
    print_error("%s", c->bsdf_count ? k->name : "light");
    for (int i = 0; i < MAX_CHILDREN && c->bsdf_count && node->child[i] >= 0; i++) {
        const BsdfNode *child = c->bsdfs + node->child[i];
        print_error(" %s", rey_bsdf_kinds[child->kind].name);
        for (int j = 0; j < rey_bsdf_kinds[child->kind].param_count; j++) {
            const TextureNode *t = c->textures + child->slot[j];
            print_error(" %s=[%d]%g", rey_bsdf_kinds[child->kind].params[j].name, (int)t->kind, c->theta[t->theta]);
        }
    }
    for (int i = 0; c->bsdf_count && i < k->config_count; i++) {
        print_error(" %s=%d", k->configs[i].name, (int)node->config[i]);
    }
    for (int i = 0; c->bsdf_count && i < k->param_count; i++) {
        const TextureNode *t = c->textures + node->slot[i];
        print_error(" %s=[%d]", k->params[i].name, (int)t->kind);
        for (int j = 0; t->kind == TEXTURE_CONSTANT && j < t->channels; j++) {
            print_error("%g ", c->theta[t->theta + j]);
        }
    }
    if (q) {
        print_error(" wi=(%g %g %g) wo=(%g %g %g) uv=(%g %g) lobe=%d", q->wi[0], q->wi[1], q->wi[2], q->wo[0],
                    q->wo[1], q->wo[2], q->uv[0], q->uv[1], (int)q->lobe);
    }
    print_error("\n");
}

// ---- statistics --------------------------------------------------------------------------------------------------

// Regularised upper incomplete gamma function: series below a + 1, Lentz's continued fraction above.
double chi_square_tail(double degrees, double value) {
    double a = degrees / 2, x = value / 2;
    if (x <= 0) {
        return 1;
    }
    double scale = exp(-x + a * log(x) - lgamma(a));
    if (x < a + 1) {
        double term = 1 / a, sum = term;
        for (int n = 1; n < 2000 && term > 1e-16 * sum; n++) {
            term *= x / (a + n);
            sum += term;
        }
        return 1 - sum * scale;
    }
    double b = x + 1 - a, c = 1e300, d = 1 / b, h = d;
    for (int n = 1; n < 2000; n++) {
        double an = -n * (n - a);
        b += 2;
        d = 1 / (an * d + b);
        c = b + an / c;
        h *= c * d;
        if (fabs(c * d - 1) < 1e-14) {
            break;
        }
    }
    return scale * h;
}

double normal_tail(double z) {
    return erfc(fabs(z) / sqrt(2));
}

double sidak(double level, int n) {
    return -expm1(log1p(-level) / n);
}
