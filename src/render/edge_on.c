// edge_on.c: all faces against the few rays that leave a point or have one direction.
#include "render/edge_on.h"

#include "bsdf/table.h"
#include "emitter/table.h"
#include "medium/majorant_build.h"
#include "render/projection.h"
#include "sensor/kinds.h"
#include "shape/shape.h"

#include <math.h>
#include <stdio.h>

// The sine of the angle below which rays count as parallel to a face: so few cross it that their mean is not found.
#define EDGE_ON 1e-4

// Rays with one direction, or from one point.
typedef struct Beam {
    bool parallel;
    double at[3];           // the unit direction, or the point
    const Projection *film; // of the sensor's rays, else null
} Beam;

// A flat part of a border.
typedef struct Face {
    double n[3], p[4][3]; // unit normal, corners
    int corners;
} Face;

static double dot(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static void normalise(double v[3]) {
    double length = sqrt(dot(v, v));
    for (int k = 0; k < 3; k++) {
        v[k] = length > 0 ? v[k] / length : 0;
    }
}

// Along the pose's z axis, or from its origin.
static Beam beam_of_pose(const float *m, bool parallel) {
    Beam b = {.parallel = parallel, .film = NULL};
    for (int k = 0; k < 3; k++) {
        b.at[k] = (double)m[4 * k + (parallel ? 2 : 3)];
    }
    if (parallel) {
        normalise(b.at);
    }
    return b;
}

static bool beam_of_sensor(const SceneView *view, const SensorRecord *s, Beam *beam) {
    *beam = beam_of_pose(view->theta + s->to_world, s->kind == SENSOR_ORTHOGRAPHIC);
    return s->kind == SENSOR_ORTHOGRAPHIC || s->kind == SENSOR_PERSPECTIVE;
}

static bool beam_of_light(const SceneView *view, const EmitterRecord *e, Beam *beam) {
    const EmitterKind *kind = rey_emitter_kinds + e->kind;
    for (int k = 0; k < kind->param_count && kind->form == EMITTER_IS_DELTA; k++) {
        const float *place = view->theta + e->slot[k];
        switch (kind->params[k].type) {
        case EMITTER_PARAM_POSITION:
            *beam = (Beam){false, {(double)place[0], (double)place[1], (double)place[2]}, NULL};
            return true;
        case EMITTER_PARAM_POSE:
        case EMITTER_PARAM_AXIS:
            *beam = beam_of_pose(place, kind->params[k].type == EMITTER_PARAM_AXIS);
            return true;
        default:
            break;
        }
    }
    return false;
}

static bool runs_along(const Beam *beam, const Face *face) {
    double way[3];
    for (int k = 0; k < 3; k++) {
        way[k] = beam->parallel ? beam->at[k] : face->p[0][k] - beam->at[k];
    }
    normalise(way);
    bool along = fabs(dot(way, face->n)) < EDGE_ON, seen = !beam->film;
    for (int i = 0; i < face->corners && along && !seen; i++) {
        EdgeRecord side = {.last = 1};
        seen = rey_see_line(beam->film, face->p[i], face->p[(i + 1) % face->corners], &side) > 0;
    }
    return along && seen;
}

// Whether a grid has anything in the voxels at its border.
static bool reaches_border(const SceneView *view, const VolumeNode *v) {
    const float *data = view->theta + v->theta;
    for (int32_t z = 0; z < v->nz; z++) {
        for (int32_t y = 0; y < v->ny; y++) {
            bool side = z == 0 || z == v->nz - 1 || y == 0 || y == v->ny - 1;
            for (int32_t x = 0; x < v->nx; x += side || v->nx == 1 ? 1 : v->nx - 1) {
                for (int32_t c = 0; c < v->channels; c++) {
                    if (data[(((int64_t)z * v->ny + y) * v->nx + x) * v->channels + c] != 0) {
                        return true;
                    }
                }
            }
        }
    }
    return false;
}

// Whether what a medium brings may jump at a face: a grid that is empty at its border does not where the face leaves it whole.
static bool jumps_at(const SceneView *view, int32_t id, const Face *face) {
    const MediumNode *medium = view->media + id;
    const VolumeNode *v = view->volumes + medium->sigma_t;
    if (!medium->bounded || medium->emission >= 0 || v->kind != VOLUME_GRID || reaches_border(view, v) ||
        rey_volume_goes_on(view, v)) {
        return true;
    }
    double low = INFINITY, high = -INFINITY, size = 0;
    for (int corner = 0; corner < 8; corner++) {
        double q[3] = {corner & 1, corner >> 1 & 1, corner >> 2}, from[3];
        for (int k = 0; k < 3; k++) {
            const float *row = v->to_world >= 0 ? view->theta + v->to_world + 4 * k : NULL;
            double x = row ? (double)row[0] * q[0] + (double)row[1] * q[1] + (double)row[2] * q[2] + (double)row[3] : q[k];
            from[k] = x - face->p[0][k];
            size = fmax(size, fabs(from[k]));
        }
        low = fmin(low, dot(from, face->n));
        high = fmax(high, dot(from, face->n));
    }
    return low < -1e-4 * size && high > 1e-4 * size;
}

// A point through rows of an affine matrix, null: as it is.
static void place_point(const float *m, const float p[3], double out[3]) {
    for (int k = 0; k < 3; k++) {
        out[k] = m ? (double)m[4 * k] * (double)p[0] + (double)m[4 * k + 1] * (double)p[1] + (double)m[4 * k + 2] * (double)p[2] +
                         (double)m[4 * k + 3]
                   : (double)p[k];
    }
}

static Face face_of(const float *m, const float (*p)[3], int corners) {
    Face face = {.corners = corners};
    for (int i = 0; i < corners; i++) {
        place_point(m, p[i], face.p[i]);
    }
    for (int k = 0; k < 3; k++) {
        int i = (k + 1) % 3, j = (k + 2) % 3;
        face.n[k] = (face.p[1][i] - face.p[0][i]) * (face.p[2][j] - face.p[0][j]) -
                    (face.p[1][j] - face.p[0][j]) * (face.p[2][i] - face.p[0][i]);
    }
    normalise(face.n);
    return face;
}

// Whether rays run along faces of a medium's box.
static bool box_runs_along(const SceneView *view, int32_t medium, const Beam *beam) {
    const VolumeNode *v = view->volumes + view->media[medium].sigma_t;
    const float *m = v->to_world >= 0 ? view->theta + v->to_world : NULL;
    float low[3] = {0, 0, 0}, high[3] = {1, 1, 1};
    if (m) { // medium_box
        for (int k = 0; k < 3; k++) {
            low[k] = high[k] = m[4 * k + 3];
            for (int j = 0; j < 3; j++) {
                low[k] += fminf(m[4 * k + j], 0);
                high[k] += fmaxf(m[4 * k + j], 0);
            }
        }
    }
    for (int side = 0; side < 6; side++) {
        float p[4][3];
        for (int i = 0; i < 4; i++) {
            const int at[3] = {side % 2, i == 1 || i == 2, i > 1};
            for (int k = 0; k < 3; k++) {
                p[i][(side / 2 + k) % 3] = at[k] ? high[(side / 2 + k) % 3] : low[(side / 2 + k) % 3];
            }
        }
        Face face = face_of(NULL, (const float(*)[3])p, 4);
        if (runs_along(beam, &face) && jumps_at(view, medium, &face)) {
            return true;
        }
    }
    return false;
}

static bool border_jumps_at(const SceneView *view, const ShapeRecord *shape, const Face *face) {
    return (shape->interior >= 0 && jumps_at(view, shape->interior, face)) ||
           (shape->exterior >= 0 && jumps_at(view, shape->exterior, face));
}

// A pose of a shapegroup's space in the world.
static void pose_within(const float *instance, const float *own, float out[12]) {
    for (int i = 0; i < 12; i++) {
        const float *row = instance + 4 * (i / 4);
        out[i] = row[0] * own[i % 4] + row[1] * own[4 + i % 4] + row[2] * own[8 + i % 4] + (i % 4 == 3 ? row[3] : 0);
    }
}

// The same of a shape, where an instance has it: its flat parts, and what is flat along the axis of a cylinder.
static bool shape_runs_along(const SceneView *view, const ShapeRecord *shape, const float *instance, const Beam *beam) {
    static const float around[4][3] = {{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}};
    const float *pose = shape->to_world >= 0 ? view->theta + shape->to_world : NULL;
    float both[12];
    if (pose && instance) {
        pose_within(instance, pose, both);
        pose = both;
    }
    if (shape->kind == SHAPE_DISK) {
        Face face = face_of(pose, around, 4);
        return runs_along(beam, &face) && border_jumps_at(view, shape, &face);
    }
    if (shape->kind == SHAPE_CYLINDER) {
        const Beam axis = beam_of_pose(pose, true);
        return beam->parallel && fabs(dot(axis.at, beam->at)) > 1 - 0.5 * EDGE_ON * EDGE_ON;
    }
    for (int32_t i = 0; i < shape->triangle_count && shape->kind == SHAPE_MESH; i++) {
        const int32_t *at = view->triangles + 3 * ((int64_t)shape->triangle + i);
        float p[3][3];
        for (int k = 0; k < 9; k++) {
            p[k / 3][k % 3] = view->theta[shape->positions + 3 * (int64_t)at[k / 3] + k % 3];
        }
        Face face = face_of(instance, (const float(*)[3])p, 3);
        if (runs_along(beam, &face) && border_jumps_at(view, shape, &face)) {
            return true;
        }
    }
    return false;
}

static bool is_border(const SceneView *view, const ShapeRecord *shape) {
    return (shape->interior >= 0 || shape->exterior >= 0) && rey_bsdf_passes(view->bsdfs[shape->bsdf].kind);
}

// Whether rays run along faces of what a parameter moves; one that moves rays: of all borders. Then name is whose they are.
static bool faces_run_along(const rey_scene *scene, const Param *p, const Beam *beam, char name[OBJECT_NAME]) {
    const SceneView *view = &scene->view;
    const bool all = p->camera >= 0 || p->emitter >= 0;
    for (int32_t i = 0; i < (int32_t)view->shapes_count; i++) {
        const ShapeRecord *shape = view->shapes + i;
        bool single = shape->collection < 0 && (all || p->geometry == i), found = false;
        if (!is_border(view, shape)) {
            continue;
        }
        found = single && shape_runs_along(view, shape, NULL, beam);
        for (int32_t k = 0; k < (int32_t)view->instances_count && shape->collection >= 0 && !found; k++) {
            const InstanceRecord *instance = view->instances + k;
            bool moves = all || p->geometry == i || p->instance == k;
            found = instance->group == shape->collection && moves &&
                    shape_runs_along(view, shape, view->theta + instance->to_world, beam);
        }
        if (found) {
            rey_name_shape(scene, i, name);
            return true;
        }
    }
    for (int32_t i = 0; i < (int32_t)view->media_count; i++) {
        const MediumNode *medium = view->media + i;
        bool moves = all || (p->volume >= 0 && view->volumes[medium->sigma_t].to_world == p->theta);
        if (medium->bounded && moves && box_runs_along(view, i, beam)) {
            snprintf(name, OBJECT_NAME, "the box of the grid of %s", medium->sigma_s < 0 ? "sigma_t" : "sigma_s");
            return true;
        }
    }
    return false;
}

bool rey_moves_edge_on(const rey_scene *scene, const SensorRecord *sensor, const Param *p, char text[2 * OBJECT_NAME]) {
    const SceneView *view = &scene->view;
    Beam beam;
    char face[OBJECT_NAME], light[OBJECT_NAME];
    const FilmPlan plan = rey_film_plan(sensor, 3);
    const bool borders = p->volume >= 0 || p->geometry >= 0 || p->instance >= 0;
    if (!view->has_media) {
        return false;
    }
    if ((borders || p->camera >= 0) && beam_of_sensor(view, sensor, &beam)) {
        Projection film = rey_projection_of(view, &plan);
        beam.film = &film;
        if (faces_run_along(scene, p, &beam, face)) {
            snprintf(text, 2 * OBJECT_NAME, "the sensor's rays run along a face of a medium's border ('%.150s')", face);
            return true;
        }
    }
    for (int32_t i = 0; i < (int32_t)view->emitters_count; i++) {
        const EmitterRecord *e = view->emitters + i;
        if ((borders || p->emitter == i) && beam_of_light(view, e, &beam) && faces_run_along(scene, p, &beam, face)) {
            rey_name_emitter(scene, i, light);
            snprintf(text, 2 * OBJECT_NAME, "the rays of '%.100s' run along a face of a medium's border ('%.150s')", light, face);
            return true;
        }
    }
    return false;
}
