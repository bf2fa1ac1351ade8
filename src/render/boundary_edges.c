// boundary_edges.c: of the scene's edges, those that can move for the sensor, weighted by their length (edge_sizes.h).
#include "render/boundary_edges.h"

#include "bsdf/table.h"
#include "render/cuts.h"
#include "render/edge_sizes.h"
#include "render/facing.h"
#include "render/light_borders.h"
#include "render/texture_steps.h"
#include "shape/shape.h"
#include "shape/shared.h"

// Whether the selection moves a shape.
static bool shape_moves_itself(const Render *r, int32_t id, int32_t instance) {
    const PathJob *job = &r->job;
    return id >= 0 && (job->points_at[id] >= 0 || job->pose_at[id] >= 0 ||
                       (r->scene->view.shapes[id].collection >= 0 && job->instance_at[instance] >= 0));
}

bool rey_light_moves(const Render *r, int32_t light) {
    bool moves = false;
    for (int k = 0; k < MAX_EMITTER_SLOTS && light >= 0; k++) {
        moves |= r->job.place_at[MAX_EMITTER_SLOTS * light + k] >= 0;
    }
    return moves;
}

// The same, as the sensor sees it; id -1: of a light, or a plane that moves with the sensor.
static bool moves_on_film(const void *render, int32_t id, int32_t instance) {
    const Render *r = render;
    return r->job.any_camera || (id < 0 ? rey_light_moves(r, instance) : shape_moves_itself(r, id, instance));
}

// Whether it moves the line of a texture over its surface.
static bool line_moves(const Render *r, const EdgeRecord *e) {
    return e->kind == EDGE_MARK && ARRAY_AT(r->marks, MarkRecord, e->corner).at >= 0;
}

// Whether it moves what an edge looks like. Meetings were looked for where something moves.
static bool edge_moves(const Render *r, const EdgeRecord *e) {
    return e->kind == EDGE_MEETING || moves_on_film(r, e->shape, e->instance) ||
           ((e->kind == EDGE_TERMINATOR || e->kind == EDGE_CUT || e->kind == EDGE_FACING) && r->job.normals_at[e->shape] >= 0);
}

// Whether it moves what meets along a curve.
static bool meeting_moves(const Render *r, const EdgeRecord *e) {
    const MeetingRecord *m = &ARRAY_AT(r->meetings, MeetingRecord, e->prim);
    return shape_moves_itself(r, m->shape[0], m->instance[0]) || shape_moves_itself(r, m->shape[1], m->instance[1]) ||
           (m->shape[1] < 0 && rey_light_moves(r, m->prim[1]));
}

// Whether it is where a plane cuts what the sensor sees.
static bool clips(const Render *r, const EdgeRecord *e) {
    const MeetingRecord *m = &ARRAY_AT(r->meetings, MeetingRecord, e->prim);
    return m->shape[1] < 0 && m->prim[1] < 0;
}

// Whether it is where light ends on a surface.
static bool ends_light(const Render *r, const EdgeRecord *e) {
    const MeetingRecord *m = &ARRAY_AT(r->meetings, MeetingRecord, e->prim);
    return m->shape[1] < 0 && m->prim[1] >= 0;
}

// The same of a surface that only mirrors or refracts, on which nothing shows it.
static bool ends_unseen(const Render *r, const EdgeRecord *e) {
    const SceneView *view = &r->scene->view;
    return ends_light(r, e) && !view->bsdfs[view->shapes[e->shape].bsdf].spreads;
}

static rey_result accumulate(Render *r, BoundaryPlan *plan, Array *kept, Array *weights) {
    int64_t n = (int64_t)kept->count;
    plan->edges = kept->data;
    plan->cdf = weights->data;
    kept->data = weights->data = NULL;
    double sum = 0, total = 0;
    if (n > 1 << 28) {
        return rey_fail(r->scene->ctx, REY_ERROR_UNSUPPORTED, "more than 2^28 edges move");
    }
    for (int64_t i = 0; i < n; i++) {
        total += (double)plan->cdf[i];
    }
    for (int64_t i = 0; i < n; i++) {
        sum += (double)plan->cdf[i];
        plan->cdf[i] = i == n - 1 ? 1 : (float)(sum / total);
    }
    plan->job.edge_count = (int32_t)n;
    return REY_OK;
}

