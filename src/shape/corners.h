// corners.h: inner corners: the lines along which flat surfaces touch or pass through each other, those of different bodies and
// those of one small mesh.
#pragma once

#include "shape/meetings.h"

// Such a line as it is seen from one of the two surfaces, the viewer. The lens on it is a part of the other one's plane, in front
// of the viewer: h above the line at s of its length, it is where h < steep length s (1 - s).
typedef struct CornerRecord {
    int32_t viewer, wall, prim;         // prim: the wall's triangle
    float origin[3], along[3], up[3];   // of the lens: one end of the line, unit vectors along it and away from it
    float normal[3];                    // of the viewer's plane, on the lens's side
    float length, steep;
} CornerRecord;

// Appends those of all meshes in the scene itself of which at least one moves to `corners`, an Array of CornerRecord, in the order
// of their viewers.
rey_result rey_corners_find(rey_scene *scene, MeetingMoves *moves, const void *user, Array *corners);
