// rough_transmittance.c: averages over visible microfacet normals by Gauss-Legendre quadrature in the stretched slopes.
//
// In the space where the roughness is 1, normals are (-alpha p, -alpha q, r) up to length, with wi = (s, 0, c):
//   Beckmann  (p, q, r) = (X, Y, 1), density of (X, Y) exp(-X^2 - Y^2) (c' - s' X) / (pi area)
//   GGX       (p, q, r) = (sin f cos t, sin t, cos f cos t), density of (f, t) (2 / pi) cos(f + theta') cos^2 t / area
// where (s', c') = (sin theta', cos theta') is wi stretched, and area the projected area [heitz2014 eq. 66, 72]. Both are
// products of an outer and an inner weight, smooth in bounded domains. Where the far side is thinner (eta < 1), F has a
// root singularity at the critical angle: the domain is split there, and a quadratic map takes the root away. All nodes
// and weights carry their derivatives with respect to alpha and eta (dual numbers), so that the derivative is that of
// the quadrature itself.
#include "math/rough_transmittance.h"

#include <math.h>

#define PI_D 3.14159265358979323846

enum { RULE = 16 };             // nodes per panel
static const double beckmann_end = 4.2; // slopes beyond have a weight below 3e-9

// ---- dual numbers ------------------------------------------------------------------------------------------------

typedef RoughValue Dual;

static inline Dual constant(double x) { return (Dual){x, 0, 0}; }
static inline Dual chain(Dual x, double value, double slope) {
    return (Dual){value, slope * x.by_alpha, slope * x.by_eta};
}
static inline Dual add(Dual a, Dual b) { return (Dual){a.value + b.value, a.by_alpha + b.by_alpha, a.by_eta + b.by_eta}; }
static inline Dual sub(Dual a, Dual b) { return (Dual){a.value - b.value, a.by_alpha - b.by_alpha, a.by_eta - b.by_eta}; }
static inline Dual scale(Dual a, double s) { return chain(a, a.value * s, s); }
static inline Dual mul(Dual a, Dual b) {
    return (Dual){a.value * b.value, a.by_alpha * b.value + a.value * b.by_alpha, a.by_eta * b.value + a.value * b.by_eta};
}
static inline Dual square(Dual a) { return chain(a, a.value * a.value, 2 * a.value); }
static inline Dual divide(Dual a, Dual b) {
    double r = 1 / b.value, q = a.value * r;
    return (Dual){q, (a.by_alpha - q * b.by_alpha) * r, (a.by_eta - q * b.by_eta) * r};
}
static inline Dual root(Dual a) {
    double r = sqrt(a.value > 0 ? a.value : 0);
    return chain(a, r, r > 0 ? 0.5 / r : 0);
}
static Dual sine(Dual a) { return chain(a, sin(a.value), cos(a.value)); }
static Dual cosine(Dual a) { return chain(a, cos(a.value), -sin(a.value)); }
static Dual clamp(Dual a, Dual low, Dual high) { return a.value < low.value ? low : a.value > high.value ? high : a; }

// ---- the average -------------------------------------------------------------------------------------------------

typedef struct Coat {
    bool ggx, transmit;
    Dual alpha, eta; // eta: far side over near side
    double c, s;     // of wi
    Dual angle;      // theta' of wi stretched
    double node[RULE], weight[RULE]; // Gauss-Legendre on [0, 1]
} Coat;

// Nodes by Newton's method on the Legendre polynomial from the usual first guess.
static void gauss_legendre(double *node, double *weight) {
    for (int i = 0; i < RULE; i++) {
        double x = cos(PI_D * (i + 0.75) / (RULE + 0.5)), slope = 1;
        for (int step = 0; step < 6; step++) {
            double p0 = 1, p1 = x;
            for (int k = 2; k <= RULE; k++) {
                double p2 = ((2 * k - 1) * x * p1 - (k - 1) * p0) / k;
                p0 = p1;
                p1 = p2;
            }
            slope = RULE * (x * p1 - p0) / (x * x - 1);
            x -= p1 / slope;
        }
        node[i] = 0.5 * (1 - x);
        weight[i] = 1 / ((1 - x * x) * slope * slope);
    }
}

