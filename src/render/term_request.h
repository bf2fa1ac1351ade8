// term_request.h: derivatives whose terms are told apart, and have samples of their own.
#pragma once

#include "reynolds/reynolds.h"

enum { TERM_COUNT = 6 }; // REY_TERM_ bits

typedef struct TermRequest {
    int primary_spp, indirect_spp; // samples per pixel of these terms, 0 = as fits def->spp
    double (*values)[TERM_COUNT];  // null, or one row per set: what each term, in the order of its bit, adds to its value
    const float *direction;        // of rey_vjp_terms, whose value is the gradient's product with it
    void (*set_done)(void *user, int set, const double *gradient); // null, or called with each set's gradient
    void *user;
    const struct SceneView *moved; // null, or the derivative is that of this scene along the paths of the other (replay.h)
    bool asked;                    // only whether there is such a derivative: edges are not looked for
} TermRequest;

// rey_jvp and rey_vjp with a request.
rey_result rey_jvp_terms(rey_scene *scene, const rey_render_def *def, TermRequest request, rey_selection selection,
                         const float *tangent, float *derivative, double *set_values, rey_stats *stats);
rey_result rey_vjp_terms(rey_scene *scene, const rey_render_def *def, TermRequest request, rey_selection selection,
                         const float *adjoint, double *gradient, double *set_gradients, rey_stats *stats);

// Whether the derivative of a selection would be computed at all: what rey_vjp and rey_jvp refuse before they render, with
// the same message. The scene is up to date (rey_scene_update).
rey_result rey_derivative_check(rey_scene *scene, const rey_render_def *def, rey_selection selection);
