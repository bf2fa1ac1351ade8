// beacons.c: how far around lights at a point nothing lies, no surface and no border of a medium, and how far around the sensor's
// view of them nothing hides it.
#include "render/beacons.h"

#include "bsdf/ends.h"
#include "emitter/emitter.h"
#include "render/blame.h"
#include "render/boundary.h"
#include "render/boundary_edges.h"
#include "render/cuts.h"
#include "render/light_borders.h"
#include "render/live.h"
#include "render/projection.h"
#include "render/terms.h"
#include "render/update.h"
#include "sensor/kinds.h"
#include "shape/affine.h"
#include "shape/cut.h"

#include <math.h>

// Rounding of what lies just outside of a ball; and the least radius over that of the scene: within smaller balls collisions are
// too seldom to say what stands still.
static const double within = 0.99, least_radius = 1e-3;

// Squared distance of p to the segment from a to b.
static double segment_distance2(const double p[3], const double a[3], const double b[3]) {
    double e[3], q[3], d[3];
    for (int k = 0; k < 3; k++) {
        e[k] = b[k] - a[k];
        q[k] = p[k] - a[k];
    }
    double length2 = dot3(e, e), t = length2 > 0 ? fmin(fmax(dot3(e, q) / length2, 0), 1) : 0;
    for (int k = 0; k < 3; k++) {
        d[k] = q[k] - t * e[k];
    }
    return dot3(d, d);
}

// That to a triangle: of the plane where p lies over it, else of the nearest side.
static double triangle_distance2(const double p[3], double (*v)[3]) {
    double e[2][3], q[3], n[3], least = HUGE_VAL;
    bool over = true;
    for (int k = 0; k < 3; k++) {
        e[0][k] = v[1][k] - v[0][k];
        e[1][k] = v[2][k] - v[0][k];
        q[k] = p[k] - v[0][k];
    }
    for (int k = 0; k < 3; k++) {
        n[k] = e[0][(k + 1) % 3] * e[1][(k + 2) % 3] - e[0][(k + 2) % 3] * e[1][(k + 1) % 3];
    }
    for (int i = 0; i < 3; i++) {
        const double *a = v[i], *b = v[(i + 1) % 3];
        double outside = 0;
        for (int k = 0; k < 3; k++) {
            int x = (k + 1) % 3, y = (k + 2) % 3;
            outside += n[k] * ((b[x] - a[x]) * (p[y] - a[y]) - (b[y] - a[y]) * (p[x] - a[x]));
        }
        over = over && outside >= 0;
        least = fmin(least, segment_distance2(p, a, b));
    }
    double area2 = dot3(n, n), height = dot3(n, q);
    return over && area2 > 0 ? height * height / area2 : least;
}

// p in the space of an affine matrix, and what distances there are at least worth in the world, per unit: the inverse stretches
// nothing by more than its Frobenius norm. q may be p.
static bool to_local(const float *m, const double p[3], double q[3], double *worth) {
    double inverse[12], sum = 0;
    const double from[3] = {p[0], p[1], p[2]};
    if (!rey_affine_inverse(m, inverse)) {
        return false;
    }
    for (int k = 0; k < 3; k++) {
        q[k] = dot3(inverse + 4 * k, from) + inverse[4 * k + 3];
        sum += dot3(inverse + 4 * k, inverse + 4 * k);
    }
    *worth = 1 / sqrt(sum);
    return true;
}

// Squared distance of p to a box; within it 0.
static double beyond2(const double low[3], const double high[3], const double p[3]) {
    double sum = 0;
    for (int k = 0; k < 3; k++) {
        double beyond = fmax(fmax(low[k] - p[k], p[k] - high[k]), 0);
        sum += beyond * beyond;
    }
    return sum;
}

// Distance of p to the surface of the box that a heterogeneous medium fills (medium/majorant.h).
static double medium_box_distance(const SceneView *view, const VolumeNode *v, const double p[3]) {
    static const float none[12] = {[0] = 1, [5] = 1, [10] = 1};
    const float *rows = v->to_world >= 0 ? view->theta + v->to_world : none;
    double low[3], high[3], inside = HUGE_VAL;
    for (int k = 0; k < 3; k++) {
        low[k] = high[k] = (double)rows[4 * k + 3];
        for (int j = 0; j < 3; j++) {
            low[k] += fmin((double)rows[4 * k + j], 0);
            high[k] += fmax((double)rows[4 * k + j], 0);
        }
        inside = fmin(inside, fmin(fabs(p[k] - low[k]), fabs(p[k] - high[k])));
    }
    double outside = beyond2(low, high, p);
    return outside > 0 ? sqrt(outside) : inside;
}

