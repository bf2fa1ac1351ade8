// A bulb in a fog that the sensor looks at from outside: how each pixel changes as the bulb moves, and the sensor, against a
// quadrature.
#include "rooms.h"

enum { SEEDS = 16, SPP = 2048, WIDTH = 3, HEIGHT = 2, VALUES = WIDTH * HEIGHT * 3 };
enum { POINTS = 12, PANELS = 7 };

static const double pi = 3.14159265358979323846, g = 0.4, step = 1e-3;
static const double sigma[3] = {0.3, 0.5, 0.8}, albedo[3] = {0.9, 0.8, 0.7}, intensity[3] = {3, 4, 5};

// beacon_view.xml: the bulb as the sensor has it, which looks along z, where the fog begins, and the tangent of half its view.
typedef struct View {
    double bulb[3], border, tangent;
    bool tent;
} View;
static const View still = {{0.42, 0.14, 1.8}, 0.7, 0.46630765815499858, false};

// Nodes and weights of Gauss and Legendre on [0, 1], by Newton's method.
static double node[POINTS], weight[POINTS];
static void find_nodes(void) {
    for (int i = 0; i < POINTS; i++) {
        double x = cos(pi * (i + 0.75) / (POINTS + 0.5)), slope = 1;
        for (int k = 0; k < 50; k++) {
            double p = 1, before = 0;
            for (int j = 1; j <= POINTS; j++) {
                double next = ((2 * j - 1) * x * p - (j - 1) * before) / j;
                before = p, p = next;
            }
            slope = POINTS * (x * p - before) / (x * x - 1);
            x -= p / slope;
        }
        node[i] = 0.5 * (1 - x);
        weight[i] = 1 / ((1 - x * x) * slope * slope);
    }
}

// What the fog scatters along the ray of a position on the film, times its distance from the bulb: by the angle at the bulb.
static void radiance_at(const View *v, double x, double y, double out[3]) {
    double d[3] = {(1 - 2 * x / WIDTH) * v->tangent, (1 - 2 * y / HEIGHT) * v->tangent * HEIGHT / WIDTH, 1}, along = 0, apart2 = 0;
    double length = sqrt(d[0] * d[0] + d[1] * d[1] + 1);
    for (int k = 0; k < 3; k++) {
        d[k] /= length;
        along += d[k] * v->bulb[k];
    }
    for (int k = 0; k < 3; k++) {
        double q = v->bulb[k] - along * d[k];
        apart2 += q * q;
    }
    along -= v->border * length; // the rest of the ray begins there
    double apart = sqrt(apart2), first = -atan2(along, apart);
    memset(out, 0, 3 * sizeof *out);
    for (int i = 0; i < PANELS * POINTS; i++) { // the closer to where it ends the narrower
        double far = ldexp(0.5 * pi - first, -(i / POINTS)), wide = i / POINTS + 1 < PANELS ? 0.5 * far : far;
        double angle = 0.5 * pi - far + node[i % POINTS] * wide;
        double bend = 1 + g * g + 2 * g * sin(angle), way = along + apart * tan(angle) + apart / cos(angle);
        for (int c = 0; c < 3; c++) {
            out[c] += weight[i % POINTS] * wide * albedo[c] * sigma[c] * intensity[c] * exp(-sigma[c] * way) * (1 - g * g) /
                      (4 * pi * bend * sqrt(bend));
        }
    }
    for (int c = 0; c < 3; c++) {
        out[c] /= apart;
    }
}

// Weight in a pixel, along one axis, as it goes on from a cell whose middle is given: within cells filters have no kinks, and the
// triangles below reach out of them.
static double filter_at(const View *v, double x, double middle, int pixel) {
    double away = middle - pixel - 0.5;
    if (!v->tent) {
        return fabs(away) < 0.5;
    }
    return fabs(away) < 1 ? 1 - (away < 0 ? -1 : 1) * (x - pixel - 0.5) : 0;
}

