// Phase functions from their table: chi-square of sampling against density, normalisation, adjoints against differences in
// double, forward against reverse mode, widths; and values that are known.
#include "medium/table.h"
#include "phase_kernels.h"
#include "sphere.h"

#include <stdlib.h>

enum { CASES = 6, SAMPLES = 20000, QUERIES = 37 };

static const PhaseKernels *const exact = &phase_kernels_double;

// ---- cases -------------------------------------------------------------------------------------------------------

// A parameter with n numbers of its range; a number may be a picture of 2 x 2.
static int add_texture(PhaseCase *c, Random *r, const PhaseParam *p, int n) {
    TextureNode *t = c->textures + c->texture_count;
    bool picture = p->type == PHASE_PARAM_NUMBER && n > 1;
    *t = (TextureNode){.kind = picture ? TEXTURE_BITMAP : TEXTURE_CONSTANT, .theta = c->theta_count,
                       .width = picture ? 2 : n, .height = picture ? 2 : 1, .channels = 1, .filter = FILTER_BILINEAR,
                       .to_uv = -1, .child = {-1, -1}};
    for (int i = 0; i < n; i++) {
        double low = isfinite(p->low) ? (double)p->low : -1, high = isfinite(p->high) ? (double)p->high : 3;
        double edge = uniform(r), share = edge < 0.1 ? 1e-3 : edge > 0.9 ? 1 - 1e-3 : uniform(r);
        c->theta[c->theta_count++] = low + share * (high - low);
    }
    return c->texture_count++;
}

// The numbers of a texture in each voxel of a grid of 2 x 2 x 2, of which the first is there.
static void spread(PhaseCase *c, Random *r, int id, int channels) {
    TextureNode *t = c->textures + id;
    t->kind = TEXTURE_VOLUME;
    t->volume = id;
    t->width = t->height = 1;
    c->volumes[id] = (VolumeNode){.kind = VOLUME_GRID, .theta = t->theta, .channels = channels, .nx = 2, .ny = 2, .nz = 2,
                                  .filter = FILTER_BILINEAR, .wrap = WRAP_CLAMP, .table = -1, .to_world = -1, .texture = id};
    for (int voxel = 1; voxel < 8; voxel++) {
        double factor = between(r, 0.5, 1);
        for (int i = 0; i < channels; i++) {
            c->theta[t->theta + voxel * channels + i] = factor * c->theta[t->theta + i];
        }
    }
    c->theta_count = t->theta + 8 * channels;
}

// S = A A' + a little, for a random A.
static void positive_definite(Random *r, double *s) {
    static const int rows[6][2] = {{0, 0}, {1, 1}, {2, 2}, {0, 1}, {0, 2}, {1, 2}};
    double a[3][3];
    for (int i = 0; i < 9; i++) {
        a[i / 3][i % 3] = between(r, -1, 1);
    }
    for (int i = 0; i < 6; i++) {
        s[i] = i < 3 ? 0.05 : 0;
        for (int k = 0; k < 3; k++) {
            s[i] += a[rows[i][0]][k] * a[rows[i][1]][k];
        }
    }
}

static int add_node(PhaseCase *c, Random *r, int kind);

static int add_leaf(PhaseCase *c, Random *r) {
    int kind;
    do {
        kind = below(r, rey_phase_kind_count);
    } while (rey_phase_kinds[kind].children != 0);
    return add_node(c, r, kind);
}

static int add_node(PhaseCase *c, Random *r, int kind) {
    const PhaseKind *k = rey_phase_kinds + kind;
    int id = c->node_count++, rest = 0;
    PhaseNode node = {.kind = kind, .slot = {-1}, .child = {-1, -1}, .table = -1};
    for (int i = 0; i < k->param_count; i++) {
        static const int most[] = {1, 7, 6};
        PhaseParamType type = k->params[i].type;
        int n = type == PHASE_PARAM_TABLE ? 2 + below(r, 6) : type == PHASE_PARAM_WEIGHTS ? 1 + below(r, 3) : most[type];
        n = k->children > 0 && uniform(r) < 0.5 ? 4 : n;
        rest = type == PHASE_PARAM_WEIGHTS ? n : rest;
        node.slot[i] = add_texture(c, r, k->params + i, n);
        if (k->params[i].type == PHASE_PARAM_MATRIX) {
            positive_definite(r, c->theta + c->textures[node.slot[i]].theta);
        }
        if ((type == PHASE_PARAM_MATRIX || (type == PHASE_PARAM_NUMBER && n == 1)) && uniform(r) < 0.4) {
            spread(c, r, node.slot[i], type == PHASE_PARAM_MATRIX ? 6 : 1);
        }
    }
    for (int i = 0; i < k->children; i++) {
        node.child[i] = add_leaf(c, r);
    }
    for (int at = id; rest > 0; rest--) { // a list: one node after the other, each with one function
        node.child[0] = add_leaf(c, r);
        node.child[1] = rest > 1 ? c->node_count++ : -1;
        c->nodes[at] = node;
        at = node.child[1];
    }
    if (k->children != ANY_NUMBER) {
        c->nodes[id] = node;
    }
    return id;
}

