// The motion of boundary segments that other vertices than the camera see, in reverse mode, against differences of where their
// points get to: attached ones, near points that slide because the camera sees them, and normals.
#include "edge_world.h"

#include "integrator/boundary/indirect.h"

#include <stdlib.h>

// Edge, near and far points lie on these.
enum { EDGE_SHAPE = MESH, NEAR_SHAPE = INSTANCED, FAR_SHAPE = DISK };

static const int32_t instance_at[1] = {-1};

typedef struct Sample {
    World w;
    Tracer t;
    Pinhole pinhole;
    BoundaryJob job;
    Segments q;
    Hit edge, near, far;
    Vec3 n, other, d;  // other: of the second surface of a meeting
    float along, behind, seen, unseen, x, y;
    int32_t slot[LANES];
} Sample;

static Interaction look(const World *w, const Hit *hit) {
    const ShapeRecord *shape = w->shapes + hit->shape;
    Hit own = *hit;
    if (shape->kind == SHAPE_DISK) { // keeps its place in the space of the pose
        own.p = pose_to_world(&w->scene, 0, hit->p);
    }
    return shape_interaction(&w->scene, shape->kind, shape->flags, &own);
}

static void keep(real *u, real *v, real *x, real *y, real *z, int32_t *shape, int32_t *prim, int32_t *instance, const World *w,
                 const Hit *hit) {
    Hit own = *hit;
    own.p = look(w, hit).p;
    hit_compress(u, v, x, y, z, shape, prim, instance, &own, own.p, m_set(true));
}