// Smith's masking of a direction of cosine z > 0, as in microfacet.h.
static inline Dual masking(const Coat *coat, Dual z) {
    Dual z2 = square(z), s2 = mul(square(coat->alpha), sub(constant(1), z2));
    if (coat->ggx) {
        return divide(scale(z, 2), add(z, root(add(s2, z2))));
    }
    Dual t = root(s2);
    if (z.value >= 1.6 * t.value) {
        return constant(1);
    }
    Dual tz = mul(t, z);
    return divide(add(scale(tz, 3.535), scale(z2, 2.181)), add(add(s2, scale(tz, 2.276)), scale(z2, 2.577)));
}

// (1 - F) G1(refracted) or F G1(reflected) for one normal; total: in total internal reflection.
static inline Dual contribution(const Coat *coat, Dual p, Dual q, Dual r, bool total) {
    if (total && coat->transmit) {
        return constant(0);
    }
    Dual length = root(add(mul(square(coat->alpha), add(square(p), square(q))), square(r)));
    Dual x = divide(sub(scale(r, coat->c), scale(mul(coat->alpha, p), coat->s)), length); // wi . m
    Dual mz = divide(r, length);
    Dual f = constant(1), ct = constant(0); // ct: |cos| of the refracted direction times eta
    if (!total) {
        Dual e2 = square(coat->eta);
        ct = root(add(sub(e2, constant(1)), square(x)));
        Dual rs = divide(sub(x, ct), add(x, ct));
        Dual ex = mul(e2, x), rp = divide(sub(ct, ex), add(ct, ex));
        f = scale(add(square(rs), square(rp)), 0.5);
    }
    if (coat->transmit) {
        // wo = m (x / eta - ct) - wi / eta
        Dual z = divide(add(mul(mz, sub(ct, x)), constant(coat->c)), coat->eta);
        return z.value > 0 ? mul(sub(constant(1), f), masking(coat, z)) : constant(0);
    }
    Dual z = sub(scale(mul(x, mz), 2), constant(coat->c));
    return z.value > 0 ? mul(f, masking(coat, z)) : constant(0);
}

// One panel of the inner integral: t from low to high; edge: the critical angle lies at high.
static Dual inner_panel(const Coat *coat, Dual outer, Dual low, Dual high, bool edge, bool total) {
    Dual sum = constant(0), width = sub(high, low);
    Dual sin_f = constant(0), cos_f = constant(0);
    if (coat->ggx) {
        sin_f = sine(outer);
        cos_f = cosine(outer);
    }
    for (int i = 0; i < RULE; i++) {
        double v = coat->node[i], w = coat->weight[i];
        if (edge) { // t = high - width v^2
            w *= 2 * v;
            v = 1 - v * v;
        }
        Dual t = add(low, scale(width, v)), density, f;
        if (coat->ggx) {
            Dual sin_t = sine(t), cos_t = cosine(t);
            density = square(cos_t);
            f = contribution(coat, mul(sin_f, cos_t), sin_t, mul(cos_f, cos_t), total);
        } else {
            double e = exp(-t.value * t.value);
            density = chain(t, e, -2 * t.value * e);
            f = contribution(coat, outer, t, constant(1), total);
        }
        sum = add(sum, scale(mul(density, f), w));
    }
    return mul(sum, width);
}

// t where (q / r at t = 0's r)^2 is y2: tan t or Y; at most the end of the domain.
static Dual inner_coordinate(const Coat *coat, Dual y2, Dual end) {
    if (y2.value <= 0) {
        return constant(0);
    }
    Dual y = root(y2);
    Dual t = coat->ggx ? chain(y, atan(y.value), 1 / (1 + y.value * y.value)) : y;
    return t.value < end.value ? t : end;
}

