// Points of edges of meshes, rims and outlines: each lies on its curve, its tangent is the rate of the point, and what it says of
// its surfaces is so. And where sensors see points, and how fast those move on the film.
#include "edge_world.h"

static void test_mesh_edges(void **state) {
    (void)state;
    uint64_t random = 1;
    for (int round = 0; round < 4 * ROUNDS; round++) {
        World w;
        world_make(&w, &random);
        const int corner = round % 3, shape = round / 3 % 2 ? INSTANCED : MESH;
        const int from = corner, to = (corner + 1) % 3, apex = (corner + 2) % 3;
        float u = 0.5f + 0.4f * uniform(&random), t = 0.1f + 0.7f * u;
        w.edges[1].kind = EDGE_MESH;
        w.edges[1].shape = shape;
        w.edges[1].corner = corner;
        w.edges[1].opposite = round % 5 ? 3 : EDGE_OPEN;
        Vec3 p[4], eye = v3_zero();
        for (int i = 0; i < 4; i++) {
            p[i] = shape == MESH ? vertex(&w, i) : pose_to_world(&w.scene, INSTANCE_AT, vertex(&w, i));
        }
        EdgePoint e = point_of(&w, u, eye, false);
        assert_near_v3("point", e.p, v3_madd(v3_scale(p[from], 1 - t), t, p[to]), 1e-5);
        assert_near_v3("side", e.side[0], v3_sub(p[apex], p[from]), 1e-5);
        assert_true((e.open != 0) == (w.edges[1].opposite == EDGE_OPEN));
        if (!e.open) {
            assert_near_v3("other side", e.side[1], v3_sub(p[3], p[from]), 1e-5);
        }
        Interaction si = shape_interaction(&w.scene, SHAPE_MESH, w.shapes[shape].flags, &e.hit);
        assert_near_v3("hit", si.p, e.p, 1e-5);
        check_tangent(&w, &e, u, eye, false);
        // All triangles at it must lie on one side; here those of the fan, to the vertices 3 and `apex`.
        const int32_t fan[2] = {apex, 3};
        w.job.fans = fan;
        e.fan_count = round % 7 ? 0 : 2;
        Vec3 d = random_vector(&random), n = v3_normalize(v3_cross(e.tangent, d));
        bool alike = v3_dot(e.side[0], n) * v3_dot(v3_sub(p[3], p[from]), n) > 0;
        assert_true((edge_is_silhouette(&w.scene, &w.job, &e, n, d) != 0) == ((e.open && !e.fan_count) || alike));
        // What is seen edge-on is an outline at the edge that rays pass first, not at the one behind.
        const int edge_on = round % 2;
        if (!e.open) {
            d = e.side[edge_on];
            n = v3_normalize(v3_cross(e.tangent, d));
            assert_true(edge_is_silhouette(&w.scene, &w.job, &e, n, d));
            assert_true(!edge_is_silhouette(&w.scene, &w.job, &e, n, v3_neg(d)));
            assert_true((edge_first_rise(&e, n) > 0) == (v3_dot(e.side[!edge_on], n) > 0));
        }
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
        w.edges[1].kind = EDGE_RIM;
        w.edges[1].shape = disk ? DISK : CYLINDER;
        w.edges[1].corner = (int32_t)end;
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
    if (w->edges[1].shape == SPHERE) {
        return v3_normalize(v3_sub(p, table_v3(&w->scene, TABLES)));
    }
    Vec3 q = local_of(w, p);
    return v3_normalize(v3_madd(v3_scale(table_v3(&w->scene, 12), q.x), q.y, table_v3(&w->scene, 16)));
}

// Distance to the surface, relative to its size.
static float round_off(const World *w, Vec3 p) {
    if (w->edges[1].shape == SPHERE) {
        return v3_length(v3_sub(p, table_v3(&w->scene, TABLES))) / w->spheres[TABLES + 3] - 1;
    }
    Vec3 q = local_of(w, p);
    return hypotf(q.x, q.y) - 1;
}

// Into the surface; and beside it the eye sees the surface, all but from the side.
static void check_inner(const World *w, const EdgePoint *e, Vec3 n, Vec3 view, Vec3 eye, bool parallel) {
    if (w->edges[1].shape == SPHERE) {
        assert_true(v3_length(v3_sub(e->inner, e->p)) < 0.01f);
        assert_near("angle beside it", v3_dot(round_normal(w, e->inner), view), OUTLINE_TURN, 0.01 * OUTLINE_TURN);
        assert_near("into the surface", v3_dot(v3_normalize(e->side[0]), n), -1, 1e-5);
        return;
    }
    Vec3 p = local_of(w, e->p), q = local_of(w, e->inner), o = local_of(w, v3_zero()), to_eye = local_of(w, eye);
    Vec3 s = v3_sub(local_of(w, e->side[0]), o);
    to_eye = parallel ? v3_sub(o, to_eye) : to_eye;
    float r = OUTLINE_TURN / hypotf(to_eye.x, to_eye.y), x = p.x + r * to_eye.x, y = p.y + r * to_eye.y;
    assert_near("x beside it", q.x, x / hypotf(x, y), 1e-5);
    assert_near("y beside it", q.y, y / hypotf(x, y), 1e-5);
    assert_near_v3("into the surface", s, v3(-p.x, -p.y, 0), 1e-5);
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
        w.edges[1].kind = sphere ? EDGE_OUTLINE : EDGE_SIDE;
        w.edges[1].shape = sphere ? SPHERE : CYLINDER;
        w.edges[1].corner = round % 3 == 1;
        Vec3 eye = v3_normalize(random_vector(&random));
        eye = parallel ? eye : v3_scale(eye, sphere ? 4 : 12);
        EdgePoint e = point_of(&w, u, eye, parallel);
        if (v3_length(e.tangent) == 0) {
            continue; // an eye in the cylinder
        }
        judged++;
        Vec3 n = round_normal(&w, e.p), view = v3_normalize(towards_eye(eye, parallel, e.p));
        assert_near("distance from the surface", round_off(&w, e.p), 0, 1e-5);
        assert_near("normal along the view", v3_dot(n, view), 0, 1e-5);
        assert_near("distance of the inner point", round_off(&w, e.inner), 0, 1e-5);
        check_inner(&w, &e, n, view, eye, parallel);
        check_tangent(&w, &e, u, eye, parallel);
        if (!sphere) { // its two sides are two lines
            w.edges[1].corner = !w.edges[1].corner;
            assert_true(v3_length(v3_sub(point_of(&w, u, eye, parallel).p, e.p)) > 0.5f);
        }
        Vec3 middle = sphere ? table_v3(&w.scene, TABLES) : pose_to_world(&w.scene, 0, v3(0, 0, 0.5f));
        assert_near_v3("middle", edge_reference(&e), middle, 1e-5);
    }
    assert_true(judged > ROUNDS / 2);
}

