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

KFN Vec3 table_v3(const SceneView *scene, Int at) {
    return v3(table_at(scene, at), table_at(scene, at + 1), table_at(scene, at + 2));
}

// Position in [0, n) of u in n cumulative values starting at `at` (per lane), and the fraction inside the cell.
KFN Int cdf_search(const SceneView *scene, Int at, int32_t n, Float u, Float *fraction, Float *mass) {
    Int low = i_set(0), high = i_set(n - 1);
    for (int32_t left = n; left > 1; left = (left + 1) / 2) {
        Int middle = (low + high) >> 1;
        Mask right = m_le(table_at(scene, at + middle), u) & mi_lt(low, high);
        low = i_select(right, middle + 1, low);
        high = i_select(right, high, i_max(middle, low));
    }
    Float before = f_select(mi_lt(i_set(0), low), table_at(scene, at + i_max(low - 1, i_set(0))), f_set(0));
    *mass = table_at(scene, at + low) - before;
    *fraction = f_clamp((u - before) * f_safe_rcp(*mass), f_set(0), f_set(0.99999994f));
    return low;
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
    Float before = f_select(mi_lt(i_set(0), low), table_at(scene, at + i_max(low - 1, i_set(0))), f_set(0));
    Float mass = table_at(scene, at + low) - before;
    *fraction = f_clamp((u - before) * f_safe_rcp(mass), f_set(0), f_set(0.99999994f));
    return low;
}
