// dropped.h: what of a derivative is not known where `path` drops light (SceneView.drops), and how that depends on the sum of an
// environment's table.
#pragma once

#include "render/render_parts.h"

// Why the derivative by a parameter with these REY_TERM_ is not known, null where it is.
const char *rey_dropped_gap(const SceneView *view, const Param *p, int terms);

// Where texels of an environment are selected, the logarithm of the sum gets room behind the selection, at *size.
void rey_dropped_add_sky(Render *r, int64_t *size);
// Reverse: adds what the gradient of that sum makes of the gradient of the texels.
void rey_dropped_gradient(const Render *r, double *gradient);
// Forward: the motion of that sum that the texels' makes.
void rey_dropped_tangent(const Render *r, float *tangent);
