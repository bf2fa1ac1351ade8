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

// Texture coordinates and, on surfaces, the hit that they belong to: attributes of meshes are read there.
typedef struct TexCoord {
    Float x, y;
    const Hit *hit; // null where there is no surface
} TexCoord;

KFN TexCoord texcoord(Vec2 uv, const Hit *hit) { return (TexCoord){uv.x, uv.y, hit}; }

#define SHAPE_FIELD(scene, id, field)                                                                                  \
    i_gather((const int32_t *)(scene)->shapes, (id) * (int32_t)(sizeof(ShapeRecord) / 4) +                             \
                                                   (int32_t)(offsetof(ShapeRecord, field) / 4))

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

// The three vertex numbers of a triangle, relative to the shape.
typedef struct Corners {
    Int i[3];
} Corners;

KFN Corners mesh_corners(const SceneView *scene, Int shape, Int prim) {
    Int at = (SHAPE_FIELD(scene, shape, triangle) + prim) * 3;
    Corners c;
    for (int k = 0; k < 3; k++) {
        c.i[k] = i_gather(scene->triangles, at + k);
    }
    return c;
}
