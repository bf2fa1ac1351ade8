// Grids that move over points of the world, in double: the adjoint of their values at a fixed point in every entry of the pose and
// in every voxel, and their slope where the point moves, against central differences; of numbers, colours and matrices.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#define REAL_DOUBLE
#define LANES 1
#define float double
#include "medium/phase.h"

enum { ACROSS = 3, VOXELS = ACROSS * ACROSS * ACROSS, MOST = 6 * VOXELS, POSE = MOST, NUMBERS = MOST + 12, ROUNDS = 40 };

typedef struct World {
    SceneView scene;
    VolumeNode volume;
    TextureNode texture;
    PhaseNode phase;
    double theta[NUMBERS], tables[12];
} World;

static double uniform(uint64_t *state) {
    uint64_t z = (*state += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return (double)((z ^ (z >> 31)) >> 11) * 0x1p-52 - 1;
}

static Vec3 random_vector(uint64_t *random) { return v3(uniform(random), uniform(random), uniform(random)); }

// The rows of the pose's inverse.
static void follow(World *w) {
    const double *m = w->theta + POSE;
    Vec3 x = {m[0], m[4], m[8]}, y = {m[1], m[5], m[9]}, z = {m[2], m[6], m[10]}, t = {m[3], m[7], m[11]};
    double det = v3_dot(x, v3_cross(y, z));
    const Vec3 rows[3] = {v3_cross(y, z), v3_cross(z, x), v3_cross(x, y)};
    for (int k = 0; k < 3; k++) {
        Vec3 row = v3_scale(rows[k], 1 / det);
        memcpy(w->tables + 4 * k, (double[4]){row.x, row.y, row.z, -v3_dot(row, t)}, 4 * sizeof *w->tables);
    }
}

static void world_make(World *w, int32_t channels, uint64_t *random) {
    memset(w, 0, sizeof *w);
    for (int i = 0; i < NUMBERS; i++) {
        w->theta[i] = uniform(random) + (i >= POSE && (i - POSE) % 5 == 0 ? 2 : 0);
    }
    w->volume = (VolumeNode){.kind = VOLUME_GRID, .channels = channels, .nx = ACROSS, .ny = ACROSS, .nz = ACROSS,
                             .filter = FILTER_BILINEAR, .wrap = WRAP_CLAMP, .to_world = POSE};
    w->texture = (TextureNode){.kind = TEXTURE_VOLUME};
    follow(w);
}

static void world_link(World *w) {
    w->scene = (SceneView){.theta = w->theta, .tables = w->tables, .volumes = &w->volume, .textures = &w->texture,
                           .phases = &w->phase};
}

// A point of the world between eight voxels, away from where the slope jumps.
static Vec3 point_make(const World *w, uint64_t *random) {
    const double *m = w->theta + POSE;
    double q[3];
    for (int k = 0; k < 3; k++) {
        q[k] = (1 + 0.3 * uniform(random) + (uniform(random) > 0 ? 1 : 0)) / ACROSS;
    }
    return v3(m[0] * q[0] + m[1] * q[1] + m[2] * q[2] + m[3], m[4] * q[0] + m[5] * q[1] + m[6] * q[2] + m[7],
              m[8] * q[0] + m[9] * q[1] + m[10] * q[2] + m[11]);
}

// What the value at a point of the world is worth, d per channel.
static double worth(World *w, Vec3 p, const double *d) {
    double values[6], sum = 0;
    world_link(w);
    Vec3 q = volume_to_local(&w->scene, &w->volume, p, 1);
    if (w->volume.channels == 6) {
        gridvolume_eval_six(&w->scene, &w->volume, q, values);
        for (int i = 0; i < 6; i++) {
            sum += d[i] * values[i];
        }
        return sum;
    }
    return spec_dot((Spec){{d[0], d[1], d[2]}}, volume_eval(&w->scene, &w->volume, q));
}

static void assert_near(const char *what, double found, double expected) {
    if (!(fabs(found - expected) <= 1e-6 * (1 + fabs(expected)))) {
        fail_msg("%s: derivative %.9g, expected %.9g", what, found, expected);
    }
}

static void gradient_of(World *w, Vec3 p, const double *d, double *gradient) {
    const int32_t values_at = 0, pose_at = POSE;
    Sink sink = {.gradient = gradient, .texture_at = &values_at, .volume_at = &pose_at, .any_volumes = true};
    world_link(w);
    if (w->volume.channels == 6) {
        Hit hit = {.p = p};
        PhaseCall call = {.scene = &w->scene, .at = {.hit = &hit}};
        PhaseMatrix matrix;
        memcpy(matrix.m, d, sizeof matrix.m);
        phase_scatter_MATRIX(&call, 0, matrix, &sink, m_set(true));
    } else {
        volume_world_adj(&w->scene, &w->volume, p, (Spec){{d[0], d[1], d[2]}}, &sink, m_set(true));
    }
}

static void test_pose(void **state) {
    (void)state;
    uint64_t random = 1;
    for (int round = 0; round < ROUNDS; round++) {
        static const int32_t channels[] = {1, 3, 6};
        const double h = 1e-6;
        World w;
        world_make(&w, channels[round % 3], &random);
        Vec3 p = point_make(&w, &random), way = random_vector(&random);
        double d[6], gradient[NUMBERS] = {0};
        for (int i = 0; i < 6; i++) {
            d[i] = uniform(&random);
        }
        gradient_of(&w, p, d, gradient);
        for (int i = 0; i < NUMBERS; i++) {
            double start = w.theta[i], difference = 0;
            for (int side = -1; side <= 1; side += 2) {
                w.theta[i] = start + side * h;
                follow(&w);
                difference += side * worth(&w, p, d) / (2 * h);
            }
            w.theta[i] = start;
            follow(&w);
            assert_near(i < POSE ? "voxel" : "pose", gradient[i], difference);
        }
        if (w.volume.channels < 6) {
            w.volume.table = round % 4 ? 0 : -1; // the unit cube of the world itself
            p = round % 4 ? p : volume_to_local(&w.scene, &(VolumeNode){.table = 0}, p, 1);
            Vec3 slope = volume_slope(&w.scene, &w.volume, p, (Spec){{d[0], d[1], d[2]}});
            double ahead = worth(&w, v3_madd(p, h, way), d), behind = worth(&w, v3_madd(p, -h, way), d);
            assert_near("slope", v3_dot(slope, way), (ahead - behind) / (2 * h));
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_pose)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
