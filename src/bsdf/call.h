// call.h: how adapters (functions made of other functions) call their children; defined in bsdf.h.
#pragma once

#include "bsdf/record.h"

// The parameterisation of the surface in the shading frame: dp_du = (ux, 0, .), dp_dv = (vx, vy, .), and the geometric
// normal. Only there where a function asks for it (BsdfNode.surface).
typedef struct BsdfSurface {
    Float ux, vx, vy;
    Vec3 ng;
} BsdfSurface;

typedef struct BsdfCall {
    const SceneView *scene;
    int32_t node;
    TexCoord uv;
    real floor; // see KIND_RECORD
    const BsdfSurface *surface;
    BsdfSurface *dsurface; // its adjoint, null = not asked for
    real rim;              // see KIND_RECORD
} BsdfCall;

KFN BsdfCall bsdf_call(const SceneView *scene, int32_t node, TexCoord uv, real floor) {
    return (BsdfCall){.scene = scene, .node = node, .uv = uv, .floor = floor};
}

static NOINLINE Spec bsdf_eval(const BsdfCall *call, Vec3 wi, Vec3 wo, Int lobe);
static NOINLINE Float bsdf_pdf(const BsdfCall *call, Vec3 wi, Vec3 wo, Int lobe);
static NOINLINE BsdfSample bsdf_sample(const BsdfCall *call, Vec3 wi, Float u1, Vec2 u2);
// Accumulates the adjoint df of bsdf_eval into the sink (lanes of m), dwi, dwo and duv (null: not asked for).
// The direction of a delta lobe is a function of wi and of the parameters: of such lanes, *dwo holds its adjoint on entry.
static NOINLINE void bsdf_adj(const BsdfCall *call, Vec3 wi, Vec3 wo, Int lobe, Spec df, Sink *sink, Mask m, Vec3 *dwi,
                              Vec3 *dwo, Vec2 *duv);

// Accumulates the adjoint dpdf of bsdf_pdf in the smooth lobe, whose floor is 0, in the same way.
static NOINLINE void bsdf_pdf_adj(const BsdfCall *call, Vec3 wi, Vec3 wo, Float dpdf, Sink *sink, Mask m, Vec3 *dwi,
                                  Vec3 *dwo, Vec2 *duv);

// Where the clamp of a share to [0, 1] lets derivatives through. Interpolation of equal texels rounds, and must not take
// a share of 0 or 1 out of its range.
KFN Mask share_inside(Float share) { return m_ge(share, f_set(-1e-5f)) & m_le(share, f_set(1 + 1e-5f)); }

// The same call as pictures make it.
KFN BsdfCall bsdf_picture(const BsdfCall *call) {
    BsdfCall c = *call;
    c.floor = c.rim = 0;
    return c;
}

KFN BsdfCall bsdf_child(const BsdfCall *call, int child) {
    BsdfCall c = *call;
    c.node = call->scene->bsdfs[call->node].child[child];
    return c;
}