// Adds what a cell of the film brings to the pixels: in triangles from where the bulb is seen, towards which radiance goes with one
// over the distance.
static void add_cell(const View *v, const double corner[4][2], const double at[2], double picture[VALUES], double norm[]) {
    const double middle[2] = {0.5 * (corner[0][0] + corner[2][0]), 0.5 * (corner[0][1] + corner[2][1])};
    for (int e = 0; e < 4; e++) {
        const double *a = corner[e], *b = corner[(e + 1) % 4];
        double twice = (a[0] - at[0]) * (b[1] - at[1]) - (a[1] - at[1]) * (b[0] - at[0]);
        for (int i = 0; i < POINTS * POINTS; i++) {
            double root = node[i / POINTS], u = root * root, t = node[i % POINTS], one[3]; // radiance goes with u log u
            double share = weight[i / POINTS] * 2 * root * weight[i % POINTS] * u * twice;
            double x = at[0] + u * (a[0] + t * (b[0] - a[0]) - at[0]), y = at[1] + u * (a[1] + t * (b[1] - a[1]) - at[1]);
            radiance_at(v, x, y, one);
            for (int p = 0; p < WIDTH * HEIGHT; p++) {
                double f = filter_at(v, x, middle[0], p % WIDTH) * filter_at(v, y, middle[1], p / WIDTH);
                norm[p] += share * f;
                for (int c = 0; c < 3; c++) {
                    picture[3 * p + c] += share * f * one[c];
                }
            }
        }
    }
}

static void picture_of(const View *v, double picture[VALUES]) {
    double norm[VALUES / 3] = {0};
    const double at[2] = {WIDTH * 0.5 * (1 - v->bulb[0] / v->bulb[2] / v->tangent),
                          HEIGHT * 0.5 * (1 - v->bulb[1] / v->bulb[2] / v->tangent * WIDTH / HEIGHT)};
    memset(picture, 0, VALUES * sizeof *picture);
    for (int i = 0; i < 4 * WIDTH * HEIGHT; i++) {
        double x = 0.5 * (i % (2 * WIDTH)), y = 0.5 * (i / (2 * WIDTH));
        const double corner[4][2] = {{x, y}, {x + 0.5, y}, {x + 0.5, y + 0.5}, {x, y + 0.5}};
        add_cell(v, corner, at, picture, norm);
    }
    for (int i = 0; i < VALUES; i++) {
        picture[i] /= norm[i / 3];
    }
}

// What moves: the bulb as the sensor sees it, the fog, and degrees of its view.
typedef struct Motion {
    const char *name;
    float along[16];
    double bulb[3], border, fov;
} Motion;

static void slope_of(View v, const Motion *m, double slope[VALUES]) {
    double high[VALUES], low[VALUES];
    View up = v, down = v;
    for (int k = 0; k < 3; k++) {
        up.bulb[k] += step * m->bulb[k], down.bulb[k] -= step * m->bulb[k];
    }
    up.border += step * m->border, down.border -= step * m->border;
    up.tangent = tan(atan(v.tangent) + step * m->fov * pi / 360);
    down.tangent = tan(atan(v.tangent) - step * m->fov * pi / 360);
    picture_of(&up, high);
    picture_of(&down, low);
    for (int i = 0; i < VALUES; i++) {
        slope[i] = (high[i] - low[i]) / (2 * step);
    }
}

// Of the picture, or where m is not null, of its derivative in forward mode: all values. Reverse mode must bring their sum, weighed
// as `worth` says.
static void measure(Room room, const Motion *m, int spp, const float worth[VALUES], double mean[VALUES], double error[VALUES]) {
    double square[VALUES] = {0};
    int param = m ? rey_param_find(room.scene, m->name) : 0;
    assert_true(param >= 0);
    memset(mean, 0, VALUES * sizeof *mean);
    for (uint32_t seed = 1; seed <= SEEDS; seed++) {
        float image[VALUES];
        double gradient[16] = {0}, forward = 0, reverse = 0, size = 0;
        const rey_selection selection = {&param, 1};
        rey_render_def def = def_make(spp, seed, 1);
        def.terms = 0;
        ok(room, m ? rey_jvp(room.scene, &def, selection, m->along, image, NULL, NULL) : rey_render(room.scene, &def, image, NULL));
        for (int i = 0; i < VALUES; i++) {
            mean[i] += (double)image[i] / SEEDS;
            square[i] += (double)image[i] * (double)image[i] / SEEDS;
            forward += (double)image[i] * (double)worth[i];
            size += fabs((double)image[i] * (double)worth[i]);
        }
        if (m) {
            ok(room, rey_vjp(room.scene, &def, selection, worth, gradient, NULL, NULL));
            for (int i = 0; i < 16; i++) {
                reverse += gradient[i] * (double)m->along[i];
            }
            assert_true(fabs(forward - reverse) < 1e-4 * size);
        }
    }
    for (int i = 0; i < VALUES; i++) {
        error[i] = sqrt(fmax(square[i] - mean[i] * mean[i], 0) / (SEEDS - 1));
    }
}

