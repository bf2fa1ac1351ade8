// Inner corners: what is subtracted there from the interior term has the mean 0 over directions, whatever moves.
#include "edge_world.h"

#include "integrator/corner.h"

// g = cos e^(a . w) beside its slope.
static float cosine_lobe(Vec3 a, Vec3 w, Vec3 *slope) {
    float lobe = expf(v3_dot(a, w));
    *slope = v3_madd(v3(0, 0, lobe), w.z * lobe, a);
    return w.z * lobe;
}

// An affine motion of points and area vectors.
typedef struct Affine {
    Vec3 shift, column[3];
} Affine;

static Affine random_affine(uint64_t *random) {
    Affine a = {.shift = random_vector(random)};
    for (int k = 0; k < 3; k++) {
        a.column[k] = random_vector(random);
    }
    return a;
}
static Vec3 affine_velocity(const Affine *a, Vec3 p) {
    return v3_madd(v3_madd(v3_madd(a->shift, p.x, a->column[0]), p.y, a->column[1]), p.z, a->column[2]);
}
static Vec3 affine_area(const Affine *a, Vec3 n) {
    float grows = a->column[0].x + a->column[1].y + a->column[2].z;
    return v3_madd(v3(-v3_dot(a->column[0], n), -v3_dot(a->column[1], n), -v3_dot(a->column[2], n)), grows, n);
}

// The mean of a lens's whole, over that of its absolute value.
static double imbalance(Corner lens, Vec3 from, Vec3 lobe, Vec3 own, const Affine *wall) {
    enum { ALONG = 300, UP = 300 };
    double sum = 0, all = 0;
    for (int i = 0; i < ALONG * UP; i++) {
        float s = ((float)(i % ALONG) + 0.5f) / ALONG, rho = ((float)(i / ALONG) + 0.5f) / UP, x = s * lens.length;
        float high = lens.steep * x * (1 - s), h = rho * high;
        Vec3 p = v3_madd(v3_madd(lens.o, x, lens.along), h, lens.up), r = v3_sub(p, from), w = v3_normalize(r), slope, darea;
        Vec3 n = v3_cross(lens.along, lens.up);
        Corner k = lens;
        k.m = m_set(true);
        corner_pass(&k, from, w);
        if (!m_any(k.m) || v3_length(v3_sub(k.p, p)) > 1e-3f) {
            fail_msg("the ray to %g %g %g passes %g %g %g", p.x, p.y, p.z, k.p.x, k.p.y, k.p.z);
        }
        float g = cosine_lobe(lobe, w, &slope);
        Vec3 dr = corner_segment_adj(&k, from, w, n, g, slope, &darea);
        double value = (double)(v3_dot(dr, v3_sub(affine_velocity(wall, p), own)) + v3_dot(darea, affine_area(wall, n)));
        double solid_angle = (double)(fabsf(v3_dot(n, w)) / v3_dot(r, r) * high);
        sum += value * solid_angle;
        all += fabs(value) * solid_angle;
    }
    return fabs(sum) / all;
}

static void test_balance(void **state) {
    (void)state;
    uint64_t random = 7;
    for (int round = 0; round < 12; round++) {
        float lean = 1.5f + 0.7f * uniform(&random), at = 1 + 0.6f * uniform(&random), apart = 0.3f + 0.2f * uniform(&random);
        Corner lens = {.o = v3_zero(), .along = v3(1, 0, 0), .up = v3(0, cosf(lean), sinf(lean)), .length = 2};
        lens.steep = 1 + 0.4f * uniform(&random);
        Affine wall = random_affine(&random);
        double off = imbalance(lens, v3(at, -apart, 0), random_vector(&random), random_vector(&random), &wall);
        if (!(off < 2e-3)) {
            fail_msg("round %d: %g", round, off);
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_balance)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
