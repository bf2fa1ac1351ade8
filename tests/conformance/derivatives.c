// derivatives.c: derivative configurations: picture, forward-mode derivative image and reverse-mode gradient against
// references made by central differences.
#include "conformance.h"

#include "base/context.h"
#include "cli.h"

#include <dirent.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MAX_PARAMS = 16 };

typedef struct Config {
    const JsonNode *spec;
    char folder[4608];
    char name[272];
    int width, height;
    bool gated;
    char specs[MAX_PARAMS][512]; // directions, NAME:OP
    const char *spec_list[MAX_PARAMS];
    int spec_count;
} Config;

typedef struct Errors {
    double mean, max;
} Errors;

static Errors relative_errors(const Config *c, const float *image, const float *reference, double floor) {
    Errors e = {0};
    int count = c->width * c->height * 3;
    for (int i = 0; i < count; i++) {
        double r = (double)reference[i], error = fabs((double)image[i] - r) / fmax(fabs(r), floor);
        e.mean += error / count;
        e.max = error <= e.max ? e.max : error;
    }
    return e;
}

// One tangent of spec.json as the text of a direction.
static bool direction_text(const JsonNode *parameter, char *text, size_t size) {
    const char *path = json_text(parameter, "path", NULL), *op = json_text(parameter, "tangent.op", NULL);
    if (!path || !op) {
        return false;
    }
    if (!strcmp(op, "add")) {
        snprintf(text, size, "%s:add=%.9g", path, json_value(parameter, "tangent.value", 1));
        return true;
    }
    const JsonNode *d = json_path(parameter, "tangent.direction");
    if (strcmp(op, "translate") || !d || !d->first || !d->first->next || !d->first->next->next) {
        return false;
    }
    bool local = !strcmp(json_text(parameter, "tangent.space", "world"), "local");
    snprintf(text, size, "%s:%s=%.9g,%.9g,%.9g", path, local ? "local_translate" : "translate", d->first->number,
             d->first->next->number, d->first->next->next->number);
    return true;
}

static bool read_config(Config *c) {
    const JsonNode *size = json_path(c->spec, "references.size"), *parameters = json_get(c->spec, "parameters");
    if (!size || !size->first || !size->first->next || !parameters) {
        return false;
    }
    c->width = (int)size->first->number;
    c->height = (int)size->first->next->number;
    c->gated = !strcmp(json_text(c->spec, "upstream_status", "active"), "active");
    for (const JsonNode *p = parameters->first; p && c->spec_count < MAX_PARAMS; p = p->next) {
        int k = c->spec_count++;
        c->spec_list[k] = c->specs[k];
        if (!direction_text(p, c->specs[k], sizeof c->specs[k])) {
            return false;
        }
    }
    return c->spec_count > 0 && c->width > 0 && c->height > 0;
}

// What the three parts of one configuration share.
typedef struct Run {
    Suite *suite;
    const Config *config;
    rey_scene *scene;
    float *image, *reference;
} Run;

static int part_spp(const Run *r, const char *part) {
    char path[64];
    snprintf(path, sizeof path, "spp.%s", part);
    return (int)json_value(r->config->spec, path, 1024) * r->suite->scale;
}

static rey_render_def part_def(const Run *r, const char *part, int seed) {
    rey_render_def def = rey_default_render_def();
    def.sampler = r->suite->sampler;
    def.spp = part_spp(r, part);
    def.seed = (uint32_t)json_value(r->config->spec, "seed", 0) + (uint32_t)seed;
    return def;
}

static double threshold(const Config *c, const char *part, const char *which) {
    char path[96];
    snprintf(path, sizeof path, "thresholds.%s.%s", part, which);
    return json_value(c->spec, path, 0);
}

static rey_result read_reference(Run *r, const char *part) {
    const Config *c = r->config;
    char key[64], path[8192];
    snprintf(key, sizeof key, "references.%s", part);
    snprintf(path, sizeof path, "%s/%s", c->folder, json_text(c->spec, key, "missing"));
    rey_free(r->suite->ctx, r->reference);
    r->reference = NULL;
    return suite_read_image(r->suite, path, c->width, c->height, &r->reference);
}

static void keep_worst(Errors *worst, Errors e) {
    worst->mean = isnan(worst->mean) || e.mean <= worst->mean ? worst->mean : e.mean; // not a number is the worst
    worst->max = isnan(worst->max) || e.max <= worst->max ? worst->max : e.max;
}

// Pictures: the primal one, or the derivative along the direction.
static rey_result run_picture(Run *r, const char *part, const Direction *direction, Errors *worst) {
    rey_result result = read_reference(r, part);
    for (int seed = 0; seed < r->suite->seeds && !result; seed++) {
        rey_render_def def = part_def(r, part, seed);
        result = direction ? rey_jvp(r->scene, &def, cli_direction_selection(direction), direction->tangent, r->image,
                                     NULL, NULL)
                           : rey_render(r->scene, &def, r->image, NULL);
        if (!result) {
            keep_worst(worst, relative_errors(r->config, r->image, r->reference,
                                              threshold(r->config, part, "denominator_floor")));
        }
    }
    return result;
}