// Of a sphere, whose table has centre and radius.
static double sphere_distance(const float *table, const double p[3]) {
    double d[3];
    for (int k = 0; k < 3; k++) {
        d[k] = p[k] - (double)table[k];
    }
    return fabs(sqrt(dot3(d, d)) - (double)table[3]);
}

// A bound below the distance of q to a surface of the kind in its own space.
static double local_distance(int32_t kind, const double q[3]) {
    double across = hypot(q[0], q[1]), beyond = fmax(fmax(-q[2], q[2] - 1), 0);
    return kind == SHAPE_DISK ? hypot(fmax(across - 1, 0), q[2]) : kind == SHAPE_CYLINDER ? hypot(across - 1, beyond) : 0;
}

static double mesh_distance(const SceneView *view, const ShapeRecord *shape, const float *to_world, const double p[3]) {
    double least = HUGE_VAL;
    for (int32_t i = 0; i < shape->triangle_count; i++) {
        double v[3][3];
        for (int k = 0; k < 3; k++) {
            const float *at = view->theta + shape->positions +
                              3 * (int64_t)view->triangles[3 * ((int64_t)shape->triangle + i) + k];
            for (int c = 0; c < 3; c++) {
                v[k][c] = (double)at[c];
            }
            if (to_world) {
                rey_affine_point(to_world, v[k], v[k]);
            }
        }
        least = fmin(least, triangle_distance2(p, v));
    }
    return sqrt(least);
}

// To the boxes of a curve's segments.
static double curve_distance(const SceneView *view, int32_t id, const double p[3]) {
    double least = HUGE_VAL, low[3], high[3];
    for (int32_t i = 0; i < view->shapes[id].segment_count; i++) {
        rey_tube_box(view, id, i, low, high);
        least = fmin(least, beyond2(low, high, p));
    }
    return sqrt(least);
}

// Bounds below the distance of p to a shape where it stands, and where an instance puts it.
static double shape_distance(const SceneView *view, const ShapeRecord *shape, const float *instance, const double p[3]) {
    if (shape->kind == SHAPE_MESH) {
        return mesh_distance(view, shape, instance, p);
    }
    double q[3], worth = 1, worth_of_instance = 1;
    memcpy(q, p, sizeof q);
    if (instance && !to_local(instance, q, q, &worth_of_instance)) {
        return 0;
    }
    if (shape->kind == SHAPE_SPHERE) {
        return sphere_distance(view->tables + shape->table, q) * worth_of_instance;
    }
    if (shape->segment_count > 0) {
        return curve_distance(view, (int32_t)(shape - view->shapes), q) * worth_of_instance;
    }
    if (shape->to_world < 0 || !to_local(view->theta + shape->to_world, q, q, &worth)) {
        return 0;
    }
    return local_distance(shape->kind, q) * worth * worth_of_instance;
}

// The least of those of all shapes; solid: that do not let everything pass.
static double surface_distance(const SceneView *view, const double p[3], bool solid) {
    double least = HUGE_VAL;
    for (int64_t i = 0; i < view->shapes_count; i++) {
        const ShapeRecord *shape = view->shapes + i;
        bool passes = shape->emitter < 0 && rey_bsdf_passes(view->bsdfs[shape->bsdf].kind);
        if ((shape->flags & SHAPE_UNSEEN) || (solid && passes)) {
            continue;
        }
        if (shape->collection < 0) {
            least = fmin(least, shape_distance(view, shape, NULL, p));
            continue;
        }
        for (int64_t k = 0; k < view->instances_count; k++) {
            if (view->instances[k].group == shape->collection) {
                least = fmin(least, shape_distance(view, shape, view->theta + view->instances[k].to_world, p));
            }
        }
    }
    return least;
}

