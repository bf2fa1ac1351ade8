// edge_pieces.h: open edges of meshes in pieces, so that what shares them shares whole pieces (shared.h): of two walls on the long
// side of a floor each has a piece of it. Private to src/shape.
#pragma once

#include "shape/edges.h"

// How far a corner may be from where others have it, over the size of its numbers.
#define CORNER_TOLERANCE 5e-7

// The ends of an edge of a mesh in the world, and the third corner of its triangle.
void rey_edge_corners(const SceneView *view, const EdgeRecord *e, double p[3][3]);
// Whether it is an edge of a mesh at which a surface ends.
bool rey_edge_is_open(const EdgeRecord *e);
// Cuts open edges in `edges`, an Array of EdgeRecord, where others begin and end on them and go along them.
// Pieces of one edge are records of their own, of which all but the first stand at the end. stands: which shapes count.
rey_result rey_edges_cut(rey_scene *scene, bool (*stands)(const SceneView *view, const ShapeRecord *shape), Array *edges);
