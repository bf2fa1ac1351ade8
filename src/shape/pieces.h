// pieces.h: the triangles of what stands in a scene, those that stand for round surfaces, and which of them overlap. Private to
// src/shape.
#pragma once

#include "shape/cut.h"
#include "shape/meetings.h"
#include "shape/overlaps.h"

// A search. moves: of bodies, of which one of each pair does; borders: triangles that stand in the air.
typedef struct Pieces {
    rey_scene *scene;
    const LightBorder *borders;
    int32_t border_count;
    MeetingMoves *moves;
    const void *user;
    int32_t itself;           // meshes of at most so many triangles overlap themselves, too
    bool meshes;              // they are the only bodies
    float margin;             // by which boxes are larger than what they hold, over its size
    Array bodies, body_boxes; // of Body, of Box
    Array pieces, boxes;      // of Piece, of Box
    Array *found;             // what the caller makes of it
    Array *halves;            // of Half (meetings.c)
} Pieces;

// A shape, or an instance of one, of tubes a segment; shape -1: the border of a light with the number `instance`.
typedef struct Body {
    int32_t shape, instance;
    int32_t segment; // of a tube, else -1
    Box window;      // where it may meet another, or itself; empty where it cannot
} Body;

// A triangle of a body's mesh, or of those that stand for a round shape.
typedef struct Piece {
    int32_t body, triangle;
} Piece;

typedef struct Triangle {
    double p[3][3], n[3]; // n: unit
    double size;          // of its longest side
} Triangle;

// Whether two bodies are segments of one strand that follow each other, or the same one.
bool rey_bodies_join(const SceneView *view, const Body *a, const Body *b);

// Calls `overlap` with the search and the numbers of pieces whose boxes overlap.
rey_result rey_pieces_overlap(Pieces *s, OverlapFn *overlap);

Triangle rey_piece_triangle(const Pieces *s, const Piece *piece);

// Where the sides of a get to the plane of b, if they do: two points. Distances below `touch` count as 0.
typedef bool TriangleReach(const Triangle *a, const Triangle *b, double touch, double points[2][3]);
// Of triangles that lie on both sides of it.
TriangleReach rey_triangle_passes;
// The line on which two triangles meet, to `tolerance` of the smaller one's size.
bool rey_triangles_meet(const Triangle *a, const Triangle *b, TriangleReach *reach, double tolerance, double ends[2][3]);
