// Integrators against each other and against closed forms.
#include "reynolds/reynolds.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

enum { SIZE = 12, NUMBERS = SIZE * SIZE * 3, SEEDS = 8, ACROSS = 3, BLOCKS = ACROSS * ACROSS * 3 };

typedef struct Room {
    rey_context *ctx;
    rey_scene *scene;
} Room;

static void ok(Room room, rey_result result) {
    if (result != REY_OK) {
        fail_msg("%s", rey_error(room.ctx));
    }
}

static Room room_open(const char *file, const rey_define *defines, int count) {
    char path[1024];
    Room room;
    snprintf(path, sizeof path, "%s/%s", RENDER_DIR, file);
    assert_int_equal(rey_context_create(NULL, &room.ctx), REY_OK);
    ok(room, rey_scene_load(room.ctx, path, defines, count, &room.scene));
    return room;
}

static void room_close(Room room) {
    rey_scene_destroy(room.scene);
    rey_context_destroy(room.ctx);
}

// Per block and channel: the mean over seeds, and its standard error.
typedef struct Blocks {
    double mean[BLOCKS], error[BLOCKS];
} Blocks;

static Blocks blocks_of(Room room, int spp) {
    static float image[NUMBERS];
    Blocks b = {{0}, {0}};
    double squares[BLOCKS] = {0};
    for (int seed = 0; seed < SEEDS; seed++) {
        rey_render_def def = rey_default_render_def();
        double sums[BLOCKS] = {0};
        def.spp = spp;
        def.seed = (uint32_t)seed;
        ok(room, rey_render(room.scene, &def, image, NULL));
        for (int i = 0; i < NUMBERS; i++) {
            int x = i / 3 % SIZE * ACROSS / SIZE, y = i / 3 / SIZE * ACROSS / SIZE;
            sums[(y * ACROSS + x) * 3 + i % 3] += (double)image[i] * ACROSS * ACROSS / (SIZE * SIZE);
        }
        for (int i = 0; i < BLOCKS; i++) {
            b.mean[i] += sums[i] / SEEDS;
            squares[i] += sums[i] * sums[i] / SEEDS;
        }
    }
    for (int i = 0; i < BLOCKS; i++) {
        b.error[i] = sqrt(fmax(0, squares[i] - b.mean[i] * b.mean[i]) / (SEEDS - 1));
    }
    return b;
}

// z-scores of all blocks: the worst and their mean square.
static void same_picture(const char *name, const Blocks *a, const Blocks *b) {
    double worst = 0, square = 0;
    for (int i = 0; i < BLOCKS; i++) {
        double error = hypot(hypot(a->error[i], b->error[i]), 2e-6 * fabs(a->mean[i]) + 1e-9);
        double z = (a->mean[i] - b->mean[i]) / error;
        worst = fmax(worst, fabs(z));
        square += z * z / BLOCKS;
    }
    print_message("%s: worst z %.2f, mean square %.2f\n", name, worst, square);
    assert_true(worst < 5.5 && square < 2.5);
}

// ---- corridor --------------------------------------------------------------------------------------------------------

enum { CORRIDOR = 8 * 8 * 3, DEPTH = 64 };

static void test_corridor(void **state) {
    (void)state;
    static const double glow[] = {1, 0.5, 2}, reflectance[] = {0.95, 0.9, 0.5};
    Room room = room_open("corridor.xml", NULL, 0);
    float image[CORRIDOR], tangent[3] = {1, 1, 1}, derivative[CORRIDOR];
    int param = rey_param_find(room.scene, "mirror.specular_reflectance.value");
    assert_true(param >= 0);
    rey_render_def def = rey_default_render_def();
    def.spp = 16;
    ok(room, rey_render(room.scene, &def, image, NULL));
    def.terms = REY_TERM_INTERIOR;
    ok(room, rey_jvp(room.scene, &def, (rey_selection){&param, 1}, tangent, derivative, NULL, NULL));
    for (int i = 0; i < CORRIDOR; i++) {
        double r = reflectance[i % 3], sum = 0, slope = 0;
        for (int k = 0; k < DEPTH; k++) {
            sum += glow[i % 3] * pow(r, k);
            slope += k > 0 ? glow[i % 3] * k * pow(r, k - 1) : 0;
        }
        assert_true(fabs((double)image[i] - sum) < 1e-4 * sum);
        assert_true(fabs((double)derivative[i] - slope) < 1e-3 * slope);
    }
    room_close(room);
}

