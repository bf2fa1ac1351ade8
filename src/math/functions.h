// functions.h: transcendental functions on Float, equal on every platform. In float: minimax polynomials after
// argument reduction (the coefficients are those of the Cephes library's single-precision routines); the error stated
// is the largest seen against libm over the stated range. In double the C library is called.
#pragma once

#include "math/lanes.h"

#ifdef REAL_DOUBLE
#define REAL_LITERAL(x) x
#else
#define REAL_LITERAL(x) x##f
#endif
#define PI REAL_LITERAL(3.14159265358979323846)
#define INV_PI REAL_LITERAL(0.31830988618379067154)
#define TWO_PI REAL_LITERAL(6.28318530717958647692)
#define INV_TWO_PI REAL_LITERAL(0.15915494309189533577)
#define TO_RADIANS REAL_LITERAL(0.017453292519943295)
#define INV_FOUR_PI REAL_LITERAL(0.07957747154594766788)
#define SQRT_PI REAL_LITERAL(1.77245385090551602729)

#ifdef REAL_DOUBLE

KFN Float f_exp(Float x) { return exp(x); }
KFN Float f_ldexp(Float x, Int n) { return ldexp(x, n); }
KFN Float f_log(Float x) { return log(x); }
KFN void f_sincos(Float x, Float *s, Float *c) {
    *s = sin(x);
    *c = cos(x);
}
KFN Float f_acos(Float x) { return acos(f_clamp(x, -1, 1)); }
KFN Float f_atan2(Float y, Float x) { return atan2(y, x); }
KFN Float f_erf(Float x) { return erf(x); }

#else

#if LANES == 1
KFN Float f_from_bits(Int bits) {
    Float x;
    memcpy(&x, &bits, sizeof x);
    return x;
}
KFN Int f_to_bits(Float x) {
    Int bits;
    memcpy(&bits, &x, sizeof bits);
    return bits;
}
#else
KFN Float f_from_bits(Int bits) { return (Float)bits; }
KFN Int f_to_bits(Float x) { return (Int)x; }
#endif

// x 2^n where 2^n is a normal number.
KFN Float f_ldexp(Float x, Int n) { return x * f_from_bits((n + 127) << 23); }

// e^x: 2 ulp for |x| < 87; 0 below, saturated near 2^127 above.
KFN Float f_exp(Float x) {
    Mask underflow = m_lt(x, f_set(-87.0f));
    x = f_clamp(x, f_set(-87.0f), f_set(88.0f));
    Float n = f_floor(x * 1.44269504088896341f + 0.5f);
    Float r = x - n * 0.693359375f + n * 2.12194440e-4f;
    Float p = r * 1.9875691500e-4f + 1.3981999507e-3f;
    p = p * r + 8.3334519073e-3f;
    p = p * r + 4.1665795894e-2f;
    p = p * r + 1.6666665459e-1f;
    p = p * r + 5.0000001201e-1f;
    p = p * r * r + r + 1.0f;
    return f_zero_unless(~underflow, f_ldexp(p, i_from_f(n)));
}

// ln x: 2 ulp for normal x > 0; about -87.3 for zero, denormal and negative x.
KFN Float f_log(Float x) {
    x = f_max(x, f_set(1.17549435e-38f));
    Int bits = f_to_bits(x);
    Float e = f_from_i((bits >> 23) - 126);
    Float m = f_from_bits((bits & 0x007fffff) | 0x3f000000); // in [0.5, 1)
    Mask low = m_lt(m, f_set(0.707106781186547524f));
    e = e - f_zero_unless(low, f_set(1));
    m = m + f_zero_unless(low, m) - 1.0f;
    Float p = m * 7.0376836292e-2f - 1.1514610310e-1f;
    p = p * m + 1.1676998740e-1f;
    p = p * m - 1.2420140846e-1f;
    p = p * m + 1.4249322787e-1f;
    p = p * m - 1.6668057665e-1f;
    p = p * m + 2.0000714765e-1f;
    p = p * m - 2.4999993993e-1f;
    p = p * m + 3.3333331174e-1f;
    Float z = m * m;
    Float y = m * z * p + e * -2.12194440e-4f - 0.5f * z;
    return m + y + e * 0.693359375f;
}

