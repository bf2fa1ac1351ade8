// beacons.h: the balls around lights at a point beside which collisions may stand still (integrator/beacon.h).
#pragma once

#include "render/render_parts.h"

// Where surfaces move in media and lights and sensor stand still: fills job->beacons. None, and job->beacons null, where directions
// matter beyond what collisions see: smooth mirrors and glass, normals that are not the surfaces' own, phase functions that differ
// from place to place.
rey_result rey_beacons_begin(Render *r);
