// Participating media in closed form: a slab's transmittance, single scattering and emission, a furnace, and the derivatives
// of all of these, also where the slab is empty. What is refused.
#include "slab.h"

#include <stdlib.h>

static void expect(const Case *c, const char *what, const double *mean, const double *error, const double *expected,
                   double scale) {
    for (int k = 0; k < 3; k++) {
        double off = fabs(mean[k] - expected[k]);
        if (off > 4 * error[k] + 2e-4 * scale || error[k] * sqrt(sample_share()) > 0.02 * scale) {
            fail_msg("%s, %s, channel %d: %.6g +- %.2g, expected %.6g", c->text, what, k, mean[k], error[k], expected[k]);
        }
    }
}

static double largest(const double *v) { return fmax(fmax(fabs(v[0]), fabs(v[1])), fabs(v[2])); }

static void judge_kind(Case c, const char *kind) {
    define(&c, "kind", kind);
    Room room = slab_open(c.defines, 2);
    double mean[3], error[3];
    mean_of(room, -1, NULL, 1024, mean, error);
    expect(&c, kind, mean, error, c.value, fmax(largest(c.value), 1e-3));
    int param = rey_param_find(room.scene, c.param);
    assert_true(param >= 0);
    mean_of(room, param, c.tangent, 1024, mean, error);
    expect(&c, c.param, mean, error, c.derivative, fmax(largest(c.derivative), largest(c.value)));
    room_close(room);
}

// The case in both kinds of medium: one is followed in closed form, the other is tracked.
static void judge(Case c) {
    judge_kind(c, "homogeneous");
    judge_kind(c, "heterogeneous");
}

// The case as the slab grows from thickness 2 s, s = 1, given dI / ds; and as it moves along the view, where nothing changes.
// The border is a surface, or that of the box of a volume. No ray may run along its sides.
static void judge_border(Case c) {
    define(&c, "tilt", "0.1");
    Case box = c;
    c.param = "slab.to_world";
    c.tangent[10] = 1;
    judge_kind(c, "homogeneous");
    define(&box, "wide", "2");
    box.param = "fog.sigma_t.to_world";
    box.tangent[10] = 2;
    box.tangent[11] = -1;
    judge_kind(box, "heterogeneous");
    c.tangent[10] = box.tangent[10] = 0;
    c.tangent[11] = box.tangent[11] = 1;
    memset(c.derivative, 0, sizeof c.derivative);
    memset(box.derivative, 0, sizeof box.derivative);
    judge_kind(c, "homogeneous");
    judge_kind(box, "heterogeneous");
}

static const double sigma[3] = {0.3, 0.6, 0.9};

// I = exp(-2 sigma)
static void test_transmittance(void **state) {
    UNUSED(state);
    Case c = {"transmittance", {{"sky", "1"}}, {0}, "fog.sigma_t.value.value", {1, 1, 1}, {0}};
    for (int k = 0; k < 3; k++) {
        c.value[k] = exp(-2 * sigma[k]);
        c.derivative[k] = -2 * c.value[k];
    }
    judge(c);
}

// Of light that comes back, p the phase function there: I = a p E (1 - exp(-4 sigma)) / 2
static void test_single_scattering(void **state) {
    UNUSED(state);
    const double albedo[3] = {0.9, 0.5, 0.2}, g = 0.3, p = (1 - g * g) / (4 * pi * pow(1 + g, 3)), light = 5;
    const double dp = -2 * g / (4 * pi * pow(1 + g, 3)) - 3 * p / (1 + g);
    Case by_density = {"scattering", {{"albedo", "0.9, 0.5, 0.2"}, {"sun", "5"}, {"depth", "2"}}, {0},
                       "fog.sigma_t.value.value", {1, 1, 1}, {0}};
    Case by_albedo = by_density, by_g = by_density;
    by_albedo.param = "fog.albedo.value.value";
    by_g.param = "fog.phase_function.g.value";
    for (int k = 0; k < 3; k++) {
        double once = (1 - exp(-4 * sigma[k])) / 2 * light;
        by_density.value[k] = by_albedo.value[k] = by_g.value[k] = albedo[k] * p * once;
        by_density.derivative[k] = albedo[k] * p * light * 2 * exp(-4 * sigma[k]);
        by_albedo.derivative[k] = p * once;
        by_g.derivative[k] = albedo[k] * dp * once;
    }
    judge(by_density);
    judge(by_albedo);
    judge(by_g);
}

