// meetings.h: the curves along which two surfaces pass through each other, and along which the light of a lamp ends on one.
#pragma once

#include "scene/scene.h"

// A surface near a curve, tubes excepted: f(x) = y . M y / 2 + n . y + constant = 0 with y = x - centre, so that a plane has M = 0.
typedef struct Quadric {
    float centre[3], linear[3], constant;
    float matrix[6]; // xx yy zz yz zx xy
} Quadric;

// Planes that cut what the sensor sees, in the place of a light's number: near_clip and far_clip.
enum { BORDER_NEAR = -1, BORDER_FAR = -2 };

// A triangle of the surface, in the air, at which the light of a lamp ends or jumps; of a cone, between two of its lines.
typedef struct LightBorder {
    float p[3][3];
    int32_t light;
    bool round;
    Quadric cone;
} LightBorder;

// A piece of such a curve, close to the straight line between its ends.
typedef struct MeetingRecord {
    int32_t shape[2], prim[2]; // second shape -1: a LightBorder, prim its light or BORDER_; of meshes and tubes: triangle, segment
    int32_t instance[2]; // of shapes with SHAPE_INSTANCED, else 0
    float ends[6];       // two points
    Quadric surface[2];
} MeetingRecord;

// Whether a shape (of an instance) can move; shape -1: the light with the number `instance`, or BORDER_.
typedef bool MeetingMoves(const void *user, int32_t shape, int32_t instance);

// Appends the curves of all surfaces of which at least one moves to `meetings`, an Array of MeetingRecord. What touches without
// passing through, to 1e-4 of its size, does not meet, nor do the segments of a strand. Of two triangles in one plane that have a
// side on a curve, its record is of one. Grids of distances and polylines have none yet.
rey_result rey_meetings_find(rey_scene *scene, const LightBorder *borders, int32_t border_count, MeetingMoves *moves,
                             const void *user, Array *meetings);
