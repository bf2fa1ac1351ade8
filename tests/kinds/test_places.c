// What moving points do: segments between attached points, points of surfaces as hits, and the faces of boxes of media that rays
// cross, against differences and by what they must be.
#include "edge_world.h"

#include "integrator/border.h"

// A segment's contribution K |N . r| / |r|^3 e^(a . w), N the area vector at its end.
static double contribution(Vec3 r, Vec3 n, Vec3 a) {
    double length = (double)v3_length(r), along = (double)v3_dot(r, a) / length;
    return fabs((double)v3_dot(n, r)) / (length * length * length) * exp(along);
}

static void test_segment(void **state) {
    (void)state;
    uint64_t random = 1;
    for (int round = 0; round < ROUNDS; round++) {
        Vec3 r = v3_scale(v3_normalize(random_vector(&random)), 1.5f + 0.5f * uniform(&random)), a = random_vector(&random);
        Vec3 n = v3_normalize(v3_madd(v3_normalize(r), 0.5f, random_vector(&random))), dn, found;
        n = round % 2 ? n : v3_neg(n);
        const float h = 0.01f, length = v3_length(r);
        double value = contribution(r, n, a), area[3], expected[3];
        for (int k = 0; k < 3; k++) {
            Vec3 e = v3(k == 0, k == 1, k == 2);
            expected[k] = (contribution(v3_madd(r, h, e), n, a) - contribution(v3_madd(r, -h, e), n, a)) / (2 * (double)h);
            area[k] = (contribution(r, v3_madd(n, h, e), a) - contribution(r, v3_madd(n, -h, e), a)) / (2 * (double)h);
        }
        found = segment_adj(v3_scale(r, 1 / length), length, n, (float)value, v3_scale(a, (float)value), &dn);
        assert_near_v3("segment", found, v3((float)expected[0], (float)expected[1], (float)expected[2]), 3e-3 * (1 + value));
        assert_near_v3("area", dn, v3((float)area[0], (float)area[1], (float)area[2]), 1e-3 * (1 + value));
    }
}

static void test_point_hit(void **state) {
    (void)state;
    uint64_t random = 2;
    for (int round = 0; round < ROUNDS; round++) {
        World w;
        world_make(&w, &random);
        float u = 0.4f + 0.3f * uniform(&random), v = 0.3f + 0.2f * uniform(&random);
        Hit at = {MESH, round % 2, u, v, v3_zero(), 0};
        Interaction si = shape_interaction(&w.scene, SHAPE_MESH, SHAPE_HAS_NORMALS, &at);
        Vec3 n, disk = pose_to_world(&w.scene, 0, v3(0.3f, 0.2f, 0));
        Hit hit = point_hit(&w.scene, MESH, round % 2, 0, si.p, &n);
        assert_near("u", hit.u, u, 1e-4);
        assert_near("v", hit.v, v, 1e-4);
        assert_near_v3("normal", n, si.ng, 1e-5);
        point_hit(&w.scene, DISK, 0, 0, disk, &n);
        assert_near("normal of a disk", fabs(v3_dot(n, pose_column(&w.scene, 0, 0))) + fabs(v3_dot(n, pose_column(&w.scene, 0, 1))),
                    0, 1e-5);
    }
}

// ---- boxes of media ----------------------------------------------------------------------------------------------

enum { TO_WORLD = POSE, TABLE = 12 }; // of the pose that the tables hold with its inverse

static void turned_to(World *w, int entry, float by) {
    w->theta[TO_WORLD + entry] += by;
    assert_true(pose_table(w->theta + TO_WORLD, w->spheres));
}

// What the distances of the faces are worth; clears `alike` where they are others.
static float faces_worth(const World *w, const VolumeNode *v, Vec3 o, Vec3 d, const float worth[2], const Face face[2],
                         bool *alike) {
    Face moved[2];
    medium_faces(&w->scene, v, o, d, INFINITY, m_set(true), moved);
    float sum = 0;
    for (int k = 0; k < 2; k++) {
        sum += moved[k].m ? worth[k] * moved[k].at : 0;
        *alike = *alike && moved[k].m == face[k].m && moved[k].axis == face[k].axis;
    }
    return sum;
}

// The box around the cube has the same axes as the world.
static void check_face(const World *w, const VolumeNode *v, Vec3 p, const Face *face) {
    float corner, size, x[3] = {p.x, p.y, p.z};
    medium_box(&w->scene, v, face->axis, &corner, &size);
    assert_near("place on the face", (x[face->axis] - corner) / size, face->upper ? 1 : 0, 1e-4);
}

static bool inside_box(const World *w, const VolumeNode *v, Vec3 p) {
    const float x[3] = {p.x, p.y, p.z};
    bool inside = true;
    for (int k = 0; k < 3; k++) {
        float corner, size;
        medium_box(&w->scene, v, k, &corner, &size);
        inside = inside && x[k] >= corner && x[k] <= corner + size;
    }
    return inside;
}