// The inner integral over t > 0, at an outer coordinate at which the normal of t = 0 is beyond the critical angle (total)
// or not. With y = tan t or Y, and, at t = 0, g = c r - alpha s p and a2 = alpha^2 p^2 + r^2:
// wi . m = g / length, length^2 = a2 + alpha^2 y^2, which falls with y.
static Dual inner(const Coat *coat, Dual outer, bool total) {
    Dual end = constant(coat->ggx ? 0.5 * PI_D : beckmann_end), zero = constant(0);
    Dual p = coat->ggx ? sine(outer) : outer, r = coat->ggx ? cosine(outer) : constant(1);
    Dual ap = mul(coat->alpha, p), alpha2 = square(coat->alpha);
    Dual g = sub(scale(r, coat->c), scale(ap, coat->s)), a2 = add(square(ap), square(r));
    if (!coat->transmit) {
        // the mirror direction has height 2 (wi . m) m.z - c: positive where 2 g r > c length^2
        Dual y2 = divide(sub(scale(mul(g, r), 2 / coat->c), a2), alpha2);
        end = inner_coordinate(coat, y2, end);
    }
    if (total || coat->eta.value >= 1) {
        return inner_panel(coat, outer, zero, end, false, total);
    }
    // critical where wi . m = kappa = sqrt(1 - eta^2), g^2 = kappa^2 length^2
    Dual kappa2 = sub(constant(1), square(coat->eta));
    Dual edge = inner_coordinate(coat, divide(sub(square(g), mul(kappa2, a2)), mul(kappa2, alpha2)), end);
    Dual through = inner_panel(coat, outer, zero, edge, true, false);
    if (edge.value >= end.value) {
        return through;
    }
    return add(through, inner_panel(coat, outer, edge, end, false, true));
}

// One panel of the outer integral.
static Dual outer_panel(const Coat *coat, Dual low, Dual high, bool total) {
    Dual sum = constant(0), width = sub(high, low);
    Dual c = cosine(coat->angle), s = sine(coat->angle);
    for (int i = 0; i < RULE; i++) {
        Dual o = add(low, scale(width, coat->node[i])), density;
        if (coat->ggx) {
            density = scale(cosine(add(o, coat->angle)), 2 / PI_D);
        } else {
            double e = exp(-o.value * o.value) * 2 / PI_D; // the inner integral runs over one half
            density = mul(chain(o, e, -2 * o.value * e), sub(c, mul(s, o)));
        }
        sum = add(sum, scale(mul(density, inner(coat, o, total)), coat->weight[i]));
    }
    return mul(sum, width);
}

// The outer coordinate, clamped to the domain, of the normal in the plane of incidence that is turned by beta from +z,
// away from wi if negative.
static Dual outer_coordinate(const Coat *coat, Dual beta, Dual low, Dual high) {
    if (fabs(beta.value) > 0.5 * PI_D - 1e-9) {
        return beta.value < 0 ? low : high;
    }
    Dual slope = divide(divide(sine(beta), cosine(beta)), coat->alpha);
    return clamp(coat->ggx ? chain(slope, atan(slope.value), 1 / (1 + slope.value * slope.value)) : slope, low, high);
}

// The outer integral, in panels between the places where the integrand is not smooth. In the plane of incidence
// wi . m = cos(beta + theta).
static Dual outer(const Coat *coat, Dual low, Dual high) {
    double theta = atan2(coat->s, coat->c);
    if (!coat->transmit) {
        // mirror directions above the horizon: |2 beta + theta| < pi / 2
        Dual from = outer_coordinate(coat, constant(-0.5 * (0.5 * PI_D + theta)), low, high);
        high = outer_coordinate(coat, constant(0.5 * (0.5 * PI_D - theta)), low, high);
        low = from;
    }
    Dual first = low, last = high;
    if (coat->eta.value < 1) {
        double kappa = sqrt(1 - coat->eta.value * coat->eta.value);
        Dual critical = chain(coat->eta, acos(kappa), 1 / kappa);
        first = outer_coordinate(coat, sub(scale(critical, -1), constant(theta)), low, high);
        last = outer_coordinate(coat, sub(critical, constant(theta)), low, high);
    }
    // the long tail of GGX, where the normal itself turns
    Dual tail = coat->ggx && coat->alpha.value < 0.25 ? outer_coordinate(coat, constant(-0.4), low, high) : low;
    Dual ends[5] = {low, tail, first, last, high};
    if (tail.value > first.value) {
        ends[1] = first;
        ends[2] = tail.value < last.value ? tail : last;
        ends[3] = tail.value < last.value ? last : tail;
    }
    Dual sum = constant(0);
    for (int i = 0; i < 4; i++) {
        if (ends[i + 1].value > ends[i].value) {
            double middle = 0.5 * (ends[i].value + ends[i + 1].value);
            bool total = middle < first.value || middle > last.value;
            sum = add(sum, outer_panel(coat, ends[i], ends[i + 1], total));
        }
    }
    return sum;
}

