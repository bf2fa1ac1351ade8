// boundary_edges.h: which edges of the scene a boundary term samples, and how often.
#pragma once

#include "render/boundary.h"

// Fills the plan's edges and their cumulative probabilities; edge_count 0 = nothing that jumps can move.
rey_result rey_boundary_edges(Render *r, BoundaryPlan *plan);
