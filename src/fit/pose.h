// pose.h: what people read of a pose, 4 x 4 numbers by rows.
#pragma once

#include <stddef.h>

// A rotation is told by its axis times the angle, of which there are two, with angles 360 degrees apart: of those, the one that is
// closer to that of the pose `near`; the smaller one where it is null.

// "1 2 3, turned 0 30 0 deg, scale 1.2": its place, its rotation, and its scale where it has one.
void rey_pose_text(const float *pose, const float *near, char *text, size_t size);
// Three numbers of a pose: its place, its rotation [degrees], its scale along its axes.
typedef enum PosePart { POSE_PLACE, POSE_TURN, POSE_SCALE, POSE_PARTS } PosePart;
void rey_pose_part(const float *pose, const float *near, PosePart part, double out[3]);
// Angle between two poses [degrees], stretched or not, and the distance of their places.
double rey_pose_turned(const float *a, const float *b);
double rey_pose_distance(const float *a, const float *b);
