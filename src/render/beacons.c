// beacons.c: how far around lights at a point nothing lies: no surface, and no border of a medium.
#include "render/beacons.h"

#include "bsdf/ends.h"
#include "emitter/emitter.h"
#include "render/blame.h"
#include "render/light_borders.h"
#include "render/live.h"
#include "shape/affine.h"

#include <math.h>

// Rounding of what lies just outside of a ball; and the least radius over that of the scene: within smaller balls collisions are
// too seldom to say what stands still.
static const double within = 0.99, least_radius = 1e-3;

static double dot(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

// Squared distance of p to the segment from a to b.
static double segment_distance2(const double p[3], const double a[3], const double b[3]) {
    double e[3], q[3], d[3];
    for (int k = 0; k < 3; k++) {
        e[k] = b[k] - a[k];
        q[k] = p[k] - a[k];
    }
    double length2 = dot(e, e), t = length2 > 0 ? fmin(fmax(dot(e, q) / length2, 0), 1) : 0;
    for (int k = 0; k < 3; k++) {
        d[k] = q[k] - t * e[k];
    }
    return dot(d, d);
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
    double area2 = dot(n, n), height = dot(n, q);
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
        q[k] = dot(inverse + 4 * k, from) + inverse[4 * k + 3];
        sum += dot(inverse + 4 * k, inverse + 4 * k);
    }
    *worth = 1 / sqrt(sum);
    return true;
}

// Distance of q to the surface of the unit cube.
static double cube_distance(const double q[3]) {
    double outside = 0, inside = HUGE_VAL;
    for (int k = 0; k < 3; k++) {
        double beyond = fmax(fmax(-q[k], q[k] - 1), 0);
        outside += beyond * beyond;
        inside = fmin(inside, fmin(fabs(q[k]), fabs(q[k] - 1)));
    }
    return outside > 0 ? sqrt(outside) : inside;
}

// Of a sphere, whose table has centre and radius.
static double sphere_distance(const float *table, const double p[3]) {
    double d[3];
    for (int k = 0; k < 3; k++) {
        d[k] = p[k] - (double)table[k];
    }
    return fabs(sqrt(dot(d, d)) - (double)table[3]);
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
    if (shape->to_world < 0 || !to_local(view->theta + shape->to_world, q, q, &worth)) {
        return 0;
    }
    return local_distance(shape->kind, q) * worth * worth_of_instance;
}

static double free_radius(const SceneView *view, const double p[3]) {
    double least = HUGE_VAL;
    for (int64_t i = 0; i < view->shapes_count; i++) {
        const ShapeRecord *shape = view->shapes + i;
        if (shape->flags & SHAPE_UNSEEN) {
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
    for (int64_t i = 0; i < view->media_count; i++) {
        const VolumeNode *v = view->volumes + view->media[i].sigma_t;
        double q[3], worth;
        if (view->media[i].bounded) {
            memcpy(q, p, sizeof q);
            bool known = v->to_world < 0 || to_local(view->theta + v->to_world, q, q, &worth);
            least = fmin(least, known ? cube_distance(q) * (v->to_world < 0 ? 1 : worth) : 0);
        }
    }
    return within * least;
}

// Whether directions matter beyond what collisions see.
static bool turns(const SceneView *view) {
    bool found = rey_bsdfs_used(view, rey_bsdf_mirrors) || rey_bsdfs_used(view, rey_bsdf_turns);
    for (int64_t i = 0; i < view->shapes_count; i++) {
        const ShapeRecord *shape = view->shapes + i;
        found |= (shape->flags & SHAPE_HAS_NORMALS) && !rey_bsdf_passes(view->bsdfs[shape->bsdf].kind);
        found |= rey_bsdf_ends_within(view, shape->bsdf);
    }
    for (int64_t i = 0; i < view->media_count; i++) {
        found |= rey_phase_varies(view, view->media[i].phase);
    }
    return found;
}

// Where a light at a point lies whose light does not jump; false of others.
static bool place_of(const SceneView *view, const EmitterRecord *e, double p[3]) {
    int32_t at[3];
    if (!emitter_place(e, at)) {
        return false;
    }
    for (int k = 0; k < 3; k++) {
        p[k] = (double)view->theta[at[k]];
    }
    return e->kind == EMITTER_POINT || !(rey_light_is_abrupt(view, e) || rey_light_is_steep(view, e));
}

rey_result rey_beacons_begin(Render *r) {
    const SceneView *view = &r->scene->view;
    if (r->request.asked || !r->job.rides || r->job.any_camera || r->job.any_places || turns(view)) {
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
        double p[3] = {0}, radius = place_of(view, view->emitters + i, p) ? free_radius(view, p) : 0;
        of[i] = radius > least_radius * (double)view->bounds_radius && isfinite(radius) ? count : -1;
        if (of[i] >= 0) {
            beacons[count++] = (Beacon){(float)p[0], (float)p[1], (float)p[2], (float)radius, i};
        }
    }
    if (count > 0) {
        r->job.beacons = beacons, r->job.beacon_of = of, r->job.beacon_count = count;
        r->job.none = r->none;
    }
    return REY_OK;
}
