// The derivative of rough interfaces with respect to the index has a finite variance at the critical angle: the second
// moment of its estimate, the integral of (df/d eta)^2 / pdf over reflected directions from inside, is cut into decades
// of the refracted cosine c. Sampling as for pictures adds the same amount in every decade down to 0, without end;
// sampling as for derivatives adds less and less.
#include "cases.h"

enum { DECADES = 5, STEPS = 24, AZIMUTHS = 24 };

static const KindKernels *const exact = &kind_kernels_double;

static const double pi = 3.14159265358979323846;

// The entry of theta that holds the index.
static int index_entry(const KindCase *c) {
    const BsdfKind *k = rey_bsdf_kinds + c->bsdfs[c->root].kind;
    for (int i = 0; i < c->theta_count; i++) {
        ParamType type = c->owner[i] >= 0 ? k->params[c->owner[i]].type : PARAM_SPEC;
        bool named = c->owner[i] >= 0 && strcmp(k->params[c->owner[i]].name, "eta") == 0;
        if (named || type == PARAM_IOR || type == PARAM_SPECULAR) {
            return i;
        }
    }
    fail_msg("%s has no index", k->name);
    return -1;
}

// (df/d eta)^2 / pdf d omega / (dc d phi) at the mirror direction about a normal with refracted cosine c.
// From inside where eta > 1, from outside where eta < 1.
static double moment_at(const KindCase *k, int entry, double eta, double sine, double c, double phi, double floor) {
    double e = fmin(eta, 1 / eta), out = eta < 1 ? 1 : -1, a = sqrt((1 - e) * (1 + e) + e * e * c * c), r = sqrt(1 - a * a);
    double cosine = sqrt(1 - sine * sine), up[3] = {sine, 0, cosine}, side[3] = {cosine, 0, -sine}, m[3];
    Query q = {{out * sine, 0, out * cosine}, {0}, {0, 0}, 0};
    for (int i = 0; i < 3; i++) {
        m[i] = a * up[i] + r * (cos(phi) * side[i] + (i == 1 ? sin(phi) : 0));
    }
    for (int i = 0; i < 3; i++) {
        q.wo[i] = out * (2 * a * m[i] - up[i]);
    }
    if (m[2] <= 0 || out * q.wo[2] <= 0) {
        return 0;
    }
    KindCase copy = *k;
    copy.floor = floor;
    Adjoint adjoint = {.df = {1, 1, 1}};
    double gradient[CASE_THETA] = {0}, f[1][3], pdf;
    exact->adj(&copy, 1, &q, &adjoint, gradient, NULL);
    exact->eval(&copy, 1, &q, f, &pdf);
    double d = gradient[entry];
    assert_true(d == 0 || pdf > 0);
    // d omega = 4 a d omega_m, d omega_m = da d phi, da = e^2 c / a dc
    return d == 0 ? 0 : d * d / pdf * 4 * e * e * c;
}

// The second moment's part from c in [10^-(k + 1), 10^-k] for each k.
static void moments(const KindCase *k, double eta, double sine, double floor, double *decades) {
    int entry = index_entry(k);
    for (int decade = 0; decade < DECADES; decade++) {
        decades[decade] = 0;
        for (int i = 0; i < STEPS; i++) {
            double c = pow(10, -decade - (i + 0.5) / STEPS), dc = c * log(10) / STEPS;
            for (int j = 0; j < AZIMUTHS; j++) {
                double phi = 2 * pi * (j + 0.5) / AZIMUTHS;
                decades[decade] += moment_at(k, entry, eta, sine, c, phi, floor) * dc * 2 * pi / AZIMUTHS;
            }
        }
    }
}