static void test_tubes(void **state) {
    (void)state;
    uint64_t random = 4;
    int judged = 0;
    for (int round = 0; round < ROUNDS; round++) {
        World w;
        world_make(&w, &random);
        const bool parallel = round % 2, side = round / 2 % 2;
        float u = 0.5f + 0.4f * uniform(&random), t = 0.1f + 0.7f * u;
        w.edges[1].kind = EDGE_TUBE;
        w.edges[1].shape = TUBE;
        w.edges[1].corner = side;
        Vec3 eye = v3(0.4f * uniform(&random), 1, uniform(&random)); // not along the tube
        eye = parallel ? v3_normalize(eye) : v3_add(v3(1.2f, 0, 0), v3_scale(eye, 4));
        EdgePoint e = point_of(&w, u, eye, parallel);
        CurveWeights b = bspline_weights(t);
        CurvePoint c = curve_sum(&w.scene, &e.hit, BSPLINE_POINTS, b.b, b.b1, b.b2);
        Vec3 view = v3_normalize(towards_eye(eye, parallel, e.p)), away = v3_sub(e.p, c.c);
        Vec3 n = bspline_interaction(&w.scene, 0, &e.hit).ng;
        assert_near("position", e.hit.u, t, 1e-6);
        assert_near_v3("middle", edge_reference(&e), c.c, 1e-5);
        assert_near("distance from the axis", v3_length(away), c.r, 1e-5);
        assert_near("foot", v3_dot(away, c.c1), 0, 1e-5);
        assert_near("normal along the view", v3_dot(n, view), 0, 2e-5);
        assert_near("into the tube", v3_dot(v3_normalize(e.side[0]), n), v3_dot(e.outside, e.outside) > 0 ? 1 : -1, 1e-5);
        check_tangent(&w, &e, u, eye, parallel);
        Hit inner = e.hit;
        inner.p = e.inner;
        assert_near("distance of the inner point", v3_length(v3_sub(e.inner, c.c)), c.r, 1e-5);
        assert_near("angle beside it", v3_dot(bspline_interaction(&w.scene, 0, &inner).ng, view), OUTLINE_TURN, 0.3 * OUTLINE_TURN);
        w.edges[1].corner = !side;
        assert_true(v3_length(v3_sub(point_of(&w, u, eye, parallel).p, e.p)) > c.r);
        judged += v3_length(e.tangent) > 0;
        // The ends are circles that bound the tube, seen from outside of it.
        w.edges[1].kind = EDGE_TUBE_END;
        e = point_of(&w, u, v3_zero(), false);
        Interaction si = bspline_interaction(&w.scene, 0, &e.hit);
        assert_near("end", e.hit.u, !side, 0);
        assert_near_v3("point of the end", si.p, e.p, 1e-5);
        assert_near_v3("seen from", e.outside, si.ng, 1e-5);
        assert_near("along the tube", v3_dot(v3_normalize(e.side[0]), v3_normalize(si.dp_dv)), side ? 1 : -1, 1e-5);
        check_tangent(&w, &e, u, v3_zero(), false);
    }
    assert_true(judged > ROUNDS / 2);
}

