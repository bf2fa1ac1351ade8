// corners.h: where noise is taken out of the interior term: at inner corners (integrator/corner.h), at narrow lobes (glossy.h) and
// on panes (shape/pane.h).
#pragma once

#include "render/render_parts.h"

// Finds out, after the selection is mapped and the terms are known.
rey_result rey_corners_begin(Render *r);
