// accel.h: the ray-tracing structure (Embree): one geometry per shape, numbered like the shapes.
#pragma once

#include "scene/scene.h"

// Builds the structure, or rebuilds the shapes marked dirty. Sets view.embree and the scene's bounds.
rey_result rey_accel_update(rey_scene *scene);
