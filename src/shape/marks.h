// marks.h: curves of a surface along which its textures jump.
#pragma once

#include "shape/edges.h"

// Where the textures of a shape jump. STEP_LINES: where u x + v y + offset, (x, y) the surface's own uv, is a whole number from
// `low` to `high`. STEP_FACES: from triangle to triangle. STEP_SEAMS: where uv itself does, between triangles and where
// round surfaces close. STEP_TANGENTS: where the direction in which u grows does, by which the surface scatters, between triangles.
enum { STEP_LINES, STEP_FACES, STEP_SEAMS, STEP_TANGENTS };
typedef struct TextureStep {
    int32_t shape, sort;
    double u, v, offset, low, high;
} TextureStep;

// The same as kernels read it.
typedef struct StepRecord {
    float u, v, offset, low, high;
    int32_t sort;
} StepRecord;

// A piece of such a curve: two points, by their barycentrics in a triangle, or by uv on other shapes.
typedef struct MarkRecord {
    float ends[4];
} MarkRecord;

// Whether a shape (of an instance) can move.
typedef bool MarkMoves(const void *user, int32_t shape, int32_t instance);

// Whether all of a mesh's edge between the points uv a and b lies on a line of the steps from `first` on, which are sorted by
// shape. Such lines are edges, not marks.
bool rey_step_along(const Array *steps, size_t first, const double a[2], const double b[2]);

// Appends the marks of shapes that move to `edges` (EDGE_MARK) and `marks`, an Array of MarkRecord.
rey_result rey_marks_find(rey_scene *scene, const Array *steps, MarkMoves *moves, const void *user, Array *edges, Array *marks);
