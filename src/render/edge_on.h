// edge_on.h: borders of media whose faces are parallel to rays. Where all rays of a light, or of the sensor, pass along a face at
// which a medium ends, none of them crosses it, and its motion moves an edge of what they bring: that is not sampled, and where the
// rays come from a point of the face's plane, it does not even have a derivative (on one side rays enter through the face, on
// the other they leave through it).
#pragma once

#include "render/blame.h"
#include "scene/scene.h"

// Whether a parameter moves such a face, or such rays; then text says which.
bool rey_moves_edge_on(const rey_scene *scene, const SensorRecord *sensor, const Param *p, char text[2 * OBJECT_NAME]);
