// shared.h: edges along which several surfaces end, as the six rectangles of a room do, or a disk on the end of a cylinder. They
// are edges of one body: whether rays pass it there, or meet another of its faces, all of these surfaces decide, and it is there
// once.
#pragma once

#include "scene/scene.h"

// Another surface that ends along an edge.
typedef struct SharedSide {
    int32_t shape, instance;
    int32_t prim;   // the triangle that ends there; 0 of other surfaces, as of what rays meet of them
    int32_t radial; // whether `side` is a point that it lies towards, and not the direction from the edge into it
    float side[3];  // in the world
} SharedSide;

// Sets `sides` and `side_count` of EdgeRecords that run along each other from end to end, and appends to `sides`, an Array of
// SharedSide. Straight edges that run along each other for a part of their length are cut into pieces first, appended to `edges`
// (edge_pieces.h). stands: which shapes count. Not found are those at which no surface ends, and arcs.
rey_result rey_edges_share(rey_scene *scene, bool (*stands)(const SceneView *view, const ShapeRecord *shape), Array *edges,
                           Array *sides);
