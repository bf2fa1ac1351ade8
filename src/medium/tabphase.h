// tabphase.h: numbers at even steps of the cosine from -1 (back) to 1 (straight on), linear between them and normalised:
// p = v(cos) / (2 pi integral of v). The derived table holds the cumulative integrals of the cells, over their sum.
#pragma once

#include "math/warp.h"
#include "medium/phase_record.h"

#define TABPHASE_PARAMS(P) P(TABLE, values, 1, 0, INFINITY, "values over the cosine, from back to straight on; their scale is free")
PHASE_RECORD(TabPhase, TABPHASE_PARAMS)

// Integral of the values over the cosine.
KFN real tabphase_integral(const TabPhase *p) {
    int32_t n = p->values.count;
    real sum = (real)0.5 * ((real)p->values.values[0] + (real)p->values.values[n - 1]);
    for (int32_t i = 1; i < n - 1; i++) {
        sum += (real)p->values.values[i];
    }
    return sum * 2 / (real)(n - 1);
}

KFN Float tabphase_value(const TabPhase *p, Int i) {
#ifdef REAL_DOUBLE
    return (Float)p->values.values[i];
#else
    return f_gather(p->values.values, i);
#endif
}

// Share of the integral that lies in the first cells, up to cell i.
KFN Float tabphase_share(const TabPhase *p, Int i) {
#ifdef REAL_DOUBLE
    return (Float)p->table[i];
#else
    return f_gather(p->table, i);
#endif
}

// Cell of a cosine, and the place in it.
KFN Int tabphase_cell(const TabPhase *p, Float cosine, Float *fraction) {
    Float x = (f_clamp(cosine, f_set(-1), f_set(1)) + 1.0f) * ((real)0.5 * (real)(p->values.count - 1));
    Int cell = i_min(i_from_f(x), i_set(p->values.count - 2));
    *fraction = x - f_from_i(cell);
    return cell;
}

KFN Float tabphase_eval(const TabPhase *p, Vec3 wi, Vec3 wo) {
    Float fraction;
    Int cell = tabphase_cell(p, phase_cosine(wi, wo), &fraction);
    return f_lerp(tabphase_value(p, cell), tabphase_value(p, cell + 1), fraction) * (INV_TWO_PI / tabphase_integral(p));
}

// With a share for all directions: where the value is 0, its derivative is not.
KFN Float tabphase_pdf(const TabPhase *p, Vec3 wi, Vec3 wo) {
    return (1 - p->floor) * tabphase_eval(p, wi, wo) + p->floor * INV_FOUR_PI;
}

KFN Vec3 tabphase_sample(const TabPhase *p, Vec3 wi, Float u1, Vec2 u2) {
    int32_t cells = p->values.count - 1;
    Int low = i_set(0), high = i_set(cells - 1);
    // The first cell whose cumulative share lies above u.
    for (int32_t steps = 1; steps < cells; steps *= 2) {
        Int middle = (low + high) >> 1;
        Mask right = m_le(tabphase_share(p, middle), u2.x) & mi_lt(low, high);
        low = i_select(right, middle + 1, low);
        high = i_select(right, high, i_max(middle, low));
    }
    Float before = f_zero_unless(mi_lt(i_set(0), low), tabphase_share(p, i_max(low - 1, i_set(0))));
    Float u = f_clamp((u2.x - before) * f_safe_rcp(tabphase_share(p, low) - before), f_set(0), f_set(1));
    // Linear density from a to b: x = u (a + b) / (a + sqrt((1 - u) a^2 + u b^2))
    Float a = tabphase_value(p, low), b = tabphase_value(p, low + 1);
    Float x = u * (a + b) * f_safe_rcp(a + f_sqrt(f_lerp(a * a, b * b, u)));
    Float cosine = (f_from_i(low) + f_min(x, f_set(1))) * ((real)2 / (real)cells) - 1.0f;
    cosine = f_select(m_lt(u1, f_set(p->floor)), 2.0f * u2.x - 1.0f, cosine);
    return phase_direction(wi, cosine, u2.y);
}

KFN void tabphase_adj(const TabPhase *p, Vec3 wi, Vec3 wo, Float df, TabPhase *dp, Vec3 *dwi, Vec3 *dwo) {
    Float fraction, norm = f_set(INV_TWO_PI / tabphase_integral(p));
    Int cell = tabphase_cell(p, phase_cosine(wi, wo), &fraction);
    Float left = tabphase_value(p, cell), right = tabphase_value(p, cell + 1);
    // p = ((1 - x) left + x right) / (2 pi integral)
    dp->values.cell = cell;
    dp->values.left = dp->values.left + df * norm * (1.0f - fraction);
    dp->values.right = dp->values.right + df * norm * fraction;
    dp->values.all = dp->values.all - df * norm * f_lerp(left, right, fraction) / tabphase_integral(p);
    // x = (cos + 1) (n - 1) / 2 - cell
    phase_cosine_adj(wi, wo, df * norm * (right - left) * ((real)0.5 * (real)(p->values.count - 1)), dwi, dwo);
}