static void check(const char *name, int variant, const char *roughness, double eta) {
    Random r = {3};
    KindCase c;
    case_make(&c, &r, rey_bsdf_kind_find(name), variant, false);
    case_set(&c, roughness, 0.4);
    case_set(&c, "alpha_v", 0.3);
    case_set(&c, "spec_trans", 1);
    case_set(&c, "metallic", 0);
    case_set(&c, "eta", eta);
    case_set(&c, "specular", eta);
    for (int i = 0; i < 3; i++) { // wi before, at and beyond the critical angle
        double plain[DECADES], guarded[DECADES];
        moments(&c, eta, (0.8 + 0.2 * i) * fmin(eta, 1 / eta), 0, plain);
        moments(&c, eta, (0.8 + 0.2 * i) * fmin(eta, 1 / eta), 0.05, guarded);
        assert_true(plain[4] > 0.9 * plain[3] && plain[3] > 0);
        assert_true(guarded[4] < 0.2 * guarded[3] && guarded[3] < 0.3 * guarded[2]);
        assert_true(guarded[4] > 0);
    }
}

static void test_rough_dielectric(void **state) {
    UNUSED(state);
    for (int variant = 0; variant < 4; variant++) {
        check("roughdielectric", variant, "alpha_u", 1.5);
        check("roughdielectric", variant, "alpha_u", 0.7);
    }
}

static void test_principled(void **state) {
    UNUSED(state);
    check("principled", 1, "roughness", 1.5); // the index is given itself
    check("principled", 1, "roughness", 0.7);
    check("principledthin", 0, "roughness", 0.7);
}

static void test_rough_plastic(void **state) {
    UNUSED(state);
    check("roughplastic", 1, "alpha", 0.7);
}

// Normals that are drawn next to the critical angle have that density also when the digits of c are lost.
static void test_digits(void **state) {
    UNUSED(state);
    enum { N = 4096 };
    static const KindKernels *const widths[] = {&kind_kernels_w1, &kind_kernels_w8, &kind_kernels_w16};
    static Draw d[N];
    static Query q[N];
    static double f[N][3], pdf[N];
    const double eta = 1.5, floor = 0.05, least = floor / (8 * pi) * eta * eta / 0.01;
    Random r = {7};
    KindCase c;
    case_make(&c, &r, rey_bsdf_kind_find("roughdielectric"), 0, false);
    case_set(&c, "alpha_u", 0.1);
    case_set(&c, "alpha_v", 0.1);
    case_set(&c, "eta", eta);
    c.floor = floor;
    const int width_count = case_width_count();
    for (int w = 0; w < width_count; w++) {
        int counted = 0;
        for (int i = 0; i < N; i++) {
            double sine = 0.2 + 0.7 * uniform(&r), turn = 2 * pi * uniform(&r);
            d[i] = (Draw){.wi = {sine * cos(turn), sine * sin(turn), -sqrt(1 - sine * sine)}, .u1 = 0.02,
                          .u2 = {pow(10, -1.5 - 2.2 * uniform(&r)), uniform(&r)}};
        }
        widths[w]->sample(&c, N, d);
        for (int i = 0; i < N; i++) {
            q[i] = (Query){.lobe = d[i].lobe};
            memcpy(q[i].wi, d[i].wi, sizeof q[i].wi);
            memcpy(q[i].wo, d[i].wo, sizeof q[i].wo);
        }
        widths[w]->eval(&c, N, q, f, pdf);
        for (int i = 0; i < N; i++) { // c < 0.01 and |a| = |b| where all but the least is mirrored
            bool mirrored = d[i].wo[2] < -1e-3 && d[i].u2[0] < 0.01;
            counted += mirrored;
            if (mirrored && !(pdf[i] > 0.8 * least)) {
                fail_msg("u = %g, wi = (%g, %g, %g): density %g, at least %g is expected", d[i].u2[0], d[i].wi[0], d[i].wi[1],
                         d[i].wi[2], pdf[i], least);
            }
        }
        assert_true(counted > N / 4);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_rough_dielectric), cmocka_unit_test(test_principled),
                                       cmocka_unit_test(test_rough_plastic),
                                       cmocka_unit_test(test_digits)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
