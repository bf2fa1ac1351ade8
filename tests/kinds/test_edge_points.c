// Points of edges: each lies on its curve, its tangent is the rate of the point, what it says of its surfaces is so, and its
// density adds up to the curve's length. And where sensors see points, and how fast those move on the film.
#define LANES 1
#include "integrator/boundary/edge.h"
#include "integrator/boundary/view.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>

#include <cmocka.h>

enum { POSITIONS, NORMALS = 12, POSE = 24, INSTANCE = 40, CAMERA = 56, FOV = 72, PRINCIPAL = 73, LENS = 75, NUMBERS = 77 };
enum { INSTANCE_AT = 24, TABLES = 48, ROUNDS = 50 };
enum { MESH, INSTANCED, DISK, CYLINDER, SPHERE, SHAPES };

typedef struct World {
    SceneView scene;
    ShapeRecord shapes[SHAPES];
    Group groups[SHAPES];
    InstanceRecord instance;
    SensorRecord sensor;
    EdgeRecord edge;
    MeetingRecord meeting;
    BoundaryJob job;
    float theta[NUMBERS], tables[TABLES], spheres[SPHERE_TABLE + TABLES], cdf[1];
    int32_t triangles[6];
} World;

// splitmix64, between -1 and 1
static float uniform(uint64_t *state) {
    uint64_t z = (*state += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return (float)((double)((z ^ (z >> 31)) >> 11) * 0x1p-52 - 1);
}

static Vec3 random_vector(uint64_t *random) { return v3(uniform(random), uniform(random), uniform(random)); }

static void assert_near(const char *what, double found, double expected, double tolerance) {
    if (!(fabs(found - expected) <= tolerance)) {
        fail_msg("%s: %.7g, expected %.7g", what, found, expected);
    }
}

static void assert_near_v3(const char *what, Vec3 found, Vec3 expected, double tolerance) {
    assert_near(what, found.x, expected.x, tolerance);
    assert_near(what, found.y, expected.y, tolerance);
    assert_near(what, found.z, expected.z, tolerance);
}

static void world_make(World *w, uint64_t *random) {
    memset(w, 0, sizeof *w);
    for (int i = 0; i < NUMBERS; i++) {
        w->theta[i] = uniform(random);
    }
    for (int k = 0; k < 4; k++) {
        w->theta[NORMALS + 3 * k + 2] += 2;
        for (int i = 0; i < 3; i++) { // poses not too far from the identity
            w->theta[POSE + 16 * i + (k < 3 ? 5 * k : 0)] += k < 3 ? 2.5f : 0;
        }
    }
    assert_true(pose_table(w->theta + POSE, w->tables) && pose_table(w->theta + INSTANCE, w->tables + INSTANCE_AT));
    const float sphere[4] = {uniform(random), uniform(random), uniform(random), 1.2f + 0.5f * uniform(random)};
    memcpy(w->spheres, w->tables, sizeof w->tables);
    memcpy(w->spheres + TABLES, sphere, sizeof sphere);
    const int32_t triangles[6] = {0, 1, 2, 1, 0, 3};
    memcpy(w->triangles, triangles, sizeof triangles);
    const ShapeRecord mesh = {.kind = SHAPE_MESH, .flags = SHAPE_HAS_NORMALS, .triangle_count = 2, .vertex_count = 4,
                              .positions = POSITIONS, .normals = NORMALS, .collection = -1};
    w->shapes[MESH] = w->shapes[INSTANCED] = mesh;
    w->shapes[INSTANCED].collection = 0;
    w->shapes[INSTANCED].flags |= SHAPE_INSTANCED | SHAPE_FLIP_NORMALS;
    w->shapes[DISK] = (ShapeRecord){.kind = SHAPE_DISK, .to_world = POSE, .collection = -1};
    w->shapes[CYLINDER] = (ShapeRecord){.kind = SHAPE_CYLINDER, .to_world = POSE, .collection = -1};
    w->shapes[SPHERE] = (ShapeRecord){.kind = SHAPE_SPHERE, .table = TABLES, .collection = -1};
    for (int i = 0; i < SHAPES; i++) {
        w->shapes[i].group = i;
        w->groups[i] = (Group){.shape_kind = w->shapes[i].kind, .shape_flags = w->shapes[i].flags, .emitter = -1};
    }
    w->instance = (InstanceRecord){.to_world = INSTANCE, .table = INSTANCE_AT};
    w->edge = (EdgeRecord){.opposite = 3, .other = 1, .first = 0.1f, .last = 0.8f};
    w->cdf[0] = 1;
    w->job = (BoundaryJob){.edges = &w->edge, .meetings = &w->meeting, .cdf = w->cdf, .edge_count = 1};
    w->scene.theta = w->theta;
    w->scene.tables = w->spheres;
    w->scene.shapes = w->shapes;
    w->scene.groups = w->groups;
    w->scene.instances = &w->instance;
    w->scene.triangles = w->triangles;
}

static EdgePoint point_of(const World *w, float u, Vec3 eye, bool parallel) {
    return edge_sample(&w->scene, &w->job, (Vec2){0.5f, u}, eye, parallel);
}

// The rate of the point over the parameter is the tangent.
static void check_tangent(const World *w, const EdgePoint *e, float u, Vec3 eye, bool parallel) {
    const float h = 0.01f, range = w->edge.last - w->edge.first;
    Vec3 p[2];
    for (int side = 0; side < 2; side++) {
        p[side] = v3_scale(v3_sub(point_of(w, u + h * (float)(2 - side), eye, parallel).p,
                                  point_of(w, u - h * (float)(2 - side), eye, parallel).p), side ? 8 / (12 * h) : -1 / (12 * h));
    }
    assert_near_v3("tangent", v3_scale(e->tangent, range), v3_add(p[0], p[1]), 1e-3 * (1 + v3_length(e->tangent)));
    assert_near("probability", e->probability, 1 / range, 1e-5);
}

static Vec3 vertex(const World *w, int i) {
    return v3(w->theta[3 * i], w->theta[3 * i + 1], w->theta[3 * i + 2]);
}

static void test_mesh_edges(void **state) {
    (void)state;
    uint64_t random = 1;
    for (int round = 0; round < ROUNDS; round++) {
        World w;
        world_make(&w, &random);
        const int corner = round % 3, shape = round / 3 % 2 ? INSTANCED : MESH;
        const int from = corner, to = (corner + 1) % 3, apex = (corner + 2) % 3;
        float u = 0.5f + 0.4f * uniform(&random), t = 0.1f + 0.7f * u;
        w.edge.kind = EDGE_MESH;
        w.edge.shape = shape;
        w.edge.corner = corner;
        w.edge.opposite = round % 5 ? 3 : EDGE_OPEN;
        Vec3 p[4], eye = v3_zero();
        for (int i = 0; i < 4; i++) {
            p[i] = shape == MESH ? vertex(&w, i) : pose_to_world(&w.scene, INSTANCE_AT, vertex(&w, i));
        }
        EdgePoint e = point_of(&w, u, eye, false);
        assert_near_v3("point", e.p, v3_madd(v3_scale(p[from], 1 - t), t, p[to]), 1e-5);
        assert_near_v3("side", e.side[0], v3_sub(p[apex], p[from]), 1e-5);
        assert_true((e.open != 0) == (w.edge.opposite == EDGE_OPEN));
        if (!e.open) {
            assert_near_v3("other side", e.side[1], v3_sub(p[3], p[from]), 1e-5);
        }
        Interaction si = shape_interaction(&w.scene, SHAPE_MESH, w.shapes[shape].flags, &e.hit);
        assert_near_v3("hit", si.p, e.p, 1e-5);
        check_tangent(&w, &e, u, eye, false);
        Vec3 n = v3_cross(e.tangent, random_vector(&random));
        bool alike = v3_dot(e.side[0], n) * v3_dot(e.side[1], n) > 0;
        assert_true((edge_is_silhouette(&w.scene, &w.job, &e, n) != 0) == (e.open || alike));
    }
}

static Vec3 local_of(const World *w, Vec3 p) { return pose_to_local(&w->scene, 0, p); }

static void test_rims(void **state) {
    (void)state;
    uint64_t random = 2;
    for (int round = 0; round < ROUNDS; round++) {
        World w;
        world_make(&w, &random);
        const bool disk = round % 3 == 0;
        float u = 0.5f + 0.4f * uniform(&random), end = round % 3 == 2 ? 1 : 0;
        w.edge.kind = EDGE_RIM;
        w.edge.shape = disk ? DISK : CYLINDER;
        w.edge.corner = (int32_t)end;
        EdgePoint e = point_of(&w, u, v3_zero(), false);
        Vec3 q = local_of(&w, e.p), inside = local_of(&w, v3_madd(e.p, 0.01f, e.side[0]));
        assert_near("radius", hypotf(q.x, q.y), 1, 1e-5);
        assert_near("angle", atan2f(q.y, q.x), remainderf(6.2831853f * (0.1f + 0.7f * u), 6.2831853f), 1e-4);
        assert_near("height", q.z, end, 1e-5);
        assert_near("radius inside", hypotf(inside.x, inside.y), disk ? 0.99 : 1, 1e-5);
        assert_near("height inside", inside.z, disk ? 0 : end > 0 ? 0.99 : 0.01, 1e-5);
        check_tangent(&w, &e, u, v3_zero(), false);
    }
}

// The unit normal of a sphere or cylinder.
static Vec3 round_normal(const World *w, Vec3 p) {
    if (w->edge.shape == SPHERE) {
        return v3_normalize(v3_sub(p, table_v3(&w->scene, TABLES)));
    }
    Vec3 q = local_of(w, p);
    return v3_normalize(v3_madd(v3_scale(table_v3(&w->scene, 12), q.x), q.y, table_v3(&w->scene, 16)));
}

// Distance to the surface, relative to its size.
static float round_off(const World *w, Vec3 p) {
    if (w->edge.shape == SPHERE) {
        return v3_length(v3_sub(p, table_v3(&w->scene, TABLES))) / w->spheres[TABLES + 3] - 1;
    }
    Vec3 q = local_of(w, p);
    return hypotf(q.x, q.y) - 1;
}

static void test_outlines(void **state) {
    (void)state;
    uint64_t random = 3;
    int judged = 0;
    for (int round = 0; round < ROUNDS; round++) {
        World w;
        world_make(&w, &random);
        const bool sphere = round % 3 == 0, parallel = round / 3 % 2;
        float u = 0.5f + 0.4f * uniform(&random);
        w.edge.kind = sphere ? EDGE_OUTLINE : EDGE_SIDE;
        w.edge.shape = sphere ? SPHERE : CYLINDER;
        w.edge.corner = round % 3 == 1;
        Vec3 eye = v3_normalize(random_vector(&random));
        eye = parallel ? eye : v3_scale(eye, 12);
        EdgePoint e = point_of(&w, u, eye, parallel);
        if (v3_length(e.tangent) == 0) {
            continue; // an eye in the cylinder
        }
        judged++;
        Vec3 n = round_normal(&w, e.p), view = v3_normalize(facet_view(eye, parallel, e.p));
        assert_near("distance from the surface", round_off(&w, e.p), 0, 1e-5);
        assert_near("normal along the view", v3_dot(n, view), 0, 1e-5);
        assert_true(v3_dot(e.side[0], n) < 0);
        // Beside it the eye sees the surface, all but from the side.
        float seen = v3_dot(round_normal(&w, e.inner), view);
        assert_near("distance of the inner point", round_off(&w, e.inner), 0, 1e-5);
        assert_true(seen > 2e-4f && seen < 3e-3f && v3_length(v3_sub(e.inner, e.p)) < 0.02f);
        check_tangent(&w, &e, u, eye, parallel);
        if (!sphere) { // its two sides are two lines
            w.edge.corner = !w.edge.corner;
            assert_true(v3_length(v3_sub(point_of(&w, u, eye, parallel).p, e.p)) > 0.5f);
        }
        Vec3 middle = sphere ? table_v3(&w.scene, TABLES) : pose_to_world(&w.scene, 0, v3(0, 0, 0.5f));
        assert_near_v3("middle", edge_reference(&w.scene, &e), middle, 1e-5);
    }
    assert_true(judged > ROUNDS / 2);
}

// ---- terminators -------------------------------------------------------------------------------------------------

static Facet facet_of(const World *w) {
    Hit hit = {w->edge.shape, 0, 0, 0, v3_zero(), 0};
    return facet_load(&w->scene, &hit, m_set(true));
}

// The shading normal at u, v along the view.
static float facing(const Facet *f, Vec3 eye, bool parallel, float u, float v) {
    return v3_dot(v3_normalize(facet_at(f->n, u, v)), facet_view(eye, parallel, facet_at(f->p, u, v)));
}

// Length of the part of the curve in the small triangle with these values at its corners.
static double piece_length(const Vec3 p[3], const float f[3]) {
    Vec3 ends[3];
    int n = 0;
    for (int i = 0; i < 3; i++) {
        int j = (i + 1) % 3;
        if ((f[i] > 0) != (f[j] > 0)) {
            ends[n++] = v3_madd(p[i], f[i] / (f[i] - f[j]), v3_sub(p[j], p[i]));
        }
    }
    return n == 2 ? v3_length(v3_sub(ends[1], ends[0])) : 0;
}

static double curve_length(const Facet *f, Vec3 eye, bool parallel) {
    enum { ACROSS = 100 };
    double length = 0;
    for (int k = 0; k < 2 * ACROSS * ACROSS; k++) {
        int i = k / 2 / ACROSS, j = k / 2 % ACROSS, up = k % 2;
        if (i + j + up >= ACROSS) {
            continue;
        }
        const int at[2][3][2] = {{{0, 0}, {1, 0}, {0, 1}}, {{1, 1}, {0, 1}, {1, 0}}};
        Vec3 p[3];
        float value[3];
        for (int c = 0; c < 3; c++) {
            float u = (float)(i + at[up][c][0]) / ACROSS, v = (float)(j + at[up][c][1]) / ACROSS;
            p[c] = facet_at(f->p, u, v);
            value[c] = facing(f, eye, parallel, u, v);
        }
        length += piece_length(p, value);
    }
    return length;
}

static void check_terminator(const Facet *f, const EdgePoint *e, Vec3 eye, bool parallel) {
    const float h = 1e-3f, u = e->hit.u, v = e->hit.v;
    Vec3 e1 = v3_sub(f->p[1], f->p[0]), e2 = v3_sub(f->p[2], f->p[0]), cross = v3_cross(e1, e2);
    float area2 = v3_dot(cross, cross), along[2], view = v3_length(e->view);
    assert_near_v3("point", e->p, facet_at(f->p, u, v), 1e-5);
    assert_near("normal along the view", facing(f, eye, parallel, u, v), 0, 2e-4 * view);
    assert_near_v3("normal", e->normal, v3_normalize(facet_at(f->n, u, v)), 1e-5);
    assert_near_v3("view", e->view, facet_view(eye, parallel, e->p), 1e-5 * view);
    const Vec3 ways[2] = {v3_normalize(e->tangent), e->rise};
    for (int k = 0; k < 2; k++) { // along the curve it does not change, along the rise by 1
        float size = h / v3_length(ways[k]), du = v3_dot(v3_cross(ways[k], e2), cross) / area2 * size;
        float dv = v3_dot(v3_cross(e1, ways[k]), cross) / area2 * size;
        along[k] = (facing(f, eye, parallel, u + du, v + dv) - facing(f, eye, parallel, u - du, v - dv)) / (2 * size);
    }
    float slope = 1 / v3_length(e->rise);
    assert_near("slope along the curve", along[0], 0, 1e-2 * slope + 2e-3 * view);
    assert_near("slope along the rise", along[1], 1, 1e-2 + 2e-3 * view / slope);
}

static void test_terminators(void **state) {
    (void)state;
    enum { SAMPLES = 6000 };
    uint64_t random = 4;
    int judged = 0;
    for (int round = 0; round < 40; round++) {
        World w;
        world_make(&w, &random);
        const bool parallel = round % 2;
        w.edge = (EdgeRecord){.kind = EDGE_TERMINATOR, .shape = round / 2 % 2 ? INSTANCED : MESH, .first = 0, .last = 1};
        Facet f = facet_of(&w);
        // An eye near the plane of a normal in the middle.
        Vec3 middle = facet_at(f.p, 0.3f, 0.4f), n = v3_normalize(facet_at(f.n, 0.3f, 0.4f));
        Vec3 away = v3_normalize(v3_cross(n, random_vector(&random))), eye = parallel ? away : v3_madd(middle, 4, away);
        double expected = curve_length(&f, eye, parallel), found = 0;
        for (int i = 0; i < SAMPLES; i++) {
            EdgePoint e = point_of(&w, ((float)i + 0.5f) / SAMPLES, eye, parallel);
            if (e.probability > 0) {
                found += (double)v3_length(e.tangent) / (double)e.probability / SAMPLES;
                if (i % 100 == 0) {
                    check_terminator(&f, &e, eye, parallel);
                }
            }
        }
        assert_near("length", found, expected, 0.02 * expected + 1e-3);
        judged += expected > 0.2;
    }
    assert_true(judged > 20);
}

// ---- meetings ----------------------------------------------------------------------------------------------------

static double quadric_at(const Quadric *q, Vec3 p, double gradient[3]) {
    const double y[3] = {(double)p.x - q->centre[0], (double)p.y - q->centre[1], (double)p.z - q->centre[2]};
    static const int entry[3][3] = {{0, 5, 4}, {5, 1, 3}, {4, 3, 2}};
    double value = q->constant;
    for (int i = 0; i < 3; i++) {
        double row = 0;
        for (int k = 0; k < 3; k++) {
            row += q->matrix[entry[i][k]] * y[k];
        }
        gradient[i] = row + q->linear[i];
        value += y[i] * (0.5 * row + q->linear[i]);
    }
    return value;
}

// A triangle of a mesh and a closed quadric around its corner; two points of their curve.
static void meeting_make(World *w, uint64_t *random) {
    Vec3 a = vertex(w, 0), e1 = v3_sub(vertex(w, 1), a), e2 = v3_sub(vertex(w, 2), a), n = v3_normalize(v3_cross(e1, e2));
    MeetingRecord *m = &w->meeting;
    *m = (MeetingRecord){.shape = {MESH, SPHERE}};
    m->surface[0] = (Quadric){{a.x, a.y, a.z}, {n.x, n.y, n.z}, 0, {0}};
    Quadric *q = m->surface + 1;
    *q = (Quadric){{a.x + 0.1f * uniform(random), a.y, a.z}, {0.1f * uniform(random), 0.1f, 0.05f}, -0.04f, {0}};
    for (int i = 0; i < 6; i++) {
        q->matrix[i] = i < 3 ? 2 + uniform(random) : 0.4f * uniform(random);
    }
    for (int end = 0; end < 2; end++) {
        Vec3 way = v3_normalize(v3_madd(v3_scale(e1, end ? 0.6f : 0.4f), end ? 0.4f : 0.6f, e2));
        float low = 0, high = 4;
        double unused[3];
        for (int i = 0; i < 40; i++) {
            float at = 0.5f * (low + high);
            bool outside = quadric_at(q, v3_madd(a, at, way), unused) > 0;
            *(outside ? &high : &low) = at;
        }
        Vec3 p = v3_madd(a, low, way);
        memcpy(m->ends + 3 * end, (float[3]){p.x, p.y, p.z}, 3 * sizeof(float));
    }
}

static void test_meetings(void **state) {
    (void)state;
    uint64_t random = 5;
    for (int round = 0; round < ROUNDS; round++) {
        World w;
        world_make(&w, &random);
        meeting_make(&w, &random);
        float u = 0.5f + 0.4f * uniform(&random);
        w.edge.kind = EDGE_MEETING;
        w.edge.shape = MESH;
        EdgePoint e = point_of(&w, u, v3_zero(), false);
        for (int k = 0; k < 2; k++) {
            double g[3], value = quadric_at(w.meeting.surface + k, e.p, g);
            Vec3 n = v3_normalize(v3((float)g[0], (float)g[1], (float)g[2]));
            assert_near("surface", value, 0, 1e-5);
            assert_near_v3("normal", e.across[k], n, 2e-3);
            assert_near("tangent along a normal", v3_dot(v3_normalize(e.tangent), n), 0, 2e-3);
            assert_near("side along a normal", v3_dot(v3_normalize(e.side[k]), v3_normalize(e.across[0])), 0, 1e-4);
        }
        Interaction si = shape_interaction(&w.scene, SHAPE_MESH, SHAPE_HAS_NORMALS, &e.hit);
        assert_near_v3("hit", si.p, e.p, 1e-4);
        assert_near_v3("hit of the other one", e.met.p, e.p, 0);
        assert_int_equal(e.met.shape, SPHERE);
        assert_true(!edge_is_silhouette(&w.scene, &w.job, &e, v3_cross(e.tangent, random_vector(&random))));
        check_tangent(&w, &e, u, v3_zero(), false);
    }
}

// ---- the choice of an edge, and sensors ----------------------------------------------------------------------------

static void test_choice(void **state) {
    (void)state;
    const float cdf[5] = {0.1f, 0.1f, 0.45f, 0.9f, 1};
    BoundaryJob b = {.cdf = cdf, .edge_count = 5};
    for (int i = 0; i < 100; i++) {
        float u = ((float)i + 0.5f) / 100, probability;
        int chosen = edge_choose(&b, u, &probability), expected = u < 0.1f ? 0 : u < 0.45f ? 2 : u < 0.9f ? 3 : 4;
        assert_int_equal(chosen, expected);
        assert_near("probability", probability, (double)cdf[chosen] - (chosen ? (double)cdf[chosen - 1] : 0), 1e-6);
    }
}

static void test_views(void **state) {
    (void)state;
    static const int32_t kinds[] = {SENSOR_PERSPECTIVE, SENSOR_THINLENS, SENSOR_ORTHOGRAPHIC};
    uint64_t random = 6;
    for (int round = 0; round < ROUNDS; round++) {
        World w;
        world_make(&w, &random);
        for (int k = 0; k < 3; k++) {
            w.theta[CAMERA + 5 * k] += 3;
        }
        w.theta[FOV] = 50 + 20 * uniform(&random);
        const int32_t kind = kinds[round % 3];
        const float shift = kind == SENSOR_ORTHOGRAPHIC ? 0 : 0.2f;
        w.theta[PRINCIPAL] *= shift;
        w.theta[PRINCIPAL + 1] *= shift;
        w.theta[LENS] = 0.2f;
        w.theta[LENS + 1] = 3 + uniform(&random);
        w.sensor = (SensorRecord){.kind = kind, .to_world = CAMERA, .fov = FOV, .principal = PRINCIPAL, .lens = LENS,
                                  .width = 30, .height = 20, .near_clip = 0.01f, .far_clip = 100};
        Pinhole pinhole = pinhole_make(&w.scene, &w.sensor);
        Vec2 lens = {0.5f + 0.4f * uniform(&random), 0.5f + 0.4f * uniform(&random)};
        View view = view_make(&w.scene, &pinhole, &w.sensor, lens);
        float x = 15 + 14 * uniform(&random), y = 10 + 9 * uniform(&random), h = 0.01f;
        Ray ray = single_sensor_ray(&w.scene, &w.sensor, x, y, lens).ray;
        Vec3 p = v3_madd(ray.o, 5 + uniform(&random), ray.d), way = random_vector(&random);
        Seen seen = view_see(&view, p), ahead = view_see(&view, v3_madd(p, h, way)), behind = view_see(&view, v3_madd(p, -h, way));
        Vec2 push = view_push(&view, &seen, way);
        assert_near("x", seen.x, x, 2e-4);
        assert_near("y", seen.y, y, 2e-4);
        assert_near_v3("direction", seen.d, ray.d, 1e-5);
        Vec3 eye = kind == SENSOR_ORTHOGRAPHIC ? pinhole.origin : view.eye;
        float distance = kind == SENSOR_ORTHOGRAPHIC ? v3_dot(v3_sub(p, eye), ray.d) : v3_length(v3_sub(p, eye));
        assert_near("distance", seen.distance, distance, 1e-4);
        assert_near("push in x", push.x, (ahead.x - behind.x) / (2 * h), 5e-3);
        assert_near("push in y", push.y, (ahead.y - behind.y) / (2 * h), 5e-3);
        assert_true(seen.valid && !view_see(&view, v3_madd(ray.o, -1, ray.d)).valid);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_mesh_edges), cmocka_unit_test(test_rims),
                                       cmocka_unit_test(test_outlines),   cmocka_unit_test(test_terminators),
                                       cmocka_unit_test(test_meetings),   cmocka_unit_test(test_choice),
                                       cmocka_unit_test(test_views)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
