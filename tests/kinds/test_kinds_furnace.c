// White furnaces: a surface of any kind that absorbs nothing, in an environment of radiance 1, looks like the environment.
// Every kind of the table is whitened: colours 1, metals without loss, microfacets narrow (what bounces twice is lost by
// the model), normals not turned. Radiance is compressed by refraction, which is undone.
#include "cases.h"

#include <stdlib.h>

enum { CASES_PER_VARIANT = 6, SAMPLES = 8000 };

static const KindKernels *const exact = &kind_kernels_double;

// What the parameters of a kind must be where their type does not tell. Lobes of `principled` that gain energy by their
// definition are off; it is a metal in odd cases and glass in even ones.
static double white_number(const char *name, int n, double value) {
    static const struct {
        const char *name;
        double even, odd;
    } numbers[] = {{"roughness", 0.05, 0.05}, {"anisotropic", 0.5, 0},    {"metallic", 0, 1}, {"spec_trans", 1, 1},
                   {"sheen", 0, 0},           {"spec_tint", 0, 0},        {"clearcoat", 0, 0}, {"diff_trans", 2, 2},
                   {"alpha", 0.02, 0.005},      {"scale", 0, 0}};
    for (int i = 0; i < COUNT_OF(numbers); i++) {
        if (strcmp(name, numbers[i].name) == 0) {
            return n % 2 ? numbers[i].odd : numbers[i].even;
        }
    }
    return value;
}

static double white_value(const ParamDesc *p, int n, int channel, double value, bool rough_coat) {
    switch (p->type) {
    case PARAM_IOR:
        return rough_coat ? fmin(fmax(value, 1.2), 2) : value; // its averages over 64 cosines are coarse beyond these
    case PARAM_SPEC:
    case PARAM_METAL_K:
        return 1;
    case PARAM_METAL_ETA:
    case PARAM_HEIGHT:
        return 0;
    case PARAM_ALPHA_U:
        return 0.004;
    case PARAM_ALPHA_V:
        return n % 2 ? 0.004 : 0.02;
    case PARAM_NORMAL:
        return channel < 2 ? 0.5 : 1;
    default:
        return white_number(p->name, n, value);
    }
}

static void whiten(KindCase *c, int n) {
    for (int id = 0; id < c->bsdf_count; id++) {
        const BsdfKind *k = rey_bsdf_kinds + c->bsdfs[id].kind;
        for (int i = 0; i < k->param_count; i++) {
            const TextureNode *t = c->textures + c->bsdfs[id].slot[i];
            for (int channel = 0; channel < t->channels; channel++) {
                double *value = c->theta + t->theta + channel;
                *value = white_value(k->params + i, n, channel, *value, strcmp(k->name, "roughplastic") == 0);
            }
        }
    }
    case_update(c);
}

// Whether light that arrives from both sides counts: other functions are black from behind.
static bool has_back(const KindCase *c) {
    const BsdfKind *k = rey_bsdf_kinds + c->bsdfs[c->root].kind;
    return (!k->adapter && k->transmits && strcmp(k->name, "principled") != 0) || strcmp(k->name, "twosided") == 0;
}

// How far from white by definition: fits of the coat's inner reflectance, masking, light bounced twice (more of it in a
// rough coat, whose averages leave it out), and a thin sheet's two roughnesses, which see Fresnel's jump at the critical
// angle differently.
static void bounds_of(const KindCase *c, double *low, double *high) {
    *low = 1 - 1e-9;
    *high = 1 + 1e-9;
    for (int id = 0; id < c->bsdf_count; id++) {
        const char *name = rey_bsdf_kinds[c->bsdfs[id].kind].name;
        bool coat = strcmp(name, "plastic") == 0;
        bool facets = strncmp(name, "rough", 5) == 0 || strncmp(name, "principled", 10) == 0;
        bool rough_coat = strcmp(name, "roughplastic") == 0, thin = strcmp(name, "principledthin") == 0;
        *low -= rough_coat ? 0.06 : facets ? 0.02 : coat ? 0.01 : 0;
        *high += thin ? 0.03 : facets ? 0.004 : coat ? 0.05 : 0;
    }
}

// Mean weight of samples, and its standard error.
static double albedo(const KindCase *c, const double wi[3], Random *r, double *error) {
    static Draw draw[SAMPLES];
    static Query query[SAMPLES];
    static double f[SAMPLES][3], pdf[SAMPLES];
    double mean = 0, square = 0;
    for (int i = 0; i < SAMPLES; i++) {
        draw[i] = (Draw){.u1 = uniform(r), .u2 = {uniform(r), uniform(r)}};
        memcpy(draw[i].wi, wi, sizeof draw[i].wi);
    }
    exact->sample(c, SAMPLES, draw);
    for (int i = 0; i < SAMPLES; i++) {
        query[i] = (Query){.lobe = draw[i].lobe};
        memcpy(query[i].wi, wi, sizeof query[i].wi);
        memcpy(query[i].wo, draw[i].wo, sizeof query[i].wo);
    }
    exact->eval(c, SAMPLES, query, f, pdf);
    for (int i = 0; i < SAMPLES; i++) {
        double weight = pdf[i] > 0 ? f[i][i % 3] / pdf[i] * draw[i].eta * draw[i].eta : 0;
        mean += weight / SAMPLES;
        square += weight * weight / SAMPLES;
    }
    *error = sqrt(fmax(square - mean * mean, 0) / SAMPLES);
    return mean;
}

static void test_white(void **state) {
    UNUSED(state);
    int failures = 0;
    for (int kind = 0; kind < rey_bsdf_kind_count; kind++) {
        Random r = case_random(kind * 1000 + 17);
        for (int n = 0; n < CASES_PER_VARIANT * case_variants(kind); n++) {
            KindCase c;
            case_make(&c, &r, kind, n % case_variants(kind), false);
            whiten(&c, n / case_variants(kind));
            c.floor = n % 3 == 0 ? 0.05 : 0;
            double z = between(&r, 0.3, 1) * (has_back(&c) && uniform(&r) < 0.5 ? -1 : 1), phi = between(&r, 0, 6.28);
            const double wi[3] = {sqrt(1 - z * z) * cos(phi), sqrt(1 - z * z) * sin(phi), z};
            double low, high, error, mean = albedo(&c, wi, &r, &error);
            bounds_of(&c, &low, &high);
            if (mean < low - 5 * error || mean > high + 5 * error) {
                Query q = {.wi = {wi[0], wi[1], wi[2]}};
                print_error("%.6f +- %.6f instead of 1: ", mean, error);
                case_print(&c, &q);
                failures++;
            }
        }
    }
    assert_int_equal(failures, 0);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_white)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
