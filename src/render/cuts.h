// cuts.h: normal and bump maps without a shadowing function let light in abruptly at the plane of the surface's own shading
// normal, although the map's normal still faces the light.
#pragma once

#include "render/blame.h"
#include "scene/scene.h"

// Whether a scattering function does, itself or inside.
bool rey_cuts_within(const SceneView *view, int32_t bsdf);

// Appends records of a kind (EDGE_) of the triangles of one shape, or of all of it where it is no mesh, in every instance.
rey_result rey_faces_find(rey_scene *scene, int32_t shape, int32_t kind, Array *edges);

// Appends the triangles of meshes with such functions to `edges`, an Array of EdgeRecord.
rey_result rey_cuts_find(rey_scene *scene, Array *edges);

// Why a parameter's derivative lacks what moves along such planes; null where it does not. object: what it is about.
const char *rey_cuts_gap(const rey_scene *scene, const SensorRecord *sensor, const Param *p, char object[OBJECT_NAME]);
