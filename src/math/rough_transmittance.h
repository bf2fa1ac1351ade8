// rough_transmittance.h: how much light passes a rough dielectric interface, tabulated for the diffuse base under a
// rough coat. Host side, in double. Everything comes with its derivatives with respect to roughness and index.
#pragma once

#include <stdbool.h>

enum { ROUGH_TRANSMITTANCE_NODES = 64 };

// A number with its derivatives.
typedef struct RoughValue {
    double value, by_alpha, by_eta;
} RoughValue;

// Averages over the microfacet normals m visible from the direction wi of cosine mu (at least 1e-6), GGX or Beckmann:
// transmittance <(1 - F) G1(refracted)> and reflectance <F G1(reflected)>, with F the Fresnel reflectance at wi . m of
// an interface whose far side has the relative index eta; directions that leave on the wrong side count 0.
// alpha > 0, eta > 0.
RoughValue rey_rough_transmittance_at(bool ggx, double alpha, double eta, double mu);
RoughValue rey_rough_reflectance_at(bool ggx, double alpha, double eta, double mu);

// The table of a coat of index eta: T[i] the transmittance for light from outside at mu = i / 63, and *internal the
// reflectance of diffuse light from inside, 2 / 64 times the sum over the nodes of reflectance(mu; 1 / eta) mu.
// Each with its derivatives. Takes milliseconds; thread-safe.
void rey_rough_transmittance(bool ggx, double alpha, double eta, float T[ROUGH_TRANSMITTANCE_NODES],
                             float dT_dalpha[ROUGH_TRANSMITTANCE_NODES], float dT_deta[ROUGH_TRANSMITTANCE_NODES],
                             double *internal, double *dint_dalpha, double *dint_deta);
