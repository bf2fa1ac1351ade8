// stages.h: the stages of a chunk that know nothing of scattering: starting paths at the camera, and tracing them.
#pragma once

#include "accel/trace.h"
#include "integrator/state.h"
#include "integrator/touch.h"
#include "medium/track.h"
#include "math/rng.h"
#include "sensor/filter.h"
#include "sensor/sensor.h"

#include <time.h>

// Dimensions of a sample: a pure function of bounce and purpose.
enum { PURPOSE_FILM, PURPOSE_LIGHT_CHOICE, PURPOSE_LIGHT, PURPOSE_LOBE, PURPOSE_DIRECTION, PURPOSE_ROULETTE, PURPOSES };

KFN uint32_t dimension(int32_t bounce, uint32_t purpose) { return (uint32_t)bounce * PURPOSES + purpose; }

// Beyond the dimensions of bounces, so that a lens changes no other random number.
#define DIMENSION_LENS 0x80000000u

// Densities of paths that light sampling could not have made: delta lobes; the camera, also behind absent surfaces.
#define PDF_DELTA (-1.0f)
#define PDF_VIEWED (-2.0f)

// Lobes whose own weight is 0 are still selected with this probability when derivatives are estimated.
#define DERIVATIVE_FLOOR 0.05f

// Of paths that begin within the scene: what media on the way to their first vertex and that vertex bring without their going on,
// what media alone, and whether it is a collision, or goes on in a direction that follows from how they came.
typedef struct Fork {
    SpecRows first, air;
    int32_t *way;
} Fork;
enum { FORK_CHAIN = 1, FORK_AIR = 2 };

typedef struct Tracer {
    PathJob *job;
    const SceneView *scene;
    const SceneView *deciding; // the scene by which media are tracked: `scene`, but where another one's paths are followed
    const SensorRecord *sensor;
    Workspace ws;
    bool derivative;
    real floor;
    int32_t active, current; // paths alive, and which of ws.paths holds them
    int32_t shadow_count;
    int32_t record_count, batch_count;
    int32_t first_bounce;    // 0, but for paths that do not begin at the camera
    real **rungs;            // radiance by number of segments: rows of a colour per number; or null
    int32_t rung_count, rungs_kept;
    real **sent, **brought;  // of those: what came to the first vertices without their scattering any; what was kept last
    Fork *fork;              // or null
    int32_t *lobes;          // per slot, of the last vertex of a particle; or null
    bool placed;             // the paths' first vertices are known
    bool on_lines;           // paths take the random numbers of lines of sight (sightline.h): what is passed counts as a bounce
    bool spares;             // lights are not selected: what vertices bring is found out from the first selected one on
    bool local;              // of surfaces nothing is recorded but what materials ask for
    bool bare;               // collisions count as if all of the extinction scattered, in media that have a sigma_s
    bool shadows_later;      // shadow rays are traced by the sweep, which must know what they pass
    real *nudge[2];          // per slot, what is added to the uv of those; or null
    const Vec3 *focus;       // where particles are to be seen from (track.h), or null
    const struct Pinhole *pinhole; // where lights at a point within media move, or the sensor (beacon_view.h); or null
    Vec3 lamps[MOST_FOCI];   // lights at a point within homogeneous media, near which paths look for collisions (lamps.h)
    int32_t lamp_medium[MOST_FOCI], lamp_count;
    bool overflow;           // the chunk's vertices did not fit the records
    int32_t most;            // paths of the next chunk
} Tracer;