static double free_radius(const SceneView *view, const double p[3]) {
    double least = surface_distance(view, p, false);
    for (int64_t i = 0; i < view->media_count; i++) {
        if (view->media[i].bounded) {
            least = fmin(least, medium_box_distance(view, view->volumes + view->media[i].sigma_t, p));
        }
    }
    return within * least;
}

// Whether directions matter beyond what collisions see.
static bool turns(const SceneView *view) {
    bool found = rey_bsdfs_used(view, rey_bsdf_mirrors) || rey_boundary_veiled(view);
    for (int64_t i = 0; i < view->shapes_count; i++) {
        found |= rey_cuts_within(view, view->shapes[i].bsdf);
    }
    return found;
}

// ---- what the sensor sees of them --------------------------------------------------------------------------------

// A ray of the sensor's to a light. Others that begin in the lens and end around the light stay within `width` times their distance
// from the sensor, or of parallel rays, within `width`.
typedef struct SightLine {
    double from[3], d[3], length, lens;
    bool parallel;
} SightLine;

// Of column k of a pose.
static double axis_length(const float *m, int k) { return sqrt((double)(m[k] * m[k] + m[4 + k] * m[4 + k] + m[8 + k] * m[8 + k])); }

// False of what lies before the near plane.
static bool line_to(const Render *r, const Projection *projection, const double p[3], SightLine *line) {
    const SensorRecord *s = r->plan.sensor;
    const float *theta = r->scene->view.theta, *m = theta + s->to_world;
    double local[3], radius = projection->pinhole ? 0 : (double)theta[s->lens];
    rey_to_sensor(projection, p, local);
    *line = (SightLine){.lens = radius * fmax(axis_length(m, 0), axis_length(m, 1)), .parallel = projection->parallel};
    for (int k = 0; k < 3; k++) {
        double axis = (double)m[4 * k + 2] * local[2];
        line->d[k] = line->parallel ? axis : p[k] - (double)m[4 * k + 3];
        line->from[k] = p[k] - line->d[k];
    }
    line->length = sqrt(dot3(line->d, line->d));
    return local[2] > projection->near;
}

enum { MOST_SIGHT_PARTS = 64 }; // the line is halved, and halves of halves, breadth last
static const double sight_slack = 0.8, least_sight = 1e-5;

// How wide nothing hides what the sensor sees along the line, less what was not looked at closely.
static double line_width(const SceneView *view, const SightLine *line) {
    double parts[MOST_SIGHT_PARTS][2] = {{0, 1}}, best = HUGE_VAL;
    for (int n = 1; n > 0 && best > least_sight;) {
        n--;
        const double low = parts[n][0], high = parts[n][1], middle = 0.5 * (low + high);
        double p[3];
        for (int k = 0; k < 3; k++) {
            p[k] = line->from[k] + middle * line->d[k];
        }
        const double distance = surface_distance(view, p, true) - line->lens, half = 0.5 * (high - low) * line->length;
        best = fmin(best, distance / (line->parallel ? 1 : middle * line->length));
        bool clear = (distance - half) / (line->parallel ? 1 : high * line->length) > sight_slack * best;
        if (!clear && n + 2 <= MOST_SIGHT_PARTS && half > 1e-7 * line->length) {
            parts[n][0] = middle, parts[n++][1] = high;
            parts[n][0] = low, parts[n++][1] = middle;
        }
    }
    return best > least_sight ? sight_slack * best : 0;
}

// How far around a light on the film nothing hides what is seen of it [pixels]; 0 where it is hidden, and below 0 where that is not
// known.
static double film_reach(const Render *r, const double p[3]) {
    const SceneView *view = &r->scene->view;
    const float *m = view->theta + r->plan.sensor->to_world;
    const Projection projection = rey_projection_of(view, &r->plan);
    SightLine line;
    if (!line_to(r, &projection, p, &line)) {
        return 0;
    }
    double width = line_width(view, &line), pixel = 0;
    for (int k = 0; k < 2; k++) {
        pixel = fmax(pixel, (line.parallel ? axis_length(m, k) : 1) / fabs(k ? projection.scale_y : projection.scale_x));
    }
    return width > 0 || line.lens <= 0 ? fmin(width / (sqrt(2) * pixel), 1e6) : -1;
}

