// particles.h: the pass of light tracing. Private to src/render.
#pragma once

#include "render/render_parts.h"

// Whether the scene's integrator is `ptracer`.
bool rey_traces_particles(const rey_scene *scene);
// Whether it is, and paths from the sensor find other light than particles do: smooth mirrors and glass, surfaces that let light
// pass, and lights that no path meets. Without these, derivatives of what moves are found along such paths.
bool rey_particles_alone(const rey_scene *scene);
// Of derivatives and replays: checks that sensor and selection are ones that are known, and makes the paths of this call end at
// what the sensor sees of lights directly, if particles are to follow (r->particles).
rey_result rey_particles_begin(Render *r, rey_selection selection);
// One pass of particles in the call's mode, with its samples per pixel: into its gradients, or added to a picture of 3
// channels.
rey_result rey_particles_run(Render *r, double *picture);
// Units of work of a pass that adds to a picture; of others there are r->shards.
int32_t rey_particle_shards(const Render *r);
// Adds what light tracing finds, all paths of at least two segments, to a picture of 3 channels.
rey_result rey_render_particles(rey_scene *scene, const rey_render_def *def, int part, int parts, double *picture,
                                rey_stats *stats);
