// renders.c: statistical render tests: every pixel and channel against a reference with known variance.
//
// z = |mean - ref| sqrt(spp / var) in XYZ, with the prescribed spp whatever the scale; p = erfc(z / sqrt 2);
// alpha = 1 - 0.99^(1/pixels); a picture passes when at least 99.75 % of the tests (counted in pixels) have p > alpha.
#include "conformance.h"

#include "base/context.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct Case {
    const char *name, *integrator;
    char scene[4096], mean[4096], variance[4096];
    int width, height, spp;
} Case;

typedef struct Figures {
    double passing; // pixel x channel tests with p > alpha, divided by 3 and by the number of pixels
    double worst_z, mean_square_z;
} Figures;

static const double accepted = 0.9975;

static void to_xyz(const float *rgb, double xyz[3]) {
    static const double matrix[3][3] = {
        {.412453, .357580, .180423}, {.212671, .715160, .072169}, {.019334, .119193, .950227}};
    for (int i = 0; i < 3; i++) {
        xyz[i] = matrix[i][0] * (double)rgb[0] + matrix[i][1] * (double)rgb[1] + matrix[i][2] * (double)rgb[2];
    }
}

static Figures z_test(const Case *c, const float *image, const float *mean, const float *variance) {
    int pixels = c->width * c->height;
    double alpha = 1 - pow(0.99, 1.0 / pixels), passing = 0;
    Figures f = {0};
    for (int i = 0; i < pixels; i++) {
        double tested[3], reference[3], spread[3];
        to_xyz(image + 3 * i, tested);
        to_xyz(mean + 3 * i, reference);
        to_xyz(variance + 3 * i, spread);
        for (int k = 0; k < 3; k++) {
            double z = fabs(tested[k] - reference[k]) * sqrt(c->spp / fmax(spread[k], 1e-4));
            passing += erfc(z / sqrt(2)) > alpha;
            f.worst_z = z <= f.worst_z ? f.worst_z : z;
            f.mean_square_z += z * z / (3.0 * pixels);
        }
    }
    f.passing = passing / 3 / pixels;
    return f;
}

static rey_result test_seed(Suite *suite, const Case *c, rey_scene *scene, int seed, float *image, const float *mean,
                            const float *variance, Figures *worst) {
    rey_render_def def = rey_default_render_def();
    def.sampler = suite->sampler;
    def.spp = c->spp * suite->scale;
    def.seed = (uint32_t)seed;
    rey_result result = rey_render(scene, &def, image, NULL);
    if (result) {
        return result;
    }
    Figures f = z_test(c, image, mean, variance);
    if (seed == 0 || !(f.passing >= worst->passing)) {
        *worst = f;
    }
    return REY_OK;
}

static rey_result load_case(Suite *suite, const Case *c, rey_scene **scene, float **mean, float **variance) {
    rey_result result = suite_load(suite, c->scene, c->integrator, c->spp, scene);
    int width, height;
    if (!result) {
        result = rey_scene_film_size(*scene, 0, &width, &height);
    }
    if (!result && (width != c->width || height != c->height)) {
        result = rey_fail(suite->ctx, REY_ERROR_SCENE, "%s: the film is %d x %d, expected %d x %d", c->scene, width,
                          height, c->width, c->height);
    }
    if (!result) {
        result = suite_read_image(suite, c->mean, c->width, c->height, mean);
    }
    return result ? result : suite_read_image(suite, c->variance, c->width, c->height, variance);
}

static void run_case(Suite *suite, const Case *c) {
    rey_scene *scene = NULL;
    float *mean = NULL, *variance = NULL, *image = NULL;
    Figures worst = {0};
    rey_result result = load_case(suite, c, &scene, &mean, &variance);
    if (!result) {
        image = suite_image(suite, c->width, c->height);
        result = image ? REY_OK : REY_ERROR_MEMORY;
    }
    for (int seed = 0; seed < suite->seeds && !result; seed++) {
        result = test_seed(suite, c, scene, seed, image, mean, variance, &worst);
    }
    if (result) {
        suite_report_failure(suite, c->name, result, true);
    } else {
        suite_report(suite, c->name, worst.passing >= accepted ? VERDICT_PASS : VERDICT_FAIL, true,
                     "%.3f %% of the tests (%.2f needed), mean z^2 %.3f, largest z %.2f, %d samples",
                     100 * worst.passing, 100 * accepted, worst.mean_square_z, worst.worst_z, c->spp * suite->scale);
    }
    rey_free(suite->ctx, mean);
    rey_free(suite->ctx, variance);
    rey_free(suite->ctx, image);
    rey_scene_destroy(scene);
}

static bool read_case(const Suite *suite, const JsonNode *node, Case *c) {
    c->name = json_text(node, "name", "");
    c->integrator = json_text(node, "integrator", "path");
    c->width = (int)json_value(node, "width", 0);
    c->height = (int)json_value(node, "height", 0);
    const char *scene = json_text(node, "scene", NULL);
    const char *mean = json_text(node, "references.rgb.mean", NULL);
    const char *variance = json_text(node, "references.rgb.variance", NULL);
    if (!scene || !mean || !variance || c->width < 1 || c->height < 1) {
        return false;
    }
    c->spp = (int)floor(2e6 / ((double)c->width * c->height));
    snprintf(c->scene, sizeof c->scene, "%s/data/%s", suite->folder, scene);
    snprintf(c->mean, sizeof c->mean, "%s/data/%s", suite->folder, mean);
    snprintf(c->variance, sizeof c->variance, "%s/data/%s", suite->folder, variance);
    return true;
}

void run_renders(Suite *suite) {
    char path[4096];
    snprintf(path, sizeof path, "%s/renders.json", suite->folder);
    JsonNode *root = json_read(path);
    const JsonNode *scenes = json_get(root, "scenes");
    if (!scenes) {
        suite_report(suite, "renders.json", VERDICT_FAIL, true, "holds no scenes");
    }
    for (const JsonNode *node = scenes ? scenes->first : NULL; node; node = node->next) {
        Case c;
        if (!read_case(suite, node, &c)) {
            suite_report(suite, json_text(node, "name", "renders.json"), VERDICT_FAIL, true, "incomplete record");
        } else if (suite_selects(suite, c.name)) {
            run_case(suite, &c);
        }
    }
    json_free(root);
}
