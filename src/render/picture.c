// picture.c: pictures, in colour and with more channels. Quantities of the first surface take a pass of their own.
#include "base/parallel.h"
#include "math/colour.h"
#include "math/rng.h"
#include "render/particles.h"
#include "render/render_parts.h"

#include <math.h>
#include <string.h>

// One pass of one integrator: its colours, or its quantities of the first surface; and powers of the same samples.
typedef struct Pass {
    int32_t integrator, mode, channels;
    int32_t power;    // of `powers`; 0 = none
    bool xyz;         // they are those of XYZ
    double *picture, *powers;
    double *alpha;    // 2 numbers per pixel, whose ratio it is; or null
    bool needs_alpha;
} Pass;

static void add_stats(rey_stats *sum, const rey_stats *part) {
    sum->seconds += part->seconds;
    sum->trace_seconds += part->trace_seconds;
    sum->thread_seconds += part->thread_seconds;
    sum->paths += part->paths;
    sum->rays += part->rays;
    sum->nonfinite += part->nonfinite;
}

// Number `part` of `parts`.
static rey_result run_pass(rey_scene *scene, const rey_render_def *def, const Pass *pass, int part, int parts, rey_stats *stats) {
    double start = rey_seconds();
    Render r;
    rey_stats one = {0};
    rey_result result = rey_render_begin(&r, scene, def, pass->mode, pass->channels);
    SceneView lights = scene->view;
    if (result == REY_OK && pass->power) {
        r.powers = rey_alloc_array(scene->ctx, (size_t)r.tiles * (size_t)r.plan.tile_floats, sizeof(double));
        r.job.power = pass->power;
        r.job.powers_of_xyz = pass->xyz;
        result = r.powers ? REY_OK : REY_ERROR_MEMORY;
    }
    if (result == REY_OK && pass->alpha) {
        size_t numbers = (size_t)(r.plan.tile_floats / r.plan.channels) * 2;
        r.coverage = rey_alloc_array(scene->ctx, (size_t)r.tiles * numbers, sizeof(double));
        result = r.coverage ? REY_OK : REY_ERROR_MEMORY;
    }
    if (result == REY_OK) {
        r.part = part;
        r.parts = parts;
        r.job.spp = r.def.spp;
        r.job.scramble = rng_scramble(def->seed, def->set, (uint32_t)def->sensor, 0);
        r.total = r.tiles;
        if (rey_traces_particles(scene) && (lights.max_depth < 0 || lights.max_depth > 1)) {
            // What the sensor sees of lights directly; particles bring all the rest.
            lights.max_depth = 1;
            r.job.scene = &lights;
        }
        rey_parallel_for(scene->ctx->def.threads, r.tiles, rey_render_film_unit, &r);
        rey_film_merge(&r.plan, r.films, r.columns, r.rows, 1.0 / r.def.spp, pass->picture);
        if (r.powers) {
            rey_film_merge(&r.plan, r.powers, r.columns, r.rows, 1.0 / r.def.spp, pass->powers);
        }
        if (r.coverage) {
            FilmPlan two = rey_film_plan(r.plan.sensor, 2);
            rey_film_merge(&two, r.coverage, r.columns, r.rows, 1.0 / r.def.spp, pass->alpha);
        }
    }
    result = rey_render_end(&r, result, start, &one);
    add_stats(stats, &one);
    return result;
}

static int32_t aov_channels(const Integrator *integrator) {
    int32_t n = 0;
    for (int32_t i = 0; i < integrator->aov_count; i++) {
        n += aov_components(integrator->aovs[i]);
    }
    return n;
}

// What the integrator `depth` finds is not a colour, but stands for one: grey.
static double xyz_of_grey(int32_t component) {
    const double white[3] = {1, 1, 1};
    return rey_xyz_of(white, component);
}

// ---- which passes a picture takes --------------------------------------------------------------------------------------

