// film.h: how samples weigh in the pixels around them, and what a sample is worth to a film's adjoint.
#pragma once

#include "math/vec.h"
#include "sensor/filter.h"

enum { MAX_FOOTPRINT = 2 * MOST_FILTER_RADIUS + 2 }; // pixels that a filter may cover along one axis

enum { FILTER_STEPS = 1024 }; // entries of the tabulated filter over its radius

// The filter, tabulated over its radius: linear interpolation is exact to 1e-6 of its peak.
typedef struct FilterTable {
    float value[FILTER_STEPS + 2];
    float scale; // steps per pixel
} FilterTable;

static void filter_tabulate(const SensorRecord *s, FilterTable *table) {
    table->scale = (float)FILTER_STEPS / s->filter_radius;
    for (int32_t i = 0; i < FILTER_STEPS + 2; i++) {
        table->value[i] = i < FILTER_STEPS ? filter_eval(s, (float)i / table->scale) : 0;
    }
}

// Weights of the pixels around x along one axis; returns their number.
static int32_t film_weights(const SensorRecord *s, const FilterTable *table, float x, int32_t low, int32_t high,
                            int32_t *first, float *weights) {
    int32_t begin, end;
    filter_range(s, x, &begin, &end);
    begin = begin < low ? low : begin;
    end = end > high ? high : end;
    int32_t n = end - begin < 0 ? 0 : end - begin > MAX_FOOTPRINT ? MAX_FOOTPRINT : end - begin;
    for (int32_t i = 0; i < n; i++) {
        float at = fabsf((float)(begin + i) + 0.5f - x) * table->scale;
        int32_t k = at < FILTER_STEPS ? (int32_t)at : FILTER_STEPS;
        weights[i] = table->value[k] + (at - (float)k) * (table->value[k + 1] - table->value[k]);
    }
    *first = begin;
    return n;
}

// The pixels around a sample, with their weights along both axes and how these change.
typedef struct FilmFootprint {
    int32_t first_x, first_y, nx, ny;
    float x[MAX_FOOTPRINT], y[MAX_FOOTPRINT], by_x[MAX_FOOTPRINT], by_y[MAX_FOOTPRINT];
} FilmFootprint;

static void film_slopes(const FilterTable *table, float x, int32_t first, int32_t n, float *slopes) {
    for (int32_t i = 0; i < n; i++) {
        float away = (float)(first + i) + 0.5f - x, at = fabsf(away) * table->scale;
        int32_t k = at < FILTER_STEPS ? (int32_t)at : FILTER_STEPS;
        float step = (table->value[k + 1] - table->value[k]) * table->scale;
        slopes[i] = away < 0 ? step : -step;
    }
}

// Of those in [left, right) x [top, bottom).
static void film_footprint(const SensorRecord *s, const FilterTable *table, float x, float y, int32_t left, int32_t top,
                           int32_t right, int32_t bottom, FilmFootprint *f) {
    f->nx = film_weights(s, table, x, left, right, &f->first_x, f->x);
    f->ny = film_weights(s, table, y, top, bottom, &f->first_y, f->y);
    film_slopes(table, x, f->first_x, f->nx, f->by_x);
    film_slopes(table, y, f->first_y, f->ny, f->by_y);
}

// What the radiance at x, y is worth to the adjoint of the delivered picture; with the box filter it counts for the pixel
// that it was drawn in.
static void film_worth(const SensorRecord *s, const FilterTable *table, const float *adjoint, float x, float y,
                       int32_t pixel_x, int32_t pixel_y, float delta[SPEC_N]) {
    const int32_t right = s->crop_x + s->crop_width, bottom = s->crop_y + s->crop_height;
    float wx[MAX_FOOTPRINT], wy[MAX_FOOTPRINT];
    int32_t first_x = pixel_x, first_y = pixel_y;
    int32_t nx = first_x >= s->crop_x && first_x < right, ny = first_y >= s->crop_y && first_y < bottom;
    wx[0] = wy[0] = 1;
    if (s->filter != FILM_BOX) {
        nx = film_weights(s, table, x, s->crop_x, right, &first_x, wx);
        ny = film_weights(s, table, y, s->crop_y, bottom, &first_y, wy);
    }
    for (int c = 0; c < SPEC_N; c++) {
        delta[c] = 0;
    }
    for (int32_t j = 0; j < ny; j++) {
        const float *row = adjoint + ((int64_t)(first_y + j - s->crop_y) * s->crop_width + first_x - s->crop_x) * SPEC_N;
        for (int32_t k = 0; k < nx * SPEC_N; k++) {
            delta[k % SPEC_N] += wx[k / SPEC_N] * wy[j] * row[k];
        }
    }
}

// How that changes with x and y, but for the box filter's jumps.
static void film_worth_slope(const SensorRecord *s, const FilterTable *table, const float *adjoint, float x, float y,
                             float slope[2][SPEC_N]) {
    FilmFootprint f;
    film_footprint(s, table, x, y, s->crop_x, s->crop_y, s->crop_x + s->crop_width, s->crop_y + s->crop_height, &f);
    memset(slope, 0, 2 * sizeof *slope);
    for (int32_t j = 0; j < f.ny; j++) {
        const float *row = adjoint + ((int64_t)(f.first_y + j - s->crop_y) * s->crop_width + f.first_x - s->crop_x) * SPEC_N;
        for (int32_t k = 0; k < f.nx * SPEC_N; k++) {
            slope[0][k % SPEC_N] += f.by_x[k / SPEC_N] * f.y[j] * row[k];
            slope[1][k % SPEC_N] += f.x[k / SPEC_N] * f.by_y[j] * row[k];
        }
    }
}
