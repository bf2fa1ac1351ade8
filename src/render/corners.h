// corners.h: the inner corners that the interior term looks out for (integrator/corner.h).
#pragma once

#include "render/render_parts.h"

// Finds them, after the selection is mapped and the terms are known.
rey_result rey_corners_begin(Render *r);
