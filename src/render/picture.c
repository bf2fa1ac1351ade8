// picture.c: pictures, in colour and with more channels. Quantities of the first surface take a pass of their own.
#include "base/parallel.h"
#include "math/rng.h"
#include "render/particles.h"
#include "render/render_parts.h"

#include <string.h>

// One pass: a picture of so many channels, assigned, and the second moments of its colours and its alpha, or null.
typedef struct Pass {
    int32_t mode, channels;
    int part, parts;
    double *picture, *squares, *alpha;
} Pass;

static void add_stats(rey_stats *sum, const rey_stats *part) {
    sum->seconds += part->seconds;
    sum->trace_seconds += part->trace_seconds;
    sum->thread_seconds += part->thread_seconds;
    sum->paths += part->paths;
    sum->rays += part->rays;
    sum->nonfinite += part->nonfinite;
}

static rey_result run_pass(rey_scene *scene, const rey_render_def *def, Pass pass, rey_stats *stats) {
    double start = rey_seconds();
    Render r;
    rey_stats one = {0};
    rey_result result = rey_render_begin(&r, scene, def, pass.mode, pass.channels);
    SceneView lights = scene->view;
    if (result == REY_OK && pass.squares) {
        r.squares = rey_alloc_array(scene->ctx, (size_t)r.tiles * (size_t)r.plan.tile_floats, sizeof(double));
        result = r.squares ? REY_OK : REY_ERROR_MEMORY;
    }
    if (result == REY_OK && pass.alpha) {
        size_t numbers = (size_t)(r.plan.tile_floats / r.plan.channels) * 2;
        r.coverage = rey_alloc_array(scene->ctx, (size_t)r.tiles * numbers, sizeof(double));
        result = r.coverage ? REY_OK : REY_ERROR_MEMORY;
    }
    if (result == REY_OK) {
        r.part = pass.part;
        r.parts = pass.parts;
        r.job.spp = r.def.spp;
        r.job.scramble = rng_scramble(def->seed, def->set, (uint32_t)def->sensor, 0);
        r.total = r.tiles;
        if (rey_traces_particles(scene) && (lights.max_depth < 0 || lights.max_depth > 1)) {
            // What the sensor sees of lights directly; particles bring all the rest.
            lights.max_depth = 1;
            r.job.scene = &lights;
        }
        rey_parallel_for(scene->ctx->def.threads, r.tiles, rey_render_film_unit, &r);
        rey_film_merge(&r.plan, r.films, r.columns, r.rows, 1.0 / r.def.spp, pass.picture);
        if (pass.squares) {
            rey_film_merge(&r.plan, r.squares, r.columns, r.rows, 1.0 / r.def.spp, pass.squares);
        }
        if (pass.alpha) {
            FilmPlan two = rey_film_plan(r.plan.sensor, 2);
            rey_film_merge(&two, r.coverage, r.columns, r.rows, 1.0 / r.def.spp, pass.alpha);
        }
    }
    result = rey_render_end(&r, result, start, &one);
    add_stats(stats, &one);
    return result;
}

static int32_t aov_channels(const SceneView *view) {
    int32_t n = 0;
    for (int32_t i = 0; i < view->aov_count; i++) {
        n += aov_components(view->aovs[i]);
    }
    return n;
}

// What the passes found, for all pixels.
typedef struct Layers {
    double *colour, *squares, *aovs; // 3, 3 and aov_count numbers per pixel
    double *alpha;                   // 2, the caller's; or null
    int32_t aov_count;
} Layers;

// CIE XYZ of linear sRGB, white D65.
static double xyz_of(const double *rgb, int32_t component) {
    static const double rows[3][3] = {
        {0.412453, 0.357580, 0.180423}, {0.212671, 0.715160, 0.072169}, {0.019334, 0.119193, 0.950227}};
    return rows[component][0] * rgb[0] + rows[component][1] * rgb[1] + rows[component][2] * rgb[2];
}

static double channel_value(const Layers *layers, const Channel *channel, int64_t pixel) {
    switch (channel->source) {
    case CHANNEL_AOV:
        return layers->aovs[pixel * layers->aov_count + channel->component];
    case CHANNEL_MEAN:
        return xyz_of(layers->colour + 3 * pixel, channel->component);
    case CHANNEL_SECOND:
        return layers->squares[3 * pixel + channel->component];
    default:
        return layers->colour[3 * pixel + channel->component];
    }
}

static void assemble(const rey_scene *scene, const Layers *layers, int32_t channels, int64_t pixels, float *image) {
    for (int64_t i = 0; i < pixels; i++) {
        for (int32_t c = 0; c < channels; c++) {
            Channel colour = {NULL, CHANNEL_COLOUR, c};
            const Channel *channel = c < 3 ? &colour : &ARRAY_AT(scene->channels, Channel, c - 3);
            image[i * channels + c] = (float)channel_value(layers, channel, i);
        }
    }
}