static double distance_to_sensor(const Render *r, const double p[3]) {
    const float *m = r->scene->view.theta + r->plan.sensor->to_world;
    return hypot(hypot(p[0] - (double)m[3], p[1] - (double)m[7]), p[2] - (double)m[11]);
}

// Whether the motion of a light counts beyond that of the sensor.
static bool light_is_shifted(const Render *r, int64_t light) {
    bool moves = r->job.any_camera;
    for (int k = 0; k < MAX_EMITTER_SLOTS; k++) {
        moves |= r->job.place_at[MAX_EMITTER_SLOTS * light + k] >= 0;
    }
    return moves;
}

// Whether what a light lights changes as something moves.
static bool lights_what_moves(const Render *r, int64_t light) {
    return r->job.any_motion || r->job.glides || light_is_shifted(r, light);
}

// Asks a kernel in which media lights at a point lie.
static rey_result find_lamps(Render *r) {
    rey_context *ctx = r->scene->ctx;
    const SceneView *view = &r->scene->view;
    const Backend *backend = rey_backend_cpu(ctx->def.lanes);
    void *workspace = rey_alloc(ctx, backend->workspace_bytes(MODE_PRIMAL)); // no path is followed
    r->lamp_medium = rey_alloc_array(ctx, (size_t)view->emitters_count + 1, sizeof *r->lamp_medium);
    rey_result result = workspace && r->lamp_medium ? rey_scene_update(r->scene) : REY_ERROR_MEMORY;
    if (result == REY_OK) {
        PathJob job = {.scene = view, .sensor = r->job.sensor, .mode = MODE_PRIMAL, .workspace = workspace,
                       .lamp_medium = r->lamp_medium};
        backend->run(&job);
    }
    rey_free(ctx, workspace);
    return result;
}

// Borders of light in media move past collisions, and these past them; and what collisions see of borders on surfaces is known
// where they ride.
static rey_result find_beams(Render *r) {
    const SceneView *view = &r->scene->view;
    PathJob *job = &r->job;
    if (!view->has_media || !(job->any_motion || job->any_places || job->glides)) {
        return REY_OK;
    }
    rey_result result = rey_beam_records(r->scene, &r->beam_steps, &r->beams);
    job->beams = r->beams.data;
    job->beam_steps = r->beam_steps.data;
    job->beam_count = (int32_t)r->beams.count;
    for (int32_t i = 0; i < job->beam_count && result == REY_OK; i++) {
        const int32_t light = job->beams[i].light;
        if (!rey_light_moves(r, light)) {
            continue;
        }
        if (rey_rides_gap(view)) {
            char name[OBJECT_NAME];
            rey_name_emitter(r->scene, light, name);
            return rey_fail(r->scene->ctx, REY_ERROR_INCOMPLETE,
                            "no term of the gradient of '%s', whose light ends abruptly or jumps, exists yet: %s", name,
                            rey_rides_gap(view));
        }
        job->glides = false;
        job->rides = job->any_motion = true;
    }
    return result;
}

rey_result rey_lights_ride(Render *r) {
    const SceneView *view = &r->scene->view;
    bool beside = false;
    rey_result result = find_beams(r);
    for (int64_t i = 0; i < view->emitters_count && view->has_media; i++) {
        int32_t at[3];
        beside |= emitter_place(view->emitters + i, at) && lights_what_moves(r, i);
    }
    result = result == REY_OK && beside ? find_lamps(r) : result;
    if (!beside || result != REY_OK || rey_rides_gap(view) || turns(view)) {
        return result;
    }
    for (int64_t i = 0; i < view->emitters_count; i++) {
        if (r->lamp_medium[i] >= 0 && light_is_shifted(r, i)) {
            r->job.glides = false;
            r->job.rides = r->job.any_motion = true;
        }
    }
    return REY_OK;
}

// Whether the light of a light ends abruptly or jumps in the air, or all but: next to the light, where all its borders meet, what
// they bring to flights has no finite variance.
static bool has_borders(const Render *r, int32_t light) {
    bool found = rey_light_is_steep(&r->scene->view, r->scene->view.emitters + light);
    for (int32_t i = 0; i < (int32_t)r->beams.count && !found; i++) {
        found = ARRAY_AT(r->beams, BeamRecord, i).light == light;
    }
    return found;
}

