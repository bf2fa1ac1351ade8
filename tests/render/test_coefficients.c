// Media that are written with what scatters and what absorbs, in closed form: transmittance and single scattering with their
// derivatives by both coefficients, also where one of them or both are 0, and in grids, whose values between voxels are ratios of
// two fields. And the chain rule, against the same medium written with extinction and albedo.
#include "slab.h"

static const double sigma_s[3] = {0.3, 0, 0.9}, sigma_a[3] = {0.2, 0.7, 0};
static const char *const kinds[] = {"homogeneous", "heterogeneous"};

static double largest(const double *v) { return fmax(fmax(fabs(v[0]), fabs(v[1])), fabs(v[2])); }

static void close_to(const Case *c, const char *what, const double *mean, const double *error, const double *expected,
                     double scale) {
    for (int k = 0; k < 3; k++) {
        double off = fabs(mean[k] - expected[k]);
        if (off > 4 * error[k] + 2e-4 * scale || error[k] * sqrt(sample_share()) > 0.02 * scale) {
            fail_msg("%s, %s, channel %d: %.6g +- %.2g, expected %.6g", c->text, what, k, mean[k], error[k], expected[k]);
        }
    }
}

// The picture and its derivative in forward mode; and in reverse mode, where it is the same number.
static void judge(const Case *c, double scale) {
    Room room = slab_open(c->defines, 2);
    double mean[3], error[3], gradient[16], sum = 0, reverse = 0;
    float image[3 * PIXELS], ones[3 * PIXELS];
    mean_of(room, -1, NULL, 1024, mean, error);
    close_to(c, "value", mean, error, c->value, fmax(largest(c->value), 1e-3));
    int param = rey_param_find(room.scene, c->param);
    assert_true(param >= 0);
    mean_of(room, param, c->tangent, 1024, mean, error);
    close_to(c, c->param, mean, error, c->derivative, fmax(scale, fmax(largest(c->derivative), largest(c->value))));
    rey_render_def def = def_make(16, 3, 1);
    rey_param_info info;
    ok(room, rey_param_get_info(room.scene, param, &info));
    ok(room, rey_jvp(room.scene, &def, (rey_selection){&param, 1}, c->tangent, image, NULL, NULL));
    for (int i = 0; i < 3 * PIXELS; i++) {
        ones[i] = 1;
        sum += (double)image[i];
    }
    ok(room, rey_vjp(room.scene, &def, (rey_selection){&param, 1}, ones, gradient, NULL, NULL));
    for (int i = 0; i < (int)info.count; i++) {
        reverse += gradient[i] * (double)c->tangent[i];
    }
    assert_float_equal(sum, reverse, 1e-4 * (1 + fabs(sum)));
    room_close(room);
}

static const Case pair = {"pair", {{"medium", "pair"}, {"sigma_s", "0.3, 0, 0.9"}, {"sigma_a", "0.2, 0.7, 0"}},
                          {0}, NULL, {1, 1, 1}, {0}};

// One coefficient or the other in both kinds of medium: one is followed in closed form, the other is tracked.
static void judge_both(Case c, const double by_s[3], const double by_a[3]) {
    for (int i = 0; i < 4; i++) {
        define(&c, "kind", kinds[i / 2]);
        c.param = i % 2 ? "pair.sigma_a.value" : "pair.sigma_s.value";
        memcpy(c.derivative, i % 2 ? by_a : by_s, sizeof c.derivative);
        judge(&c, 0);
    }
}

// Of light that comes back, p the phase function there and E the light: I = s p E (1 - exp(-4 (s + a))) / (2 (s + a))
static const double light = 5;

static double back(void) {
    const double g = 0.3;
    return light * (1 - g * g) / (4 * pi * pow(1 + g, 3));
}

static void test_scattering(void **state) {
    UNUSED(state);
    Case c = pair;
    double by_s[3], by_a[3];
    define(&c, "sun", "5");
    define(&c, "depth", "2");
    for (int k = 0; k < 3; k++) {
        double s = sigma_s[k], t = s + sigma_a[k], e = exp(-4 * t), once = (1 - e) / (2 * t);
        c.value[k] = back() * s * once;
        by_a[k] = back() * s * (2 * e - once) / t;
        by_s[k] = back() * once + by_a[k];
    }
    judge_both(c, by_s, by_a);
}

// Where there is nothing yet, all that scatters brings something, and what absorbs nothing.
static void test_empty(void **state) {
    UNUSED(state);
    Case c = pair;
    const double by_s[3] = {2 * back(), 2 * back(), 2 * back()}, by_a[3] = {0};
    define(&c, "sun", "5");
    define(&c, "depth", "2");
    define(&c, "sigma_s", "0, 0, 0");
    define(&c, "sigma_a", "0, 0, 0");
    judge_both(c, by_s, by_a);
}

// Through the slab: I = exp(-2 (s + a)), and the sky scatters light into the view as it does out of it.
static void test_transmittance(void **state) {
    UNUSED(state);
    Case c = pair;
    double by_a[3], by_s[3] = {0};
    define(&c, "sky", "1");
    define(&c, "depth", "1");
    for (int k = 0; k < 3; k++) {
        c.value[k] = exp(-2 * (sigma_s[k] + sigma_a[k]));
        by_a[k] = -2 * c.value[k];
    }
    judge_both(c, by_a, by_a);
    Case furnace = pair;
    define(&furnace, "sky", "1");
    define(&furnace, "sigma_a", "0, 0, 0");
    furnace.param = "pair.sigma_s.value";
    for (int k = 0; k < 3; k++) {
        furnace.value[k] = 1;
    }
    memcpy(furnace.derivative, by_s, sizeof by_s);
    judge(&furnace, 0);
}

// ---- grids -------------------------------------------------------------------------------------------------------