// Roulette leaves the mean as it is.
static void test_corridor_roulette(void **state) {
    (void)state;
    rey_define roulette = {"rr_depth", "5"};
    Room room = room_open("corridor.xml", &roulette, 1);
    float image[CORRIDOR];
    rey_render_def def = rey_default_render_def();
    def.spp = 4096;
    ok(room, rey_render(room.scene, &def, image, NULL));
    double sum = 0, mean = 0;
    for (int k = 0; k < DEPTH; k++) {
        sum += pow(0.95, k);
    }
    for (int i = 0; i < CORRIDOR; i += 3) {
        mean += (double)image[i] / (CORRIDOR / 3);
    }
    // One path's standard deviation is below 20: 262144 of them are within 0.2 but for one case in 10^6.
    assert_true(fabs(mean - sum) < 0.2);
    room_close(room);
}

// ---- surfaces that let light through ---------------------------------------------------------------------------------

static void test_through(void **state) {
    (void)state;
    static const rey_define kinds[] = {{"integrator", "path"}, {"integrator", "volpath"}, {"integrator", "volpathmis"}};
    Blocks b[3];
    for (int k = 0; k < 3; k++) {
        Room room = room_open("screens.xml", &kinds[k], 1);
        b[k] = blocks_of(room, 256);
        room_close(room);
    }
    same_picture("path and volpath", &b[0], &b[1]);
    assert_memory_equal(&b[1], &b[2], sizeof b[1]);
    // With one path segment, `path` sees the light itself only where nothing is before it.
    const rey_define one[] = {{"depth", "1"}, {"integrator", "volpath"}}, four[] = {{"depth", "4"}, {"integrator", "path"}};
    Room through = room_open("screens.xml", one, 2), counted = room_open("screens.xml", four, 2);
    const rey_define two[] = {{"depth", "1"}, {"integrator", "path"}};
    Room blocked = room_open("screens.xml", two, 2);
    Blocks seen = blocks_of(through, 64), hidden = blocks_of(blocked, 64), more = blocks_of(counted, 64);
    double sums[3] = {0};
    for (int i = 0; i < BLOCKS; i++) {
        assert_true(seen.mean[i] >= hidden.mean[i] - 5 * seen.error[i]);
        sums[0] += hidden.mean[i];
        sums[1] += seen.mean[i];
        sums[2] += more.mean[i];
    }
    assert_true(sums[0] < 0.99 * sums[1] && sums[1] < sums[2]);
    room_close(through);
    room_close(counted);
    room_close(blocked);
}

static double mean_of(const float *image) {
    double sum = 0;
    for (int i = 0; i < NUMBERS; i++) {
        sum += (double)image[i] / NUMBERS;
    }
    return sum;
}

