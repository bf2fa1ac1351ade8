// boundary_edges.h: which edges of the scene a boundary term samples, and how often.
#pragma once

#include "render/boundary.h"

// Fills the plan's edges and their cumulative probabilities; edge_count 0 = nothing that jumps can move.
rey_result rey_boundary_edges(Render *r, BoundaryPlan *plan);
// The same for silhouettes that any vertex may see: weighted by length and by the angle that they are silhouettes in.
rey_result rey_boundary_all_edges(Render *r, BoundaryPlan *plan);