#define KEEP(s, name)                                                                                                  \
    keep((s)->q.name##_u, (s)->q.name##_v, (s)->q.name##_x, (s)->q.name##_y, (s)->q.name##_z, (s)->q.name##_shape,     \
         (s)->q.name##_prim, (s)->q.name##_instance, &(s)->w, &(s)->name)

// Fills the segment's row.
static void segment_store(Sample *s) {
    Segments *q = &s->q;
    q->count = 1;
    v3_compress(q->nx, q->ny, q->nz, s->n, m_set(true));
    v3_compress(q->mx, q->my, q->mz, s->other, m_set(true));
    v3_compress(q->dx, q->dy, q->dz, s->d, m_set(true));
    q->along[0] = s->along;
    q->behind[0] = s->behind;
    q->seen[0] = s->seen;
    q->unseen[0] = s->unseen;
    q->source[0] = -1;
    KEEP(s, edge);
    KEEP(s, near);
    KEEP(s, far);
    // The near point as the only vertex of the segment's way upstream.
    const Upstream *u = q->up;
    q->levels = 1;
    keep(u->u, u->v, u->x, u->y, u->z, u->shape, u->prim, u->instance, &s->w, &s->near);
    u->met[0] = UPSTREAM_RAY;
    u->lobe[0] = LOBE_SMOOTH;
    u->seen[0] = s->seen;
    u->unseen[0] = s->unseen;
}

static void sample_make(Sample *s, int32_t kind, char *block, uint64_t *random) {
    memset(s, 0, sizeof *s);
    segments_layout(&s->q, block);
    world_make(&s->w, random);
    const float a = 0.4f + 0.1f * uniform(random), b = 0.3f + 0.1f * uniform(random);
    s->edge = (Hit){EDGE_SHAPE, 0, a, b, v3_zero(), 0};
    s->near = kind == BOUNDARY_CUT ? s->edge : (Hit){NEAR_SHAPE, 1, b, a, v3_zero(), 0}; // cuts start at the point itself
    s->far = (Hit){FAR_SHAPE, 0, 0, 0, v3(a, -b, 0), 0};
    s->n = random_vector(random);
    s->other = random_vector(random);
    s->d = v3_normalize(random_vector(random));
    s->along = 0.5f + 0.3f * uniform(random);
    s->behind = 1.5f + uniform(random);
    s->seen = uniform(random);
    s->unseen = uniform(random);
    place_camera(&s->w, false, look(&s->w, &s->near).p, random);
    s->pinhole = pinhole_make(&s->w.scene, &s->w.sensor);
    View view = view_make(&s->w.scene, &s->pinhole, &s->w.sensor, (Vec2){0.5f, 0.5f});
    Seen seen = view_see(&view, look(&s->w, &s->near).p);
    s->x = seen.x;
    s->y = seen.y;
    segment_store(s);
    s->job = s->w.job;
    s->job.kind = kind;
    s->job.job.mode = MODE_REVERSE;
    s->job.job.live = world_live();
    s->t.job = &s->job.job;
    s->t.scene = &s->w.scene;
    s->t.sensor = &s->w.sensor;
    s->t.ws.pixel = s->t.ws.sample = s->slot;
}

static void gradient_of(Sample *s, double *gradient) {
    Indirect in = {.t = &s->t, .b = &s->job, .pinhole = &s->pinhole, .q = s->q, .upstream = s->job.kind == BOUNDARY_CHAINED};
    Sink sink = world_sink(gradient, instance_at);
    moves_adj(&in, 0, &sink);
}

// Where the camera's ray meets the plane of the near triangle.
static Vec3 near_seen(const Sample *s) {
    Ray ray = single_sensor_ray(&s->w.scene, &s->w.sensor, s->x, s->y, (Vec2){0.5f, 0.5f}).ray;
    Interaction si = look(&s->w, &s->near);
    return v3_madd(ray.o, v3_dot(v3_sub(si.p, ray.o), si.ng) / v3_dot(ray.d, si.ng), ray.d);
}

// What light that is cut off at a point is worth: n . (far - x) / r, and the shading normal.
static double cut_of(const Sample *s, const Interaction *x) {
    return s->behind * v3_dot(s->n, v3_sub(look(&s->w, &s->far).p, x->p)) + s->along * v3_dot(s->d, x->sh.n);
}

static double cuts_of(const Sample *s) {
    Vec3 normal;
    Hit hit = point_hit(&s->w.scene, s->edge.shape, s->edge.prim, s->edge.instance, near_seen(s), &normal);
    Interaction seen = look(&s->w, &hit), unseen = look(&s->w, &s->edge);
    return s->seen * cut_of(s, &seen) + s->unseen * cut_of(s, &unseen);
}

// What the segment is worth in a world that has moved.
static double worth_of(const Sample *s) {
    const World *w = &s->w;
    Interaction edge = look(w, &s->edge), far = look(w, &s->far);
    const float both = s->seen + s->unseen, size = s->behind * both;
    Vec3 near = v3_madd(v3_scale(near_seen(s), s->seen), s->unseen, look(w, &s->near).p);
    switch (s->job.kind) {
    case BOUNDARY_CUT:
        return cuts_of(s);
    case BOUNDARY_CHAINED:
    case BOUNDARY_INDIRECT: // n . (edge - lerp(near, far, along)), and a part of the edge's n that counts for the far surface
        return both * (v3_dot(s->n, edge.p) - s->along * v3_dot(s->n, far.p)) - (1 - s->along) * v3_dot(s->n, near) +
               both * v3_dot(s->other, v3_sub(far.p, edge.p));
    case BOUNDARY_MEETING:
        return both * (v3_dot(s->n, edge.p) + v3_dot(s->other, far.p));
    case BOUNDARY_TERMINATOR: // n . (near - x) / r, and the shading normal
        return s->behind * v3_dot(s->n, near) - size * v3_dot(s->n, edge.p) - both * s->along * v3_dot(s->d, edge.sh.n);
    default: // n . (far - x) / r, and the geometric normal
        return size * v3_dot(s->n, v3_sub(far.p, edge.p)) + both * s->along * v3_dot(s->d, edge.ng);
    }
}

static void test_kind(void **state) {
    const int32_t kind = *(const int32_t *)*state;
    static Sample s;
    int judged = 0;
    uint64_t random = (uint64_t)kind + 1;
    char *block = calloc(1, segments_layout(&s.q, NULL));
    assert_non_null(block);
    for (int round = 0; round < ROUNDS; round++) {
        sample_make(&s, kind, block, &random);
        Interaction near = look(&s.w, &s.near);
        if (fabsf(v3_dot(near.ng, v3_normalize(v3_sub(near.p, s.pinhole.origin)))) < 0.5f) {
            continue; // differences of grazing rays are not good enough
        }
        judged++;
        double gradient[NUMBERS] = {0};
        gradient_of(&s, gradient);
        for (int i = 0; i < NUMBERS; i++) {
            if (i >= INSTANCE && i < CAMERA) {
                continue; // derived tables
            }
            const double start = s.w.theta[i], h = i == FOV ? 0.1 : 2e-3;
            double difference = 0;
            for (int side = -1; side <= 1; side += 2) {
                s.w.theta[i] = (float)(start + side * h);
                assert_true(pose_table(s.w.theta + POSE, s.w.spheres));
                difference += side * worth_of(&s) / (2 * h);
            }
            s.w.theta[i] = (float)start;
            assert_true(pose_table(s.w.theta + POSE, s.w.spheres));
            if (!(fabs(gradient[i] - difference) <= 0.02 * (1 + fabs(difference)))) {
                fail_msg("number %d: %.6g, expected %.6g", i, gradient[i], difference);
            }
        }
    }
    assert_true(judged > ROUNDS / 4);
    free(block);
}

int main(void) {
    static const int32_t kinds[] = {BOUNDARY_INDIRECT, BOUNDARY_TERMINATOR, BOUNDARY_HORIZON, BOUNDARY_MEETING, BOUNDARY_CUT,
                                    BOUNDARY_CHAINED};
    static const char *const names[] = {"silhouettes", "terminators", "horizons", "meetings", "cuts", "ways"};
    struct CMUnitTest tests[COUNT_OF(kinds)];
    for (int i = 0; i < COUNT_OF(kinds); i++) {
        tests[i] = (struct CMUnitTest){names[i], test_kind, NULL, NULL, (void *)(uintptr_t)(kinds + i)};
    }
    return cmocka_run_group_tests(tests, NULL, NULL);
}
