// light_borders.h: where the light of lamps ends abruptly in the air.
#pragma once

#include "shape/meetings.h"

// rey_meetings_find with the sides of the frustums of projectors, as far as the scene goes: of those whose outermost texels are
// not black.
rey_result rey_meetings_with_borders(rey_scene *scene, MeetingMoves *moves, const void *user, Array *meetings);
// Whether a light ends abruptly elsewhere.
bool rey_light_is_abrupt(const SceneView *view, const EmitterRecord *e);