// The derivative by a screen's opacity includes what its shadow does.
static void test_through_gradient(void **state) {
    (void)state;
    static float image[NUMBERS], adjoint[NUMBERS];
    const rey_define defines[] = {{"integrator", "volpath"}, {"depth", "2"}};
    Room room = room_open("screens.xml", defines, 2);
    int param = rey_param_find(room.scene, "screen.opacity.value");
    rey_selection selection = {&param, 1};
    rey_render_def def = rey_default_render_def();
    double gradient, sets[16], means[2], spread = 0, derivative = 0;
    float one = 1;
    for (int i = 0; i < NUMBERS; i++) {
        adjoint[i] = 1.0f / NUMBERS;
    }
    def.spp = 1024;
    def.terms = REY_TERM_INTERIOR;
    ok(room, rey_vjp(room.scene, &def, selection, adjoint, &gradient, sets, NULL));
    ok(room, rey_jvp(room.scene, &def, selection, &one, image, NULL, NULL));
    derivative = mean_of(image);
    assert_true(fabs(derivative - gradient) < 1e-5 * fabs(gradient));
    for (int k = 0; k < 16; k++) {
        spread += (sets[k] - gradient) * (sets[k] - gradient) / (16 * 15);
    }
    for (int k = 0; k < 2; k++) {
        float value = k ? 0.5f : 0.3f;
        ok(room, rey_param_set(room.scene, param, &value, 1));
        ok(room, rey_render(room.scene, &def, image, NULL));
        means[k] = mean_of(image);
    }
    // With two segments no light passes the screen twice on its way but straight: quadratic, so that this is exact.
    double difference = (means[1] - means[0]) / 0.2;
    print_message("opacity: %.6f +- %.6f, difference %.6f\n", gradient, sqrt(spread), difference);
    assert_true(fabs(gradient - difference) < 5 * sqrt(spread) + 0.01 * fabs(difference));
    assert_true(fabs(gradient) > 0.02);
    // An opaque screen: the light that the shadow rays would find behind it still counts.
    one = 1;
    ok(room, rey_param_set(room.scene, param, &one, 1));
    ok(room, rey_vjp(room.scene, &def, selection, adjoint, &gradient, NULL, NULL));
    float low = 0.9f;
    ok(room, rey_render(room.scene, &def, image, NULL));
    means[1] = mean_of(image);
    ok(room, rey_param_set(room.scene, param, &low, 1));
    ok(room, rey_render(room.scene, &def, image, NULL));
    means[0] = mean_of(image);
    low = 0.95f;
    ok(room, rey_param_set(room.scene, param, &low, 1));
    ok(room, rey_render(room.scene, &def, image, NULL));
    difference = (3 * means[1] - 4 * mean_of(image) + means[0]) / 0.1;
    print_message("opaque: %.6f, difference %.6f\n", gradient, difference);
    assert_true(fabs(gradient - difference) < 0.05 * fabs(difference));
    room_close(room);
}

// ---- split sample counts ---------------------------------------------------------------------------------------------

static void test_split(void **state) {
    (void)state;
    static const struct {
        const char *light, *scatter, *mirror;
    } cases[] = {{"1", "1", "conductor"}, {"4", "1", "conductor"}, {"1", "4", "conductor"}, {"2", "3", "conductor"},
                 {"1", "1", "diffuse"},   {"3", "0", "diffuse"}};
    Blocks b[6];
    double slope[6];
    for (int k = 0; k < 6; k++) {
        static float derivative[NUMBERS];
        const rey_define defines[] = {{"emitter_samples", cases[k].light}, {"bsdf_samples", cases[k].scatter},
                                      {"mirror", cases[k].mirror}};
        Room room = room_open("trio.xml", defines, 3);
        rey_render_def def = rey_default_render_def();
        rey_stats stats;
        int param = rey_param_find(room.scene, "wall.reflectance.value");
        float tangent[3] = {1, 1, 1};
        b[k] = blocks_of(room, 128);
        def.spp = 160;
        ok(room, rey_jvp(room.scene, &def, (rey_selection){&param, 1}, tangent, derivative, NULL, &stats));
        int most = cases[k].light[0] > cases[k].scatter[0] ? cases[k].light[0] : cases[k].scatter[0];
        assert_int_equal(stats.paths, (int64_t)SIZE * SIZE * 160 * (most - '0'));
        slope[k] = mean_of(derivative);
        room_close(room);
    }
    for (int k = 1; k < 4; k++) {
        same_picture("split samples", &b[0], &b[k]);
        assert_true(fabs(slope[k] - slope[0]) < 0.02 * slope[0]);
    }
    same_picture("lights alone", &b[4], &b[5]);
    assert_true(fabs(slope[5] - slope[4]) < 0.03 * slope[4]);
}