static rey_result keep_edge(Render *r, const EdgeRecord *e, double weight, bool *round, Array *kept, Array *weights) {
    if (!(weight > 0)) {
        return REY_OK;
    }
    EdgeRecord *edge = rey_array_push(r->scene->ctx, kept, sizeof *edge, 1);
    float *number = rey_array_push(r->scene->ctx, weights, sizeof *number, 1);
    if (!edge || !number) {
        return REY_ERROR_MEMORY;
    }
    *edge = *e;
    *number = (float)weight;
    *round |= e->kind == EDGE_OUTLINE || e->kind == EDGE_SIDE || e->kind == EDGE_TUBE || e->kind == EDGE_MARK ||
              e->kind == EDGE_TERMINATOR || e->kind == EDGE_MESH || (e->kind == EDGE_MEETING && ends_light(r, e));
    return REY_OK;
}

// What an edge that the sensor sees, or that other vertices see, is worth.
typedef struct Weigher {
    Projection projection;
    double eye[4];  // or the direction of parallel views, and 0
    int32_t kind;   // BOUNDARY_
    double still;   // factor on edges that stand still: they may pass light between what moves
} Weigher;

static Weigher weigher_of(const Render *r, int32_t kind) {
    const SceneView *view = &r->scene->view;
    Weigher w = {.projection = rey_projection_of(view, &r->plan), .kind = kind, .still = r->job.any_camera ? 1 : 0.25};
    rey_sensor_eye(view, r->plan.sensor, w.eye);
    bool ends_move = r->job.any_motion || (kind == BOUNDARY_INDIRECT && r->job.any_places);
    w.still = kind == BOUNDARY_PRIMARY || !ends_move ? 0 : w.still;
    return w;
}

// Whether what a surface sends out jumps where its shading normal turns away: not that of smooth glass, which mirrors all of the
// light there, from both sides and into the same direction.
static bool ends_at_normals(const SceneView *view, const ShapeRecord *shape) {
    return shape->emitter >= 0 || !rey_bsdf_refracts(view->bsdfs[shape->bsdf].kind);
}

// Collisions see lights beside what they light, which is that much darker or so.
#define RIDING_GLOW 8

// Of records that stand for one edge, those of the surfaces that the selection moves count, in equal parts, or all of them where it
// moves all or none.
static bool counts(const Render *r, EdgeRecord *e) {
    const bool own = shape_moves_itself(r, e->shape, e->instance);
    int32_t all = e->side_count + 1, moved = own;
    for (int32_t i = 0; i < e->side_count; i++) {
        const SharedSide *side = &ARRAY_AT(r->sides, SharedSide, e->sides + i);
        moved += shape_moves_itself(r, side->shape, side->instance);
    }
    e->sharers = moved > 0 ? moved : all;
    return own || moved == 0;
}

// Whether shadow rays pass an edge's surface that lets more or less of the light through on either side of lines.
static bool parts_shadows(const Render *r, int32_t kind, const EdgeRecord *e) {
    return kind == BOUNDARY_INDIRECT && r->job.veils_turn && (r->job.live[r->scene->view.shapes[e->shape].group] & LIVE_UNEVEN);
}

