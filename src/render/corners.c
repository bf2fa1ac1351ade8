// corners.c: what the interior term has to look out for.
#include "render/corners.h"

#include "bsdf/table.h"
#include "render/blame.h"
#include "render/boundary.h"

typedef struct Sliding {
    const Render *render;
    bool all;
} Sliding;

// What the sensor sees of surfaces slides over them where it moves itself, and what mirrors and glass show where they do.
static bool moves_on_film(const void *sliding, int32_t id, int32_t instance) {
    const Sliding *s = sliding;
    UNUSED(instance);
    return s->all || s->render->job.points_at[id] >= 0 || s->render->job.pose_at[id] >= 0;
}

// Whether what the viewer scatters is 0 at its horizon.
static bool ends_with_cosine(const SceneView *view, const CornerRecord *c) {
    return !view->bsdfs[view->shapes[c->viewer].bsdf].turns;
}

// Whether the wall's light is attached to it; mirrors show, and masks let pass, what is not.
static bool wall_scatters(const SceneView *view, const CornerRecord *c) {
    int32_t bsdf = view->shapes[c->wall].bsdf;
    return view->bsdfs[bsdf].spreads && !rey_bsdf_holds(view, bsdf, rey_bsdf_opens);
}

rey_result rey_corners_begin(Render *r) {
    const SceneView *view = &r->scene->view;
    bool plain = !view->has_media && !view->through && !view->drops && !view->split;
    if (!r->job.any_motion || !plain || r->request.asked || !(r->terms & REY_TERM_INTERIOR)) {
        return REY_OK;
    }
    r->job.glossy = rey_bsdfs_used(view, rey_bsdf_glossy);
    r->job.none = r->none;
    const Sliding sliding = {r, r->job.any_camera || rey_boundary_chained(view)};
    rey_result result = rey_corners_find(r->scene, moves_on_film, &sliding, &r->corners);
    CornerRecord *all = r->corners.data;
    size_t kept = 0;
    for (size_t i = 0; i < r->corners.count && result == REY_OK; i++) {
        if (ends_with_cosine(view, all + i) && wall_scatters(view, all + i)) {
            all[kept++] = all[i];
        }
    }
    if (result != REY_OK || kept == 0) {
        return result;
    }
    r->corner_at = rey_alloc_array(r->scene->ctx, (size_t)view->shapes_count + 1, sizeof *r->corner_at);
    if (!r->corner_at) {
        return REY_ERROR_MEMORY;
    }
    for (int32_t id = 0, i = 0; id <= view->shapes_count; id++) {
        while (i < (int32_t)kept && all[i].viewer < id) {
            i++;
        }
        r->corner_at[id] = i;
    }
    r->job.corners = all;
    r->job.corner_at = r->corner_at;
    return REY_OK;
}