enum { STRATA = 4, STEPS = 20000 };
static const double strata_s[STRATA] = {0.9, 0, 0, 2}, strata_a[STRATA] = {0.1, 0, 1.5, 0.3};

// Weights of the strata at a height of [0, 1].
static void weights_at(double height, double weight[STRATA]) {
    double x = fmin(fmax(height * STRATA - 0.5, 0), STRATA - 1);
    for (int k = 0; k < STRATA; k++) {
        weight[k] = fmax(0, 1 - fabs(x - k));
    }
}

// I = int s p E exp(-2 depth) over the way from the top, with its derivatives by the voxels.
static double strata(double by_s[STRATA], double by_a[STRATA]) {
    double depth = 0, value = 0, above[STRATA] = {0}, ds = 2.0 / STEPS;
    memset(by_s, 0, STRATA * sizeof *by_s);
    memset(by_a, 0, STRATA * sizeof *by_a);
    for (int i = 0; i < STEPS; i++) {
        double weight[STRATA], s = 0, t = 0;
        weights_at(1 - (i + 0.5) / STEPS, weight);
        for (int k = 0; k < STRATA; k++) {
            s += weight[k] * strata_s[k];
            t += weight[k] * (strata_s[k] + strata_a[k]);
        }
        double passed = back() * exp(-2 * (depth + 0.5 * t * ds)) * ds;
        value += s * passed;
        for (int k = 0; k < STRATA; k++) {
            double lost = -2 * s * passed * (above[k] + 0.5 * weight[k] * ds);
            by_s[k] += weight[k] * passed + lost;
            by_a[k] += lost;
            above[k] += weight[k] * ds;
        }
        depth += t * ds;
    }
    return value;
}

static void test_grids(void **state) {
    UNUSED(state);
    double by_s[STRATA], by_a[STRATA];
    Case c = {"strata", {{"medium", "strata"}, {"sun", "5"}, {"depth", "2"}}, {0}, NULL, {0}, {0}};
    c.value[0] = c.value[1] = c.value[2] = strata(by_s, by_a);
    for (int i = 0; i < 2 * STRATA; i++) {
        double derivative = i % 2 ? by_a[i / 2] : by_s[i / 2];
        c.param = i % 2 ? "strata.sigma_a.data" : "strata.sigma_s.data";
        memset(c.tangent, 0, sizeof c.tangent);
        c.tangent[i / 2] = 1;
        c.derivative[0] = c.derivative[1] = c.derivative[2] = derivative;
        judge(&c, 0.5 * back());
    }
    // Where there is nothing: dI / d scale = p E int s.
    c.value[0] = c.value[1] = c.value[2] = 0;
    c.param = "strata.scale.value";
    c.tangent[0] = 1;
    define(&c, "scale", "0");
    c.derivative[0] = c.derivative[1] = c.derivative[2] = back() * 2 * (0.9 + 2) / STRATA;
    judge(&c, 0);
}

// ---- the chain rule ----------------------------------------------------------------------------------------------

typedef struct Slope {
    double mean[3], error[3];
} Slope;

static Slope slope_of(Room room, const char *name) {
    const float ones[3] = {1, 1, 1};
    Slope s;
    int param = rey_param_find(room.scene, name);
    assert_true(param >= 0);
    mean_of(room, param, ones, 1024, s.mean, s.error);
    return s;
}

// t = s + a and w = s / t, so that d/ds = d/dt + (1 - w) / t d/dw and d/da = d/dt - w / t d/dw: with all orders of scattering.
static void test_chain_rule(void **state) {
    UNUSED(state);
    const double s[3] = {0.3, 0.6, 0.9}, t[3] = {0.5, 0.75, 1};
    const rey_define apart[MOST_DEFINES] = {
        {"medium", "pair"}, {"sun", "5"}, {"sigma_s", "0.3, 0.6, 0.9"}, {"sigma_a", "0.2, 0.15, 0.1"}};
    const rey_define whole[MOST_DEFINES] = {
        {"medium", "fog"}, {"sun", "5"}, {"sigma_t", "0.5, 0.75, 1"}, {"albedo", "0.6, 0.8, 0.9"}};
    Room one = slab_open(apart, 2), other = slab_open(whole, 2);
    Slope by_s = slope_of(one, "pair.sigma_s.value"), by_a = slope_of(one, "pair.sigma_a.value");
    Slope by_t = slope_of(other, "fog.sigma_t.value"), by_w = slope_of(other, "fog.albedo.value");
    for (int k = 0; k < 3; k++) {
        double w = s[k] / t[k], expected_s = by_t.mean[k] + (1 - w) / t[k] * by_w.mean[k];
        double expected_a = by_t.mean[k] - w / t[k] * by_w.mean[k];
        double error_s = hypot(by_s.error[k], hypot(by_t.error[k], (1 - w) / t[k] * by_w.error[k]));
        double error_a = hypot(by_a.error[k], hypot(by_t.error[k], w / t[k] * by_w.error[k]));
        print_message("channel %d: by sigma_s %.5g +- %.2g, expected %.5g; by sigma_a %.5g +- %.2g, expected %.5g\n", k,
                      by_s.mean[k], error_s, expected_s, by_a.mean[k], error_a, expected_a);
        assert_true(fabs(by_s.mean[k] - expected_s) < 4 * error_s && fabs(by_a.mean[k] - expected_a) < 4 * error_a);
        assert_true(error_s < 0.03 * fabs(expected_s) && error_a < 0.03 * fabs(expected_a));
    }
    room_close(one);
    room_close(other);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_scattering), cmocka_unit_test(test_empty),
                                       cmocka_unit_test(test_transmittance), cmocka_unit_test(test_grids),
                                       cmocka_unit_test(test_chain_rule)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
