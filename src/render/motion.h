// motion.h: the selected parameters that move surfaces or the sensor.
#pragma once

#include "render/blame.h"
#include "render/render_parts.h"

// Whether the kernels know the interior term of a parameter that moves something, as the sensor sees it.
bool rey_motion_known(const rey_scene *scene, const SensorRecord *sensor, const Param *p);

// Why not, in words that name the object.
void rey_motion_obstacle(const rey_scene *scene, const SensorRecord *sensor, const Param *p, char text[OBJECT_NAME]);

// Whether the parameter moves nothing but surfaces that light passes undeviated and undimmed: in scenes with media these are
// where media end, and neither the path's vertices nor what hides light are among them.
bool rey_moves_border(const SceneView *view, const Param *p);

// Whether cameras that move take whole paths along (integrator/glide.h): in scenes with media, where no surface scatters or shines.
bool rey_cameras_glide(const SceneView *view);

// Where a sensor keeps one of its numbers (CAMERA_), -1 where it has none.
int32_t rey_camera_theta(const SensorRecord *s, int32_t number);

// The numbers of a sensor's cameras, CAMERA_NUMBERS of each: several are those of a batch.
int32_t rey_motion_cameras(const SensorRecord *s);

// Where the job notes that the values of such a parameter are selected; null when they do nothing to what the sensor sees.
int32_t *rey_motion_slot(Render *r, const Param *p);

// What follows from all that is selected: whether collisions ride, and volumes of one place (the pair of build_scattering.c and its
// sum), which move together.
void rey_motion_settle(Render *r);

// Vertex normals that follow selected vertices (SHAPE_SMOOTH_NORMALS) get room behind the selection, from *size on.
void rey_motion_add_normals(Render *r, int64_t *size);
// Reverse: adds what the gradient of those normals makes of the gradient of their vertices.
rey_result rey_motion_gradient(Render *r, double *gradient);
// Forward: the motion of those normals that the vertices' makes.
rey_result rey_motion_tangent(const Render *r, float *tangent);
