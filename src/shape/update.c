// update.c: derived data of shapes.
#include "shape/update.h"

#include "shape/affine.h"
#include "shape/normals.h"
#include "shape/shape.h"

#include <string.h>

void rey_rectangle_mesh(float vertices[RECTANGLE_VERTICES][8], int32_t triangles[RECTANGLE_TRIANGLES][3]) {
    for (int i = 0; i < 4; i++) {
        float u = i == 1 || i == 2, v = i >= 2;
        float vertex[8] = {2 * u - 1, 2 * v - 1, 0, 0, 0, 1, u, v};
        memcpy(vertices[i], vertex, sizeof vertex);
    }
    int32_t t[2][3] = {{0, 1, 2}, {0, 2, 3}};
    memcpy(triangles, t, sizeof t);
}

// The format's order of faces, and of corners within them: uv (0,1), (1,1), (1,0), (0,0).
void rey_cube_mesh(float vertices[CUBE_VERTICES][8], int32_t triangles[CUBE_TRIANGLES][3]) {
    static const struct {
        float normal[3], corner[4][3];
    } faces[6] = {{{0, -1, 0}, {{1, -1, -1}, {1, -1, 1}, {-1, -1, 1}, {-1, -1, -1}}},
                  {{0, 1, 0}, {{1, 1, -1}, {-1, 1, -1}, {-1, 1, 1}, {1, 1, 1}}},
                  {{1, 0, 0}, {{1, -1, -1}, {1, 1, -1}, {1, 1, 1}, {1, -1, 1}}},
                  {{0, 0, 1}, {{1, -1, 1}, {1, 1, 1}, {-1, 1, 1}, {-1, -1, 1}}},
                  {{-1, 0, 0}, {{-1, -1, 1}, {-1, 1, 1}, {-1, 1, -1}, {-1, -1, -1}}},
                  {{0, 0, -1}, {{1, 1, -1}, {1, -1, -1}, {-1, -1, -1}, {-1, 1, -1}}}};
    static const float uv[4][2] = {{0, 1}, {1, 1}, {1, 0}, {0, 0}};
    for (int face = 0; face < 6; face++) {
        for (int k = 0; k < 4; k++) {
            float *vertex = vertices[face * 4 + k];
            memcpy(vertex, faces[face].corner[k], 3 * sizeof *vertex);
            memcpy(vertex + 3, faces[face].normal, 3 * sizeof *vertex);
            memcpy(vertex + 6, uv[k], 2 * sizeof *vertex);
        }
        int32_t first = face * 4, t[2][3] = {{first, first + 1, first + 2}, {first + 3, first, first + 2}};
        memcpy(triangles[2 * face], t, sizeof t);
    }
}

static void transform_point(const float *m, const float *p, float *out) {
    for (int r = 0; r < 3; r++) {
        out[r] = m[r * 4] * p[0] + m[r * 4 + 1] * p[1] + m[r * 4 + 2] * p[2] + m[r * 4 + 3];
    }
}

// Rectangles and cubes: vertices in the world from to_world; a mirroring pose turns the winding over.
static rey_result mesh_follow(rey_scene *scene, const ShapeRecord *shape) {
    SceneView *view = &scene->view;
    const float *m = view->theta + shape->to_world;
    double inverse[12];
    if (!rey_affine_inverse(m, inverse)) {
        return rey_fail(scene->ctx, REY_ERROR_SCENE, "a shape's to_world cannot be inverted");
    }
    bool cube = shape->vertex_count == CUBE_VERTICES;
    float vertices[CUBE_VERTICES][8];
    int32_t triangles[CUBE_TRIANGLES][3];
    if (cube) {
        rey_cube_mesh(vertices, triangles);
    } else {
        rey_rectangle_mesh(vertices, triangles);
    }
    bool mirrored = rey_affine_determinant(m) < 0;
    for (int32_t i = 0; i < shape->vertex_count; i++) {
        transform_point(m, vertices[i], view->theta + shape->positions + 3 * i);
    }
    for (int32_t i = 0; i < shape->triangle_count; i++) {
        int32_t *t = view->triangles + 3 * (shape->triangle + i);
        t[0] = triangles[i][0];
        t[1] = triangles[i][mirrored ? 2 : 1];
        t[2] = triangles[i][mirrored ? 1 : 2];
    }
    return REY_OK;
}

