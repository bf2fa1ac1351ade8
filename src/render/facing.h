// facing.h: where normals of normal and bump maps turn away from what looks at them (integrator/boundary/facing.h).
#pragma once

#include "scene/scene.h"

// What keeps that from being known in a scene, null where it is.
const char *rey_facing_gap(const SceneView *view, const SensorRecord *sensor);

// Whether a parameter turns normals of maps in a scene with media, where that is known as what moves is (integrator/ride.h).
bool rey_facing_in_media(const SceneView *view, const Param *p);

// Of the terms that a parameter may need, those that it does: the jump is computed where it is known, and elsewhere looked out for.
int rey_terms_stated(const rey_scene *scene, int sensor, int terms);

// Appends the triangles of meshes with maps, and their other surfaces, to `edges`, an Array of EdgeRecord.
rey_result rey_facing_find(rey_scene *scene, Array *edges);