// Whether the sensor is one that is looked up backwards.
static bool camera_is_known(const Render *r) {
    const int32_t kind = r->plan.sensor->kind;
    return kind == SENSOR_PERSPECTIVE || kind == SENSOR_THINLENS || kind == SENSOR_ORTHOGRAPHIC;
}

// The ball around a light, if there is one.
static bool beacon_of_light(const Render *r, int32_t light, Beacon *beacon) {
    const SceneView *view = &r->scene->view;
    const EmitterRecord *e = view->emitters + light;
    const bool seen = light_is_shifted(r, light);
    int32_t at[3];
    if (!emitter_place(e, at) || has_borders(r, light) || (seen && !camera_is_known(r))) {
        return false;
    }
    const double p[3] = {(double)view->theta[at[0]], (double)view->theta[at[1]], (double)view->theta[at[2]]};
    double radius = free_radius(view, p), reach = 0;
    if (!(radius > least_radius * (double)view->bounds_radius)) {
        return false;
    }
    radius = camera_is_known(r) ? fmin(radius, 2 * (double)view->bounds_radius + distance_to_sensor(r, p)) : radius;
    reach = seen ? film_reach(r, p) : 0;
    *beacon = (Beacon){(float)p[0], (float)p[1], (float)p[2], (float)radius, (float)reach, light};
    return isfinite(radius) && reach >= 0;
}

static rey_result refuse_lamp(const Render *r, int32_t light) {
    const SceneView *view = &r->scene->view;
    const char *why = "so close to a surface (grids of distances count as close) or to the border of its medium";
    char name[OBJECT_NAME];
    rey_name_emitter(r->scene, light, name);
    why = has_borders(r, light) ? "where its light ends abruptly or jumps" : why;
    why = light_is_shifted(r, light) && !camera_is_known(r) ? "with sensors that are no cameras" : why;
    why = turns(view) ? "in scenes with smooth mirrors, glass, masks, or maps without a shadowing function" : why;
    why = rey_rides_gap(view) ? rey_rides_gap(view) : why;
    return rey_fail(r->scene->ctx, REY_ERROR_INCOMPLETE,
                    "the gradient of what moves beside '%s', a light at a point that lies within a participating medium, does "
                    "not exist yet %s: points next to the light, from which its light is scattered, must move as it does "
                    "(docs/media.md)", name, why);
}

rey_result rey_beacons_begin(Render *r) {
    const SceneView *view = &r->scene->view;
    const bool moves = r->job.rides && !turns(view);
    const bool needed = r->needed & (REY_TERM_PRIMARY | REY_TERM_INDIRECT | REY_TERM_SPECULAR); // not by what turns normals alone
    if (!r->lamp_medium) {
        return REY_OK;
    }
    size_t n = (size_t)view->emitters_count + 1;
    Beacon *beacons = r->beacons = rey_alloc_array(r->scene->ctx, n, sizeof *beacons);
    int32_t *of = r->beacon_of = rey_alloc_array(r->scene->ctx, n, sizeof *of);
    if (!beacons || !of) {
        return REY_ERROR_MEMORY;
    }
    int32_t count = 0;
    for (int32_t i = 0; i < (int32_t)view->emitters_count; i++) {
        const int32_t medium = r->lamp_medium[i];
        bool known = moves && medium >= 0 && beacon_of_light(r, i, beacons + count);
        of[i] = known ? count++ : -1;
        if (needed && !known && medium >= 0 && lights_what_moves(r, i)) {
            return refuse_lamp(r, i);
        }
    }
    if (count > 0) {
        r->job.beacons = beacons, r->job.beacon_of = of, r->job.beacon_count = count;
        r->job.seen_x = r->plan.x, r->job.seen_width = r->plan.width;
        r->job.seen_y = r->plan.y, r->job.seen_height = r->plan.height;
        r->job.none = r->none;
    }
    return REY_OK;
}

void rey_beacons_end(Render *r) {
    rey_free(r->scene->ctx, r->lamp_medium);
    rey_free(r->scene->ctx, r->beacons);
    rey_free(r->scene->ctx, r->beacon_of);
    rey_array_free(r->scene->ctx, &r->beams);
    rey_array_free(r->scene->ctx, &r->beam_steps);
}