// Which faces there are, seen from points along the ray.
static void check_found(const World *w, const VolumeNode *v, Vec3 o, Vec3 d, const Face face[2]) {
    enum { STEPS = 1000 };
    const float step = 0.02f;
    int within = 0;
    for (int i = 0; i < STEPS; i++) {
        within += inside_box(w, v, v3_madd(o, step * (float)i, d));
    }
    bool starts = inside_box(w, v, o);
    if (within > 3) {
        assert_true((face[0].m != 0) == !starts && face[1].m);
        assert_near("length within", face[1].at - (starts ? 0 : face[0].at), step * (float)within, 2.1 * step);
    }
}

// Faces next to where the ray begins or ends are a surface's.
static void check_apart(const World *w, const VolumeNode *v, Vec3 o, Vec3 d, const Face *face, bool leaves) {
    Vec3 p = v3_madd(o, face->at, d), n = v3(face->axis == 0, face->axis == 1, face->axis == 2);
    const float cosine = fabsf(v3_dot(n, d)), out = face->upper ? 1 : -1;
    for (int far = 0; far < 2 && cosine > 0.1f; far++) {
        float least = (1 + fmaxf(fmaxf(fabsf(p.x), fabsf(p.y)), fabsf(p.z))) * 1.5e-4f * (far ? 1.5f : 0.6f);
        Face found[2];
        if (leaves) { // the least distance goes by where the ray begins
            Vec3 begin = v3_madd(p, -0.2f, d);
            least *= (1 + fmaxf(fmaxf(fabsf(begin.x), fabsf(begin.y)), fabsf(begin.z))) /
                     (1 + fmaxf(fmaxf(fabsf(p.x), fabsf(p.y)), fabsf(p.z)));
            medium_faces(&w->scene, v, begin, d, 0.2f + least / cosine, m_set(true), found);
        } else {
            medium_faces(&w->scene, v, v3_madd(p, out * least, n), d, INFINITY, m_set(true), found);
        }
        assert_int_equal(found[leaves].m != 0, far);
    }
    Vec3 next = face_inside(p, d, leaves);
    float step = (1 + fmaxf(fmaxf(fabsf(p.x), fabsf(p.y)), fabsf(p.z))) * 1e-5f;
    assert_near("step", v3_dot(v3_sub(next, p), d), leaves ? -step : step, 0.1 * step);
}

static void test_faces(void **state) {
    (void)state;
    uint64_t random = 3;
    int crossed = 0;
    for (int round = 0; round < 4 * ROUNDS; round++) {
        World w;
        world_make(&w, &random);
        VolumeNode v = {.kind = VOLUME_GRID, .wrap = round % 2 ? WRAP_CLAMP : WRAP_REPEAT, .table = TABLE, .to_world = TO_WORLD};
        const int32_t at = 0;
        double gradient[16] = {0};
        Sink sink = {.gradient = gradient, .volume_at = &at};
        w.scene.volumes = &v;
        // From within or from outside.
        Vec3 middle = pose_to_world(&w.scene, 0, v3(0.5f, 0.5f, 0.5f)), d = v3_normalize(random_vector(&random));
        Vec3 o = v3_madd(v3_madd(middle, round % 3 ? -8.0f : 0.0f, d), 0.4f, random_vector(&random));
        const float worth[2] = {uniform(&random), uniform(&random)}, h = 1e-3f;
        Face face[2];
        medium_faces(&w.scene, &v, o, d, INFINITY, m_set(true), face);
        Vec3 turn = v3_zero(), way = random_vector(&random);
        check_found(&w, &v, o, d, face);
        for (int k = 0; k < 2; k++) {
            if (face[k].m) {
                Vec3 p = v3_madd(o, face[k].at, d);
                check_face(&w, &v, p, face + k);
                check_apart(&w, &v, o, d, face + k, k);
                face_adj(&w.scene, &v, face + k, d, worth[k], &sink);
                turn = v3_add(turn, face_turn(face + k, d, worth[k]));
                crossed++;
            }
        }
        float difference = 0;
        bool alike = true;
        for (int side = -1; side <= 1; side += 2) { // where the ray moves by `way`, it crosses that much earlier
            difference -= (float)side / (2 * h) * faces_worth(&w, &v, v3_madd(o, (float)side * h, way), d, worth, face, &alike);
        }
        if (alike) {
            assert_near("turn", v3_dot(turn, way), difference, 0.02 * (1 + fabs(difference)));
        }
        for (int i = 0; i < 12; i++) {
            difference = 0;
            alike = true;
            for (int side = -1; side <= 1; side += 2) {
                turned_to(&w, i, (float)side * h);
                difference += (float)side / (2 * h) * faces_worth(&w, &v, o, d, worth, face, &alike);
                turned_to(&w, i, (float)-side * h);
            }
            if (alike) {
                assert_near("pose", gradient[i], difference, 0.02 * (1 + fabs(difference)));
            }
        }
    }
    assert_true(crossed > ROUNDS);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_segment), cmocka_unit_test(test_point_hit),
                                       cmocka_unit_test(test_faces)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
