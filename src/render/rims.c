// rims.c: what of the ends of rough refraction is not known.
#include "render/rims.h"

#include "bsdf/ends.h"
#include "render/boundary.h"
#include "render/particles.h"

// What keeps the samplers of rims in the light of points and of single directions from all of what a parameter moves, null where
// nothing does (integrator/boundary/rim_light.h, rim_view.h).
static const char *gap_of_sharp_light(const SceneView *view, const SensorRecord *sensor) {
    if (!rey_boundary_sees(sensor)) {
        return "in the light of a point or of one direction only perspective, thinlens and orthographic sensors find that";
    }
    for (int64_t i = 0; i < view->shapes_count; i++) {
        const ShapeRecord *shape = view->shapes + i;
        if (rey_bsdf_holds(view, shape->bsdf, rey_bsdf_bends) && rey_bsdf_holds(view, shape->bsdf, rey_bsdf_turns)) {
            return "in the light of a point or of one direction it is not found in smooth mirrors and glass that have normal maps";
        }
    }
    return NULL;
}

// What keeps the scene's light from being found there, null where nothing does.
static const char *unsampled(const rey_scene *scene, const SensorRecord *sensor, const Param *p) {
    if (rey_particles_alone(scene)) {
        return "light tracing does not find that. The integrator 'path' does";
    }
    return p->moves_rims ? gap_of_sharp_light(&scene->view, sensor) : NULL;
}

bool rey_rims_move(const rey_scene *scene, rey_selection selection) {
    bool moves = false;
    for (int i = 0; i < selection.count && !moves; i++) {
        moves = ARRAY_AT(scene->params, Param, selection.params[i]).moves_rims;
    }
    return moves;
}

static bool any_ends(const SceneView *view) {
    bool found = false;
    for (int64_t i = 0; i < view->bsdfs_count && !found; i++) {
        found = view->bsdfs[i].used && rey_bsdf_ends(view, view->bsdfs + i);
    }
    return found;
}

// A function of which a parameter moves ends, -1: none.
static int32_t moved_by(const SceneView *view, const Param *p) {
    const bool moves = p->geometry >= 0 || p->instance >= 0 || p->camera >= 0 || p->emitter >= 0 || p->moves_rims;
    for (int64_t i = 0; i < view->shapes_count; i++) {
        int32_t bsdf = view->shapes[i].bsdf;
        if (rey_bsdf_ends_within(view, bsdf) && (moves || rey_bsdf_ends_move(view, bsdf, p, p->normals == i))) {
            return bsdf;
        }
    }
    return -1;
}

bool rey_rims_moved_by(const rey_scene *scene, const Param *p) {
    return any_ends(&scene->view) && moved_by(&scene->view, p) >= 0; // far fewer functions are looked at than by shape
}

const char *rey_rims_gap(const rey_scene *scene, const SensorRecord *sensor, const Param *p, char object[OBJECT_NAME]) {
    const SceneView *view = &scene->view;
    const char *gap = any_ends(view) ? unsampled(scene, sensor, p) : NULL;
    int32_t bsdf = gap ? moved_by(view, p) : -1;
    if (bsdf >= 0) {
        rey_name_bsdf(scene, bsdf, object);
    }
    return bsdf >= 0 ? gap : NULL;
}
