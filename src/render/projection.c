// projection.c: the film's side of a pinhole, or of parallel views, and what it cuts off.
#include "render/projection.h"

#include "sensor/kinds.h"
#include "shape/affine.h"

#include <math.h>

double rey_pose_size(const float *m) {
    double size = 0;
    for (int k = 0; k < 11; k++) {
        size = k % 4 < 3 ? fmax(size, fabs((double)m[k])) : size;
    }
    return size;
}

void rey_sensor_eye(const SceneView *view, const SensorRecord *sensor, double eye[4]) {
    const bool parallel = sensor->kind == SENSOR_ORTHOGRAPHIC;
    for (int k = 0; k < 3; k++) {
        eye[k] = (double)view->theta[sensor->to_world + 4 * k + (parallel ? 2 : 3)];
    }
    eye[3] = parallel ? 0 : 1;
}

Projection rey_projection_of(const SceneView *view, const FilmPlan *plan) {
    const SensorRecord *s = plan->sensor;
    Projection p = {.near = fmax((double)s->near_clip, 1e-6), .parallel = s->kind == SENSOR_ORTHOGRAPHIC,
                    .pinhole = s->kind == SENSOR_PERSPECTIVE || s->kind == SENSOR_ORTHOGRAPHIC};
    rey_affine_inverse(view->theta + s->to_world, p.inverse);
    p.lens = p.pinhole ? 0 : 3 * rey_pose_size(view->theta + s->to_world) * (double)view->theta[s->lens];
    double tangent = p.parallel ? 1 : tan(0.5 * 3.14159265358979323846 / 180 * (double)view->theta[s->fov]);
    p.scale_x = -0.5 * s->width / tangent;
    p.scale_y = -0.5 * s->width / tangent; // pixels are square
    p.shift_x = s->width * (0.5 - (p.parallel ? 0 : (double)view->theta[s->principal]));
    p.shift_y = s->height * (0.5 - (p.parallel ? 0 : (double)view->theta[s->principal + 1]));
    p.low_x = plan->x;
    p.low_y = plan->y;
    p.high_x = plan->x + plan->width;
    p.high_y = plan->y + plan->height;
    return p;
}

void rey_clip_borders(const SceneView *view, const FilmPlan *plan, LightBorder borders[4]) {
    static const double corners[4][2] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
    static const int triangles[2][3] = {{0, 1, 2}, {0, 2, 3}};
    const Projection p = rey_projection_of(view, plan);
    const float *m = view->theta + plan->sensor->to_world;
    const double middle[2] = {0.5 * (p.low_x + p.high_x), 0.5 * (p.low_y + p.high_y)};
    for (int i = 0; i < 4; i++) {
        double z = i < 2 ? p.near : (double)plan->sensor->far_clip, spread = p.parallel ? 1 : z;
        borders[i] = (LightBorder){.light = i < 2 ? BORDER_NEAR : BORDER_FAR};
        for (int k = 0; k < 3; k++) { // with room around what the film sees
            const double *corner = corners[triangles[i % 2][k]];
            double x = middle[0] + 1.1 * (p.low_x + corner[0] * (p.high_x - p.low_x) - middle[0]);
            double y = middle[1] + 1.1 * (p.low_y + corner[1] * (p.high_y - p.low_y) - middle[1]);
            double local[3] = {(x - p.shift_x) / p.scale_x * spread, (y - p.shift_y) / p.scale_y * spread, z};
            local[0] += p.pinhole ? 0 : (2 * corner[0] - 1) * (p.scale_x > 0 ? 1 : -1) * p.lens;
            local[1] += p.pinhole ? 0 : (2 * corner[1] - 1) * (p.scale_y > 0 ? 1 : -1) * p.lens;
            for (int c = 0; c < 3; c++) {
                borders[i].p[k][c] = (float)((double)m[4 * c] * local[0] + (double)m[4 * c + 1] * local[1] +
                                             (double)m[4 * c + 2] * local[2] + (double)m[4 * c + 3]);
            }
        }
    }
}

void rey_to_sensor(const Projection *p, const double *world, double *out) {
    for (int k = 0; k < 3; k++) {
        const double *row = p->inverse + 4 * k;
        out[k] = row[0] * world[0] + row[1] * world[1] + row[2] * world[2] + row[3];
    }
}

void rey_to_film(const Projection *p, const double *local, double *film) {
    double z = p->parallel ? 1 : local[2];
    film[0] = p->shift_x + p->scale_x * local[0] / z;
    film[1] = p->shift_y + p->scale_y * local[1] / z;
}

// Cuts the range [*s0, *s1] of a line from a to b to low <= coordinate <= high.
static void clip(double a, double b, double low, double high, double *s0, double *s1) {
    double d = b - a;
    if (d == 0) {
        *s1 = a < low || a > high ? -1 : *s1;
        return;
    }
    double enter = ((d > 0 ? low : high) - a) / d, leave = ((d > 0 ? high : low) - a) / d;
    *s0 = fmax(*s0, enter);
    *s1 = fmin(*s1, leave);
}

double rey_see_line(const Projection *p, const double from[3], const double to[3], EdgeRecord *e) {
    double a[3], b[3], fa[2], fb[2];
    rey_to_sensor(p, from, a);
    rey_to_sensor(p, to, b);
    double t0 = (double)e->first, t1 = (double)e->last;
    clip(a[2], b[2], p->near, INFINITY, &t0, &t1);
    if (t0 >= t1) {
        return 0;
    }
    double q[2][3];
    for (int k = 0; k < 3; k++) {
        q[0][k] = a[k] + t0 * (b[k] - a[k]);
        q[1][k] = a[k] + t1 * (b[k] - a[k]);
    }
    rey_to_film(p, q[0], fa);
    rey_to_film(p, q[1], fb);
    double length = hypot(fb[0] - fa[0], fb[1] - fa[1]), s0 = 0, s1 = 1;
    if (!p->pinhole) {
        return fmin(length, 4 * (p->high_x - p->low_x)) + 1;
    }
    clip(fa[0], fb[0], p->low_x, p->high_x, &s0, &s1);
    clip(fa[1], fb[1], p->low_y, p->high_y, &s0, &s1);
    if (s0 >= s1) {
        return 0;
    }
    // Back from the film to the line, which perspective does not divide evenly.
    double z0 = p->parallel ? 1 : q[0][2], z1 = p->parallel ? 1 : q[1][2], ends[2] = {s0, s1};
    for (int i = 0; i < 2; i++) {
        double s = ends[i], t = s * z0 / ((1 - s) * z1 + s * z0);
        ends[i] = t0 + t * (t1 - t0);
    }
    e->first = (float)ends[0];
    e->last = (float)ends[1];
    return length * (s1 - s0);
}