// Brings derived tables up to date, through the library's own floats.
static void update_tables(PhaseCase *c) {
    float theta[PHASE_THETA], tables[PHASE_THETA] = {0};
    for (int i = 0; i < PHASE_THETA; i++) {
        theta[i] = (float)c->theta[i];
    }
    SceneView view = {.theta = theta, .tables = tables, .textures = c->textures};
    int at = 0;
    for (int i = 0; i < c->node_count; i++) {
        int size = rey_phase_table_size(c->textures, c->nodes + i);
        c->nodes[i].table = size ? at : -1;
        rey_phase_update(&view, c->nodes + i);
        at += size;
    }
    for (int i = 0; i < PHASE_THETA; i++) {
        c->tables[i] = (double)tables[i];
    }
}

static void phase_case(PhaseCase *c, Random *r, int kind) {
    *c = (PhaseCase){.floor = uniform(r) < 0.5 ? 0 : 0.05};
    c->root = add_node(c, r, kind);
    update_tables(c);
}

static void unit(Random *r, double v[3]) {
    double z = between(r, -1, 1), phi = between(r, 0, 6.283185307179586), s = sqrt(1 - z * z);
    v[0] = s * cos(phi);
    v[1] = s * sin(phi);
    v[2] = z;
}

static void random_query(Random *r, PhaseQuery *q) {
    unit(r, q->wi);
    unit(r, q->wo);
    q->uv[0] = uniform(r);
    q->uv[1] = uniform(r);
}

// ---- sampling ----------------------------------------------------------------------------------------------------

typedef struct Fixed {
    const PhaseCase *c;
    double wi[3], uv[2];
} Fixed;

static void density(void *user, int n, double (*d)[3], double *pdf) {
    const Fixed *x = user;
    PhaseQuery q[POINTS];
    for (int i = 0; i < n; i++) {
        q[i] = (PhaseQuery){.uv = {x->uv[0], x->uv[1]}};
        memcpy(q[i].wi, x->wi, sizeof q[i].wi);
        memcpy(q[i].wo, d[i], sizeof q[i].wo);
    }
    exact->eval(x->c, n, q);
    for (int i = 0; i < n; i++) {
        pdf[i] = q[i].pdf;
    }
}

static void test_sampling(void **state) {
    (void)state;
    static PhaseDraw draw[SAMPLES];
    static PhaseQuery query[SAMPLES];
    Random r = {11};
    const double level = sidak(0.01, rey_phase_kind_count * CASES);
    for (int k = 0; k < rey_phase_kind_count * CASES; k++) {
        PhaseCase c;
        Fixed x = {.c = &c, .uv = {uniform(&r), uniform(&r)}};
        phase_case(&c, &r, k / CASES);
        unit(&r, x.wi);
        for (int i = 0; i < SAMPLES; i++) {
            draw[i] = (PhaseDraw){.uv = {x.uv[0], x.uv[1]}, .u1 = uniform(&r), .u2 = {uniform(&r), uniform(&r)}};
            memcpy(draw[i].wi, x.wi, sizeof x.wi);
        }
        exact->sample(&c, SAMPLES, draw);
        int best = 0;
        double weight = 0;
        for (int i = 0; i < SAMPLES; i++) {
            query[i] = (PhaseQuery){.uv = {x.uv[0], x.uv[1]}};
            memcpy(query[i].wi, x.wi, sizeof x.wi);
            memcpy(query[i].wo, draw[i].wo, sizeof x.wi);
        }
        exact->eval(&c, SAMPLES, query);
        for (int i = 0; i < SAMPLES; i++) {
            best = query[i].pdf > query[best].pdf ? i : best;
            weight += query[i].f / query[i].pdf / SAMPLES;
            assert_true(query[i].pdf > 0 && isfinite(query[i].pdf));
        }
        double p[CELLS], sum = 0;
        int counts[CELLS] = {0};
        SphereGrid g = grid_make(query[best].wo, fmin(0.5, 0.3 / sqrt(3.14 * fmax(query[best].pdf, 1))), 0, density, &x);
        for (int i = 0; i < SAMPLES; i++) {
            counts[grid_cell(&g, query[i].wo)]++;
        }
        grid_probabilities(&g, counts, SAMPLES, p);
        for (int i = 0; i < CELLS; i++) {
            sum += p[i];
        }
        double chance = chi_square_test(CELLS, p, counts, SAMPLES);
        if (!(chance > level) || fabs(sum - 1) > 2e-3 || fabs(weight - 1) > 0.03) {
            fail_msg("%s: chance %g, integral %g, mean weight %g", rey_phase_kinds[k / CASES].name, chance, sum, weight);
        }
    }
}