// m null: the picture.
static void check(const char *kind, const char *filter, const Motion *m) {
    const rey_define defines[] = {{"filter", filter}, {"kind", kind}};
    const double slack = m ? 1e-3 : 3e-4; // of the quadrature
    double found[VALUES], error[VALUES], exact[VALUES], all = 0, noise = 0, sum = 0;
    float worth[VALUES];
    uint64_t random = 7;
    View v = still;
    Room room;
    v.tent = strcmp(filter, "tent") == 0;
    find_nodes();
    if (m) {
        slope_of(v, m, exact);
    } else {
        picture_of(&v, exact);
    }
    for (int i = 0; i < VALUES; i++) {
        worth[i] = (float)(uniform(&random) - 0.3);
    }
    assert_int_equal(rey_context_create(NULL, &room.ctx), REY_OK);
    ok(room, rey_scene_load(room.ctx, RENDER_DIR "/beacon_view.xml", defines, 2, &room.scene));
    const bool tracked = strcmp(kind, "heterogeneous") == 0; // such flights do not know their density
    measure(room, m, m ? (tracked ? 3 : 1) * SPP : 16 * SPP, worth, found, error);
    for (int i = 0; i < VALUES; i++) {
        double z = normal_of_t((found[i] - exact[i]) / hypot(error[i], slack * exact[i]), SEEDS - 1);
        printf("%s %s %s %d: %.4g +- %.2g, exact %.4g, z %.1f\n", kind, filter, m ? m->name : "picture", i, found[i],
               error[i], exact[i], z);
        assert_true(fabs(z) < 4);
        all += exact[i] * exact[i];
        noise += error[i] * error[i];
        sum += z;
    }
    printf("noise %.2f %%, sum of z %.1f\n", 100 * sqrt(noise / all), sum / sqrt(VALUES));
    assert_true(sqrt(noise / all) < 0.03 / sqrt(sample_share()));
    room_close(room);
}

static const Motion bulb = {"bulb.position", {1, 0.3f, 0.2f}, {1, 0.3, 0.2}, 0, 0};
static const Motion camera = {"camera.to_world", {[3] = 1, [7] = 0.3f, [11] = 0.2f}, {-1, -0.3, -0.2}, -0.2, 0};
static const Motion fov = {"camera.x_fov", {20}, {0, 0, 0}, 0, 20};

static void test_box(void **state) {
    UNUSED(state);
    check("homogeneous", "box", NULL);
    check("homogeneous", "box", &bulb);
}

static void test_tent(void **state) {
    UNUSED(state);
    check("homogeneous", "tent", &camera);
    check("homogeneous", "tent", &fov);
}

static void test_tracked(void **state) {
    UNUSED(state);
    check("heterogeneous", "box", NULL);
    check("heterogeneous", "box", &bulb);
    check("heterogeneous", "tent", &camera);
}

int main(int argc, char **argv) {
    struct CMUnitTest tests[] = {cmocka_unit_test(test_box), cmocka_unit_test(test_tent), cmocka_unit_test(test_tracked)};
    size_t count = tests_asked(tests, COUNT_OF(tests), argc, argv);
    return _cmocka_run_group_tests("beacon view", tests, count, NULL, NULL);
}
