// beacons.h: the balls around lights at a point beside which collisions may move as the lights do (integrator/beacon.h).
#pragma once

#include "render/render_parts.h"

// Where lights at a point that lie within media move, or the sensor beside them, or lights whose borders media show
// (integrator/shaft.h; fills job->beams): collisions ride (integrator/ride.h), which
// job->rides and what goes with it say from here on. Not where directions matter beyond what collisions see (rey_beacons_begin),
// and where collisions cannot ride.
rey_result rey_lights_ride(Render *r);
// Where collisions ride: fills job->beacons. None, and job->beacons null, where directions matter beyond what collisions see:
// smooth mirrors and glass, masks, maps without a shadowing function; and where lights or the sensor move, with sensors that are
// no cameras. Refuses what moves beside lights that need one and have none.
rey_result rey_beacons_begin(Render *r);
void rey_beacons_end(Render *r);
