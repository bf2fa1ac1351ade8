// cases.c: random scenes for the kind tests.
#include "cases.h"

#include "base/parallel.h"

#include <stdlib.h>

Random case_random(int number) {
    const char *seed = getenv("REYNOLDS_TEST_SEED");
    return (Random){(uint64_t)number + 1000003 * (uint64_t)(seed ? atoi(seed) : 0)};
}

static const double roughness_extremes[] = {1e-3, 0.05, 0.5, 1};

static double metal_value(Random *r) {
    return uniform(r) < 0.3 ? between(r, 0.05, 1) : between(r, 1, 8);
}

// From gases seen from inside of a gem to germanium, or hardly an interface at all; 1 itself is none.
static double index_value(Random *r) {
    double sort = uniform(r), x = uniform(r);
    return sort < 0.15 ? 1 + (x < 0.5 ? -1 : 1) * (0.002 + 0.04 * x) : sort < 0.4 ? 0.22 + 0.73 * x : 1.05 + 3.5 * x * x;
}

static double random_value(Random *r, const ParamDesc *p) {
    bool roughness = p->type == PARAM_ALPHA_U || p->type == PARAM_ALPHA_V ||
                     (p->type == PARAM_REAL && p->low > 0 && p->high <= 1);
    if (strcmp(p->name, "eta") == 0 && p->type == PARAM_REAL) {
        return index_value(r);
    }
    if (roughness) {
        return uniform(r) < 0.5 ? roughness_extremes[below(r, 4)] : exp(between(r, log(1e-3), 0));
    }
    switch (p->type) {
    case PARAM_IOR:
    case PARAM_SMOOTH_IOR:
    case PARAM_SPECULAR: // as eta and as specular alike
        return index_value(r);
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

int case_values(KindCase *c, Random *r, const ParamDesc *p, int n, int owner) {
    int at = c->theta_count;
    c->theta_count += n;
    assert_true(c->theta_count <= CASE_THETA);
    for (int i = at; i < at + n; i++) {
        c->theta[i] = (double)(float)random_value(r, p);
        c->low[i] = (double)p->low;
        c->high[i] = fmax((double)p->high, c->theta[i]); // an index in the place of a specular goes beyond its range
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
        t.theta = case_values(c, r, p, t.width * t.height * t.channels, owner);
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
    c->coat_base[0] = c->theta[c->coat_alpha];
    c->coat_base[1] = c->theta[c->coat_eta];
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
    case_update(c);
}

void case_update(KindCase *c) {
    if (c->bsdfs[c->root].table >= 0) {
        derive_table(c, c->bsdfs + c->root);
    }
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

int case_width_count(void) {
    return rey_widest_lanes() >= 16 ? 3 : rey_widest_lanes() >= 8 ? 2 : 1;
}

double normal_tail(double z) {
    return erfc(fabs(z) / sqrt(2));
}

double sidak(double level, int n) {
    return -expm1(log1p(-level) / n);
}