// ---- adjoints ----------------------------------------------------------------------------------------------------

static double value_at(const PhaseCase *c, const PhaseQuery *q) {
    PhaseQuery one = *q;
    exact->eval(c, 1, &one);
    return one.f;
}

static void near(const char *name, const char *what, double got, double expected, double scale) {
    if (!(fabs(got - expected) <= 2e-5 * (fabs(expected) + scale) + 1e-9)) {
        fail_msg("%s: derivative by %s is %.10g, the difference %.10g", name, what, got, expected);
    }
}

// By a direction that stays a unit vector.
static double turned(const PhaseCase *c, const PhaseQuery *q, bool light, const double *axis, double h) {
    double f[2];
    for (int k = 0; k < 2; k++) {
        PhaseQuery moved = *q;
        double *v = light ? moved.wo : moved.wi, length = 0;
        for (int i = 0; i < 3; i++) {
            v[i] += (k ? -h : h) * axis[i];
            length += v[i] * v[i];
        }
        for (int i = 0; i < 3; i++) {
            v[i] /= sqrt(length);
        }
        f[k] = value_at(c, &moved);
    }
    return (f[0] - f[1]) / (2 * h);
}

static void check_directions(const char *name, const PhaseCase *c, const PhaseQuery *q, const PhaseAdjoint *a, double df,
                             double f) {
    for (int light = 0; light < 2; light++) {
        const double *v = light ? q->wo : q->wi, *d = light ? a->dwo : a->dwi;
        double axis[3] = {v[1], -v[0], 0};
        double along = d[0] * axis[0] + d[1] * axis[1];
        near(name, light ? "wo" : "wi", along / df, turned(c, q, light, axis, 1e-6), f);
        double other[3] = {v[2] * v[0], v[2] * v[1], -(v[0] * v[0] + v[1] * v[1])};
        near(name, light ? "wo" : "wi", (d[0] * other[0] + d[1] * other[1] + d[2] * other[2]) / df,
             turned(c, q, light, other, 1e-6), f);
    }
}

static void test_adjoint(void **state) {
    (void)state;
    Random r = {12};
    for (int kind = 0; kind < rey_phase_kind_count; kind++) {
        const char *name = rey_phase_kinds[kind].name;
        double largest = 0;
        for (int k = 0; k < 4 * CASES; k++) {
            PhaseCase c;
            PhaseQuery q;
            phase_case(&c, &r, kind);
            random_query(&r, &q);
            const double df = between(&r, 0.5, 2);
            double gradient[PHASE_THETA] = {0}, tangent[PHASE_THETA] = {0}, along = 0, f = value_at(&c, &q);
            PhaseAdjoint a = {.df = df};
            exact->adj(&c, 1, &q, &a, gradient, NULL);
            check_directions(name, &c, &q, &a, df, f);
            for (int i = 0; i < c.theta_count; i++) {
                const double h = 1e-5;
                double x = c.theta[i], values[2];
                for (int side = 0; side < 2; side++) {
                    c.theta[i] = x + (side ? -h : h);
                    values[side] = value_at(&c, &q);
                }
                c.theta[i] = x;
                near(name, "a parameter", gradient[i] / df, (values[0] - values[1]) / (2 * h), f);
                tangent[i] = between(&r, -1, 1);
                along += tangent[i] * gradient[i];
                largest = fmax(largest, fabs(gradient[i]));
            }
            a = (PhaseAdjoint){.df = df};
            exact->adj(&c, 1, &q, &a, NULL, tangent);
            assert_true(fabs(a.forward - along) <= 1e-12 * (1 + fabs(along)));
        }
        assert_true(largest > 0 || rey_phase_kinds[kind].param_count == 0);
    }
}

