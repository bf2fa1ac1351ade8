// rims.c: what of the ends of rough refraction is not known.
#include "render/rims.h"

#include "bsdf/ends.h"
#include "render/boundary.h"
#include "render/particles.h"

// What keeps the samplers of rims in the light of points and of single directions from all of what a parameter moves, null where
// nothing does (integrator/boundary/rim_light.h, rim_view.h).
static const char *gap_of_sharp_light(const SceneView *view, const SensorRecord *sensor) {
    if (view->has_media || view->through) {
        return "in the light of a point or of one direction the integrators for media do not find that. 'path' does";
    }
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

// What of the scene's light comes along directions that are not sampled by scattering, null where none does.
static const char *unsampled(const rey_scene *scene, const SensorRecord *sensor, const Param *p) {
    if (rey_traces_particles(scene)) {
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

const char *rey_rims_gap(const rey_scene *scene, const SensorRecord *sensor, const Param *p, char object[OBJECT_NAME]) {
    const SceneView *view = &scene->view;
    const char *gap = any_ends(view) ? unsampled(scene, sensor, p) : NULL; // far fewer functions are looked at than by shape
    const bool moves = p->geometry >= 0 || p->instance >= 0 || p->camera >= 0 || p->emitter >= 0 || p->moves_rims;
    for (int64_t i = 0; i < view->shapes_count && gap; i++) {
        int32_t bsdf = view->shapes[i].bsdf;
        if (rey_bsdf_ends_within(view, bsdf) && (moves || rey_bsdf_ends_move(view, bsdf, p, p->normals == i))) {
            rey_name_bsdf(scene, bsdf, object);
            return gap;
        }
    }
    return NULL;
}
