// remesh.h: a mesh of about the same shape with edges of about the same length [botsch2004 section 4].
#pragma once

#include "fit/point_mesh.h"
#include "io/mesh.h"

// points: three numbers per point of mesh. Rounds of splits of edges longer than 4/3 of edge_length, collapses of those
// shorter than 4/5, flips that bring the number of neighbours closer to six, and relaxation within the surface; always in the
// same order. Borders, and edges where more than two triangles meet, may be split and stay otherwise. out gets positions
// and faces; the caller frees it with rey_mesh_free.
rey_result rey_remesh(rey_context *ctx, const PointMesh *mesh, const double *points, double edge_length, int rounds,
                      rey_mesh *out);