// May cut the edge to what the film sees.
static double edge_weight(const Render *r, const Weigher *w, EdgeRecord *e) {
    const SceneView *view = &r->scene->view;
    if (w->kind == BOUNDARY_LINES) {
        return line_moves(r, e) ? rey_edge_in_world(r, e, false) : 0;
    }
    if (w->kind != BOUNDARY_PRIMARY && e->kind == EDGE_MARK && ARRAY_AT(r->marks, MarkRecord, e->corner).half) {
        return 0;
    }
    if (boundary_is_facing(w->kind) || e->kind == EDGE_FACING) {
        bool reads = r->job.live[view->shapes[e->shape].group] & LIVE_SCATTERING; // which may be a map's texture
        double area = boundary_is_facing(w->kind) && e->kind == EDGE_FACING ? rey_edge_in_world(r, e, false) : 0;
        return edge_moves(r, e) || reads ? area : w->still * area;
    }
    double factor = edge_moves(r, e) || (w->kind == BOUNDARY_PRIMARY && line_moves(r, e)) ? 1 : w->still;
    bool hides = rey_boundary_hides(view, view->shapes + e->shape);
    if (factor == 0 || !hides || !counts(r, e) || (w->kind == BOUNDARY_MEETING && e->kind != EDGE_MEETING)) {
        return 0;
    }
    bool turning = boundary_is_terminator(w->kind) || boundary_is_horizon(w->kind);
    if ((w->kind == BOUNDARY_CUT) != (e->kind == EDGE_CUT)) {
        return 0;
    }
    factor *= w->kind == BOUNDARY_RIDING && view->shapes[e->shape].emitter >= 0 ? RIDING_GLOW : 1;
    bool marks = w->kind == BOUNDARY_PRIMARY || boundary_is_paired(w->kind) || parts_shadows(r, w->kind, e);
    if (w->kind != BOUNDARY_PRIMARY && (turning != (e->kind == EDGE_TERMINATOR) || (e->kind == EDGE_MARK && !marks))) {
        return 0;
    }
    if (e->kind == EDGE_TERMINATOR && !boundary_is_horizon(w->kind) && !ends_at_normals(view, view->shapes + e->shape)) {
        return 0;
    }
    bool crosses = e->kind == EDGE_MEETING, still = crosses && !meeting_moves(r, e);
    if (crosses && ((w->kind != BOUNDARY_PRIMARY && clips(r, e)) || ends_unseen(r, e))) {
        return 0;
    }
    if (w->kind == BOUNDARY_PRIMARY) {
        return still && !r->job.any_camera ? 0 : rey_edge_on_film(r, &w->projection, w->eye, e);
    }
    if (still && !boundary_is_paired(w->kind)) {
        return 0;
    }
    factor = still ? w->still : factor;
    return factor * rey_edge_in_world(r, e, marks);
}

// Whether what lies on a shape matters: along chains and from collisions, what moves shows it also where it stands still.
static bool seen_moving(const void *render, int32_t id, int32_t instance) {
    const Render *r = render;
    return (r->terms & REY_TERM_SPECULAR) || r->job.rides || r->job.veils_turn || moves_on_film(r, id, instance);
}

static rey_result find_meetings(Render *r) {
    LightBorder clip[4];
    r->meetings_found = true;
    rey_clip_borders(&r->scene->view, &r->plan, clip);
    return rey_meetings_with_borders(r->scene, clip, 4, seen_moving, r, &r->meetings);
}

static EdgeRecord meeting_edge(const Render *r, size_t i) {
    return (EdgeRecord){.kind = EDGE_MEETING, .shape = ARRAY_AT(r->meetings, MeetingRecord, i).shape[0], .prim = (int32_t)i,
                        .opposite = EDGE_OPEN, .other = EDGE_ANY, .crease = EDGE_CREASE, .last = 1};
}

// Keeps the curves along which surfaces pass through each other, as far as the sensor sees them.
static rey_result keep_meetings(Render *r, const Weigher *w, BoundaryPlan *plan, Array *kept, Array *weights) {
    rey_result result = r->meetings_found ? REY_OK : find_meetings(r);
    for (size_t i = 0; i < r->meetings.count && result == REY_OK; i++) {
        EdgeRecord e = meeting_edge(r, i);
        double weight = edge_weight(r, w, &e);
        result = keep_edge(r, &e, weight, &plan->job.round, kept, weights);
    }
    return result;
}

// Whether a shape's ends are edges of what it shares them with: lights that the sensor does not see are no faces for it.
static bool ends_there(const SceneView *view, const ShapeRecord *shape) {
    return rey_boundary_hides(view, shape) && !(view->hide_emitters && shape->emitter >= 0);
}