// ---- channels --------------------------------------------------------------------------------------------------------

static int channel(Room room, const char *name) {
    for (int i = 0; i < rey_channel_count(room.scene); i++) {
        if (strcmp(rey_channel_name(room.scene, i), name) == 0) {
            return i;
        }
    }
    fail_msg("there is no channel %s", name);
    return -1;
}

static void near(const char *what, int x, int y, double found, double expected, double tolerance) {
    if (!(fabs(found - expected) <= tolerance)) {
        fail_msg("%s at pixel %d, %d: %g, expected %g", what, x, y, found, expected);
    }
}

enum { CHANNELS = 3 + 4 + 1 + 3 + 2 + 3 + 3 + 3 + 3 + 2 + 2 + 1 + 1 + 3, LAYER_SPP = 64 };

// The wall's quantities at a pixel that it fills. With n = (0, sin 30, cos 30) its plane is n . p = 0.
static void check_wall(Room room, const float *pixel, int x, int y) {
    double sine = 0.5, cosine = sqrt(0.75), t = tan(20 * 3.14159265358979 / 180), size = 2.0 / SIZE * t;
    double dx = (2 * (x + 0.5) / SIZE - 1) * t, dy = (1 - 2 * (y + 0.5) / SIZE) * t; // of a ray of depth 1
    double depth = 4 * cosine / (cosine - sine * dy), px = dx * depth, py = dy * depth, pz = 4 - depth;
    double slant = sqrt(1 + dx * dx + dy * dy);
    struct {
        const char *name;
        double expected, tolerance;
    } rows[] = {
        {"dd.T", (depth - 0.01) * slant, 0.01}, {"pp.X", px, 0.01}, {"pp.Y", py, 0.01}, {"pp.Z", pz, 0.01},
        {"ng.X", 0, 1e-5}, {"ng.Y", sine, 1e-5}, {"ng.Z", cosine, 1e-5}, {"ns.X", 0, 1e-5}, {"ns.Y", sine, 1e-5},
        {"ns.Z", cosine, 1e-5}, {"tu.X", 6, 1e-4}, {"tu.Y", 0, 1e-4}, {"tu.Z", 0, 1e-4}, {"tv.X", 0, 1e-4},
        {"tv.Y", 6 * cosine, 1e-4}, {"tv.Z", -6 * sine, 1e-4}, {"uv.U", px / 6, 0.002},
        {"uv.V", (py * cosine - pz * sine) / 6 + 0.5, 0.002}, {"ux.U", size * depth / 6 / sqrt(LAYER_SPP), 1.2e-4},
        {"ux.V", 0, 1e-6}, {"sh.I", 1, 1e-6}, {"al.R", 0.2, 1e-6}, {"al.G", 0.4, 1e-6}, {"al.B", 0.6, 1e-6},
        {"img.A", 1, 1e-6},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        near(rows[i].name, x, y, (double)pixel[channel(room, rows[i].name)], rows[i].expected, rows[i].tolerance);
    }
    // One pixel down moves v by what the neighbouring centre's v differs, to second order.
    double below = dy - size, next = 4 * cosine / (cosine - sine * below);
    double slope = ((below * next - py) * cosine - (4 - next - pz) * sine) / 6 / sqrt(LAYER_SPP);
    near("uy.V", x, y, (double)pixel[channel(room, "uy.V")], slope, 0.1 * fabs(slope));
}