static Dual average(Coat *coat, double mu) {
    coat->c = fmin(fmax(mu, 1e-6), 1);
    coat->s = sqrt((1 - coat->c) * (1 + coat->c));
    Dual tangent = scale(coat->alpha, coat->s / coat->c);
    coat->angle = chain(tangent, atan(tangent.value), 1 / (1 + tangent.value * tangent.value));
    Dual c = cosine(coat->angle), s = sine(coat->angle);
    if (coat->ggx) {
        Dual area = scale(add(constant(1), c), 0.5);
        return divide(outer(coat, constant(-0.5 * PI_D), sub(constant(0.5 * PI_D), coat->angle)), area);
    }
    Dual end = constant(beckmann_end), a = s.value * beckmann_end < c.value ? end : divide(c, s);
    double e = exp(-a.value * a.value) / sqrt(PI_D);
    Dual tail = chain(a, e, -2 * a.value * e), erf_a = chain(a, erf(a.value), 2 * e);
    Dual area = scale(add(add(c, mul(c, erf_a)), mul(s, tail)), 0.5);
    return divide(outer(coat, scale(end, -1), a), area);
}

// ---- the table ---------------------------------------------------------------------------------------------------

static void coat_init(Coat *coat, bool ggx, bool transmit, double alpha, double eta) {
    coat->ggx = ggx;
    coat->transmit = transmit;
    coat->alpha = (Dual){alpha, 1, 0};
    coat->eta = (Dual){eta, 0, 1};
    gauss_legendre(coat->node, coat->weight);
}

RoughValue rey_rough_transmittance_at(bool ggx, double alpha, double eta, double mu) {
    Coat coat;
    coat_init(&coat, ggx, true, alpha, eta);
    return average(&coat, mu);
}

RoughValue rey_rough_reflectance_at(bool ggx, double alpha, double eta, double mu) {
    Coat coat;
    coat_init(&coat, ggx, false, alpha, eta);
    return average(&coat, mu);
}

void rey_rough_transmittance(bool ggx, double alpha, double eta, float T[ROUGH_TRANSMITTANCE_NODES],
                             float dT_dalpha[ROUGH_TRANSMITTANCE_NODES], float dT_deta[ROUGH_TRANSMITTANCE_NODES],
                             double *internal, double *dint_dalpha, double *dint_deta) {
    Coat outside, inside;
    coat_init(&outside, ggx, true, alpha, eta);
    coat_init(&inside, ggx, false, alpha, 1 / eta);
    Dual sum = constant(0);
    for (int i = 0; i < ROUGH_TRANSMITTANCE_NODES; i++) {
        double mu = (double)i / (ROUGH_TRANSMITTANCE_NODES - 1);
        Dual t = average(&outside, mu);
        T[i] = (float)t.value;
        dT_dalpha[i] = (float)t.by_alpha;
        dT_deta[i] = (float)t.by_eta;
        sum = add(sum, scale(average(&inside, mu), fmax(mu, 1e-6) * 2 / ROUGH_TRANSMITTANCE_NODES));
    }
    *internal = sum.value;
    *dint_dalpha = sum.by_alpha;
    *dint_deta = -sum.by_eta / (eta * eta);
}
