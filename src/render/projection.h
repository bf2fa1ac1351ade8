// projection.h: where the film sees points and lines, without lenses.
#pragma once

#include "render/film.h"
#include "shape/edges.h"
#include "shape/meetings.h"

typedef struct Projection {
    double inverse[12];     // of the sensor's pose
    double scale_x, scale_y, shift_x, shift_y; // pixels per slope, and the centre
    double low_x, low_y, high_x, high_y;       // what of the film counts [pixels]
    double near, lens; // lens: no point of it is further from the middle
    bool parallel, pinhole;
} Projection;

// The planes that cut what the film sees, two triangles each.
void rey_clip_borders(const SceneView *view, const FilmPlan *plan, LightBorder borders[4]);
// Largest entry of a pose's linear part.
double rey_pose_size(const float *m);
// Where a sensor looks from: a point and 1, or the direction of parallel views and 0.
void rey_sensor_eye(const SceneView *view, const SensorRecord *sensor, double eye[4]);
Projection rey_projection_of(const SceneView *view, const FilmPlan *plan);
void rey_to_sensor(const Projection *p, const double *world, double *out);
// Of a point in the sensor's space [pixels].
void rey_to_film(const Projection *p, const double *local, double *film);
// Cuts a straight edge to what the film sees; returns its length there [pixels].
double rey_see_line(const Projection *p, const double from[3], const double to[3], EdgeRecord *e);
