// remesh.h: a mesh of about the same shape with edges of about the same length [botsch2004 section 4].
#pragma once

#include "fit/point_mesh.h"
#include "io/mesh.h"

enum { REMESH_LARGEST = 1 << 22 }; // triangles: one of the rounds over five million took 80 s on two cores

typedef struct RemeshDef {
    double edge_length;
    int rounds;
    bool (*go_on)(void *user); // asked in every pass; false cancels (REY_ERROR_CANCELLED). May be null
    void *user;
} RemeshDef;

// About how many triangles of these edges a mesh has: as many as its area holds, and as its edges are split into where it is thin.
double rey_remesh_estimate(const PointMesh *mesh, const double *points, double edge_length);

// points: three numbers per point of mesh. Rounds of splits of edges longer than 4/3 of edge_length, collapses of those
// shorter than 4/5, flips that bring the number of neighbours closer to six, and relaxation within the surface; always in the
// same order. Borders, and edges where more than two triangles meet, may be split and stay otherwise. out gets positions
// and faces; the caller frees it with rey_mesh_free.
rey_result rey_remesh(rey_context *ctx, const PointMesh *mesh, const double *points, RemeshDef def, rey_mesh *out);
