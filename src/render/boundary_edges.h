// boundary_edges.h: which edges of the scene a boundary term samples, and how often.
#pragma once

#include "render/boundary.h"

// Fills the plan's edges and their cumulative probabilities; edge_count 0 = nothing that jumps can move. What the sensor sees
// of edges that move, by its length on the film; silhouettes that any vertex may see, by length and by the angle that they are
// silhouettes in; or triangles, by area and by the angle between their normals.
rey_result rey_boundary_edges(Render *r, int32_t kind, BoundaryPlan *plan);

// Whether the selection moves a light.
bool rey_light_moves(const Render *r, int32_t light);

// Refuses what moves where the sensor's near or far plane cuts the border of a medium in view, unless terms were asked for by name.
rey_result rey_check_clipped_media(const Render *given);