static void test_layers(void **state) {
    (void)state;
    static float image[NUMBERS / 3 * CHANNELS], colour[NUMBERS];
    for (int hidden = 0; hidden < 2; hidden++) {
        rey_define define = {"hide", hidden ? "true" : "false"};
        Room room = room_open("layers_of.xml", &define, 1);
        rey_render_def def = rey_default_render_def();
        rey_stats stats;
        def.spp = LAYER_SPP;
        assert_int_equal(rey_channel_count(room.scene), CHANNELS);
        assert_null(rey_channel_name(room.scene, CHANNELS));
        assert_string_equal(rey_channel_name(room.scene, 2), "B");
        ok(room, rey_render_channels(room.scene, &def, image, &stats));
        assert_int_equal(stats.nonfinite, 0);
        ok(room, rey_render(room.scene, &def, colour, NULL));
        for (int i = 0; i < NUMBERS / 3; i++) {
            assert_memory_equal(image + i * CHANNELS, colour + 3 * i, 3 * sizeof *colour);
            assert_memory_equal(image + i * CHANNELS, image + i * CHANNELS + channel(room, "img.R"), 3 * sizeof *colour);
        }
        check_wall(room, image + (2 * SIZE + 9) * CHANNELS, 9, 2);
        check_wall(room, image + (8 * SIZE + 10) * CHANNELS, 10, 8);
        // The lamp: hidden in colour and alpha, a surface to the others.
        const float *lamp = image + (3 * SIZE + 3) * CHANNELS, *nothing = image + 11 * SIZE * CHANNELS;
        near("sh.I", 3, 3, (double)lamp[channel(room, "sh.I")], 2, 1e-6);
        near("img.A", 3, 3, (double)lamp[channel(room, "img.A")], hidden ? 0 : 1, 1e-6);
        near("R", 3, 3, (double)lamp[0], hidden ? 0 : 3, 1e-6);
        for (int c = 0; c < CHANNELS; c++) {
            near(rey_channel_name(room.scene, c), 0, 11, (double)nothing[c], 0, 0);
        }
        room_close(room);
    }
}

static rey_scene *load_text(rey_context *ctx, const char *integrator, const char *rest) {
    char path[64];
    rey_scene *scene;
    snprintf(path, sizeof path, "/tmp/reynolds_channels_%ld.xml", (long)getpid());
    FILE *f = fopen(path, "w");
    assert_non_null(f);
    fprintf(f,
            "<scene version='3.0.0'>%s<sensor type='perspective'><film type='hdrfilm'><integer name='width' value='4'/>"
            "<integer name='height' value='4'/></film></sensor>%s</scene>",
            integrator, rest);
    assert_int_equal(fclose(f), 0);
    rey_result result = rey_scene_load(ctx, path, NULL, 0, &scene);
    unlink(path);
    if (result) {
        fail_msg("%s", rey_error(ctx));
    }
    return scene;
}

// Half of the light of a random sky passes: the second moment is what a coin says.
static void test_moments(void **state) {
    (void)state;
    rey_context *ctx;
    assert_int_equal(rey_context_create(NULL, &ctx), REY_OK);
    rey_scene *scene = load_text(ctx, "<integrator type='moment'><integrator type='path'/></integrator>",
                                 "<shape type='rectangle'><transform name='to_world'><scale value='50'/>"
                                 "<translate z='1'/></transform><bsdf type='mask'><float name='opacity' value='0.5'/>"
                                 "<bsdf type='diffuse'><rgb name='reflectance' value='0 0 0'/></bsdf></bsdf></shape>"
                                 "<emitter type='constant'><rgb name='radiance' value='2 1 0.5'/></emitter>");
    static const double rgb[] = {2, 1, 0.5};
    static const double rows[3][3] = {
        {0.412453, 0.357580, 0.180423}, {0.212671, 0.715160, 0.072169}, {0.019334, 0.119193, 0.950227}};
    float image[4 * 4 * 9];
    rey_render_def def = rey_default_render_def();
    def.spp = 4096;
    assert_int_equal(rey_channel_count(scene), 9);
    assert_string_equal(rey_channel_name(scene, 3), "_arg_0.X");
    assert_string_equal(rey_channel_name(scene, 8), "m2__arg_0.Z");
    assert_int_equal(rey_render_channels(scene, &def, image, NULL), REY_OK);
    for (int i = 0; i < 16; i++) {
        for (int c = 0; c < 3; c++) {
            double xyz = rows[c][0] * rgb[0] + rows[c][1] * rgb[1] + rows[c][2] * rgb[2];
            near("mean", i % 4, i / 4, (double)image[9 * i + c], 0.5 * rgb[c], 0.02 * rgb[c]);
            near("mean XYZ", i % 4, i / 4, (double)image[9 * i + 3 + c], 0.5 * xyz, 0.02 * xyz);
            near("second moment", i % 4, i / 4, (double)image[9 * i + 6 + c], 0.5 * xyz * xyz, 0.02 * xyz * xyz);
        }
    }
    rey_scene_destroy(scene);
    rey_context_destroy(ctx);
}

