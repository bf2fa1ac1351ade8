// distribution.h: a piecewise constant density on a grid of the unit square, sampled row first, then column. Layout in
// `tables`: height cumulative row masses, then height x width cumulative masses within each row, all normalised to 1.
// Every cell has positive mass, because a derivative may be non-zero where the value is 0.
#pragma once

#include "scene/tables.h"

// Samples uv; density is per unit square.
KFN Vec2 grid_sample(const SceneView *scene, int32_t table, int32_t width, int32_t height, Vec2 u, Float *density) {
    Float fx, fy, row_mass, column_mass;
    Int row = cdf_search(scene, i_set(table), height, u.y, &fy, &row_mass);
    Int column = cdf_search(scene, row * width + (table + height), width, u.x, &fx, &column_mass);
    *density = row_mass * column_mass * ((real)width * (real)height);
    return (Vec2){(f_from_i(column) + fx) * (1.0f / (real)width), (f_from_i(row) + fy) * (1.0f / (real)height)};
}

KFN Float grid_pdf(const SceneView *scene, int32_t table, int32_t width, int32_t height, Vec2 uv) {
    Int row = i_max(i_min(i_from_f(uv.y * (real)height), i_set(height - 1)), i_set(0));
    Int column = i_max(i_min(i_from_f(uv.x * (real)width), i_set(width - 1)), i_set(0));
    Int at = row * width + column + (table + height);
    Float row_before = f_select(mi_lt(i_set(0), row), table_at(scene, i_max(row - 1, i_set(0)) + table), f_set(0));
    Float before = f_select(mi_lt(i_set(0), column), table_at(scene, i_max(at - 1, i_set(0))), f_set(0));
    return (table_at(scene, row + table) - row_before) * (table_at(scene, at) - before) *
           ((real)width * (real)height);
}
