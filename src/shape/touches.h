// touches.h: borders of media that lie in other surfaces, as a box of fog does that stands on a floor.
#pragma once

#include "scene/scene.h"

// Sets *touch to whether some face of a shape with media lies in a face of another shape, to 1e-4 of their size.
rey_result rey_borders_touch(rey_scene *scene, bool *touch);