// ---- widths ------------------------------------------------------------------------------------------------------

static void test_widths(void **state) {
    (void)state;
    static const PhaseKernels *const wide[] = {&phase_kernels_w1, &phase_kernels_w8, &phase_kernels_w16};
    Random r = {13};
    for (int k = 0; k < rey_phase_kind_count * CASES; k++) {
        PhaseCase c;
        PhaseQuery q[3][QUERIES];
        PhaseDraw d[3][QUERIES];
        phase_case(&c, &r, k / CASES);
        for (int i = 0; i < QUERIES; i++) {
            random_query(&r, &q[0][i]);
            d[0][i] = (PhaseDraw){.uv = {uniform(&r), uniform(&r)}, .u1 = uniform(&r), .u2 = {uniform(&r), uniform(&r)}};
            memcpy(d[0][i].wi, q[0][i].wi, sizeof q[0][i].wi);
        }
        double gradient[3][PHASE_THETA] = {{0}};
        PhaseAdjoint a[3][QUERIES];
        for (int w = 0; w < 3; w++) {
            static const char *const features[] = {"sse2", "avx2", "avx512f"};
            if ((w == 1 && !__builtin_cpu_supports("avx2")) || (w == 2 && !__builtin_cpu_supports("avx512f"))) {
                print_message("no %s here\n", features[w]);
                continue;
            }
            memcpy(q[w], q[0], sizeof q[0]);
            memcpy(d[w], d[0], sizeof d[0]);
            for (int i = 0; i < QUERIES; i++) {
                a[w][i] = (PhaseAdjoint){.df = 1};
            }
            wide[w]->eval(&c, QUERIES, q[w]);
            wide[w]->sample(&c, QUERIES, d[w]);
            wide[w]->adj(&c, QUERIES, q[w], a[w], gradient[w], NULL);
            for (int i = 0; i < QUERIES; i++) {
                assert_true(fabs(q[w][i].f - q[0][i].f) <= 2e-4 * q[0][i].f + 1e-7);
                assert_true(fabs(q[w][i].pdf - q[0][i].pdf) <= 2e-4 * q[0][i].pdf + 1e-7);
                for (int j = 0; j < 3; j++) {
                    assert_true(fabs(d[w][i].wo[j] - d[0][i].wo[j]) <= 1e-3);
                }
            }
            for (int i = 0; i < c.theta_count; i++) {
                assert_true(fabs(gradient[w][i] - gradient[0][i]) <= 1e-3 * fabs(gradient[0][i]) + 1e-3);
            }
        }
    }
}

// ---- values that are known ---------------------------------------------------------------------------------------

static PhaseCase case_of(const char *name, const double *values, int n) {
    PhaseCase c = {.node_count = 1, .texture_count = n > 0, .theta_count = n};
    c.nodes[0] = (PhaseNode){.kind = rey_phase_kind_find(name), .slot = {0}, .child = {-1, -1}, .table = -1};
    assert_true(c.nodes[0].kind >= 0);
    c.textures[0] = (TextureNode){.kind = TEXTURE_CONSTANT, .width = n, .height = 1, .channels = 1, .to_uv = -1};
    for (int i = 0; i < n; i++) {
        c.theta[i] = values[i];
    }
    update_tables(&c);
    return c;
}

static double at_cosine(const PhaseCase *c, double cosine) {
    PhaseQuery q = {.wi = {0, 0, 1}, .wo = {sqrt(1 - cosine * cosine), 0, -cosine}};
    return value_at(c, &q);
}

