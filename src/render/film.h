// film.h: the picture that a sensor delivers: which samples it takes, how tiles merge, and what a pixel's weights sum to.
#pragma once

#include "scene/scene.h"

typedef struct Tile {
    int32_t x, y, width, height; // pixels in which samples are drawn, in full-film numbers
} Tile;

// How one sensor's samples are cut into tiles. The cut depends on the sensor alone.
typedef struct FilmPlan {
    const SensorRecord *sensor;
    int32_t x, y, width, height; // region in which samples are drawn: the crop window, and a border if asked for
    int32_t tile;                // edge of a tile [pixels]
    int32_t columns, rows;
    int32_t border;              // pixels by which the filter reaches over a tile's edge
    int32_t channels;
    int64_t tile_floats;         // numbers in the film of one full tile, with its border
} FilmPlan;

FilmPlan rey_film_plan(const SensorRecord *sensor, int32_t channels);
// Makes it one tile that covers the whole picture.
void rey_film_plan_whole(FilmPlan *plan);
Tile rey_film_tile(const FilmPlan *plan, int32_t index);

// Sums of the filter over the region in which samples are drawn, one per column and per row of the delivered picture:
// the deterministic normalisation that all terms share. The caller provides crop_width and crop_height doubles.
void rey_film_norms(const FilmPlan *plan, double *columns, double *rows);

// Adds the tiles' films to the delivered picture, pixel by pixel in the order of the tiles: picture += scale x sum /
// norm. films: one block of tile_floats per tile.
void rey_film_merge(const FilmPlan *plan, const double *films, const double *columns, const double *rows, double scale,
                    double *picture);
