// twins.h: surfaces that lie in the same place, each point of one on the other. Which of them rays meet is an accident of rounding,
// and their outlines are there twice.
#pragma once

#include "scene/scene.h"

// A shape, or of instances the number of one; shape -1 where it is an instance, and both -1 where there is nothing.
typedef struct Twin {
    int32_t shape, instance;
} Twin;

// Sets twins to two surfaces of one kind with the same numbers, if there are any. `stands` says which shapes count. Faces of meshes
// that only overlap, and such that are turned over, are not found.
rey_result rey_twins_find(rey_scene *scene, bool (*stands)(const SceneView *view, const ShapeRecord *shape), Twin twins[2]);