static void test_values(void **state) {
    (void)state;
    const double pi = 3.14159265358979323846, table[] = {0.5, 1, 1.5}, ramp[] = {0, 0.5, 1}, sphere[] = {1, 1, 1, 0, 0, 0};
    PhaseCase c = case_of("isotropic", NULL, 0);
    assert_true(fabs(at_cosine(&c, 0.3) - 0.25 / pi) < 1e-12);
    c = case_of("rayleigh", NULL, 0);
    assert_true(fabs(at_cosine(&c, -1) - 0.375 / pi) < 1e-12);
    // Flakes that face everywhere alike.
    c = case_of("sggx", sphere, 6);
    assert_true(fabs(at_cosine(&c, 0.4) - 0.25 / pi) < 1e-9);
    // The last value is that of going straight on.
    c = case_of("tabphase", table, 3);
    assert_true(fabs(at_cosine(&c, 1) - 0.1193662073189215) < 1e-9 && at_cosine(&c, -1) < at_cosine(&c, 1));
    c = case_of("tabphase", ramp, 3);
    PhaseDraw d = {.wi = {0, 0, 1}, .u1 = 0.5, .u2 = {1, 0}};
    exact->sample(&c, 1, &d);
    assert_true(fabs(d.wo[2] + 1) < 1e-6 && fabs(at_cosine(&c, 1) - 0.15915494309189535) < 1e-9);
    // g is the mean cosine.
    for (double g = -0.95; g < 1; g += 0.19) {
        c = case_of("hg", &g, 1);
        double mean = 0, step = 2e-4;
        for (double x = -1 + step / 2; x < 1; x += step) {
            mean += 2 * pi * x * at_cosine(&c, x) * step;
        }
        assert_true(fabs(mean - g) < 1e-3);
    }
}

// d ln p / dg = (g^3 + g^2 c - 5 g + 3 c) / ((1 - g^2) (1 + g^2 - 2 g c)), c the cosine of the angle by which light is turned.
static void test_score(void **state) {
    (void)state;
    for (double g = -0.9; g < 0.95; g += 0.3) {
        PhaseCase c = case_of("hg", &g, 1);
        for (double x = -0.95; x < 1; x += 0.19) {
            PhaseQuery q = {.wi = {0, 0, 1}, .wo = {sqrt(1 - x * x), 0, -x}};
            PhaseAdjoint a = {.df = 1};
            double gradient[PHASE_THETA] = {0};
            exact->adj(&c, 1, &q, &a, gradient, NULL);
            double score = (g * g * g + g * g * x - 5 * g + 3 * x) / ((1 - g * g) * (1 + g * g - 2 * g * x));
            assert_true(fabs(gradient[0] / value_at(&c, &q) - score) < 1e-9 * (1 + fabs(score)));
        }
    }
}

// Flakes see each other alike from both sides: sigma(wi) p(wi, wo) = sigma(wo) p(wo, wi).
static void test_reciprocity(void **state) {
    (void)state;
    Random r = {14};
    for (int k = 0; k < 100; k++) {
        PhaseCase c;
        phase_case(&c, &r, rey_phase_kind_find("sggx"));
        c.textures[0].kind = TEXTURE_TABLE; // the same everywhere
        PhaseQuery q;
        random_query(&r, &q);
        PhaseQuery back = q;
        memcpy(back.wi, q.wo, sizeof q.wo);
        memcpy(back.wo, q.wi, sizeof q.wi);
        double area[2];
        for (int i = 0; i < 2; i++) {
            const double *v = i ? q.wo : q.wi, *s = c.theta;
            area[i] = sqrt(s[0] * v[0] * v[0] + s[1] * v[1] * v[1] + s[2] * v[2] * v[2] +
                           2 * (s[3] * v[0] * v[1] + s[4] * v[0] * v[2] + s[5] * v[1] * v[2]));
        }
        double one = area[0] * value_at(&c, &q), other = area[1] * value_at(&c, &back);
        assert_true(fabs(one - other) <= 1e-9 * one + 1e-12);
    }
}

// The name of a test as an argument runs that one only.
int main(int argc, char **argv) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_sampling), cmocka_unit_test(test_adjoint),
                                       cmocka_unit_test(test_widths), cmocka_unit_test(test_values),
                                       cmocka_unit_test(test_score),
                                       cmocka_unit_test(test_reciprocity)};
    if (argc > 1) {
        cmocka_set_test_filter(argv[1]);
    }
    return cmocka_run_group_tests(tests, NULL, NULL);
}
