// marks.h: curves of a surface along which its textures jump.
#pragma once

#include "shape/edges.h"

// Where the textures of a shape jump. STEP_LINES: where u x + v y + offset, (x, y) the surface's own uv, is a whole number from
// `low` to `high`. STEP_FACES: from triangle to triangle. STEP_SEAMS: where uv itself does, between triangles and where
// round surfaces close. STEP_TANGENTS: where the direction in which u grows does, by which the surface scatters, between triangles.
// STEP_FRAMES: where the vectors by which points move with u and v do, by which heights are slopes.
enum { STEP_LINES, STEP_FACES, STEP_SEAMS, STEP_TANGENTS, STEP_FRAMES };
// Of STEP_LINES, (u, v, offset) is `scale` times a row of the texture's to_uv, less a constant, and that row begins at number `at`
// of the selection, -1 = it is not selected.
typedef struct TextureStep {
    int32_t shape, sort, at;
    double u, v, offset, low, high, scale;
} TextureStep;

// The same as kernels read it.
typedef struct StepRecord {
    float u, v, offset, low, high, scale;
    int32_t sort, at;
} StepRecord;

// A spot or projector whose light ends abruptly or jumps: at its cone, or along the lines first... of its picture, STEP_LINES of
// its uv.
typedef struct BeamRecord {
    int32_t light, first, end, cone;
} BeamRecord;

// A piece of such a curve: two points, by their barycentrics in a triangle, or by uv on other shapes; and of a line of a
// texture whose to_uv is selected, what the step says of it. Where such a line lies along the end of its surface or triangle, the
// picture has two derivatives, one to either side: `half` of its jump is their mean, between the field on the left of the piece and
// the one that would be on its right. That moves with to_uv alone: surfaces' ends are edges.
typedef struct MarkRecord {
    float ends[4];
    float u, v, scale;
    int32_t at, half;
} MarkRecord;

// Whether a shape (of an instance) can move.
typedef bool MarkMoves(const void *user, int32_t shape, int32_t instance);

// Whether all of a mesh's edge between the points uv a and b lies on a line of the steps from `first` on, which are sorted by
// shape. Such lines are edges, not marks.
bool rey_step_along(const Array *steps, size_t first, const double a[2], const double b[2]);

// Where a step is `level` across the unit square; *side: along which side of it, with the square on the left, else -1.
bool rey_step_across(const TextureStep *s, double level, double ends[2][2], int *side);

// Appends the marks of shapes that move, and those of steps that are selected, to `edges` (EDGE_MARK) and `marks`, an Array of
// MarkRecord. Fails where a selected texture jumps along a line of another one.
rey_result rey_marks_find(rey_scene *scene, const Array *steps, MarkMoves *moves, const void *user, Array *edges, Array *marks);