// The same where there is nothing yet: dI / d scale = 2 sigma a p E at scale 0.
static void test_empty(void **state) {
    UNUSED(state);
    const double albedo[3] = {0.9, 0.5, 0.2}, g = 0.3, p = (1 - g * g) / (4 * pi * pow(1 + g, 3));
    Case c = {"empty", {{"albedo", "0.9, 0.5, 0.2"}, {"sun", "5"}, {"depth", "2"}, {"scale", "0"}}, {0},
              "fog.scale.value", {1}, {0}};
    Case dark = {"empty, before a sky", {{"sky", "1"}, {"scale", "0"}}, {1, 1, 1}, "fog.scale.value", {1}, {0}};
    for (int k = 0; k < 3; k++) {
        c.derivative[k] = 2 * sigma[k] * albedo[k] * p * 5;
        dark.derivative[k] = -2 * sigma[k];
    }
    judge(c);
    judge(dark);
}

// I = j (1 - exp(-2 sigma)) / sigma, and 2 j where the slab is empty; dI / d sigma = -2 j there.
static void test_emission(void **state) {
    UNUSED(state);
    Case c = {"emission", {{"emission", "0.5"}}, {0}, "fog.emission.value.value", {1}, {0}}, dense = c;
    dense.param = "fog.sigma_t.value.value";
    dense.tangent[0] = dense.tangent[1] = dense.tangent[2] = 1;
    for (int k = 0; k < 3; k++) {
        double s = sigma[k], e = exp(-2 * s);
        c.derivative[k] = (1 - e) / s;
        c.value[k] = dense.value[k] = 0.5 * c.derivative[k];
        dense.derivative[k] = 0.5 * (2 * e * s - (1 - e)) / (s * s);
    }
    judge(c);
    judge(dense);
    Case empty = {"emission of an empty slab", {{"emission", "0.5"}, {"scale", "0"}}, {1, 1, 1}, "fog.scale.value", {1}, {0}};
    for (int k = 0; k < 3; k++) {
        empty.derivative[k] = -sigma[k];
    }
    judge(empty);
}

// Light that is the same everywhere stays so where nothing is absorbed, however dense the fog is.
static void test_furnace(void **state) {
    UNUSED(state);
    Case c = {"furnace", {{"albedo", "1, 1, 1"}, {"sky", "1"}, {"scale", "3"}}, {1, 1, 1}, "fog.sigma_t.value.value",
              {1, 1, 1}, {0}};
    judge(c);
}

// Flakes that grow: what bounds their extinction must follow.
static void test_growing_flakes(void **state) {
    UNUSED(state);
    const rey_define defines[MOST_DEFINES] = {{"sky", "1"}, {"medium", "flakes"}, {"kind", "heterogeneous"}};
    const float wide[6] = {2, 1.6f, 2.56f, 0.4f, 0, 0};
    Case c = {.text = "flakes that grow"};
    double mean[3], error[3];
    Room room = slab_open(defines, 2);
    mean_of(room, -1, NULL, 64, mean, error);
    ok(room, rey_param_set(room.scene, rey_param_find(room.scene, "flakes.phase_function.S"), wide, 6));
    mean_of(room, -1, NULL, 1024, mean, error);
    for (int k = 0; k < 3; k++) {
        c.value[k] = exp(-2 * sigma[k] * 1.6);
    }
    expect(&c, "transmittance", mean, error, c.value, 1);
    room_close(room);
}

