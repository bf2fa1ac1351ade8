// distribution.h: a piecewise constant distribution on a grid of the unit square, sampled row first, then column. Layout in
// `tables`: height cumulative row masses; then per row those at the end of every GRID_BLOCK columns, few enough to stay in
// the cache; then height x width cumulative masses within each row. All are normalised to 1. Every cell has positive mass,
// because a derivative may be non-zero where the value is 0.
#pragma once

#include "scene/tables.h"

enum { GRID_BLOCK = 16 }; // columns: a cache line

static inline int32_t grid_blocks(int32_t width) { return (width + GRID_BLOCK - 1) / GRID_BLOCK; }
static inline int64_t grid_size(int32_t width, int32_t height) { return (int64_t)height * (1 + grid_blocks(width) + width); }
static inline float *grid_cells(float *grid, int32_t width, int32_t height) {
    return grid + (int64_t)height * (1 + grid_blocks(width));
}

// Host: the ends of the blocks, when the cumulative masses within the rows stand.
static inline void grid_finish(float *grid, int32_t width, int32_t height) {
    const float *cells = grid_cells(grid, width, height);
    const int32_t blocks = grid_blocks(width);
    for (int32_t y = 0; y < height; y++) {
        for (int32_t b = 0; b < blocks; b++) {
            int32_t last = b + 1 < blocks ? (b + 1) * GRID_BLOCK - 1 : width - 1;
            grid[height + y * blocks + b] = cells[(int64_t)y * width + last];
        }
    }
}

// The cell that u falls into, and where in it.
typedef struct GridCell {
    Int row, column;
    Float fx, fy;
} GridCell;

KFN GridCell grid_sample(const SceneView *scene, int32_t table, int32_t width, int32_t height, Vec2 u) {
    const int32_t blocks = grid_blocks(width);
    GridCell c;
    Float mass;
    c.row = cdf_search(scene, i_set(table), height, u.y, &c.fy, &mass);
    Int first = cdf_first_above(scene, c.row * blocks + (table + height), i_set(blocks - 1), blocks, u.x) * GRID_BLOCK;
    Int cells = c.row * width + (table + height * (1 + blocks));
    Int last = i_min(i_set(GRID_BLOCK - 1), width - 1 - first);
    c.column = first + cdf_first_above(scene, cells + first, last, GRID_BLOCK, u.x);
    c.fx = cdf_fraction(scene, cells, c.column, u.x, &mass);
    return c;
}
