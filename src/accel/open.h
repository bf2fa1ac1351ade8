// open.h: surfaces that let light pass and that kernels meet themselves (triangles.h). Private to src/accel.
#pragma once

#include "scene/scene.h"
#include "shape/shape.h"

static inline bool is_seen(const ShapeRecord *shape) { return !(shape->flags & SHAPE_UNSEEN); }

static inline bool stands_alone(const ShapeRecord *shape) {
    return shape->kind == SHAPE_SPHERE && shape->collection < 0 && is_seen(shape);
}

bool rey_is_open(const SceneView *view, const ShapeRecord *shape);
// Decides on view->open_apart.
void rey_open_find(SceneView *view);
// Fills view->open_triangles, where there are any, with what these surfaces are now.
void rey_open_take(SceneView *view);
