// pose.h: what people read of a pose, 4 x 4 numbers by rows.
#pragma once

#include <stddef.h>

// "1 2 3, turned 0 30 0 deg, scale 1.2": its place, the axis of its rotation times the angle, and its scale where it has one.
void rey_pose_text(const float *pose, char *text, size_t size);
// Angle between two poses [degrees], stretched or not, and the distance of their places.
double rey_pose_turned(const float *a, const float *b);
double rey_pose_distance(const float *a, const float *b);
