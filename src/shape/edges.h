// edges.h: the curves of surfaces along which visibility or shading can jump: edges of meshes, rims of disks and
// cylinders, outlines of spheres and tubes. Meshes' edges depend on their vertices, too: those in a plane are none.
#pragma once

#include "scene/scene.h"

// EDGE_OUTLINE: of a sphere; EDGE_SIDE: one of the two lines that bound a cylinder for a viewer; EDGE_TUBE: the same of a segment
// of a B-spline curve; EDGE_TUBE_END: the circle at which such a curve ends; EDGE_TERMINATOR: the curve in
// a triangle along which its shading normal is at right angles to the viewer; EDGE_MEETING: a MeetingRecord (meetings.h);
// EDGE_MARK: a MarkRecord (marks.h); EDGE_CUT: a triangle whose scattering function
// cuts light off at the plane of its shading normal; EDGE_FACING: a triangle, or all of another surface, on which normals of maps
// turn away from viewers.
enum {
    EDGE_MESH,
    EDGE_RIM,
    EDGE_OUTLINE,
    EDGE_SIDE,
    EDGE_TUBE,
    EDGE_TUBE_END,
    EDGE_TERMINATOR,
    EDGE_MEETING,
    EDGE_MARK,
    EDGE_CUT,
    EDGE_FACING
};
enum { EDGE_OPEN = -1 };
enum { EDGE_NONE = -1, EDGE_ANY = -2 };
// EDGE_SOFT: only the plane does behind which rays start; EDGE_STEP: a texture does, also where the triangles lie in one plane
enum { EDGE_SMOOTH, EDGE_CREASE, EDGE_SOFT, EDGE_STEP };

typedef struct EdgeRecord {
    int32_t kind, shape;
    int32_t instance;    // of shapes with SHAPE_INSTANCED, else 0
    int32_t prim, corner; // meshes: it runs from this corner of this triangle to the next one; tubes: the segment; corner of rims,
                          // sides and tubes: which, 0 or 1;
                          // meetings: prim is the record's number, and the shape its first; marks: corner is that number
    int32_t opposite;    // meshes: vertex of the other triangle that is not on it, or EDGE_OPEN
    int32_t other;       // meshes: that triangle, EDGE_NONE, or EDGE_ANY triangle of the mesh
    int32_t fan, fan_count; // meshes: where more than two triangles meet, such vertices of the others, in `fans`
    int32_t sides, side_count; // other surfaces that end along all of it, among the SharedSides (shared.h)
    int32_t sharers;     // how many records count for it together, 0 as 1
    int32_t crease;      // whether and why shading jumps across it: EDGE_SMOOTH, _CREASE, _SOFT, _STEP
    float first, last;   // the part of it that counts, within [0, 1]
} EdgeRecord;

// Appends the edges of all surfaces to `edges`, an Array of EdgeRecord, and to `fans`, an Array of int32_t; also those in a
// plane along which textures jump: `steps` are TextureSteps (marks.h), sorted by shape. Grids of distances and
// polylines have none yet.
rey_result rey_edges_find(rey_scene *scene, const Array *steps, Array *edges, Array *fans);
