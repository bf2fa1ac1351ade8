// The motion of edges that the camera sees: what a sample makes of it, against differences of where attached points, normals and
// the camera's rays get to; and where two surfaces meet, by what their two parts add up to.
#include "edge_world.h"

#include "integrator/boundary/primary.h"

#include <stdlib.h>

static const int32_t instance_at[1] = {INSTANCE};

// A sample of an edge, as the camera of a world sees it.
typedef struct Sample {
    PrimarySample s;
    Pinhole pinhole;
    Interaction si; // of the attached point
    Ray ray;
} Sample;

static Ray ray_of(const World *w, const Sample *x) {
    return single_sensor_ray(&w->scene, &w->sensor, x->s.seen.x, x->s.seen.y, x->s.view.lens).ray;
}

static Interaction attached_of(const World *w, const Sample *x) {
    return shape_interaction(&w->scene, SHAPE_MESH, w->shapes[x->s.edge.hit.shape].flags, &x->s.edge.hit);
}

// Sorts of edges: of a mesh, and where a shading normal turns away.
static Sample sample_make(World *w, bool terminator, bool parallel, int32_t shape, uint64_t *random) {
    Sample x = {.s = {.m = m_set(true)}};
    EdgePoint *e = &x.s.edge;
    e->line = i_set(-1);
    e->hit = (Hit){shape, 0, 0.4f + 0.2f * uniform(random), 0.3f + 0.1f * uniform(random), v3_zero(), 0};
    x.si = attached_of(w, &x);
    e->p = e->hit.p = x.si.p;
    place_camera(w, parallel, e->p, random);
    x.pinhole = pinhole_make(&w->scene, &w->sensor);
    x.s.view = view_make(&w->scene, &x.pinhole, &w->sensor, (Vec2){0.5f, 0.5f});
    x.s.seen = view_see(&x.s.view, e->p);
    assert_true(x.s.seen.valid);
    x.s.n = v3_normalize(random_vector(random));
    if (terminator) {
        e->normal = x.si.sh.n;
        e->view = parallel ? v3_neg(x.pinhole.axis) : v3_sub(x.s.view.eye, e->p);
        e->rise = random_vector(random);
    }
    x.ray = ray_of(w, &x);
    return x;
}

static void gradient_of(const World *w, const Sample *x, float worth, bool parallel, double *gradient) {
    PathJob job = {.live = world_live()};
    Tracer *t = calloc(1, sizeof *t);
    assert_non_null(t);
    t->job = &job;
    t->scene = &w->scene;
    t->sensor = &w->sensor;
    Sink sink = world_sink(gradient, instance_at);
    primary_move_adj(t, &w->job, &x->s, worth, parallel, &sink);
    free(t);
}

// What the sample is worth in a world that has moved: the attached point along n, less the camera's ray there; and the rate of
// F = n . view, where it is the curve on which that is 0.
static double worth_of(const World *w, const Sample *x, float worth, bool parallel) {
    Interaction si = attached_of(w, x);
    Ray ray = ray_of(w, x);
    float distance = v3_length(v3_sub(x->s.edge.p, x->ray.o)), rate = -worth * v3_dot(x->s.n, x->s.edge.rise);
    Vec3 at = v3_madd(ray.o, distance, ray.d), view = parallel ? v3_neg(ray.d) : v3_sub(ray.o, si.p);
    return worth * v3_dot(x->s.n, v3_sub(si.p, at)) + rate * v3_dot(si.sh.n, view);
}

static void test_moves(void **state) {
    (void)state;
    uint64_t random = 1;
    for (int round = 0; round < 2 * ROUNDS; round++) {
        World w;
        world_make(&w, &random);
        const bool terminator = round % 2, parallel = round / 2 % 2;
        Sample x = sample_make(&w, terminator, parallel, round / 4 % 2 ? INSTANCED : MESH, &random);
        const float worth = 1.5f + 0.5f * uniform(&random), h = 2e-3f;
        double gradient[NUMBERS] = {0};
        gradient_of(&w, &x, worth, parallel, gradient);
        for (int i = 0; i < NUMBERS; i++) {
            if (i >= POSE && i < CAMERA) {
                continue; // of disks, and of instances, whose tables are derived
            }
            double difference = 0, start = w.theta[i], step = i == FOV ? 50 * h : h;
            for (int side = -1; side <= 1; side += 2) {
                w.theta[i] = (float)(start + side * step);
                difference += side * worth_of(&w, &x, worth, parallel) / (2 * step);
            }
            w.theta[i] = (float)start;
            assert_near("number", gradient[i], difference, 0.02 * (1 + fabs(difference)));
        }
    }
}

// The mesh and the disk give what makes the motion along both normals.
static void test_meetings(void **state) {
    (void)state;
    uint64_t random = 2;
    for (int round = 0; round < ROUNDS; round++) {
        World w;
        world_make(&w, &random);
        Sample x = sample_make(&w, false, false, MESH, &random);
        Vec3 a = v3_normalize(random_vector(&random)), b = v3_normalize(random_vector(&random));
        const bool border = round % 5 == 0; // one of the two is where the light ends
        const float worth = 1.5f + 0.5f * uniform(&random);
        Vec3 q = pose_to_world(&w.scene, 0, v3(0.3f, 0.4f, 0)), along = v3_scale(x.s.n, worth);
        x.s.edge.meeting = m_set(true);
        x.s.edge.met = (Hit){border ? -1 : DISK, 0, 0, 0, q, 0};
        x.s.edge.across[0] = a;
        x.s.edge.across[1] = b;
        double gradient[NUMBERS] = {0};
        gradient_of(&w, &x, worth, false, gradient);
        Vec3 first = v3_zero(), second = v3((float)gradient[POSE + 3], (float)gradient[POSE + 7], (float)gradient[POSE + 11]);
        for (int i = 0; i < 4; i++) {
            first = v3_add(first, v3((float)gradient[3 * i], (float)gradient[3 * i + 1], (float)gradient[3 * i + 2]));
        }
        assert_near("first along its normal", v3_length(v3_cross(first, a)), 0, 1e-3 * (1 + v3_length(first)));
        assert_near("second along its normal", v3_length(v3_cross(second, b)), 0, 1e-3 * (1 + v3_length(second)));
        if (border) {
            assert_near("second", v3_length(second), 0, 0);
            continue;
        }
        Vec3 sum = v3_add(first, second);
        float size = 1 + v3_length(first) + v3_length(second);
        assert_near("along the first normal", v3_dot(sum, a), v3_dot(along, a), 1e-3 * size);
        assert_near("along the second normal", v3_dot(sum, b), v3_dot(along, b), 1e-3 * size);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_moves), cmocka_unit_test(test_meetings)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