// e = |g / N - A mean(R')| / max(|A mean(R')|, floor), g = d/dtheta of the sum of A * image.
static rey_result run_backward(Run *r, const Direction *direction, Errors *worst) {
    const Config *c = r->config;
    int count = c->width * c->height * 3;
    int64_t size = direction->offsets[direction->count];
    double weight = threshold(c, "backward", "image_adjoint"), expected = 0;
    double *gradient = rey_alloc_array(r->suite->ctx, (size_t)size, sizeof *gradient);
    rey_result result = gradient ? read_reference(r, "forward") : REY_ERROR_MEMORY;
    for (int i = 0; i < count && !result; i++) {
        expected += weight * (double)r->reference[i] / count;
        r->image[i] = (float)weight;
    }
    for (int seed = 0; seed < r->suite->seeds && !result; seed++) {
        rey_render_def def = part_def(r, "backward", seed);
        result = rey_vjp(r->scene, &def, cli_direction_selection(direction), r->image, gradient, NULL, NULL);
        double g = 0;
        for (int64_t i = 0; i < size && !result; i++) {
            g += gradient[i] * (double)direction->tangent[i] / count;
        }
        double error = fabs(g - expected) / fmax(fabs(expected), threshold(c, "backward", "denominator_floor"));
        keep_worst(worst, (Errors){.max = error});
    }
    rey_free(r->suite->ctx, gradient);
    return result;
}

static void report(const Run *r, const char *part, rey_result result, Errors e) {
    const Config *c = r->config;
    char name[320];
    snprintf(name, sizeof name, "%s %s", c->name, part);
    if (result) {
        suite_report_failure(r->suite, name, result, c->gated);
        return;
    }
    bool backward = !strcmp(part, "backward");
    double max_mean = threshold(c, part, "mean"), max = threshold(c, part, "max");
    bool passed = e.max <= max && (backward || e.mean <= max_mean);
    if (backward) {
        suite_report(r->suite, name, passed ? VERDICT_PASS : VERDICT_FAIL, c->gated, "error %.6f (%g)", e.max, max);
    } else {
        suite_report(r->suite, name, passed ? VERDICT_PASS : VERDICT_FAIL, c->gated, "mean %.5f (%g), max %.4f (%g)",
                     e.mean, max_mean, e.max, max);
    }
}

static void run_parts(Run *r) {
    static const char *const parts[] = {"primal", "forward", "backward"};
    Direction direction = {0};
    rey_result built =
        cli_direction_build(r->suite->ctx, r->scene, r->config->spec_list, r->config->spec_count, &direction);
    for (int i = 0; i < COUNT_OF(parts); i++) {
        double samples = (double)part_spp(r, parts[i]) * r->config->width * r->config->height;
        if (r->suite->quick && samples > quick_samples) {
            char name[320];
            snprintf(name, sizeof name, "%s %s", r->config->name, parts[i]);
            suite_report(r->suite, name, VERDICT_SKIP, r->config->gated, "left out by --quick");
            continue;
        }
        Errors worst = {0};
        rey_result result = i == 0 ? REY_OK : built;
        if (!result) {
            result = i == 2 ? run_backward(r, &direction, &worst)
                            : run_picture(r, parts[i], i == 1 ? &direction : NULL, &worst);
        }
        report(r, parts[i], result, worst);
    }
    cli_direction_free(r->suite->ctx, &direction);
}

static void run_config(Suite *suite, const Config *c) {
    Run r = {.suite = suite, .config = c};
    char path[8192];
    snprintf(path, sizeof path, "%s/%s", c->folder, json_text(c->spec, "scene", "scene.xml"));
    rey_result result = suite_load(suite, path, "path", (int)json_value(c->spec, "spp.primal", 1024), &r.scene);
    int width, height;
    if (!result) {
        result = rey_scene_film_size(r.scene, 0, &width, &height);
    }
    if (!result && (width != c->width || height != c->height)) {
        result = rey_fail(suite->ctx, REY_ERROR_SCENE, "%s: the film is %d x %d, expected %d x %d", path, width, height,
                          c->width, c->height);
    }
    if (!result) {
        r.image = suite_image(suite, c->width, c->height);
        result = r.image ? REY_OK : REY_ERROR_MEMORY;
    }
    if (result) {
        suite_report_failure(suite, c->name, result, c->gated);
    } else {
        run_parts(&r);
    }
    rey_free(suite->ctx, r.image);
    rey_free(suite->ctx, r.reference);
    rey_scene_destroy(r.scene);
}

void run_derivatives(Suite *suite) {
    char folder[4096], path[8192];
    snprintf(folder, sizeof folder, "%s/ad", suite->folder);
    struct dirent **entries = NULL;
    int count = scandir(folder, &entries, NULL, alphasort);
    for (int i = 0; i < count; i++) {
        Config *c = calloc(1, sizeof *c);
        snprintf(path, sizeof path, "%s/%s/spec.json", folder, entries[i]->d_name);
        FILE *file = c ? fopen(path, "r") : NULL; // other folders hold meshes and textures
        if (file) {
            fclose(file);
            snprintf(c->name, sizeof c->name, "ad/%s", entries[i]->d_name);
            snprintf(c->folder, sizeof c->folder, "%s/%s", folder, entries[i]->d_name);
            JsonNode *spec = json_read(path);
            c->spec = spec;
            if (!spec || !read_config(c)) {
                suite_report(suite, c->name, VERDICT_FAIL, true, "malformed spec.json");
            } else if (suite_selects(suite, c->name)) {
                run_config(suite, c);
            }
            json_free(spec);
        }
        free(c);
        free(entries[i]);
    }
    free(entries);
}
