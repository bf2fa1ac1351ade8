// Lights at a point within a medium, where these or surfaces beside them move: what a floor shows of the fog around a torch, and
// how that changes as the torch, the floor or a coin before it rises, against a quadrature over the fog. What the sensor sees of
// the fog itself: test_beacon_view.c.
#include "rooms.h"

enum { SEEDS = 16, SPP = 512 };
enum { ACROSS_R = 100, ACROSS_POLAR = 70, ACROSS_AZIMUTH = 48, POINTS = 4 };

// beacon_floor.xml: heights, and the radius of the coin.
typedef struct Place {
    double floor, coin, radius, light, eye;
} Place;
static const double border = -0.3, half_view = 0.36397023426620234; // tan 20 degrees
static const double beam = 25, cutoff = 75, g = 0.4, reach = 40, step = 0.01;
static const double sigma[3] = {0.5, 0.7, 0.9}, albedo[3] = {0.9, 0.8, 0.7}, intensity[3] = {8, 9, 12};
static const double reflectance[3] = {0.5, 0.6, 0.4}, pi = 3.14159265358979323846;
static const Place shaded = {-1.5, -0.5, 0.22, 0.6, -0.8}, bare = {-1.5, -0.5, 0, 0.6, -0.8};

// How far outside of the coin a point of the fog is seen from a point of the floor; polar: the angle from the light's axis.
static double outside(const Place *at, double from, double r, double polar, double azimuth) {
    double rise = at->light + r * cos(polar) - at->floor, k = (at->coin - at->floor) / rise;
    double x = from + (r * sin(polar) * cos(azimuth) - from) * k, z = r * sin(polar) * sin(azimuth) * k;
    return hypot(x, z) - at->radius;
}

// Adds what one cell of the fog brings to a point of the floor.
static void add_cell(const Place *at, double from, double u, double polar, double azimuth, double out[3]) {
    const double du = 0.5 / ACROSS_R, dp = 0.5 * cutoff / 180 * pi / ACROSS_POLAR, da = 0.5 * pi / ACROSS_AZIMUTH;
    double r = reach * u * u, edge = outside(at, from, r, polar, azimuth);
    double width = fabs(outside(at, from, reach * (u + du) * (u + du), polar, azimuth) - edge) +
                   fabs(outside(at, from, r, polar + dp, azimuth) - edge) + fabs(outside(at, from, r, polar, azimuth + da) - edge);
    double seen = at->radius > 0 ? fmin(fmax(0.5 * edge / width + 0.5, 0), 1) : 1;
    double x = r * sin(polar) * cos(azimuth) - from, z = r * sin(polar) * sin(azimuth);
    double rise = at->light + r * cos(polar) - at->floor;
    double s = sqrt(x * x + z * z + rise * rise), degrees = polar * 180 / pi;
    double scattered = -(sin(polar) * cos(azimuth) * x + sin(polar) * sin(azimuth) * z + cos(polar) * rise) / s;
    double bend = 1 + g * g - 2 * g * scattered, phase = (1 - g * g) / (4 * pi * bend * sqrt(bend));
    double falloff = fmin((cutoff - degrees) / (cutoff - beam), 1), within = s * (at->light + r * cos(polar) - border) / rise;
    // Both halves of the azimuth.
    double volume = 2 * sin(polar) * (2 * reach * u * 2 * du) * 2 * dp * 2 * da;
    double all = volume * seen * falloff * phase * rise / (s * s * s);
    for (int c = 0; c < 3; c++) {
        out[c] += all * reflectance[c] / pi * intensity[c] * albedo[c] * sigma[c] * exp(-sigma[c] * (r + within));
    }
}

static void floor_at(const Place *at, double from, double out[3]) {
    memset(out, 0, 3 * sizeof *out);
    for (int i = 0; i < ACROSS_R; i++) {
        for (int k = 0; k < ACROSS_POLAR; k++) {
            for (int j = 0; j < ACROSS_AZIMUTH; j++) {
                double polar = (k + 0.5) / ACROSS_POLAR * cutoff / 180 * pi;
                add_cell(at, from, (i + 0.5) / ACROSS_R, polar, (j + 0.5) / ACROSS_AZIMUTH * pi, out);
            }
        }
    }
}

// Mean over the picture: Gauss-Legendre over one quadrant of the square that it shows.
static void picture_of(Place at, double mean[3]) {
    static const double node[POINTS] = {0.06943184420297371, 0.33000947820757187, 0.6699905217924281, 0.9305681557970263};
    static const double weight[POINTS] = {0.17392742256872693, 0.32607257743127307, 0.32607257743127307, 0.17392742256872693};
    const double half = (at.eye - at.floor) * half_view;
    memset(mean, 0, 3 * sizeof *mean);
    for (int i = 0; i < POINTS; i++) {
        for (int k = 0; k <= i; k++) {
            double one[3];
            floor_at(&at, half * hypot(node[i], node[k]), one);
            for (int c = 0; c < 3; c++) {
                mean[c] += weight[i] * weight[k] * (i == k ? 1 : 2) * one[c];
            }
        }
    }
}

// by: what rises.
static void slope_of(Place at, Place by, double slope[3]) {
    double high[3], low[3];
    Place up = at, down = at;
    up.floor += step * by.floor, down.floor -= step * by.floor;
    up.coin += step * by.coin, down.coin -= step * by.coin;
    up.light += step * by.light, down.light -= step * by.light;
    up.eye += step * by.eye, down.eye -= step * by.eye;
    picture_of(up, high);
    picture_of(down, low);
    for (int c = 0; c < 3; c++) {
        slope[c] = (high[c] - low[c]) / (2 * step);
    }
}