static rey_result find_edges(Render *r) {
    Array steps = {0};
    rey_result result = rey_texture_steps(r->scene, r->job.to_uv_at, &steps);
    if (result == REY_OK) {
        result = rey_edges_find(r->scene, &steps, &r->edges, &r->fans);
    }
    if (result == REY_OK) {
        result = rey_marks_find(r->scene, &steps, seen_moving, r, &r->edges, &r->marks);
    }
    result = result == REY_OK ? rey_edges_share(r->scene, ends_there, &r->edges, &r->sides) : result;
    result = result == REY_OK ? rey_cuts_find(r->scene, &r->edges) : result;
    result = result == REY_OK && r->facing ? rey_facing_find(r->scene, &r->edges) : result;
    rey_array_free(r->scene->ctx, &steps);
    return result;
}

rey_result rey_boundary_edges(Render *r, int32_t kind, BoundaryPlan *plan) {
    const Weigher w = weigher_of(r, kind);
    Array kept = {0}, weights = {0};
    rey_result result = r->edges.count ? REY_OK : find_edges(r);
    for (size_t i = 0; i < r->edges.count && result == REY_OK; i++) {
        EdgeRecord e = ARRAY_AT(r->edges, EdgeRecord, i);
        double weight = edge_weight(r, &w, &e);
        result = keep_edge(r, &e, weight, &plan->job.round, &kept, &weights);
    }
    if (result == REY_OK && (kind == BOUNDARY_PRIMARY || kind == BOUNDARY_MEETING || boundary_is_paired(kind))) {
        result = keep_meetings(r, &w, plan, &kept, &weights);
    }
    if (result == REY_OK) {
        result = accumulate(r, plan, &kept, &weights);
    }
    rey_array_free(r->scene->ctx, &kept);
    rey_array_free(r->scene->ctx, &weights);
    return result;
}

// Whether a surface is the border of a medium, and no more, and the sensor sees it move.
static bool border_moves(const void *render, int32_t id, int32_t instance) {
    const Render *r = render;
    const SceneView *view = &r->scene->view;
    const ShapeRecord *shape = view->shapes + (id < 0 ? 0 : id);
    const Group *group = view->groups + shape->group;
    bool border = id >= 0 && !rey_boundary_hides(view, shape) && group->interior != group->exterior;
    return border && moves_on_film(r, id, instance);
}

rey_result rey_check_clipped_media(const Render *given) {
    Render r = *given; // with meetings of its own
    LightBorder clip[4];
    char name[OBJECT_NAME] = "";
    bool any = false;
    r.meetings = (Array){0};
    for (int32_t i = 0; i < r.scene->view.shapes_count && r.scene->view.has_media && !any; i++) {
        any = border_moves(&r, i, 0) || r.scene->view.shapes[i].collection >= 0;
    }
    if (!any || r.def.terms || !rey_boundary_sees(r.plan.sensor)) {
        return REY_OK;
    }
    rey_clip_borders(&r.scene->view, &r.plan, clip);
    rey_result result = rey_meetings_find(r.scene, clip, 4, border_moves, &r, &r.meetings);
    const Weigher w = weigher_of(&r, BOUNDARY_PRIMARY);
    for (size_t i = 0; i < r.meetings.count && result == REY_OK && !name[0]; i++) {
        EdgeRecord e = meeting_edge(&r, i);
        if (clips(&r, &e) && border_moves(&r, e.shape, 0) && rey_edge_on_film(&r, &w.projection, w.eye, &e) > 0) {
            rey_name_shape(r.scene, e.shape, name);
        }
    }
    rey_array_free(r.scene->ctx, &r.meetings);
    return name[0] ? rey_fail(r.scene->ctx, REY_ERROR_INCOMPLETE,
                              "the gradient does not exist yet of what moves while near_clip or far_clip cuts the border of a "
                              "medium ('%s'): the picture jumps where rays begin or end on it. --terms interior gives the rest",
                              name)
                   : result;
}
