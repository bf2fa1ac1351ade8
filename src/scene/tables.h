// tables.h: reading derived data, and searching cumulative distributions in it.
#pragma once

#include "scene/hit.h"

KFN Float table_at(const SceneView *scene, Int index) {
#ifdef REAL_DOUBLE
    return (Float)scene->tables[index];
#else
    return f_gather(scene->tables, index);
#endif
}

KFN Vec3 table_v3(const SceneView *scene, Int at) { return numbers_v3_shared(scene->tables, at); }

// The first of the cumulative values at `at` (per lane) that exceeds u, or `last`, which is less than n.
KFN Int cdf_first_above(const SceneView *scene, Int at, Int last, int32_t n, Float u) {
    Int low = i_set(0), high = last;
    for (int32_t left = n; left > 1; left = (left + 1) / 2) {
        Int middle = (low + high) >> 1;
        Mask right = m_le(table_at(scene, at + middle), u) & mi_lt(low, high);
        low = i_select(right, middle + 1, low);
        high = i_select(right, high, i_max(middle, low));
    }
    return low;
}

// Where in the cell u lies, and the mass of the cell.
KFN Float cdf_fraction(const SceneView *scene, Int at, Int cell, Float u, Float *mass) {
    Float before = f_select(mi_lt(i_set(0), cell), table_at(scene, at + i_max(cell - 1, i_set(0))), f_set(0));
    *mass = table_at(scene, at + cell) - before;
    return f_clamp((u - before) * f_safe_rcp(*mass), f_set(0), f_set(0.99999994f));
}

// Position in [0, n) of u in n cumulative values starting at `at` (per lane), and the fraction inside the cell.
KFN Int cdf_search(const SceneView *scene, Int at, int32_t n, Float u, Float *fraction, Float *mass) {
    Int cell = cdf_first_above(scene, at, i_set(n - 1), n, u);
    *fraction = cdf_fraction(scene, at, cell, u, mass);
    return cell;
}

// The same with as many values per lane as n says.
KFN Int cdf_search_many(const SceneView *scene, Int at, Int n, Float u, Float *fraction) {
    Int low = i_set(0), high = n - 1;
    for (Mask left = mi_lt(low, high); m_any(left); left = mi_lt(low, high)) {
        Int middle = (low + high) >> 1;
        Mask right = m_le(table_at(scene, at + middle), u) & left;
        low = i_select(right, middle + 1, low);
        high = i_select(right, high, i_max(middle, low));
    }
    Float mass;
    *fraction = cdf_fraction(scene, at, low, u, &mass);
    return low;
}
