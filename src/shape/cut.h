// cut.h: the triangles of surfaces, and those that stand for round ones. Private to src/shape, but for what is asked about tubes.
#pragma once

#include "scene/scene.h"

// So many triangles stand for one segment of a tube.
enum { REY_TUBE_PIECES = 128 };

// How many triangles a shape has; of tubes, a segment. 0: it is never cut.
int32_t rey_cut_triangles(const SceneView *view, int32_t shape);
// Corner k of a triangle in the shape's own space; those of a tube's segments follow each other.
void rey_cut_corner(const SceneView *view, int32_t shape, int32_t triangle, int k, double p[3]);
const int32_t *rey_mesh_triangle(const SceneView *view, const ShapeRecord *shape, int32_t triangle);

// Whether a tube bends somewhere more sharply than its radius, so that it passes through itself there.
bool rey_tube_folds(const SceneView *view, int32_t shape);
// What a curve's segment lies in, in its own space.
void rey_tube_box(const SceneView *view, int32_t shape, int32_t segment, double low[3], double high[3]);
// What its triangles lie in.
void rey_cut_box(const SceneView *view, int32_t shape, int32_t segment, double low[3], double high[3]);

static inline double dot3(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static inline void cross3(const double a[3], const double b[3], double out[3]) {
    for (int k = 0; k < 3; k++) {
        int i = (k + 1) % 3, j = (k + 2) % 3;
        out[k] = a[i] * b[j] - a[j] * b[i];
    }
}
