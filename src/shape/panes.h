// panes.h: flat convex panes, over which attached points may slide where it spares noise (pane.h).
#pragma once

#include "scene/scene.h"

enum { PANE_SIDES = 8 };

// side[i] . (x, 1) is the distance of x from a side, in units of the width along it in which points stop sliding; sides that
// there are not are (0, 0, 0, 1).
typedef struct PaneRecord {
    float side[PANE_SIDES][4];
} PaneRecord;

// at: by shape, where its triangles begin in `of`, -1 = it has no panes; of: their panes, -1 = they are of none. eye: a point and
// 1, or a direction and 0: along the lines of sight points slide.
typedef struct PaneSet {
    const PaneRecord *pane;
    const int32_t *at, *of;
    float eye[4];
} PaneSet;

// Appends the panes of a mesh to `panes`, an Array of PaneRecord, and which of them its triangles belong to, to `of`, an Array of
// int32_t: a pane is all triangles in one plane, turned alike, if their common border is a convex polygon of at most PANE_SIDES
// sides. Large meshes have none, nor do those with vertex normals, and nothing is appended of what has none.
rey_result rey_panes_find(rey_scene *scene, int32_t shape, Array *panes, Array *of);
