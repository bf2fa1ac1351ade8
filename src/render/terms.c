// terms.c: which terms a selection needs, which exist, and what each brings.
#include "render/terms.h"

#include "render/motion.h"

#include <string.h>

// Why a parameter needs a term.
static const char *term_reason(int bit, const rey_param_info *info) {
    switch (bit) {
    case REY_TERM_SPECULAR:
        return "the scene has smooth mirrors or glass, smooth coats, or surfaces that let a part of the light pass, and the "
               "edges that are seen in or through them are not found";
    case REY_TERM_TERMINATOR:
        return "the picture jumps where the normals of maps turn away from the viewer";
    default:
        return info->why;
    }
}

// The terms of a parameter's derivative that exist.
static int terms_known(const rey_scene *scene, const rey_render_def *def, const Param *p) {
    const int still = REY_TERM_INTERIOR | REY_TERM_TERMINATOR; // the latter is looked for on the way
    if (p->geometry >= 0 || p->instance >= 0 || p->camera >= 0) {
        bool known = rey_motion_known(scene, scene->view.sensors + def->sensor, p);
        return known ? still | REY_TERM_PRIMARY | REY_TERM_INDIRECT : 0;
    }
    if (p->volume >= 0) {
        return 0;
    }
    if (p->normals >= 0) {
        return still | REY_TERM_PRIMARY | REY_TERM_INDIRECT;
    }
    return p->emitter >= 0 ? REY_TERM_INTERIOR | REY_TERM_INDIRECT : still;
}

// In media everything that moves changes the light on its way, and boundaries of shadows lie in the air.
static bool moves(const Param *p) {
    return p->geometry >= 0 || p->instance >= 0 || p->camera >= 0 || p->emitter >= 0 || p->volume >= 0 ||
           (p->terms & REY_TERM_SPECULAR);
}

static bool is_volume(const SceneView *view, int32_t texture) {
    if (texture < 0) {
        return false;
    }
    const TextureNode *t = view->textures + texture;
    return t->kind == TEXTURE_VOLUME || is_volume(view, t->child[0]) || is_volume(view, t->child[1]);
}

// Whether points of surfaces look up volumes: where points move, so does what they find.
static bool surfaces_read_volumes(const SceneView *view) {
    for (int64_t i = 0; i < view->bsdfs_count; i++) {
        for (int k = 0; k < MAX_SLOTS; k++) {
            if (is_volume(view, view->bsdfs[i].slot[k])) {
                return true;
            }
        }
    }
    return false;
}

// Refuses parameters whose derivative would lack a term; collects the terms that they need.
rey_result rey_terms_check(rey_scene *scene, const rey_render_def *def, rey_selection selection, int *needed) {
    if (scene->view.drops) {
        return rey_fail(scene->ctx, REY_ERROR_UNSUPPORTED,
                        "with hide_emitters, 'path' drops light of a surface that lets a part of it pass, and what it "
                        "drops has no derivative: 'volpath' drops none");
    }
    for (int i = 0; i < selection.count; i++) {
        rey_param_info info;
        rey_result result = rey_param_get_info(scene, selection.params[i], &info);
        if (result != REY_OK) {
            return result;
        }
        if (!info.terms) {
            return rey_fail(scene->ctx, REY_ERROR_PARAM, "%s is not differentiable: %s", info.name, info.why);
        }
        const Param *p = &ARRAY_AT(scene->params, Param, selection.params[i]);
        if (scene->view.has_media && moves(p)) {
            return rey_fail(scene->ctx, REY_ERROR_INCOMPLETE,
                            "no term of the gradient of %s exists yet in scenes with participating media: what moves "
                            "changes what they let through and scatter, and moves the shadows in them",
                            info.name);
        }
        bool points = p->geometry >= 0 || p->instance >= 0 || p->camera >= 0 ||
                      (p->emitter < 0 && (p->terms & REY_TERM_SPECULAR));
        if (points && surfaces_read_volumes(&scene->view)) {
            return rey_fail(scene->ctx, REY_ERROR_INCOMPLETE,
                            "no term of the gradient of %s exists yet where surfaces have volumes as textures: points that "
                            "move look them up elsewhere", info.name);
        }
        int known = terms_known(scene, def, p);
        int missing = info.terms & ~known;
        bool interior = known & REY_TERM_INTERIOR;
        if (missing && !def->terms) {
            int bit = missing & -missing;
            return rey_fail(scene->ctx, REY_ERROR_INCOMPLETE,
                            "the gradient of %s needs the term '%s', which does not exist yet: %s%s", info.name,
                            rey_term_name(bit), term_reason(bit, &info), interior ? ". --terms interior gives the part that does" : "");
        }
        if (missing && !interior) {
            return rey_fail(scene->ctx, REY_ERROR_INCOMPLETE, "no term of the gradient of %s exists yet: %s", info.name,
                            info.why);
        }
        *needed |= info.terms;
    }
    if (def->terms & ~(REY_TERM_INTERIOR | REY_TERM_PRIMARY | REY_TERM_INDIRECT)) {
        int bit = def->terms & ~(REY_TERM_INTERIOR | REY_TERM_PRIMARY | REY_TERM_INDIRECT);
        return rey_fail(scene->ctx, REY_ERROR_UNSUPPORTED, "the term '%s' does not exist yet", rey_term_name(bit & -bit));
    }
    return REY_OK;
}

void rey_terms_book(Render *r, int set, int term, const double *picture) {
    if (!r->request.values) {
        return;
    }
    double sum = 0;
    if (picture) {
        int64_t n = (int64_t)r->plan.sensor->crop_width * r->plan.sensor->crop_height * 3;
        for (int64_t i = 0; i < n; i++) {
            sum += picture[i] / (double)n;
        }
    } else {
        for (int64_t i = 0; i < r->shards * r->gradient_size; i++) {
            sum += r->gradients[i] * (double)r->tangent[i % r->gradient_size];
        }
    }
    double *values = r->request.values[set];
    if (term == REY_TERM_INTERIOR) {
        r->booked = 0;
        memset(values, 0, TERM_COUNT * sizeof *values);
    }
    int index = 0;
    for (; term >> index > 1; index++) {
    }
    values[index] = sum - r->booked;
    r->booked = sum;
}

rey_result rey_jvp(rey_scene *scene, const rey_render_def *def, rey_selection selection, const float *tangent,
                   float *derivative, double *set_values, rey_stats *stats) {
    return rey_jvp_terms(scene, def, (TermRequest){0}, selection, tangent, derivative, set_values, stats);
}

rey_result rey_vjp(rey_scene *scene, const rey_render_def *def, rey_selection selection, const float *adjoint,
                   double *gradient, double *set_gradients, rey_stats *stats) {
    return rey_vjp_terms(scene, def, (TermRequest){0}, selection, adjoint, gradient, set_gradients, stats);
}