// sin x and cos x: absolute error 1e-7 for |x| < 8192.
KFN void f_sincos(Float x, Float *s, Float *c) {
    Float n = f_floor(x * (2.0f * INV_PI) + 0.5f);
    Int quadrant = i_from_f(n);
    Float r = x - n * 1.5703125f - n * 4.837512969970703e-4f - n * 7.549789948768648e-8f;
    Float z = r * r;
    Float sine = ((z * -1.9515295891e-4f + 8.3321608736e-3f) * z - 1.6666654611e-1f) * z * r + r;
    Float cosine = ((z * 2.443315711809948e-5f - 1.388731625493765e-3f) * z + 4.166664568298827e-2f) * z * z -
                   0.5f * z + 1.0f;
    Mask swap = mi_eq(quadrant & 1, i_set(1));
    Mask negative_sine = mi_eq(quadrant & 2, i_set(2));
    Mask negative_cosine = mi_eq((quadrant + 1) & 2, i_set(2));
    Float ss = f_select(swap, cosine, sine), cc = f_select(swap, sine, cosine);
    *s = f_select(negative_sine, -ss, ss);
    *c = f_select(negative_cosine, -cc, cc);
}

// atan2: absolute error 3e-7; 0 at the origin.
KFN Float f_atan2(Float y, Float x) {
    Float ay = f_abs(y), ax = f_abs(x);
    Float big = f_max(ax, ay), small = f_min(ax, ay);
    Float t = small / f_max(big, f_set(1e-37f));
    Mask reduce = m_gt(t, f_set(0.414213562373095f)); // tan(pi/8)
    Float u = f_select(reduce, (t - 1.0f) / (t + 1.0f), t);
    Float z = u * u;
    Float a = (((8.05374449538e-2f * z - 1.38776856032e-1f) * z + 1.99777106478e-1f) * z - 3.33329491539e-1f) * z * u + u;
    a = a + f_zero_unless(reduce, f_set(0.25f * PI));
    a = f_select(m_gt(ay, ax), 0.5f * PI - a, a);
    a = f_select(m_lt(x, f_set(0)), PI - a, a);
    return f_copysign(a, y);
}

// arc cosine of x clamped to [-1, 1]: absolute error 4e-7.
KFN Float f_acos(Float x) {
    x = f_clamp(x, f_set(-1), f_set(1));
    return f_atan2(f_sqrt((1.0f - x) * (1.0f + x)), x);
}

// erf x: absolute error 3e-7, relative error 5e-7.
KFN Float f_erf(Float x) {
    Float a = f_abs(x);
    // Series where it is exact to rounding, e^(-x^2) form elsewhere [abramowitz1972 eq. 7.1.26].
    Float z = x * x;
    Float series = x * (2.0f / SQRT_PI) *
                   (1.0f + z * (-1.0f / 3 + z * (1.0f / 10 + z * (-1.0f / 42 + z * (1.0f / 216 - z * (1.0f / 1320))))));
    Float t = 1.0f / (1.0f + 0.3275911f * a);
    Float p = ((((1.061405429f * t - 1.453152027f) * t + 1.421413741f) * t - 0.284496736f) * t + 0.254829592f) * t;
    Float tail = f_copysign(1.0f - p * f_exp(-z), x);
    return f_select(m_lt(a, f_set(0.6f)), series, tail);
}

#endif

KFN Float f_pow(Float x, Float y) { return f_exp(y * f_log(x)); }

// Inverse of erf for |x| < 1, by the polynomials of [giles2010 table 5]: relative error 4e-7 in float for
// |x| <= 1 - 2^-24; in double two more steps of Halley's method.
KFN Float f_erfinv(Float x) {
    x = f_clamp(x, f_set(-0.99999994f), f_set(0.99999994f));
    Float w = -f_log((1.0f - x) * (1.0f + x));
    Mask centre = m_lt(w, f_set(5.0f));
    Float v = w - 2.5f;
    Float p = v * 2.81022636e-08f + 3.43273939e-07f;
    p = p * v - 3.5233877e-06f;
    p = p * v - 4.39150654e-06f;
    p = p * v + 0.00021858087f;
    p = p * v - 0.00125372503f;
    p = p * v - 0.00417768164f;
    p = p * v + 0.246640727f;
    p = p * v + 1.50140941f;
    Float s = f_sqrt(f_max(w, f_set(5))) - 3.0f;
    Float q = s * -0.000200214257f + 0.000100950558f;
    q = q * s + 0.00134934322f;
    q = q * s - 0.00367342844f;
    q = q * s + 0.00573950773f;
    q = q * s - 0.0076224613f;
    q = q * s + 0.00943887047f;
    q = q * s + 1.00167406f;
    q = q * s + 2.83297682f;
    Float y = f_select(centre, p, q) * x;
#ifdef REAL_DOUBLE
    for (int i = 0; i < 2; i++) {
        Float step = (f_erf(y) - x) * (0.5 * SQRT_PI) * f_exp(y * y);
        y = y - step / (1.0 + y * step);
    }
#endif
    return y;
}