static const Integrator *integrator_of(const rey_scene *scene, int32_t i) {
    return &ARRAY_AT(scene->integrators, Integrator, i);
}

// A channel of the picture: R G B, and those that the integrators add.
static Channel picture_channel(const rey_scene *scene, int32_t c) {
    Channel colour = {.source = CHANNEL_RGB, .component = c, .power = 1};
    return c < 3 ? colour : ARRAY_AT(scene->channels, Channel, c - 3);
}

// What a pass must keep for a channel.
static Pass pass_for(const rey_scene *scene, Channel channel) {
    const Integrator *integrator = integrator_of(scene, channel.integrator);
    bool surface = channel.source == CHANNEL_AOV || integrator->colour_is_depth, alpha = channel.source == CHANNEL_ALPHA;
    return (Pass){.integrator = channel.integrator,
                  .mode = surface ? MODE_AOV : MODE_PRIMAL,
                  .channels = surface ? aov_channels(integrator) : 3,
                  .power = alpha || channel.power == 1 ? 0 : channel.power,
                  .xyz = !surface && channel.source == CHANNEL_XYZ,
                  .needs_alpha = alpha};
}

// The pass that has it: samples are the same in all passes of one integrator and mode.
static Pass *find_pass(const Array *passes, const Pass *wanted) {
    for (size_t i = 0; i < passes->count; i++) {
        Pass *pass = &ARRAY_AT(*passes, Pass, i);
        bool powers = !wanted->power || (pass->power == wanted->power && pass->xyz == wanted->xyz);
        if (pass->integrator == wanted->integrator && pass->mode == wanted->mode && powers) {
            return pass;
        }
    }
    return NULL;
}

// One that keeps no powers yet takes these up, too.
static rey_result want(rey_context *ctx, Array *passes, Pass wanted) {
    Pass plain = wanted, *pass = find_pass(passes, &wanted);
    plain.power = 0;
    if (!pass) {
        pass = find_pass(passes, &plain);
        pass = pass && !pass->power ? pass : NULL;
    }
    if (!pass) {
        pass = rey_array_push(ctx, passes, sizeof *pass, 1);
        if (!pass) {
            return REY_ERROR_MEMORY;
        }
        *pass = plain;
    }
    if (wanted.power) {
        pass->power = wanted.power;
        pass->xyz = wanted.xyz;
    }
    pass->needs_alpha |= wanted.needs_alpha;
    return REY_OK;
}

static rey_result plan_passes(rey_scene *scene, int32_t channels, int64_t pixels, bool alpha, Array *passes) {
    Channel first = {.source = alpha ? CHANNEL_ALPHA : CHANNEL_RGB, .power = 1};
    rey_result result = want(scene->ctx, passes, pass_for(scene, first));
    for (int32_t c = 0; c < channels && result == REY_OK; c++) {
        result = want(scene->ctx, passes, pass_for(scene, picture_channel(scene, c)));
    }
    for (size_t i = 0; i < passes->count && result == REY_OK; i++) {
        Pass *pass = &ARRAY_AT(*passes, Pass, i);
        size_t numbers = (size_t)pixels * (size_t)pass->channels;
        pass->picture = rey_alloc_array(scene->ctx, numbers, sizeof(double));
        pass->powers = pass->power ? rey_alloc_array(scene->ctx, numbers, sizeof(double)) : NULL;
        pass->alpha = pass->needs_alpha ? rey_alloc_array(scene->ctx, (size_t)pixels * 2, sizeof(double)) : NULL;
        bool room = pass->picture && (pass->powers || !pass->power) && (pass->alpha || !pass->needs_alpha);
        result = room ? REY_OK : REY_ERROR_MEMORY;
    }
    return result;
}

// Whether particles bring what paths of one segment do not.
static bool particles_follow(const Integrator *integrator, const Pass *pass) {
    return integrator->particles && pass->mode == MODE_PRIMAL && (integrator->max_depth < 0 || integrator->max_depth > 1);
}