static Room floor_open(const char *aside) {
    const rey_define define = {"aside", aside};
    Room room;
    assert_int_equal(rey_context_create(NULL, &room.ctx), REY_OK);
    ok(room, rey_scene_load(room.ctx, RENDER_DIR "/beacon_floor.xml", &define, 1, &room.scene));
    return room;
}

static const float rise[16] = {[7] = 1};

// Means over the picture, of seeds; name null: of the picture itself.
static void measure(const char *aside, const char *name, int spp, double mean[3], double error[3]) {
    static float image[NUMBERS];
    double square[3] = {0};
    Room room = floor_open(aside);
    int param = name ? rey_param_find(room.scene, name) : -1;
    memset(mean, 0, 3 * sizeof *mean);
    for (uint32_t seed = 1; seed <= SEEDS; seed++) {
        double one[3] = {0};
        rey_render_def def = def_make(spp, seed, 1);
        def.terms = 0;
        ok(room, name ? rey_jvp(room.scene, &def, (rey_selection){&param, 1}, rise, image, NULL, NULL)
                      : rey_render(room.scene, &def, image, NULL));
        for (int i = 0; i < NUMBERS; i++) {
            one[i % 3] += (double)image[i] * 3 / NUMBERS;
        }
        for (int c = 0; c < 3; c++) {
            mean[c] += one[c] / SEEDS;
            square[c] += one[c] * one[c] / SEEDS;
        }
    }
    for (int c = 0; c < 3; c++) {
        error[c] = sqrt(fmax(square[c] - mean[c] * mean[c], 0) / (SEEDS - 1));
    }
    room_close(room);
}

// Colours agree within so many errors, and those are small.
static void agree(const char *what, const double found[3], const double error[3], const double exact[3], double most) {
    for (int c = 0; c < 3; c++) {
        double z = normal_of_t((found[c] - exact[c]) / hypot(error[c], 2e-3 * exact[c]), SEEDS - 1);
        printf("%s %d: %.4g +- %.2g, exact %.4g, z %.1f\n", what, c, found[c], error[c], exact[c], z);
        assert_true(fabs(z) < 3.5);
        assert_true(error[c] < most / sqrt(sample_share()) * fabs(exact[c]));
    }
}

static void test_picture(void **state) {
    UNUSED(state);
    double found[3], error[3], exact[3];
    measure("0", NULL, 4 * SPP, found, error);
    picture_of(shaded, exact);
    agree("picture", found, error, exact, 0.02);
}

// How the picture changes as what `name` places rises.
static void slope_agrees(const char *aside, const char *name, int spp, Place at, double most) {
    const Place by = {strcmp(name, "floor.to_world") == 0, strcmp(name, "coin.to_world") == 0, 0,
                      strcmp(name, "torch.to_world") == 0, strcmp(name, "camera.to_world") == 0};
    double found[3], error[3], exact[3];
    measure(aside, name, spp, found, error);
    slope_of(at, by, exact);
    agree(name, found, error, exact, most);
}

// Nothing before the floor: what is scattered right beside the torch is most of how it changes.
static void test_open(void **state) {
    UNUSED(state);
    slope_agrees("50", "floor.to_world", SPP, bare, 0.06);
}

static void test_coin(void **state) {
    UNUSED(state);
    slope_agrees("0", "coin.to_world", SPP, shaded, 0.1);
}

// The coin's edge hides what moves with the torch, and what rides.
static void test_shadow(void **state) {
    UNUSED(state);
    slope_agrees("0", "floor.to_world", 16 * SPP, shaded, 0.15);
}

// What is scattered moves with the torch, beside the coin's edge, too.
static void test_torch(void **state) {
    UNUSED(state);
    slope_agrees("50", "torch.to_world", SPP, bare, 0.02);
    slope_agrees("0", "torch.to_world", SPP, shaded, 0.02);
}

static void test_camera(void **state) {
    UNUSED(state);
    slope_agrees("50", "camera.to_world", SPP, bare, 0.06);
}

// Lights that all but touch a border are not known.
static void test_refused(void **state) {
    UNUSED(state);
    static const char *const names[] = {"camera.to_world", "torch.to_world", "floor.to_world"};
    static float image[NUMBERS];
    Room room = floor_open("0");
    int torch = rey_param_find(room.scene, "torch.to_world");
    float pose[16];
    memcpy(pose, rey_param_values(room.scene, torch), sizeof pose);
    pose[7] = (float)border + 0.05f;
    ok(room, rey_param_set(room.scene, torch, pose, 16));
    for (int i = 0; i < COUNT_OF(names); i++) {
        int param = rey_param_find(room.scene, names[i]);
        rey_render_def def = def_make(16, 1, 1);
        def.terms = 0;
        assert_int_equal(rey_jvp(room.scene, &def, (rey_selection){&param, 1}, rise, image, NULL, NULL), REY_ERROR_INCOMPLETE);
        assert_non_null(strstr(rey_error(room.ctx), "does not exist yet so close to a surface"));
    }
    room_close(room);
}

int main(int argc, char **argv) {
    struct CMUnitTest tests[] = {cmocka_unit_test(test_picture), cmocka_unit_test(test_open), cmocka_unit_test(test_coin),
                                 cmocka_unit_test(test_shadow), cmocka_unit_test(test_refused),
                                 cmocka_unit_test(test_torch), cmocka_unit_test(test_camera)};
    size_t count = tests_asked(tests, COUNT_OF(tests), argc, argv);
    return _cmocka_run_group_tests("beacons", tests, count, NULL, NULL);
}
