// phase_record.h: the record of one phase function, generated from its parameter list. A phase function is the density
// of the direction wo towards the light at a point that the path reaches from wi, both away from the point and in the
// world; the angle of scattering is that between -wi and wo.
#pragma once

#include "scene/sink.h"
#include "scene/texture.h"

// Numbers over the cosine of the angle, of which a lookup reads two. In an adjoint: what goes to the left and the right
// one, and to all of them by their share of the integral.
typedef struct PhaseTable {
    const float *values;
    int32_t count;
    Int cell;
    Float left, right, all;
} PhaseTable;

// A symmetric matrix: xx, yy, zz, xy, xz, yz.
typedef struct PhaseMatrix {
    Float m[6];
} PhaseMatrix;

// As many as there are functions; whoever reads them also hands out their adjoints.
typedef struct PhaseWeights {
    const float *values;
    int32_t count, slot;
} PhaseWeights;

// A kind's parameters as rows P(type, field, default, low, high, description):
//   NUMBER   number, or a texture of numbers
//   TABLE    two or more numbers
//   MATRIX   six numbers, or a grid of them
//   WEIGHTS  a number for each of the functions that this one is made of
#define FIELD_NUMBER Float
#define FIELD_TABLE PhaseTable
#define FIELD_MATRIX PhaseMatrix
#define FIELD_WEIGHTS PhaseWeights
#define PHASE_FIELD(type, field, value, low, high, text) FIELD_##type field;
#define NO_PHASE_PARAMS(P)

// A record also knows its derived table, and the smallest share of sampling that everything has whose derivative may be
// non-zero: 0 for pictures.
#define PHASE_RECORD(Type, PARAMS)                                                                                     \
    typedef struct Type {                                                                                              \
        PARAMS(PHASE_FIELD) const float *table;                                                                        \
        real floor;                                                                                                    \
    } Type;

// Cosine of the angle of scattering; 1 is straight on.
KFN Float phase_cosine(Vec3 wi, Vec3 wo) { return -v3_dot(wi, wo); }

// Accumulates its adjoint.
KFN void phase_cosine_adj(Vec3 wi, Vec3 wo, Float d, Vec3 *dwi, Vec3 *dwo) {
    // cosine = -wi . wo
    *dwi = v3_madd(*dwi, -d, wo);
    *dwo = v3_madd(*dwo, -d, wi);
}

// The direction at an angle from -wi, turned around it by the share u of a circle.
KFN Vec3 phase_direction_at(Vec3 wi, Float cosine, Float sine, Float u) {
    Float sin_phi, cos_phi;
    Frame frame = frame_from_normal(v3_neg(wi));
    f_sincos(TWO_PI * u, &sin_phi, &cos_phi);
    return frame_to_world(&frame, v3(sine * cos_phi, sine * sin_phi, cosine));
}

KFN Vec3 phase_direction(Vec3 wi, Float cosine, Float u) {
    return phase_direction_at(wi, cosine, f_safe_sqrt(1.0f - cosine * cosine), u);
}