// Where the surface is hollow along the view, points before and behind lie within the tube.
static void test_hollow(void **state) {
    (void)state;
    uint64_t random = 6;
    int judged[2] = {0, 0};
    for (int round = 0; round < 20 * ROUNDS; round++) {
        World w;
        world_make(&w, &random);
        const bool parallel = round % 2;
        for (int i = 0; i < 4; i++) { // a sharp bend
            w.theta[CONTROLS + 4 * i + 1] += i % 2 ? 0.8f : -0.8f;
        }
        w.edges[1].kind = EDGE_TUBE;
        w.edges[1].shape = TUBE;
        w.edges[1].corner = round / 2 % 2;
        Vec3 eye = v3_normalize(random_vector(&random));
        eye = parallel ? eye : v3_add(v3(1.2f, 0, 0), v3_scale(eye, 4));
        EdgePoint e = point_of(&w, 0.5f + 0.4f * uniform(&random), eye, parallel);
        Hit hit = e.hit;
        Vec3 view = v3_normalize(towards_eye(eye, parallel, e.p)), slope;
        const float step = 0.02f;
        float ahead = bspline_distance(&w.scene, &hit, v3_madd(e.p, step, view), &slope);
        float behind = bspline_distance(&w.scene, &hit, v3_madd(e.p, -step, view), &slope);
        if (v3_length(e.tangent) > 0 && fabsf(ahead + behind) > 1e-5f && fabsf(ahead - behind) < fabsf(ahead + behind)) {
            bool hollow = ahead + behind < 0;
            assert_true((v3_dot(e.outside, e.outside) > 0) == hollow);
            if (hollow) { // no ray along it counts
                assert_true(v3_dot(e.outside, view) > 0);
            }
            judged[hollow]++;
        }
    }
    assert_true(judged[0] > ROUNDS && judged[1] > 20);
}

// In a shapegroup all is as in the group's own space, through the instance.
static void test_instanced(void **state) {
    (void)state;
    static const int32_t kinds[6][2] = {{EDGE_RIM, DISK}, {EDGE_RIM, CYLINDER}, {EDGE_SIDE, CYLINDER}, {EDGE_OUTLINE, SPHERE},
                                        {EDGE_TUBE, TUBE}, {EDGE_TUBE_END, TUBE}};
    uint64_t random = 5;
    for (int round = 0; round < ROUNDS; round++) {
        World w;
        world_make(&w, &random);
        const bool parallel = round / 6 % 2;
        float u = 0.5f + 0.4f * uniform(&random);
        w.edges[1].kind = kinds[round % 6][0];
        w.edges[1].shape = kinds[round % 6][1];
        Vec3 eye = v3_scale(v3_normalize(random_vector(&random)), parallel ? 1 : 12);
        EdgePoint own = point_of(&w, u, eye, parallel);
        w.shapes[w.edges[1].shape].collection = 0;
        eye = parallel ? instance_vector(&w.scene, INSTANCE_AT, eye) : pose_to_world(&w.scene, INSTANCE_AT, eye);
        EdgePoint e = point_of(&w, u, eye, parallel);
        float size = 1 + v3_length(e.p) + v3_length(e.tangent);
        if (v3_length(own.tangent) == 0) {
            continue; // an eye in the cylinder
        }
        assert_near_v3("point", e.p, pose_to_world(&w.scene, INSTANCE_AT, own.p), 1e-4 * size);
        assert_near_v3("tangent", e.tangent, instance_vector(&w.scene, INSTANCE_AT, own.tangent), 1e-3 * size);
        assert_near_v3("side", e.side[0], instance_vector(&w.scene, INSTANCE_AT, own.side[0]), 1e-4 * size);
        if (w.edges[1].kind == EDGE_TUBE_END) {
            assert_near_v3("seen from", e.outside, pose_normal(&w.scene, INSTANCE_AT, own.outside), 1e-5);
        }
        if (e.round) {
            assert_near_v3("inner point", e.inner, pose_to_world(&w.scene, INSTANCE_AT, own.inner), 1e-4 * size);
            assert_near_v3("middle", edge_reference(&e), pose_to_world(&w.scene, INSTANCE_AT, own.middle), 1e-4 * size);
        }
    }
}

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
                                       cmocka_unit_test(test_outlines), cmocka_unit_test(test_tubes),
                                       cmocka_unit_test(test_hollow),
                                       cmocka_unit_test(test_instanced), cmocka_unit_test(test_choice),
                                       cmocka_unit_test(test_views)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
