// film.c: tiles and their merging.
#include "render/film.h"

#include "sensor/filter.h"

FilmPlan rey_film_plan(const SensorRecord *s, int32_t channels) {
    FilmPlan plan = {
        .sensor = s, .channels = channels, .x = s->crop_x, .y = s->crop_y, .width = s->crop_width, .height = s->crop_height};
    if (s->sample_border && s->filter != FILM_BOX) {
        int32_t reach = (int32_t)ceilf(s->filter_radius - 0.5f);
        plan.x -= reach;
        plan.y -= reach;
        plan.width += 2 * reach;
        plan.height += 2 * reach;
    }
    // Small pictures get small tiles, so that there is work for several threads.
    int64_t pixels = (int64_t)plan.width * plan.height;
    plan.tile = pixels > 128 * 128 ? 32 : pixels > 32 * 32 ? 16 : 8;
    // Tiles hold what the filter carries over their edges: wide filters get larger ones.
    plan.tile = s->filter_radius > 12 ? 128 : plan.tile;
    plan.columns = (plan.width + plan.tile - 1) / plan.tile;
    plan.rows = (plan.height + plan.tile - 1) / plan.tile;
    plan.border = s->filter == FILM_BOX ? 0 : (int32_t)ceilf(s->filter_radius - 0.5f) + 1;
    int64_t edge = plan.tile + 2 * plan.border;
    plan.tile_floats = edge * edge * channels;
    return plan;
}

void rey_film_plan_whole(FilmPlan *plan) {
    plan->tile = plan->width > plan->height ? plan->width : plan->height;
    plan->columns = plan->rows = 1;
    plan->tile_floats = (int64_t)(plan->width + 2 * plan->border) * (plan->height + 2 * plan->border) * plan->channels;
}

Tile rey_film_tile(const FilmPlan *plan, int32_t index) {
    int32_t column = index % plan->columns, row = index / plan->columns;
    Tile t = {plan->x + column * plan->tile, plan->y + row * plan->tile, plan->tile, plan->tile};
    int32_t right = plan->x + plan->width, bottom = plan->y + plan->height;
    t.width = t.x + t.width > right ? right - t.x : t.width;
    t.height = t.y + t.height > bottom ? bottom - t.y : t.height;
    return t;
}

// Integral of the filter around a pixel over [low, high), by the midpoint rule on a fine grid.
static double filter_integral(const SensorRecord *s, int32_t pixel, int32_t low, int32_t high) {
    const int steps = s->filter_radius > 12 ? 4096 : 256;
    if (s->filter == FILM_BOX) {
        return 1;
    }
    double centre = pixel + 0.5, radius = s->filter_radius;
    double a = fmax(centre - radius, low), b = fmin(centre + radius, high), sum = 0;
    for (int i = 0; i < steps; i++) {
        sum += (double)filter_eval(s, (float)(a + (b - a) * (i + 0.5) / steps - centre));
    }
    return sum * (b - a) / steps;
}

void rey_film_norms(const FilmPlan *plan, double *columns, double *rows) {
    const SensorRecord *s = plan->sensor;
    for (int32_t i = 0; i < s->crop_width; i++) {
        columns[i] = filter_integral(s, s->crop_x + i, plan->x, plan->x + plan->width);
    }
    for (int32_t i = 0; i < s->crop_height; i++) {
        rows[i] = filter_integral(s, s->crop_y + i, plan->y, plan->y + plan->height);
    }
}

void rey_film_merge(const FilmPlan *plan, const double *films, const double *columns, const double *rows, double scale,
                    double *picture) {
    const SensorRecord *s = plan->sensor;
    for (int32_t index = 0; index < plan->columns * plan->rows; index++) {
        Tile t = rey_film_tile(plan, index);
        const double *film = films + index * plan->tile_floats;
        int32_t width = t.width + 2 * plan->border, height = t.height + 2 * plan->border;
        for (int32_t j = 0; j < height; j++) {
            int32_t y = t.y - plan->border + j - s->crop_y;
            for (int32_t i = 0; i < width && y >= 0 && y < s->crop_height; i++) {
                int32_t x = t.x - plan->border + i - s->crop_x;
                if (x < 0 || x >= s->crop_width) {
                    continue;
                }
                double weight = scale / (columns[x] * rows[y]);
                double *pixel = picture + ((int64_t)y * s->crop_width + x) * plan->channels;
                for (int c = 0; c < plan->channels; c++) {
                    pixel[c] += weight * film[((int64_t)j * width + i) * plan->channels + c];
                }
            }
        }
    }
}