// Transmittance and single scattering in flakes that show the area A along the view and m^1/2 across it, where they scatter back
// p = A^2 / (4 pi m^1/2): both depend on the extinction sigma A, and all on the matrix.
static void test_flakes(void **state) {
    UNUSED(state);
    const double albedo[3] = {0.9, 0.5, 0.2}, zz = 0.64, area = 0.8, minor = 0.5 * 0.4 - 0.1 * 0.1, light = 5;
    const double p = zz / (4 * pi * sqrt(minor)), dminor = 0.4 + 0.5 - 2 * 0.1; // as all numbers of the matrix grow
    const double dp = p * (1 / zz - 0.5 * dminor / minor), darea = 0.5 / area;
    Case dark = {"transmittance of flakes", {{"sky", "1"}, {"medium", "flakes"}}, {0}, "flakes.phase_function.S",
                 {1, 1, 1, 1, 1, 1}, {0}};
    Case by_density = {"scattering of flakes", {{"albedo", "0.9, 0.5, 0.2"}, {"sun", "5"}, {"depth", "2"}, {"medium", "flakes"}},
                       {0}, "flakes.sigma_t.value.value", {1, 1, 1}, {0}};
    Case by_matrix = by_density, empty = by_density;
    by_matrix.param = "flakes.phase_function.S";
    by_matrix.tangent[3] = by_matrix.tangent[4] = by_matrix.tangent[5] = 1;
    define(&empty, "scale", "0");
    empty.param = "flakes.scale.value";
    for (int k = 0; k < 3; k++) {
        double s = sigma[k], once = (1 - exp(-4 * s * area)) / 2 * light, more = 2 * light * exp(-4 * s * area);
        dark.value[k] = exp(-2 * s * area);
        dark.derivative[k] = -2 * s * darea * dark.value[k];
        by_density.value[k] = by_matrix.value[k] = albedo[k] * p * once;
        by_density.derivative[k] = albedo[k] * p * area * more;
        by_matrix.derivative[k] = albedo[k] * (dp * once + p * s * darea * more);
        empty.derivative[k] = 2 * s * area * albedo[k] * p * light;
    }
    judge(dark);
    judge(by_density);
    judge(by_matrix);
    if (slab_estimator == REY_ESTIMATOR_PROBE) {
        judge(empty);
    }
}

// Flakes seen by a camera that turns about the slab's middle, d' = (0, 1, 0), and flakes in a slab that grows. Of the first,
// lengths stay, and the area changes by -S_yz / A.
static void test_turned_flakes(void **state) {
    UNUSED(state);
    const double area = 0.8, yz = 0.2;
    Case turned = {"flakes from another side", {{"sky", "1"}, {"medium", "flakes"}, {"S", "0.5, 0.4, 0.64, 0, 0, 0.2"}}, {0},
                   "camera.to_world", {[6] = 1, [7] = -3, [9] = 0.5f}, {0}};
    Case grown = {"more flakes", {{"sky", "1"}, {"medium", "flakes"}, {"tilt", "0.1"}}, {0}, "slab.to_world", {[10] = 1}, {0}};
    for (int k = 0; k < 3; k++) {
        turned.value[k] = grown.value[k] = exp(-2 * sigma[k] * area);
        turned.derivative[k] = 2 * sigma[k] * yz / area * turned.value[k];
        grown.derivative[k] = -2 * sigma[k] * area * grown.value[k];
    }
    judge(turned);
    judge_kind(grown, "homogeneous");
}

// The three of them as functions of where the slab begins and ends.
static void test_borders(void **state) {
    UNUSED(state);
    const double albedo[3] = {0.9, 0.5, 0.2}, g = 0.3, tilted = sqrt(1.02), ways = 1 + tilted; // to a depth of 1 and back
    const double p = (1 - g * g) / (4 * pi * pow(1 + g * g + 2 * g / tilted, 1.5)), light = 5;
    Case through = {"transmittance", {{"sky", "1"}}, {0}, NULL, {0}, {0}};
    Case scattered = {"scattering", {{"albedo", "0.9, 0.5, 0.2"}, {"sun", "5"}, {"depth", "2"}}, {0}, NULL, {0}, {0}};
    Case glow = {"emission", {{"emission", "0.5"}}, {0}, NULL, {0}, {0}};
    for (int k = 0; k < 3; k++) {
        double s = sigma[k];
        through.value[k] = exp(-2 * s);
        through.derivative[k] = -2 * s * through.value[k];
        scattered.value[k] = albedo[k] * p * light * (1 - exp(-2 * ways * s)) / ways;
        scattered.derivative[k] = albedo[k] * p * light * 2 * s * exp(-2 * ways * s);
        glow.value[k] = 0.5 * (1 - exp(-2 * s)) / s;
        glow.derivative[k] = 2 * 0.5 * exp(-2 * s);
    }
    judge_border(through);
    judge_border(scattered);
    judge_border(glow);
}