static rey_result render_layers(rey_scene *scene, const rey_render_def *def, int32_t channels, int64_t pixels,
                                Layers *layers, rey_stats *stats) {
    const SceneView *view = &scene->view;
    rey_context *ctx = scene->ctx;
    bool wide = channels > 3, aovs = view->aov_count && (wide || view->colour_is_depth);
    bool particles = rey_traces_particles(scene) && (view->max_depth < 0 || view->max_depth > 1);
    int parts = !view->colour_is_depth + aovs + particles;
    layers->aov_count = aov_channels(view);
    layers->colour = rey_alloc_array(ctx, (size_t)pixels * 3, sizeof(double));
    layers->squares = wide && view->moments ? rey_alloc_array(ctx, (size_t)pixels * 3, sizeof(double)) : NULL;
    layers->aovs = aovs ? rey_alloc_array(ctx, (size_t)pixels * (size_t)layers->aov_count, sizeof(double)) : NULL;
    if (!layers->colour || (wide && view->moments && !layers->squares) || (aovs && !layers->aovs)) {
        return REY_ERROR_MEMORY;
    }
    rey_result result = REY_OK;
    if (!view->colour_is_depth) {
        result = run_pass(scene, def, (Pass){MODE_PRIMAL, 3, 0, parts, layers->colour, layers->squares, layers->alpha}, stats);
    }
    if (result == REY_OK && particles) {
        rey_stats one = {0};
        result = rey_render_particles(scene, def, 1, parts, layers->colour, &one);
        add_stats(stats, &one);
    }
    if (result == REY_OK && aovs) {
        Pass pass = {MODE_AOV, layers->aov_count, parts - 1, parts, layers->aovs, NULL, NULL};
        result = run_pass(scene, def, pass, stats);
    }
    for (int64_t i = 0; i < pixels * 3 && result == REY_OK && view->colour_is_depth; i++) {
        layers->colour[i] = layers->aovs[i / 3 * layers->aov_count];
    }
    return result;
}

rey_result rey_render_picture(rey_scene *scene, const rey_render_def *def, int32_t channels, float *image, double *alpha,
                              rey_stats *stats) {
    Layers layers = {.alpha = alpha};
    rey_stats sum = {0};
    int width = 0, height = 0;
    rey_result result = rey_begin(scene ? scene->ctx : NULL, image != NULL);
    if (result != REY_OK) {
        return result;
    }
    result = rey_scene_film_size(scene, def ? def->sensor : 0, &width, &height);
    int64_t pixels = (int64_t)width * height;
    if (result == REY_OK) {
        result = render_layers(scene, def, channels, pixels, &layers, &sum);
    }
    if (result == REY_OK) {
        assemble(scene, &layers, channels, pixels, image);
    }
    rey_free(scene->ctx, layers.colour);
    rey_free(scene->ctx, layers.squares);
    rey_free(scene->ctx, layers.aovs);
    if (stats) {
        *stats = sum;
    }
    return result;
}

rey_result rey_render(rey_scene *scene, const rey_render_def *def, float *image, rey_stats *stats) {
    return rey_render_picture(scene, def, 3, image, NULL, stats);
}

int rey_channel_count(const rey_scene *scene) {
    return scene ? 3 + (int)scene->channels.count : 0;
}

const char *rey_channel_name(const rey_scene *scene, int channel) {
    static const char *const colours[] = {"R", "G", "B"};
    if (channel < 0 || channel >= rey_channel_count(scene)) {
        return NULL;
    }
    return channel < 3 ? colours[channel] : ARRAY_AT(scene->channels, Channel, channel - 3).name;
}

rey_result rey_render_channels(rey_scene *scene, const rey_render_def *def, float *image, rey_stats *stats) {
    return rey_render_picture(scene, def, rey_channel_count(scene), image, NULL, stats);
}

rey_result rey_render_sensors(rey_scene *scene, const rey_render_def *def, const int *sensors, int count,
                              float *const *images, rey_stats *stats) {
    if (!def || count < 0 || (count > 0 && (!sensors || !images))) {
        return rey_fail(scene->ctx, REY_ERROR_ARGUMENT, "rey_render_sensors needs a def, sensors and a picture for each");
    }
    rey_stats sum = {0};
    rey_result result = REY_OK;
    for (int i = 0; i < count && result == REY_OK; i++) {
        rey_render_def one = *def;
        rey_stats part = {0};
        one.sensor = sensors[i];
        result = rey_render(scene, &one, images[i], &part);
        add_stats(&sum, &part);
    }
    if (stats) {
        *stats = sum;
    }
    return result;
}