// The time, waits for a processor included: to ask for that of the thread alone takes a system call.
KFN double stage_seconds(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

KFN SampleKey slot_key(const Tracer *t, Int slot) {
    SampleKey key;
    key.pixel = (UInt)i_gather(t->ws.pixel, slot);
    key.sample = (UInt)i_gather(t->ws.sample, slot);
    key.scramble = t->job->scramble;
    key.sobol = t->job->sobol;
    return key;
}

// Where on the lens a sample's ray begins; of sensors that have none, 0.
KFN Vec2 sample_lens(const Tracer *t, const SampleKey *key) {
    return sensor_has_lens(t->sensor) ? rng_2d(key, DIMENSION_LENS) : (Vec2){f_set(0), f_set(0)};
}

// A vector per slot and channel.
KFN Vec3 rows_gather(const ChannelRows *r, int channel, Int slot) {
    return v3(real_gather(r->x[channel], slot), real_gather(r->y[channel], slot), real_gather(r->z[channel], slot));
}
KFN void rows_scatter(const ChannelRows *r, int channel, Int slot, Vec3 v, Mask m) {
    f_scatter(r->x[channel], slot, v.x, m);
    f_scatter(r->y[channel], slot, v.y, m);
    f_scatter(r->z[channel], slot, v.z, m);
}

#define LOAD_V3(a, x, y, z, i) v3(real_gather((a).x, i), real_gather((a).y, i), real_gather((a).z, i))

// ---- camera ------------------------------------------------------------------------------------------------------

// The state of LANES new paths, at position i.
KFN void path_begin(Tracer *t, int32_t i, Int slot, const Ray *ray, Float weight) {
    Paths *p = &t->ws.paths[0];
    f_store(p->ox + i, ray->o.x);
    f_store(p->oy + i, ray->o.y);
    f_store(p->oz + i, ray->o.z);
    f_store(p->dx + i, ray->d.x);
    f_store(p->dy + i, ray->d.y);
    f_store(p->dz + i, ray->d.z);
    f_store(p->px + i, ray->o.x);
    f_store(p->py + i, ray->o.y);
    f_store(p->pz + i, ray->o.z);
    f_store(p->tmax + i, ray->tmax);
    f_store(p->skip + i, f_set(0));
    spec_store(p->beta, i, spec_set(weight));
    f_store(p->eta2 + i, f_set(1));
    f_store(p->roulette + i, f_set(1));
    f_store(p->pdf + i, f_set(PDF_VIEWED));
    i_store(p->slot + i, slot);
    i_store(p->medium + i, i_set(t->sensor->medium));
    i_store(p->depth + i, i_set(0));
    i_store(p->begins + i, i_set(BEGINS_AT_SURFACE));
    spec_store(t->ws.radiance, i, spec_zero());
    spec_store(t->ws.suffix, i, spec_zero());
    f_store(t->ws.reached + i, f_set(0));
}

// Which pixels and samples `count` paths from `first` on are.
static void number_samples(Tracer *t, int64_t first, int32_t count, int32_t margin) {
    const PathJob *job = t->job;
    int32_t pixel = (int32_t)(first / job->spp), sample = (int32_t)(first % job->spp);
    for (int32_t i = 0, number = -1; i < count; i++) {
        if (number < 0) {
            // Numbers of pixels of the whole film with room for a border, so that they do not depend on the tiles.
            int32_t x = job->x + pixel % job->width + margin, y = job->y + pixel / job->width + margin;
            number = y * (t->sensor->width + 2 * margin) + x;
        }
        t->ws.pixel[i] = number;
        t->ws.sample[i] = sample++;
        if (sample == job->spp) {
            sample = 0;
            pixel++;
            number = -1;
        }
    }
}

// Starts `count` paths: samples `first`... of the tile, pixel by pixel, so that packets are coherent.
static void camera_stage(Tracer *t, int64_t first, int32_t count) {
    PathJob *job = t->job;
    const int32_t margin = filter_margin(t->sensor);
    number_samples(t, first, count, margin);
    for (int32_t i = 0; i < count; i += LANES) {
        Int slot = i_iota() + i;
        SampleKey key = slot_key(t, slot);
        Vec2 jitter = rng_2d(&key, dimension(0, PURPOSE_FILM));
        Int stride = i_set(t->sensor->width + 2 * margin);
        Int pixel = i_load(t->ws.pixel + i);
        Int y = pixel / stride;
        Int x = pixel - y * stride;
        Float film_x = f_from_i(x - margin) + jitter.x, film_y = f_from_i(y - margin) + jitter.y;
        f_store(t->ws.film_x + i, film_x);
        f_store(t->ws.film_y + i, film_y);
        SensorRay sample = sensor_ray(t->scene, t->sensor, film_x, film_y, sample_lens(t, &key));
        path_begin(t, i, slot, &sample.ray, sample.weight);
    }
    t->active = count;
    t->current = 0;
    t->record_count = t->batch_count = 0;
    t->overflow = false;
    job->paths += count;
}

// ---- trace and sort ----------------------------------------------------------------------------------------------

KFN Ray path_ray(const Paths *p, int32_t k) {
    Ray ray;
    ray.o = v3(f_load(p->ox + k), f_load(p->oy + k), f_load(p->oz + k));
    ray.d = v3(f_load(p->dx + k), f_load(p->dy + k), f_load(p->dz + k));
    ray.tmax = f_load(p->tmax + k);
    return ray;
}

// Camera rays of a sensor that hides emitters go on behind every area light that they meet.
KFN Hit trace_past_emitters(Tracer *t, Ray ray, Mask m, Hit hit) {
    enum { MOST_LIGHTS_IN_A_ROW = 64 };
    for (int i = 0; i < MOST_LIGHTS_IN_A_ROW; i++) {
        Mask found = m & mi_lt(i_set(-1), hit.shape);
        Int emitter = SHAPE_FIELD(t->scene, i_max(hit.shape, i_set(0)), emitter);
        Mask again = found & mi_lt(i_set(-1), emitter);
        if (!m_any(again)) {
            break;
        }
        Float step = interaction_step(hit.p);
        Vec3 o = v3_madd(hit.p, step, ray.d);
        Float passed = v3_dot(v3_sub(o, ray.o), ray.d);
        ray.o = v3_select(again, o, ray.o);
        ray.tmax = f_select(again, ray.tmax - passed, ray.tmax);
        Hit next = trace_closest(t->scene, &ray, again, false);
        t->job->rays += m_count(again);
        hit.shape = i_select(again, next.shape, hit.shape);
        hit.prim = i_select(again, next.prim, hit.prim);
        hit.instance = i_select(again, next.instance, hit.instance);
        hit.u = f_select(again, next.u, hit.u);
        hit.v = f_select(again, next.v, hit.v);
        hit.p = v3_select(again, next.p, hit.p);
    }
    return hit;
}

// Counting sort of `count` entries by key + base, in [0, bins): fills `order`, and where each bin begins.
static void counting_sort(const int32_t *key, int32_t base, int32_t count, int32_t bins, int32_t *order, int32_t *begin) {
    memset(begin, 0, (size_t)(bins + 1) * sizeof *begin);
    for (int32_t k = 0; k < count; k++) {
        begin[key[k] + base + 1]++;
    }
    for (int32_t g = 0; g < bins; g++) {
        begin[g + 1] += begin[g];
    }
    for (int32_t k = 0; k < count; k++) {
        order[begin[key[k] + base]++] = k;
    }
    memmove(begin + 1, begin, (size_t)bins * sizeof *begin);
    begin[0] = 0;
}

// What the rays of the paths k... meet.
KFN void hit_store(Tracer *t, int32_t k, const Hit *hit) {
    Workspace *ws = &t->ws;
    Mask found = mi_lt(i_set(-1), hit->shape);
    Int group = SHAPE_FIELD(t->scene, i_max(hit->shape, i_set(0)), group);
    i_store(ws->hit_shape + k, hit->shape);
    i_store(ws->hit_prim + k, hit->prim);
    i_store(ws->hit_instance + k, hit->instance);
    i_store(ws->hit_group + k, i_select(found, group + 1, i_set(0)));
    f_store(ws->hit_u + k, hit->u);
    f_store(ws->hit_v + k, hit->v);
    f_store(ws->hit_x + k, hit->p.x);
    f_store(ws->hit_y + k, hit->p.y);
    f_store(ws->hit_z + k, hit->p.z);
}

// Closest hits of rays that media may change along.
KFN Hit trace_media(const Tracer *t, const Ray *ray, Mask m, bool coherent) {
    Hit hit = trace_closest(t->scene, ray, m, coherent);
    return t->scene->has_media && t->scene->borders_touch ? hit_touching(t->scene, &hit, ray, m) : hit;
}

static void trace_stage(Tracer *t, int32_t bounce) {
    const Paths *p = &t->ws.paths[t->current];
    double start = stage_seconds();
    for (int32_t k = 0; k < t->active; k += LANES) {
        Mask m = m_first_n(t->active - k);
        Ray ray = path_ray(p, k);
        Hit hit = trace_media(t, &ray, m, bounce == 0);
        if (t->scene->hide_emitters && (bounce == 0 || t->scene->through)) {
            Mask seen = t->scene->through ? m & mi_eq(i_load(p->depth + k), i_set(0)) : m;
            Mask found = seen & mi_lt(i_set(-1), hit.shape);
            Mask lights = found & mi_lt(i_set(-1), SHAPE_FIELD(t->scene, i_max(hit.shape, i_set(0)), emitter));
            bool in_fog = t->scene->has_media && m_any(lights & mi_lt(i_set(-1), i_load(p->medium + k)));
            t->job->faces |= in_fog ? LIGHT_HIDDEN : 0;
            hit = trace_past_emitters(t, ray, seen, hit);
        }
        hit_store(t, k, &hit);
    }
    t->job->rays += t->active;
    t->job->trace_seconds += stage_seconds() - start;
}
