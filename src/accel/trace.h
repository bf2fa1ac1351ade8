// trace.h: ray packets of the kernel's own width through Embree. Dead lanes carry a harmless ray, because Embree
// asserts on non-finite input, and non-finite rays are dropped before they get there.
#pragma once

#include "accel/spheres.h"
#include "accel/triangles.h"
#include "accel/tubes.h"

#include <embree3/rtcore.h>

#if LANES == 16
typedef struct RTCRayHit16 RayHitPacket;
typedef struct RTCRay16 RayPacket;
#elif LANES == 8
typedef struct RTCRayHit8 RayHitPacket;
typedef struct RTCRay8 RayPacket;
#else
typedef struct RTCRayHit RayHitPacket;
typedef struct RTCRay RayPacket;
#endif

#if LANES == 1
#define PACKET_F(field) (&(field))
#define PACKET_I(field) ((int32_t *)&(field))
#else
#define PACKET_F(field) (field)
#define PACKET_I(field) ((int32_t *)(field))
#endif

// Fills the packet and returns the lanes that may be traced.
KFN Mask packet_set(RayPacket *packet, const Ray *ray, Mask m) {
    m = m & m_finite(ray->o.x + ray->o.y + ray->o.z) & m_finite(ray->d.x + ray->d.y + ray->d.z) &
        m_gt(ray->tmax, f_set(0));
    f_store(PACKET_F(packet->org_x), f_zero_unless(m, ray->o.x));
    f_store(PACKET_F(packet->org_y), f_zero_unless(m, ray->o.y));
    f_store(PACKET_F(packet->org_z), f_zero_unless(m, ray->o.z));
    f_store(PACKET_F(packet->dir_x), f_zero_unless(m, ray->d.x));
    f_store(PACKET_F(packet->dir_y), f_zero_unless(m, ray->d.y));
    f_store(PACKET_F(packet->dir_z), f_select(m, ray->d.z, f_set(1)));
    f_store(PACKET_F(packet->tnear), f_set(0));
    f_store(PACKET_F(packet->tfar), f_select(m, ray->tmax, f_set(-1)));
    f_store(PACKET_F(packet->time), f_set(0));
    i_store(PACKET_I(packet->mask), i_set(-1));
    i_store(PACKET_I(packet->id), i_set(0));
    i_store(PACKET_I(packet->flags), i_set(0));
    return m;
}

#define HIT_NONE (Hit){i_set(-1), i_set(0), f_set(0), f_set(0), v3_zero(), i_set(0)}

// Where the rays of m meet what Embree knows; `otherwise`: what they meet otherwise, at ray->tmax.
KFN Hit packet_closest(const SceneView *scene, const Ray *ray, const Hit *otherwise, Mask m, struct RTCIntersectContext *context) {
    RayHitPacket ALIGNED(64) packet;
    m = packet_set(&packet.ray, ray, m);
    i_store(PACKET_I(packet.ray.id), i_iota());
    i_store(PACKET_I(packet.hit.geomID), i_set(-1));
    i_store(PACKET_I(packet.hit.instID[0]), i_set(-1));
#if LANES == 1
    if (m) {
        rtcIntersect1(scene->embree, context, &packet);
    }
#else
    int32_t ALIGNED(64) valid[LANES];
    i_store(valid, m);
#if LANES == 16
    rtcIntersect16(valid, scene->embree, context, &packet);
#else
    rtcIntersect8(valid, scene->embree, context, &packet);
#endif
#endif
    Hit hit = *otherwise;
    Int shape = i_select(m, i_load(PACKET_I(packet.hit.geomID)), i_set(-1));
    Mask found = mi_lt(i_set(-1), shape);
    hit.shape = i_select(found, shape, hit.shape);
    hit.prim = i_select(found, i_load(PACKET_I(packet.hit.primID)), hit.prim);
    hit.u = f_select(found, f_load(PACKET_F(packet.hit.u)), hit.u);
    hit.v = f_select(found, f_load(PACKET_F(packet.hit.v)), hit.v);
    if (scene->instances_count) {
        // Instances are numbered behind the shapes.
        Int number = i_load(PACKET_I(packet.hit.instID[0]));
        Mask inside = found & mi_lt(i_set(-1), number);
        hit.instance = i_select(found, i_select(inside, number - (int32_t)scene->shapes_count, i_set(0)), hit.instance);
    }
    Mask any = mi_lt(i_set(-1), hit.shape);
    hit.p = v3_madd(ray->o, f_zero_unless(any, f_select(m, f_load(PACKET_F(packet.ray.tfar)), ray->tmax)), ray->d);
    if (scene->segments_count) {
        tubes_refine(scene, ray, &hit, m);
    }
    return hit;
}

// Closest hits on surfaces of these kinds (MEET_); on solid ones only, where Embree knows no others (open_apart).
KFN Hit trace_kinds(const SceneView *scene, const Ray *ray, int which, Mask m, bool coherent) {
    struct RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    context.flags = coherent ? RTC_INTERSECT_CONTEXT_FLAG_COHERENT : RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT;
    Ray range = *ray;
    Hit hit = HIT_NONE;
    if (scene->own_spheres_count) {
        range.tmax = spheres_meet(scene, ray, which, m, &hit.shape);
    }
    if (scene->open_triangles_count && (which & MEET_OPEN)) {
        triangles_meet(scene, ray, NULL, m, &range.tmax, &hit);
    }
    return packet_closest(scene, &range, &hit, m, &context);
}

