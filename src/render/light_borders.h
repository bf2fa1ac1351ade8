// light_borders.h: where the light of lamps ends abruptly in the air.
#pragma once

#include "shape/meetings.h"

// rey_meetings_find with the surfaces in the air at which light jumps, as far as the scene goes: the sides of the frustums of
// projectors whose outermost texels are not black, the planes along which their pictures jump, and spots' textures, and the cones
// of spots that end abruptly; clips: further such triangles.
rey_result rey_meetings_with_borders(rey_scene *scene, const LightBorder *clips, int clip_count, MeetingMoves *moves,
                                     const void *user, Array *meetings);
// The same for kernels, which find them between two points: an Array of BeamRecord, and of StepRecord, to which its steps are
// appended.
rey_result rey_beam_records(rey_scene *scene, Array *steps, Array *beams);
// Whether a spot has no soft border; or so narrow a one that it all but jumps, which no border says.
bool rey_light_is_abrupt(const SceneView *view, const EmitterRecord *e);
bool rey_light_is_steep(const SceneView *view, const EmitterRecord *e);