// A ball of the radius r that glows, whole in the picture: I = j 4/3 pi r^3, also next to its outline.
static void test_outline(void **state) {
    UNUSED(state);
    Case c = {"ball", {{"emission", "1"}, {"scale", "0"}, {"shape", "sphere"}, {"wide", "0.4"}}, {0}, "slab.to_world", {0}, {0}};
    c.tangent[0] = c.tangent[5] = c.tangent[10] = 0.4f;
    for (int k = 0; k < 3; k++) {
        c.value[k] = 4 / 3.0 * pi * 0.4 * 0.4 * 0.4;
        c.derivative[k] = 3 * c.value[k];
    }
    judge_kind(c, "homogeneous");
}

static void refused(const rey_define *defines, const char *param, const char *why) {
    float image[3 * PIXELS], tangent[64] = {1};
    Room room = slab_open(defines, 1);
    int id = rey_param_find(room.scene, param);
    rey_render_def def = def_make(1, 0, 1);
    def.terms = 0;
    def.estimator = slab_estimator;
    assert_true(id >= 0);
    assert_int_not_equal(rey_jvp(room.scene, &def, (rey_selection){&id, 1}, tangent, image, NULL, NULL), REY_OK);
    if (!strstr(rey_error(room.ctx), why)) {
        fail_msg("%s", rey_error(room.ctx));
    }
    room_close(room);
}

// The same by the score function, which is another estimate, and none where the slab is empty.
static void test_score(void **state) {
    const float along[3] = {1, 1, 1};
    const rey_define air[MOST_DEFINES] = {{"sky", "1"}, {"scale", "0"}}, fog[MOST_DEFINES] = {{"sun", "5"}, {"albedo", "1, 1, 1"}};
    double mean[2][3], error[3];
    slab_estimator = REY_ESTIMATOR_SCORE;
    test_transmittance(state);
    test_single_scattering(state);
    test_flakes(state);
    test_furnace(state);
    refused(air, "fog.scale.value", "the score function has none where an extinction is 0");
    refused(fog, "slab.to_world", "the score function has none of media that move");
    Room room = slab_open(fog, 2);
    for (int k = 0; k < 2; k++) {
        slab_estimator = k ? REY_ESTIMATOR_SCORE : REY_ESTIMATOR_PROBE;
        mean_of(room, rey_param_find(room.scene, "fog.sigma_t.value.value"), along, 64, mean[k], error);
    }
    assert_true(mean[0][0] != mean[1][0]);
    slab_estimator = REY_ESTIMATOR_PROBE;
    room_close(room);
}

// The sensor's far plane ends its rays in a medium, too, in pictures and derivatives alike: the glow is j (1 - exp(-s d)) / s.
static void test_far_plane(void **state) {
    UNUSED(state);
    static const char *const ends[] = {"1.7", "100"};
    const double thickness[] = {1.2, 2.5}, s = 0.8, glow = 0.5;
    for (int i = 0; i < COUNT_OF(ends); i++) {
        const rey_define define = {"far", ends[i]};
        const double seen = exp(-s * thickness[i]), sum = (1 - seen) / s;
        const double exact[] = {glow * sum, glow * (thickness[i] * seen - sum)};
        static float image[NUMBERS];
        Room room;
        assert_int_equal(rey_context_create(NULL, &room.ctx), REY_OK);
        ok(room, rey_scene_load(room.ctx, RENDER_DIR "/fog_far_plane.xml", &define, 1, &room.scene));
        int scale = rey_param_find(room.scene, "glow.scale");
        for (int k = 0; k < 2; k++) {
            const float along = 1;
            double mean = 0;
            rey_render_def def = def_make(256, 1, 1);
            ok(room, k ? rey_jvp(room.scene, &def, (rey_selection){&scale, 1}, &along, image, NULL, NULL)
                       : rey_render(room.scene, &def, image, NULL));
            for (int n = 0; n < NUMBERS; n++) {
                mean += (double)image[n] / NUMBERS;
            }
            printf("far plane %s: %.5f, expected %.5f\n", ends[i], mean, exact[k]);
            assert_true(fabs(mean - exact[k]) < 0.01 / sqrt(sample_share()) * fabs(exact[k]));
        }
        room_close(room);
    }
}