static double triangle_area(const SceneView *view, const ShapeRecord *shape, int32_t triangle) {
    const int32_t *t = view->triangles + 3 * (shape->triangle + triangle);
    const float *p = view->theta + shape->positions;
    double a[3], b[3];
    for (int k = 0; k < 3; k++) {
        a[k] = (double)p[3 * t[1] + k] - p[3 * t[0] + k];
        b[k] = (double)p[3 * t[2] + k] - p[3 * t[0] + k];
    }
    double n[3] = {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
    return 0.5 * sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
}

static void mesh_areas(SceneView *view, ShapeRecord *shape) {
    double total = 0;
    for (int32_t i = 0; i < shape->triangle_count; i++) {
        total += triangle_area(view, shape, i);
    }
    shape->area = (float)total;
    double sum = 0;
    for (int32_t i = 0; i < shape->triangle_count && shape->area_cdf >= 0; i++) {
        sum += triangle_area(view, shape, i);
        view->tables[shape->area_cdf + i] = total > 0 ? (float)(sum / total) : (float)(i + 1) / (float)shape->triangle_count;
    }
}

rey_result rey_shape_normals(const rey_scene *scene, const ShapeRecord *shape, float *normals) {
    const SceneView *view = &scene->view;
    MeshView mesh = {view->theta + shape->positions, (const uint32_t *)view->triangles + 3 * (size_t)shape->triangle,
                     (const uint32_t *)view->welded + shape->welded, shape->vertex_count, shape->triangle_count};
    double *sums = rey_alloc_array(scene->ctx, 3 * (size_t)shape->vertex_count, sizeof *sums);
    if (!sums) {
        return REY_ERROR_MEMORY;
    }
    rey_normal_sums(&mesh, sums);
    rey_normals_from_sums(&mesh, sums, normals);
    rey_free(scene->ctx, sums);
    return REY_OK;
}

// What a shape of one surface derives from its pose.
static rey_result posed_follow(rey_scene *scene, ShapeRecord *shape) {
    const float *m = scene->view.theta + shape->to_world;
    float *t = scene->view.tables + shape->table;
    bool regular = true;
    switch (shape->kind) {
#define SHAPE_MESH_KIND(ENUM, prefix)
#define SHAPE_CURVE(ENUM, prefix, ...)
#define SHAPE_POSED(ENUM, prefix, ...)                                                                                 \
    case SHAPE_##ENUM:                                                                                                 \
        regular = prefix##_follow(m, t, &shape->area);                                                                 \
        break;
#include "shape/kinds.inl"
#undef SHAPE_MESH_KIND
#undef SHAPE_POSED
#undef SHAPE_CURVE
    default:
        break;
    }
    if (regular && shape->kind == SHAPE_SPHERE && (rey_affine_determinant(m) < 0) != shape->mirrored) {
        return rey_fail(scene->ctx, REY_ERROR_SCENE, "the to_world of a sphere became a mirror image of what it was, which would "
                                                     "turn the sphere inside out");
    }
    return regular ? REY_OK : rey_fail(scene->ctx, REY_ERROR_SCENE, "a shape's to_world cannot be inverted");
}

rey_result rey_shape_update(rey_scene *scene, int32_t id) {
    ShapeRecord *shape = scene->view.shapes + id;
    rey_result result = REY_OK;
    if (shape->segment_count > 0) { // control points are all there is of a curve
        const float *points = scene->view.theta + shape->positions;
        for (int32_t i = 0; i < shape->vertex_count; i++) {
            if (points[4 * i + 3] < 0) {
                return rey_fail(scene->ctx, REY_ERROR_SCENE, "the radius of a curve's control point %d is %g, expected one >= 0",
                                (int)i, (double)points[4 * i + 3]);
            }
        }
        return REY_OK;
    }
    if (shape->kind != SHAPE_MESH) {
        return posed_follow(scene, shape);
    }
    if (shape->to_world >= 0 && (scene->dirty_shapes[id] & SHAPE_DIRTY_POSE)) {
        result = mesh_follow(scene, shape);
    }
    if (result == REY_OK && (shape->flags & SHAPE_SMOOTH_NORMALS) && (scene->dirty_shapes[id] & SHAPE_DIRTY_VERTICES)) {
        result = rey_shape_normals(scene, shape, scene->view.theta + shape->normals);
    }
    if (result == REY_OK) {
        mesh_areas(&scene->view, shape);
    }
    return result;
}

rey_result rey_instance_update(rey_scene *scene, int32_t id) {
    SceneView *view = &scene->view;
    const InstanceRecord *instance = view->instances + id;
    bool regular = pose_table(view->theta + instance->to_world, view->tables + instance->table);
    return regular ? REY_OK : rey_fail(scene->ctx, REY_ERROR_SCENE, "an instance's to_world cannot be inverted");
}
