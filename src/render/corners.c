// corners.c: what the interior term has to look out for.
#include "render/corners.h"

#include "bsdf/table.h"
#include "render/blame.h"
#include "render/boundary.h"
#include "render/projection.h"

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

// Whether points may slide over the faces of a surface: it refracts into lobes, alike everywhere, moves, and has no corner with
// another one, which would seem to move otherwise there.
static bool pane_slides(const Render *r, int32_t id) {
    const SceneView *view = &r->scene->view;
    const ShapeRecord *shape = view->shapes + id;
    const BsdfNode *node = view->bsdfs + shape->bsdf;
    bool moves = r->job.points_at[id] >= 0 || r->job.pose_at[id] >= 0;
    bool alike = node->glossy && node->transmits && !node->surface && node->child[0] < 0;
    for (int k = 0; k < MAX_SLOTS && alike; k++) {
        alike = node->slot[k] < 0 || view->textures[node->slot[k]].kind == TEXTURE_CONSTANT;
    }
    bool touched = false;
    for (size_t i = 0; i < r->corners.count && alike; i++) {
        const CornerRecord *c = &ARRAY_AT(r->corners, CornerRecord, i);
        touched |= c->viewer != c->wall && (c->viewer == id || c->wall == id);
    }
    return moves && alike && !touched && shape->collection < 0 && shape->emitter < 0;
}

// Over panes, points slide along the sensor's view.
static rey_result find_panes(Render *r) {
    const SceneView *view = &r->scene->view;
    double eye[4];
    if (!rey_boundary_sees(r->plan.sensor)) {
        return REY_OK;
    }
    rey_sensor_eye(view, r->plan.sensor, eye);
    for (int k = 0; k < 4; k++) {
        r->panes.eye[k] = (float)eye[k];
    }
    r->pane_at = rey_alloc_array(r->scene->ctx, (size_t)view->shapes_count + 1, sizeof *r->pane_at);
    for (int32_t id = 0; id < view->shapes_count && r->pane_at; id++) {
        const size_t before = r->pane_of.count;
        if (pane_slides(r, id) && rey_panes_find(r->scene, id, &r->pane_records, &r->pane_of) != REY_OK) {
            return REY_ERROR_MEMORY;
        }
        r->pane_at[id] = r->pane_of.count > before ? (int32_t)before : -1;
    }
    r->panes.pane = r->pane_records.data;
    r->panes.at = r->pane_at;
    r->panes.of = r->pane_of.data;
    r->job.panes = r->pane_records.count ? &r->panes : NULL;
    return r->pane_at ? REY_OK : REY_ERROR_MEMORY;
}

rey_result rey_corners_begin(Render *r) {
    const SceneView *view = &r->scene->view;
    bool plain = !view->has_media && !view->through && !view->drops && !view->split;
    // All terms have to know the panes, even where only one is asked for.
    bool glossy = rey_bsdfs_used(view, rey_bsdf_glossy), needed = glossy || (r->terms & REY_TERM_INTERIOR);
    if (!r->job.any_motion || !plain || r->request.asked || !needed) {
        return REY_OK;
    }
    r->job.glossy = glossy;
    r->job.none = r->none;
    const Sliding sliding = {r, r->job.any_camera || rey_boundary_chained(view)};
    rey_result result = rey_corners_find(r->scene, moves_on_film, &sliding, &r->corners);
    result = result == REY_OK ? find_panes(r) : result;
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
