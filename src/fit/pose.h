// pose.h: what people read of a pose, 4 x 4 numbers by rows.
#pragma once

#include <stddef.h>

// "1 2 3, turned 0 30 0 deg, scale 1.2": its place, the axis of its rotation times the angle, and its scale where it has one.
void rey_pose_text(const float *pose, char *text, size_t size);
// Three numbers of a pose: its place, the axis of its rotation times the angle [degrees], its scale along its axes.
typedef enum PosePart { POSE_PLACE, POSE_TURN, POSE_SCALE, POSE_PARTS } PosePart;
void rey_pose_part(const float *pose, PosePart part, double out[3]);
// Angle between two poses [degrees], stretched or not, and the distance of their places.
double rey_pose_turned(const float *a, const float *b);
double rey_pose_distance(const float *a, const float *b);
