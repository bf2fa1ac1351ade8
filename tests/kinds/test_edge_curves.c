// Points of the curves along which shading normals turn away, and along which surfaces pass through each other: each lies on its
// curve, its tangent is the rate of the point, and its density adds up to the curve's length.
#include "../quadric.h"
#include "edge_world.h"


static Facet facet_of(const World *w) {
    Hit hit = {w->edges[1].shape, 0, 0, 0, v3_zero(), 0};
    return facet_load(&w->scene, &hit, m_set(true));
}

// Corners and normals in the world, on the side that shades.
static void check_facet(const World *w, const Facet *f) {
    for (int i = 0; i < 3; i++) {
        const float *n = w->theta + NORMALS + 3 * i, *r = w->tables + INSTANCE_AT + 12;
        Vec3 p = vertex(w, i), normal = v3(n[0], n[1], n[2]);
        if (w->edges[1].shape == INSTANCED) { // by the transposed inverse, and flipped
            p = pose_to_world(&w->scene, INSTANCE_AT, p);
            normal = v3(-(r[0] * n[0] + r[4] * n[1] + r[8] * n[2]), -(r[1] * n[0] + r[5] * n[1] + r[9] * n[2]),
                        -(r[2] * n[0] + r[6] * n[1] + r[10] * n[2]));
        }
        assert_near_v3("corner", f->p[i], p, 1e-5);
        assert_near_v3("normal", f->n[i], normal, 1e-5);
    }
}

// The shading normal at u, v along the view.
static float facing(const Facet *f, Vec3 eye, bool parallel, float u, float v) {
    return v3_dot(v3_normalize(facet_at(f->n, u, v)), towards_eye(eye, parallel, facet_at(f->p, u, v)));
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
    assert_near_v3("view", e->view, towards_eye(eye, parallel, e->p), 1e-5 * view);
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
        w.edges[1] = (EdgeRecord){.kind = EDGE_TERMINATOR, .shape = round / 2 % 2 ? INSTANCED : MESH, .first = 0, .last = 1};
        Facet f = facet_of(&w);
        check_facet(&w, &f);
        // An eye near the plane of a normal in the middle.
        Vec3 middle = facet_at(f.p, 0.3f, 0.4f), n = v3_normalize(facet_at(f.n, 0.3f, 0.4f));
        Vec3 away = v3_normalize(v3_cross(n, random_vector(&random))), eye = parallel ? away : v3_madd(middle, 4, away);
        double expected = curve_length(&f, eye, parallel), found = 0;
        for (int i = 0; i < SAMPLES; i++) {
            EdgePoint e = point_of(&w, ((float)i + 0.5f) / SAMPLES, eye, parallel);
            if (e.probability > 0) {
                found += (double)EDGE_SHARE * (double)v3_length(e.tangent) / (double)e.probability / SAMPLES;
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
            bool outside = quadric_at(q, (const float[]){a.x + at * way.x, a.y + at * way.y, a.z + at * way.z}, unused) > 0;
            *(outside ? &high : &low) = at;
        }
        Vec3 p = v3_madd(a, low, way);
        memcpy(m->ends + 3 * end, (float[3]){p.x, p.y, p.z}, 3 * sizeof(float));
    }
}

// Bends the first surface, and moves the ends onto both again: the shortest way that Newton's steps allow.
static void meeting_bend(World *w, uint64_t *random) {
    MeetingRecord *m = &w->meeting;
    for (int i = 0; i < 6; i++) {
        m->surface[0].matrix[i] = 0.5f * uniform(random);
    }
    for (int end = 0; end < 2; end++) {
        float *p = m->ends + 3 * end;
        for (int step = 0; step < 8; step++) {
            double g[2][3], f[2], a[3] = {0};
            for (int k = 0; k < 2; k++) {
                f[k] = quadric_at(m->surface + k, p, g[k]);
            }
            for (int i = 0; i < 3; i++) {
                a[0] += g[0][i] * g[0][i];
                a[1] += g[0][i] * g[1][i];
                a[2] += g[1][i] * g[1][i];
            }
            double det = a[0] * a[2] - a[1] * a[1], x = (a[2] * f[0] - a[1] * f[1]) / det, y = (a[0] * f[1] - a[1] * f[0]) / det;
            for (int i = 0; i < 3; i++) {
                p[i] -= (float)(x * g[0][i] + y * g[1][i]);
            }
        }
    }
}

static void test_meetings(void **state) {
    (void)state;
    uint64_t random = 5;
    for (int round = 0; round < ROUNDS; round++) {
        World w;
        world_make(&w, &random);
        meeting_make(&w, &random);
        const bool bent = round % 2;
        if (bent) {
            meeting_bend(&w, &random);
        }
        float u = 0.5f + 0.4f * uniform(&random);
        w.edges[1].kind = EDGE_MEETING;
        w.edges[1].shape = MESH;
        EdgePoint e = point_of(&w, u, v3_zero(), false);
        for (int k = 0; k < 2; k++) {
            double g[3], value = quadric_at(w.meeting.surface + k, (const float[]){e.p.x, e.p.y, e.p.z}, g);
            Vec3 n = v3_normalize(v3((float)g[0], (float)g[1], (float)g[2]));
            assert_near("surface", value, 0, 1e-5);
            assert_near_v3("normal", e.across[k], n, 2e-3);
            assert_near("tangent along a normal", v3_dot(v3_normalize(e.tangent), n), 0, 2e-3);
            assert_near("side along a normal", v3_dot(v3_normalize(e.side[k]), v3_normalize(e.across[0])), 0, 1e-4);
        }
        Interaction si = shape_interaction(&w.scene, SHAPE_MESH, SHAPE_HAS_NORMALS, &e.hit);
        assert_true(bent || v3_length(v3_sub(si.p, e.p)) < 1e-4f);
        assert_near_v3("hit of the other one", e.met.p, e.p, 0);
        assert_int_equal(e.met.shape, SPHERE);
        Vec3 d = random_vector(&random), n = v3_normalize(v3_cross(e.tangent, d));
        assert_true(!edge_is_silhouette(&w.scene, &w.job, &e, n, d));
        check_tangent(&w, &e, u, v3_zero(), false);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_terminators), cmocka_unit_test(test_meetings)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
