// majorant_build.c: the largest extinction in each supervoxel, over all voxels that lookups inside it may read; and behind them
// the largest one of all.
#include "medium/majorant_build.h"

static int32_t supervoxels(int32_t voxels) { return voxels < MOST_SUPERVOXELS ? voxels : MOST_SUPERVOXELS; }

int32_t rey_medium_table_size(const VolumeNode *sigma_t, MediumNode *medium) {
    bool grid = sigma_t->kind == VOLUME_GRID;
    medium->nx = grid ? supervoxels(sigma_t->nx) : 1;
    medium->ny = grid ? supervoxels(sigma_t->ny) : 1;
    medium->nz = grid ? supervoxels(sigma_t->nz) : 1;
    return medium->nx * medium->ny * medium->nz + 1;
}

// Index of a voxel that may lie beyond the grid, as texture_wrap has it.
static int64_t wrapped(int64_t i, int64_t n, int32_t wrap) {
    if (wrap == WRAP_CLAMP) {
        return i < 0 ? 0 : i >= n ? n - 1 : i;
    }
    int64_t period = wrap == WRAP_MIRROR ? 2 * n : n;
    i = (i % period + period) % period;
    return i < n ? i : 2 * n - 1 - i;
}

// Voxels that a supervoxel's lookups read along one axis, one more than needed on each side of borders that coincide.
static void reach(int32_t cell, int32_t cells, int32_t voxels, int64_t *first, int64_t *last) {
    *first = (int64_t)floor((double)cell * voxels / cells - 0.5 - 1e-3);
    *last = (int64_t)floor((double)(cell + 1) * voxels / cells - 0.5 + 1e-3) + 1;
}

static float largest_in(const SceneView *view, const VolumeNode *v, const MediumNode *m, int32_t x, int32_t y, int32_t z) {
    int64_t x0, x1, y0, y1, z0, z1;
    float largest = 0;
    reach(x, m->nx, v->nx, &x0, &x1);
    reach(y, m->ny, v->ny, &y0, &y1);
    reach(z, m->nz, v->nz, &z0, &z1);
    for (int64_t k = z0; k <= z1; k++) {
        for (int64_t j = y0; j <= y1; j++) {
            int64_t row = (wrapped(k, v->nz, v->wrap) * v->ny + wrapped(j, v->ny, v->wrap)) * v->nx;
            for (int64_t i = x0; i <= x1; i++) {
                const float *voxel = view->theta + v->theta + (row + wrapped(i, v->nx, v->wrap)) * v->channels;
                for (int32_t c = 0; c < v->channels; c++) {
                    largest = voxel[c] > largest ? voxel[c] : largest;
                }
            }
        }
    }
    return largest;
}

// A bound of the area that flakes show to any direction, squared: no eigenvalue of a matrix exceeds the largest sum of a row's
// magnitudes (Gershgorin), and matrices between voxels have no larger ones than the voxels'.
static float largest_square(const SceneView *view, int32_t flakes) {
    static const int rows[3][3] = {{0, 3, 4}, {3, 1, 5}, {4, 5, 2}};
    const TextureNode *t = view->textures + flakes;
    const VolumeNode *v = t->kind == TEXTURE_VOLUME ? view->volumes + t->volume : NULL;
    int64_t count = v ? (int64_t)v->nx * v->ny * v->nz : 1;
    float largest = 0;
    for (int64_t i = 0; i < count; i++) {
        const float *s = view->theta + t->theta + 6 * i;
        for (int k = 0; k < 3; k++) {
            float sum = fabsf(s[rows[k][0]]) + fabsf(s[rows[k][1]]) + fabsf(s[rows[k][2]]);
            largest = sum > largest ? sum : largest;
        }
    }
    return largest;
}

bool rey_volume_goes_on(const SceneView *view, const VolumeNode *v) {
    for (int k = 0; k < 3 && v->to_world >= 0 && v->kind == VOLUME_GRID && v->wrap != WRAP_CLAMP; k++) {
        const float *row = view->theta + v->to_world + 4 * k;
        float sum = fabsf(row[0]) + fabsf(row[1]) + fabsf(row[2]), most = fmaxf(fmaxf(fabsf(row[0]), fabsf(row[1])), fabsf(row[2]));
        if (sum > most * 1.000001f) {
            return true;
        }
    }
    return false;
}

void rey_medium_update(const SceneView *view, const VolumeNode *v, const MediumNode *m, float room) {
    float scale = view->theta[m->scale] * 1.00001f * room;
    if (m->flakes >= 0) {
        scale *= sqrtf(largest_square(view, m->flakes));
    }
    float *all = view->tables + m->table + m->nx * m->ny * m->nz;
    *all = 0;
    for (int32_t z = 0; z < m->nz; z++) {
        for (int32_t y = 0; y < m->ny; y++) {
            for (int32_t x = 0; x < m->nx; x++) {
                float *bound = view->tables + m->table + (z * m->ny + y) * m->nx + x;
                *bound = scale * largest_in(view, v, m, x, y, z);
                *all = *bound > *all ? *bound : *all;
            }
        }
    }
}