static void test_refusals(void **state) {
    UNUSED(state);
    const rey_define particles[MOST_DEFINES] = {{"integrator", "ptracer"}};
    refused(particles, "fog.scale.value", "'ptracer' knows no participating media");
    static float image[NUMBERS];
    const float along[3] = {1, 0, 0};
    Room room = room_open("fog.xml", 1, 0);
    int bulb = rey_param_find(room.scene, "bulb.position");
    rey_render_def def = def_make(1, 0, 1);
    assert_int_not_equal(rey_jvp(room.scene, &def, (rey_selection){&bulb, 1}, along, image, NULL, NULL), REY_OK);
    assert_non_null(strstr(rey_error(room.ctx), "lies within a participating medium"));
    // Cameras move where no light is within a medium, and where one hangs free there.
    int camera;
    float shift[16] = {[3] = 1};
    room_close(room);
    room = room_open("media_tour.xml", 1, 0);
    const float within[3] = {-0.7f, 0, 0.2f};
    camera = rey_param_find(room.scene, "camera.to_world");
    ok(room, rey_jvp(room.scene, &def, (rey_selection){&camera, 1}, shift, image, NULL, NULL));
    ok(room, rey_param_set(room.scene, rey_param_find(room.scene, "bulb.position"), within, 3));
    ok(room, rey_jvp(room.scene, &def, (rey_selection){&camera, 1}, shift, image, NULL, NULL));
    room_close(room);
}

// Where media overlap, or the borders around them do not agree, the medium at a point depends on the way there, and what moves
// jumps in more places than are known. What does not move has its derivative.
static void test_overlap(void **state) {
    UNUSED(state);
    static const char *const params[] = {"second.to_world", "floor.to_world", "camera.to_world", "dense.sigma_t.value.value"};
    static float image[3 * 8 * 8];
    for (int i = 0; i < 2 * COUNT_OF(params); i++) {
        const rey_define define = {"x", i % 2 ? "0.7" : "0.1"};
        const bool moves = i / 2 < COUNT_OF(params) - 1;
        const float along[16] = {[3] = 1, [0] = moves ? 0 : 1};
        Room room;
        assert_int_equal(rey_context_create(NULL, &room.ctx), REY_OK);
        ok(room, rey_scene_load(room.ctx, RENDER_DIR "/fog_overlap.xml", &define, 1, &room.scene));
        int id = rey_param_find(room.scene, params[i / 2]);
        rey_render_def def = def_make(64, 1, 1);
        def.terms = 0;
        rey_result result = rey_jvp(room.scene, &def, (rey_selection){&id, 1}, along, image, NULL, NULL);
        if (i % 2 && moves) {
            assert_int_equal(result, REY_ERROR_INCOMPLETE);
            assert_non_null(strstr(rey_error(room.ctx), "where media overlap or their borders do not agree"));
        } else {
            ok(room, result);
        }
        room_close(room);
    }
}

// Arguments: what the names of tests begin with.
int main(int argc, char **argv) {
    struct CMUnitTest tests[] = {cmocka_unit_test(test_transmittance), cmocka_unit_test(test_single_scattering),
                                       cmocka_unit_test(test_empty),         cmocka_unit_test(test_emission),
                                       cmocka_unit_test(test_furnace),       cmocka_unit_test(test_refusals),
                                       cmocka_unit_test(test_overlap),
                                       cmocka_unit_test(test_far_plane),
                                       cmocka_unit_test(test_score),         cmocka_unit_test(test_flakes),
                                       cmocka_unit_test(test_growing_flakes), cmocka_unit_test(test_turned_flakes),
                                       cmocka_unit_test(test_borders),
                                       cmocka_unit_test(test_outline)};
    size_t count = tests_asked(tests, COUNT_OF(tests), argc, argv);
    return _cmocka_run_group_tests("fog", tests, count, NULL, NULL);
}
