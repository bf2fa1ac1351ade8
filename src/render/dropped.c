// dropped.c: what of a derivative is not known where `path` drops light. What is: integrator/kept.h.
#include "render/dropped.h"

#include "bsdf/table.h"
#include "emitter/envmap.h"
#include "emitter/table.h"
#include "render/blame.h"

// Whether a parameter belongs to thin glass, by whose coefficient paths pass, or to what it stands in.
static bool gap_of_function(const SceneView *view, int32_t id, const Param *p) {
    const BsdfNode *bsdf = view->bsdfs + id;
    bool gap = false;
    for (int k = 0; k < rey_bsdf_kinds[bsdf->kind].param_count; k++) {
        gap = gap || rey_texture_reads(view, bsdf->slot[k], p);
    }
    return gap && rey_bsdf_holds(view, id, rey_bsdf_tints);
}

const char *rey_dropped_gap(const SceneView *view, const Param *p, int terms) {
    if (!view->drops) {
        return NULL;
    }
    // Of vertex normals only the jumps are not known where they turn away, for which paths look out (boundary.c).
    int motion = p->normals >= 0 ? REY_TERM_SPECULAR : REY_TERM_PRIMARY | REY_TERM_INDIRECT | REY_TERM_SPECULAR;
    bool moves = (terms & motion) || p->emitter >= 0, gap = false; // a sky that turns changes the density of its light
    for (int32_t i = 0; i < (int32_t)view->bsdfs_count; i++) {
        gap = gap || gap_of_function(view, i, p) || (p->normals >= 0 && rey_bsdf_tints(view->bsdfs[i].kind));
    }
    return moves ? "with hide_emitters, 'path' drops light of surfaces that let a part of it pass, also where this parameter moves "
                   "something. 'volpath' drops none"
         : gap   ? "with hide_emitters, 'path' drops light of surfaces that let a part of it pass, and how much depends on the "
                   "thin glass that this parameter belongs to. 'volpath' drops none"
                 : NULL;
}

// The picture of the environment, -1 = there is none.
static int32_t sky_image(const SceneView *view) {
    const EmitterRecord *e = view->environment >= 0 ? view->emitters + view->environment : NULL;
    for (int k = 0; e && k < rey_emitter_kinds[e->kind].param_count; k++) {
        if (rey_emitter_kinds[e->kind].params[k].type == EMITTER_PARAM_IMAGE) {
            return e->slot[k];
        }
    }
    return -1;
}

void rey_dropped_add_sky(Render *r, int64_t *size) {
    const SceneView *view = &r->scene->view;
    const int32_t image = view->drops ? sky_image(view) : -1;
    r->job.any_sky = image >= 0 && r->job.texture_at[image] >= 0;
    r->job.sky_at = (int32_t)*size;
    *size += r->job.any_sky;
}

// How many numbers the selected picture of the environment has, 0 where the sum is not asked for; where they begin.
static int64_t sky_numbers(const Render *r, int64_t *first) {
    *first = 0;
    if (!r->job.any_sky) {
        return 0;
    }
    const TextureNode *t = r->scene->view.textures + sky_image(&r->scene->view);
    *first = r->job.texture_at[sky_image(&r->scene->view)];
    return (int64_t)t->channels * t->width * t->height;
}

static double sky_slope(const Render *r, int64_t number) {
    return envmap_log_sum_slope(&r->scene->view, r->scene->view.emitters + r->scene->view.environment, number);
}

void rey_dropped_gradient(const Render *r, double *gradient) {
    int64_t first, n = sky_numbers(r, &first);
    for (int64_t i = 0; i < n; i++) {
        gradient[first + i] += gradient[r->job.sky_at] * sky_slope(r, i);
    }
}

void rey_dropped_tangent(const Render *r, float *tangent) {
    int64_t first, n = sky_numbers(r, &first);
    double sum = 0;
    for (int64_t i = 0; i < n; i++) {
        sum += (double)tangent[first + i] * sky_slope(r, i);
    }
    if (n) {
        tangent[r->job.sky_at] = (float)sum;
    }
}
