// endless.c: what of a derivative is not known where an environment lights fog without end.
#include "render/endless.h"

#include "bsdf/table.h"
#include "emitter/emitter.h"
#include "medium/table.h"
#include "render/blame.h"
#include "render/motion.h"

// Whether the medium around the sensor reaches up to the sky (walk.h, medium_beyond).
static bool is_endless(const SceneView *view, const SensorRecord *sensor) {
    const int32_t id = sensor->medium;
    bool endless = id >= 0 && !view->media[id].bounded;
    for (int64_t i = 0; i < view->shapes_count && endless; i++) {
        endless = view->shapes[i].interior != id || view->shapes[i].exterior == id;
    }
    return endless;
}

// Whether densities of directions change: with a parameter, or because lobes whose weight is 0 are sampled where derivatives are
// asked for. Reflectances of functions that are sampled alike need not change them.
static bool densities_change(const SceneView *view, const Param *p) {
    const EmitterRecord *sky = view->emitters + view->environment;
    bool change = p->emitter == view->environment || (sky->kind == EMITTER_ENVMAP && rey_texture_reads(view, sky->slot[0], p));
    for (int64_t i = 0; i < view->bsdfs_count; i++) {
        change = change || (view->bsdfs[i].used && !rey_bsdf_samples_alike(view->bsdfs[i].kind));
    }
    for (int64_t i = 0; i < view->phases_count; i++) {
        const PhaseKind *kind = rey_phase_kinds + view->phases[i].kind;
        change = change || kind->children != 0; // lobes
        for (int k = 0; k < kind->param_count; k++) {
            change = change || kind->params[k].type == PHASE_PARAM_TABLE || rey_texture_reads(view, view->phases[i].slot[k], p);
        }
    }
    return change;
}

const char *rey_endless_gap(const SceneView *view, const SensorRecord *sensor, const Param *p, int terms) {
    const bool glides = p->camera >= 0 && rey_cameras_glide(view), stays = glides || rey_moves_border(view, p);
    if (view->environment < 0 || !is_endless(view, sensor)) {
        return NULL;
    }
    return ((terms & ~REY_TERM_INTERIOR) && !stays) || densities_change(view, p)
               ? "an environment lights a medium without end, in which light samples alone find it, and how much of its light they "
                 "bring depends on densities that change. Within a surface of the kind 'null' the medium has an end"
               : NULL;
}