// Each as if its integrator stood alone: with the same random numbers.
static rey_result run_passes(rey_scene *scene, const rey_render_def *def, const Array *passes, rey_stats *stats) {
    int part = 0, parts = 0;
    rey_result result = REY_OK;
    for (size_t i = 0; i < passes->count; i++) {
        const Pass *pass = &ARRAY_AT(*passes, Pass, i);
        parts += 1 + particles_follow(integrator_of(scene, pass->integrator), pass);
    }
    for (size_t i = 0; i < passes->count && result == REY_OK; i++) {
        const Pass *pass = &ARRAY_AT(*passes, Pass, i);
        rey_scene_use(scene, pass->integrator);
        result = run_pass(scene, def, pass, part++, parts, stats);
        if (result == REY_OK && particles_follow(integrator_of(scene, pass->integrator), pass)) {
            rey_stats one = {0};
            result = rey_render_particles(scene, def, part++, parts, pass->picture, &one);
            add_stats(stats, &one);
        }
    }
    rey_scene_use(scene, 0);
    return result;
}

// ---- channels ----------------------------------------------------------------------------------------------------------

// Its value at a pixel, from the pass that has it.
static double channel_value(const Channel *channel, const Pass *pass, bool is_depth, int64_t pixel) {
    const bool power = channel->power > 1;
    const double *values = (power && pass->powers ? pass->powers : pass->picture) + pixel * pass->channels;
    switch (channel->source) {
    case CHANNEL_AOV:
        return values[channel->component];
    case CHANNEL_ALPHA: // of a sample 0 or 1, and so are its powers
        return rey_film_alpha(pass->alpha + 2 * pixel);
    case CHANNEL_XYZ:
        return is_depth ? values[0] * pow(xyz_of_grey(channel->component), channel->power)
               : power  ? values[channel->component]
                        : rey_xyz_of(values, channel->component);
    default:
        return values[is_depth ? 0 : channel->component];
    }
}

static void assemble(const rey_scene *scene, const Array *passes, int32_t channels, int64_t pixels, float *image) {
    for (int32_t c = 0; c < channels; c++) {
        const Channel channel = picture_channel(scene, c);
        const Pass wanted = pass_for(scene, channel), *pass = find_pass(passes, &wanted);
        const bool is_depth = integrator_of(scene, channel.integrator)->colour_is_depth;
        for (int64_t i = 0; i < pixels; i++) {
            image[i * channels + c] = (float)channel_value(&channel, pass, is_depth, i);
        }
    }
}

rey_result rey_render_picture(rey_scene *scene, const rey_render_def *def, int32_t channels, float *image, double *alpha,
                              rey_stats *stats) {
    Array passes = {0};
    rey_stats sum = {0};
    int width = 0, height = 0;
    rey_result result = rey_begin(scene ? scene->ctx : NULL, image != NULL);
    if (result != REY_OK) {
        return result;
    }
    result = rey_scene_film_size(scene, def ? def->sensor : 0, &width, &height);
    int64_t pixels = (int64_t)width * height;
    if (result == REY_OK) {
        result = rey_render_check(scene, def);
    }
    if (result == REY_OK) {
        result = plan_passes(scene, channels, pixels, alpha != NULL, &passes);
    }
    if (result == REY_OK) {
        result = run_passes(scene, def, &passes, &sum);
    }
    if (result == REY_OK) {
        assemble(scene, &passes, channels, pixels, image);
    }
    if (result == REY_OK && alpha) {
        memcpy(alpha, ARRAY_AT(passes, Pass, 0).alpha, (size_t)pixels * 2 * sizeof *alpha);
    }
    for (size_t i = 0; i < passes.count; i++) {
        const Pass *pass = &ARRAY_AT(passes, Pass, i);
        rey_free(scene->ctx, pass->picture);
        rey_free(scene->ctx, pass->powers);
        rey_free(scene->ctx, pass->alpha);
    }
    rey_array_free(scene->ctx, &passes);
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
