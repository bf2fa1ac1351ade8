// hit.h: what a ray found, and where textures are looked up on it.
#pragma once

#include "math/vec.h"
#include "scene/scene.h"

#include <stddef.h>

typedef struct Hit {
    Int shape;   // number of the shape, -1 = none
    Int prim;    // triangle within the shape
    Float u, v;  // barycentrics of the second and third vertex; analytic shapes: unused
    Vec3 p;      // analytic shapes: the point on the ray
    Int instance; // of shapes with SHAPE_INSTANCED, else 0
} Hit;

KFN Hit hit_select(Mask m, const Hit *a, const Hit *b) {
    return (Hit){i_select(m, a->shape, b->shape), i_select(m, a->prim, b->prim), f_select(m, a->u, b->u),
                 f_select(m, a->v, b->v), v3_select(m, a->p, b->p), i_select(m, a->instance, b->instance)};
}

// Texture coordinates and, on surfaces, the hit that they belong to: attributes of meshes are read there.
typedef struct TexCoord {
    Float x, y;
    const Hit *hit; // null where there is no surface
} TexCoord;

KFN TexCoord texcoord(Vec2 uv, const Hit *hit) { return (TexCoord){uv.x, uv.y, hit}; }

#define SHAPE_FIELD(scene, id, field)                                                                                  \
    i_gather_shared((const int32_t *)(scene)->shapes, (id) * (int32_t)(sizeof(ShapeRecord) / 4) +                      \
                                                          (int32_t)(offsetof(ShapeRecord, field) / 4))
#define GROUP_FIELD(scene, id, field)                                                                                  \
    i_gather_shared((const int32_t *)(scene)->groups, (id) * (int32_t)(sizeof(Group) / 4) +                            \
                                                          (int32_t)(offsetof(Group, field) / 4))
#define BSDF_FIELD(scene, id, field)                                                                                   \
    i_gather_shared((const int32_t *)(scene)->bsdfs, (id) * (int32_t)(sizeof(BsdfNode) / 4) +                          \
                                                         (int32_t)(offsetof(BsdfNode, field) / 4))

// A float among the numbers of shapes (the tests compile these headers with wider ones).
#ifdef REAL_DOUBLE
#define SHAPE_FLOAT(scene, id, field) ((Float)(scene)->shapes[id].field)
#else
#define SHAPE_FLOAT(scene, id, field)                                                                                  \
    f_gather((const float *)(scene)->shapes, (id) * (int32_t)(sizeof(ShapeRecord) / 4) +                               \
                                                 (int32_t)(offsetof(ShapeRecord, field) / 4))
#endif

KFN Float theta_at(const SceneView *scene, Int index) {
#ifdef REAL_DOUBLE
    return (Float)scene->theta[index];
#else
    return f_gather(scene->theta, index);
#endif
}

// Three numbers in a row.
KFN Vec3 numbers_v3(const float *numbers, Int at) {
    Float n[3];
    f_gather3(numbers, at, n);
    return v3(n[0], n[1], n[2]);
}

// The same where all lanes often read in one place.
KFN Vec3 numbers_v3_shared(const float *numbers, Int at) {
    if (i_uniform(at)) {
        const float *n = numbers + i_lane(at, 0);
        return v3(f_set(n[0]), f_set(n[1]), f_set(n[2]));
    }
    return numbers_v3(numbers, at);
}

KFN Vec3 theta_v3(const SceneView *scene, Int at) { return numbers_v3(scene->theta, at); }

// The three vertex numbers of a triangle, relative to the shape.
typedef struct Corners {
    Int i[3];
} Corners;

KFN Corners mesh_corners(const SceneView *scene, Int shape, Int prim) {
    Int at = (SHAPE_FIELD(scene, shape, triangle) + prim) * 3;
    Corners c;
    i_gather3(scene->triangles, at, c.i);
    return c;
}
