// edge_sizes.h: how much of the film, and of the world, edges take: by that they are sampled.
#pragma once

#include "render/projection.h"
#include "render/render_parts.h"

// Length on the film [pixels], 0 where it does not see the edge, which may be cut to what it sees. eye: of the sensor, or the
// direction of parallel views, and 0.
double rey_edge_on_film(const Render *r, const Projection *p, const double eye[4], EdgeRecord *e);
// Length in the world; of meshes times the angle that makes it a silhouette. Of EDGE_TERMINATOR and EDGE_CUT the triangle's area,
// of the former times the largest sine of the angles between its normals. steps: jumps of textures count, silhouettes or not.
double rey_edge_in_world(const Render *r, const EdgeRecord *e, bool steps);