// Closest hits. Lanes without one have shape -1.
KFN Hit trace_closest(const SceneView *scene, const Ray *ray, Mask m, bool coherent) {
    return trace_kinds(scene, ray, MEET_ALL, m, coherent);
}

// Closest hits on surfaces that let light pass, where Embree does not know them (open_apart).
static NOINLINE Hit trace_open(const SceneView *scene, const Ray *ray, Mask m) {
    Hit hit = HIT_NONE;
    Float t = spheres_meet(scene, ray, MEET_OPEN, m, &hit.shape);
    triangles_meet(scene, ray, NULL, m, &t, &hit);
    hit.p = v3_madd(ray->o, f_zero_unless(mi_lt(i_set(-1), hit.shape), t), ray->d);
    return hit;
}

// The surfaces that rays leave aside, lane by lane.
typedef struct Aside {
    struct RTCIntersectContext context; // the first, so that Embree's callback finds the rest
    int32_t ALIGNED(64) shape[LANES];
    int32_t ALIGNED(64) prim[LANES];    // -1: all of the shape's
    int32_t ALIGNED(64) instance[LANES];
} Aside;

static void aside_filter(const struct RTCFilterFunctionNArguments *a) {
    enum { RAY_ID = 10, HIT_PRIM = 5, HIT_SHAPE = 6, HIT_INSTANCE = 7 }; // rows of Embree's packets
    const Aside *aside = (const Aside *)a->context;
    const int32_t *rays = (const int32_t *)a->ray, *hits = (const int32_t *)a->hit;
    const unsigned n = a->N;
    for (unsigned i = 0; i < n; i++) {
        if (a->valid[i]) {
            int32_t lane = rays[RAY_ID * n + i];
            bool own = hits[HIT_SHAPE * n + i] == aside->shape[lane] && hits[HIT_INSTANCE * n + i] == aside->instance[lane];
            bool prim = aside->prim[lane] < 0 || hits[HIT_PRIM * n + i] == aside->prim[lane];
            a->valid[i] = own && prim ? 0 : a->valid[i];
        }
    }
}

// Closest hits on anything but the primitives of `hit`, or, where its prim is -1, its shapes.
static NOINLINE Hit trace_others(const SceneView *scene, const Hit *hit, Ray ray, Mask m) {
    Aside aside;
    rtcInitIntersectContext(&aside.context);
    aside.context.flags = RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT;
    aside.context.filter = aside_filter;
    Mask inside = mi_lt(i_set(0), SHAPE_FIELD(scene, i_max(hit->shape, i_set(0)), flags) & SHAPE_INSTANCED);
    i_store(aside.shape, hit->shape);
    i_store(aside.prim, hit->prim);
    i_store(aside.instance, i_select(inside, hit->instance + (int32_t)scene->shapes_count, i_set(-1)));
    Hit other = HIT_NONE;
    if (scene->open_triangles_count) {
        triangles_meet(scene, &ray, hit, m, &ray.tmax, &other);
    }
    return packet_closest(scene, &ray, &other, m, &aside.context);
}

// What other shapes have at the point of a hit, on the way of rays that step over it: up to `step` before it, and `behind` after.
KFN Hit trace_beside(const SceneView *scene, const Hit *hit, Vec3 d, Float step, Float behind, Mask m) {
    Hit all = *hit;
    all.prim = i_set(-1);
    return trace_others(scene, &all, (Ray){v3_madd(hit->p, -step, d), d, step + f_min(behind, step)}, m);
}

// Lanes of m in whose way nothing is that Embree knows.
KFN Mask packet_clear(const SceneView *scene, const Ray *ray, Mask m) {
    RayPacket ALIGNED(64) packet;
    m = packet_set(&packet, ray, m);
    struct RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    context.flags = RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT;
#if LANES == 1
    if (m) {
        rtcOccluded1(scene->embree, &context, &packet);
    }
#else
    int32_t ALIGNED(64) valid[LANES];
    i_store(valid, m);
#if LANES == 16
    rtcOccluded16(valid, scene->embree, &context, &packet);
#else
    rtcOccluded8(valid, scene->embree, &context, &packet);
#endif
#endif
    // Embree sets tfar to -infinity where it found something.
    return m & m_ge(f_load(PACKET_F(packet.tfar)), f_set(0));
}

// Lanes of m in whose way there is no surface that lets no light pass, where Embree knows only those (open_apart).
static NOINLINE Mask trace_clear(const SceneView *scene, const Ray *ray, Mask m) {
    m = scene->own_spheres_count ? m & ~spheres_block(scene, ray, MEET_SOLID, m) : m;
    return packet_clear(scene, ray, m);
}

// Transmittance along shadow rays: 1 where nothing is in the way, 0 behind a surface. A colour and not a bit, because
// media will attenuate segment by segment.
KFN Spec trace_transmittance(const SceneView *scene, const Ray *ray, Mask m) {
    if (scene->own_spheres_count) {
        m = m & ~spheres_block(scene, ray, MEET_ALL, m);
    }
    if (scene->open_triangles_count) {
        m = m & ~triangles_block(scene, ray, m);
    }
    return spec_set(f_zero_unless(packet_clear(scene, ray, m), f_set(1)));
}
