// The adjoints of sensors' rays in double: where a ray gets to at a fixed distance, and its direction, against central
// differences in every entry of the pose and in all numbers of the sensor.
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
#include "sensor/sensor.h"

enum { POSE, FOV = 16, PRINCIPAL = 17, LENS = 19, NUMBERS = 21 };

// Where the sink keeps what; number 20 is the focus distance.
static const int32_t camera_at[CAMERA_NUMBERS] = {POSE, FOV, PRINCIPAL, PRINCIPAL + 1, LENS, LENS + 1};

static double uniform(uint64_t *state) {
    uint64_t z = (*state += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return (double)((z ^ (z >> 31)) >> 11) * 0x1p-52 - 1;
}

static Vec3 random_vector(uint64_t *random) { return v3(uniform(random), uniform(random), uniform(random)); }

// A sensor, a place on its film and on its lens, and how far its ray is followed.
typedef struct View {
    SensorRecord sensor;
    double theta[NUMBERS], x, y, distance;
    Vec2 lens;
} View;

static View view_make(int32_t kind, uint64_t *random) {
    View v = {.sensor = {.kind = kind, .to_world = POSE, .fov = FOV, .principal = PRINCIPAL, .lens = LENS, .width = 32,
                         .height = 20, .far_clip = 100}};
    for (int i = 0; i < 12; i++) { // scales and shears too
        v.theta[i] = uniform(random) + (i % 5 == 0 ? 2 : 0);
    }
    v.sensor.near_clip = kind == SENSOR_ORTHOGRAPHIC ? 0.3 : 0; // other rays begin where the sensor is
    v.theta[FOV] = 50 + 20 * uniform(random);
    v.theta[PRINCIPAL] = 0.2 * uniform(random);
    v.theta[PRINCIPAL + 1] = 0.2 * uniform(random);
    v.theta[LENS] = 0.3 + 0.1 * uniform(random);
    v.theta[LENS + 1] = 3 + uniform(random);
    v.x = 16 + 15 * uniform(random);
    v.y = 10 + 9 * uniform(random);
    v.lens = (Vec2){0.5 + 0.5 * uniform(random), 0.5 + 0.5 * uniform(random)};
    v.distance = 4 + 2 * uniform(random);
    return v;
}

static Ray ray_of(const View *v) {
    SceneView scene = {.theta = (double *)(uintptr_t)v->theta};
    return single_sensor_ray(&scene, &v->sensor, v->x, v->y, v->lens).ray;
}

static double worth(const View *v, const RayAdj *d) {
    Ray ray = ray_of(v);
    return v3_dot(d->position, v3_madd(ray.o, v->distance, ray.d)) + v3_dot(d->direction, ray.d);
}

static void test_kind(void **state) {
    const int32_t kind = *(const int32_t *)*state;
    uint64_t random = (uint64_t)kind + 1;
    double size[NUMBERS] = {0};
    for (int round = 0; round < 40; round++) {
        View v = view_make(kind, &random);
        SceneView scene = {.theta = v.theta};
        double gradient[NUMBERS] = {0};
        Sink sink = {.gradient = gradient, .camera_at = camera_at};
        Ray ray = ray_of(&v);
        RayAdj d = {v3_madd(ray.o, v.distance, ray.d), random_vector(&random), random_vector(&random)};
        sensor_ray_adj(&scene, &v.sensor, v.x, v.y, v.lens, &d, &sink, m_set(true));
        for (int i = 0; i < NUMBERS; i++) {
            const double h = 1e-5;
            double difference = 0;
            for (int side = -1; side <= 1; side += 2) {
                View moved = v;
                moved.theta[i] += side * h;
                difference += side * worth(&moved, &d) / (2 * h);
            }
            size[i] += fabs(difference);
            if (fabs(difference - gradient[i]) > 1e-7 * (1 + fabs(difference))) {
                fail_msg("number %d has derivative %.9g, expected %.9g", i, gradient[i], difference);
            }
        }
    }
    assert_true(size[3] > 1 && size[7] > 1 && size[11] > 1);
    assert_true((size[FOV] > 0) == (kind == SENSOR_PERSPECTIVE || kind == SENSOR_THINLENS));
    assert_true((size[LENS] > 0) == (kind == SENSOR_THINLENS));
}

int main(void) {
    static const int32_t kinds[] = {SENSOR_PERSPECTIVE, SENSOR_THINLENS, SENSOR_ORTHOGRAPHIC, SENSOR_RADIANCEMETER};
    struct CMUnitTest tests[4];
    for (int i = 0; i < 4; i++) {
        static const char *const names[] = {"perspective", "thinlens", "orthographic", "radiancemeter"};
        tests[i] = (struct CMUnitTest){names[i], test_kind, NULL, NULL, (void *)(uintptr_t)(kinds + i)};
    }
    return cmocka_run_group_tests(tests, NULL, NULL);
}