static void test_depth(void **state) {
    (void)state;
    rey_context *ctx;
    assert_int_equal(rey_context_create(NULL, &ctx), REY_OK);
    rey_scene *scene = load_text(ctx, "<integrator type='depth'/>",
                                 "<shape type='rectangle'><transform name='to_world'><scale value='50'/>"
                                 "<rotate y='1' angle='180'/><translate z='3'/></transform></shape>");
    float image[4 * 4 * 3];
    double gradient[3];
    int param = rey_param_find(scene, "shape_0.bsdf.reflectance.value");
    rey_render_def def = rey_default_render_def();
    def.spp = 64;
    assert_int_equal(rey_channel_count(scene), 3);
    assert_int_equal(rey_render(scene, &def, image, NULL), REY_OK);
    for (int i = 0; i < 48; i++) {
        assert_true(image[i] > 2.99f && image[i] < 3.6f && image[i] == image[i / 3 * 3]);
    }
    near("depth", 1, 1, (double)image[15], 2.99 * sqrt(1 + 2 * pow(0.25 * tan(0.3), 2)), 0.1);
    assert_int_equal(rey_vjp(scene, &def, (rey_selection){&param, 1}, image, gradient, NULL, NULL), REY_ERROR_UNSUPPORTED);
    assert_non_null(strstr(rey_error(ctx), "'depth' has no derivatives"));
    rey_scene_destroy(scene);
    rey_context_destroy(ctx);
}

// A sky that is hidden from the camera is hidden behind surfaces that are not there, too; and lights what is.
static void test_hidden_sky(void **state) {
    static const char *const shapes[] = {
        "<bsdf type='null'/>", "<bsdf type='mask'><float name='opacity' value='0'/><bsdf type='diffuse'/></bsdf>", ""};
    (void)state;
    for (int i = 0; i < 3; i++) {
        char rest[512];
        rey_context *ctx;
        float image[4 * 4 * 3];
        rey_render_def def = rey_default_render_def();
        def.spp = 64;
        snprintf(rest, sizeof rest, "<emitter type='constant'/><shape type='sphere'><float name='radius' value='9'/>%s"
                                    "<boolean name='flip_normals' value='true'/></shape>", shapes[i]);
        assert_int_equal(rey_context_create(NULL, &ctx), REY_OK);
        rey_scene *scene = load_text(ctx, "<integrator type='path'><boolean name='hide_emitters' value='true'/></integrator>",
                                     i < 2 ? rest : "<emitter type='constant'/><shape type='rectangle'><transform "
                                                    "name='to_world'><scale value='50'/><rotate y='1' angle='180'/>"
                                                    "<translate z='3'/></transform></shape>");
        assert_int_equal(rey_render(scene, &def, image, NULL), REY_OK);
        for (int k = 0; k < 48; k++) {
            assert_true(i < 2 ? image[k] <= 0 : image[k] > 0.4f);
        }
        rey_scene_destroy(scene);
        rey_context_destroy(ctx);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_corridor), cmocka_unit_test(test_corridor_roulette),
                                       cmocka_unit_test(test_through), cmocka_unit_test(test_through_gradient),
                                       cmocka_unit_test(test_split),            cmocka_unit_test(test_layers),
                                       cmocka_unit_test(test_moments),          cmocka_unit_test(test_depth),
                                       cmocka_unit_test(test_hidden_sky)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
