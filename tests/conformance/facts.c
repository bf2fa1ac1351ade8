// facts.c: tabulated numbers: spectra, named materials, fields of view, filters, texture and environment lookups; and
// the scenes that must load.
#include "facts.h"

#include "base/context.h"
#include "io/image.h"
#include "io/spectrum.h"
#include "sensor/filter.h"

#include <ctype.h>
#include <dirent.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

void facts_tally(Tally *t, const char *what, double value, double expected, double tolerance) {
    double error = fabs(value - expected) / tolerance;
    bool good = error <= 1;
    t->tested++;
    t->agreed += good;
    t->worst = error <= t->worst ? t->worst : error;
    if (!good && !t->first[0]) {
        snprintf(t->first, sizeof t->first, "; %s is %.7g, expected %.7g", what, value, expected);
    }
}

void facts_report(Suite *suite, const char *name, const Tally *t) {
    bool passed = t->tested > 0 && t->agreed == t->tested;
    suite_report(suite, name, passed ? VERDICT_PASS : VERDICT_FAIL, true,
                 "%d of %d numbers, worst error %.3g tolerances%s", t->agreed, t->tested, t->worst, t->first);
}

JsonNode *facts_read(const Suite *suite, const char *name) {
    char path[4096];
    snprintf(path, sizeof path, "%s/facts/%s", suite->folder, name);
    return access(path, R_OK) ? NULL : json_read(path);
}

double facts_item(const JsonNode *array, int i) {
    const JsonNode *node = array ? array->first : NULL;
    for (; node && i > 0; i--) {
        node = node->next;
    }
    return node && node->kind == JSON_NUMBER ? node->number : NAN;
}

/* ---- spectra and materials ----------------------------------------------------------------------------------- */

static void run_named_ior(Suite *suite, const char *name) {
    JsonNode *root = facts_read(suite, "named_ior.json");
    Tally t = {0};
    const JsonNode *table = json_get(root, "ior");
    for (const JsonNode *n = table ? table->first : NULL; n; n = n->next) {
        double ior = NAN;
        char word[64];
        snprintf(word, sizeof word, "%s", n->key);
        word[0] = (char)toupper(word[0]); // names have no case
        facts_tally(&t, n->key, rey_named_ior(word, &ior) ? ior : NAN, n->number, 1e-6);
    }
    facts_report(suite, name, &t);
    json_free(root);
}

static void run_metals(Suite *suite, const char *name) {
    JsonNode *root = facts_read(suite, "rgb_from_spectra.json");
    Tally t = {0};
    const JsonNode *table = json_get(root, "metals");
    for (const JsonNode *n = table ? table->first : NULL; n; n = n->next) {
        double eta[3] = {NAN, NAN, NAN}, k[3] = {NAN, NAN, NAN};
        rey_named_metal(n->key, eta, k);
        for (int c = 0; c < 3; c++) {
            double e = facts_item(json_get(n, "eta"), c), f = facts_item(json_get(n, "k"), c);
            facts_tally(&t, n->key, eta[c], e, 1e-5 * fabs(e) + 2e-6);
            facts_tally(&t, n->key, k[c], f, 1e-5 * fabs(f) + 2e-6);
        }
    }
    facts_report(suite, name, &t);
    json_free(root);
}

static void run_spectra(Suite *suite, const char *name) {
    JsonNode *root = facts_read(suite, "spectra.json");
    Tally t = {0};
    double xyz[3], temperature = json_value(root, "blackbody.temperature", 0);
    rey_cie1931(json_value(root, "cie1931.wavelength", 0), xyz);
    for (int i = 0; i < 3; i++) {
        facts_tally(&t, "colour matching", xyz[i], facts_item(json_path(root, "cie1931.xyz"), i),
              json_value(root, "cie1931.atol", 0));
    }
    for (int i = 0; i < 4; i++) {
        double d65 = facts_item(json_path(root, "d65.values"), i), black = facts_item(json_path(root, "blackbody.values"), i);
        facts_tally(&t, "D65", rey_d65(facts_item(json_path(root, "d65.wavelengths"), i)), d65, 1e-3 * fabs(d65) + 1e-5);
        facts_tally(&t, "black body", rey_blackbody(facts_item(json_path(root, "blackbody.wavelengths"), i), temperature), black,
              1e-3 * fabs(black) + 1e-5);
    }
    facts_tally(&t, "D65 normalisation", REY_D65_SCALE, json_value(root, "d65.normalisation", 0), 1e-9);
    facts_report(suite, name, &t);
    json_free(root);
}

/* ---- small scenes ------------------------------------------------------------------------------------------- */

// Loads a scene from text; folder is where its files are looked up.
rey_result facts_load(Suite *suite, const char *text, rey_scene **scene) {
    char path[] = "/tmp/reynolds-conformance-XXXXXX";
    int descriptor = mkstemp(path);
    FILE *file = descriptor < 0 ? NULL : fdopen(descriptor, "w");
    if (!file) {
        return rey_fail(suite->ctx, REY_ERROR_IO, "no temporary file could be made");
    }
    fputs(text, file);
    rey_result result = fclose(file) ? rey_fail(suite->ctx, REY_ERROR_IO, "%s: cannot be written", path)
                                     : rey_scene_load(suite->ctx, path, NULL, 0, scene);
    unlink(path);
    return result;
}

static double param_value(const rey_scene *scene, const char *name, int64_t index) {
    int param = rey_param_find(scene, name);
    return param < 0 ? NAN : (double)rey_param_values(scene, param)[index];
}

// Horizontal field of view of one record; NaN after a failure.
static double scene_fov(Suite *suite, const JsonNode *fact, rey_result *result) {
    char text[2048], fov[256] = "";
    double aspect = json_value(fact, "aspect", 1);
    const char *focal = json_text(fact, "focal_length", NULL), *axis = json_text(fact, "fov_axis", NULL);
    if (focal) {
        snprintf(fov, sizeof fov, "<string name=\"focal_length\" value=\"%s\"/>", focal);
    } else if (json_get(fact, "fov")) {
        snprintf(fov, sizeof fov, "<float name=\"fov\" value=\"%.9g\"/>", json_value(fact, "fov", 0));
    }
    size_t used = strlen(fov);
    if (axis) {
        snprintf(fov + used, sizeof fov - used, "<string name=\"fov_axis\" value=\"%s\"/>", axis);
    }
    snprintf(text, sizeof text,
             "<scene version=\"3.0.0\"><sensor type=\"perspective\" id=\"camera\">%s<film type=\"hdrfilm\">"
             "<integer name=\"width\" value=\"%d\"/><integer name=\"height\" value=\"%d\"/></film></sensor></scene>",
             fov, (int)(aspect * 64), 64);
    rey_scene *scene = NULL;
    *result = facts_load(suite, text, &scene);
    double value = *result ? NAN : param_value(scene, "camera.x_fov", 0);
    rey_scene_destroy(scene);
    return value;
}

static void run_fov(Suite *suite, const char *name) {
    JsonNode *root = facts_read(suite, "sensor.json");
    const JsonNode *list = json_get(root, "fov");
    Tally t = {0};
    rey_result result = REY_OK;
    for (const JsonNode *fact = list ? list->first : NULL; fact && !result; fact = fact->next) {
        double expected = json_value(fact, "x_fov", 0);
        facts_tally(&t, "x_fov", scene_fov(suite, fact, &result), expected, 1e-5 * expected);
    }
    if (result) {
        suite_report_failure(suite, name, result, true);
    } else {
        facts_report(suite, name, &t);
    }
    json_free(root);
}

/* ---- film ------------------------------------------------------------------------------------------------------ */

static rey_result load_filter(Suite *suite, const char *type, const char *inside, rey_scene **scene) {
    char text[1024];
    snprintf(text, sizeof text,
             "<scene version=\"3.0.0\"><sensor type=\"perspective\"><film type=\"hdrfilm\"><rfilter "
             "type=\"%s\">%s</rfilter></film>"
             "</sensor></scene>",
             type, inside);
    return facts_load(suite, text, scene);
}

static void run_filters(Suite *suite, const char *name) {
    JsonNode *root = facts_read(suite, "film.json");
    const JsonNode *list = json_get(root, "rfilter");
    Tally t = {0};
    rey_result result = REY_OK;
    for (const JsonNode *fact = list ? list->first : NULL; fact && !result; fact = fact->next) {
        const char *type = json_text(fact, "type", "");
        rey_scene *scene = NULL;
        result = load_filter(suite, type, "", &scene);
        const JsonNode *at = json_get(fact, "at");
        for (const JsonNode *p = at ? at->first : NULL; p && !result; p = p->next) {
            const SensorRecord *sensor = scene->view.sensors;
            double x = facts_item(p, 0), tolerance = facts_item(p, 2);
            double value = x > (double)sensor->filter_radius ? 0 : (double)filter_eval(sensor, (float)x);
            facts_tally(&t, type, value, facts_item(p, 1), isnan(tolerance) ? 1e-5 : tolerance);
        }
        rey_scene_destroy(scene);
    }
    if (result) {
        suite_report_failure(suite, name, result, true);
    } else {
        facts_report(suite, name, &t);
    }
    json_free(root);
}

/* ---- lookups ---------------------------------------------------------------------------------------------------- */

static rey_result test_bitmap(Suite *suite, const JsonNode *fact, Tally *t) {
    static const double luminance[3] = {.212671, .715160, .072169};
    char text[8192];
    const char *file = json_text(fact, "file", "");
    const JsonNode *rgb = json_get(fact, "rgb"), *pixel = json_get(fact, "pixel");
    snprintf(
        text, sizeof text,
        "<scene version=\"3.0.0\"><path value=\"%s/data\"/><shape type=\"rectangle\"><bsdf type=\"diffuse\" id=\"b\">"
        "<texture type=\"bitmap\" name=\"reflectance\"><string name=\"filename\" "
        "value=\"%s\"/></texture></bsdf></shape></scene>",
        suite->folder, file);
    rey_scene *scene = NULL;
    rey_result result = facts_load(suite, text, &scene);
    int param = result ? -1 : rey_param_find(scene, "b.reflectance.data");
    if (!result && param < 0) {
        result = rey_fail(suite->ctx, REY_ERROR_PARAM, "there is no parameter b.reflectance.data");
    }
    if (!result) {
        rey_param_info info;
        rey_param_get_info(scene, param, &info);
        int64_t channels = info.shape[2],
                at = ((int64_t)facts_item(pixel, 1) * info.shape[1] + (int64_t)facts_item(pixel, 0)) * channels;
        double sum = 0;
        for (int64_t c = 0; c < channels && c < 3; c++) {
            double value = param_value(scene, "b.reflectance.data", at + c);
            sum += channels == 1 ? value : luminance[c] * value;
            if (rgb) {
                facts_tally(t, file, value, facts_item(rgb, (int)c), json_value(fact, "atol", 1e-4));
            }
        }
        if (!rgb) {
            facts_tally(t, file, sum, json_value(fact, "eval_1", NAN), json_value(fact, "atol", 1e-4));
        }
    }
    rey_scene_destroy(scene);
    return result;
}

static void run_bitmaps(Suite *suite, const char *name) {
    JsonNode *root = facts_read(suite, "textures_volumes_emitters.json");
    const JsonNode *list = json_get(root, "bitmap");
    Tally t = {0};
    rey_result result = REY_OK;
    for (const JsonNode *fact = list ? list->first : NULL; fact && !result; fact = fact->next) {
        char path[4096];
        const char *file = json_text(fact, "file", "");
        snprintf(path, sizeof path, "%s/data/%s", suite->folder, file);
        if (!strcmp(json_text(fact, "mode", "rgb"), "spectral")) {
            continue;
        }
        if (access(path, R_OK)) {
            suite_report(suite, name, VERDICT_SKIP, true, "there is no data/%s", file);
        } else {
            result = test_bitmap(suite, fact, &t);
        }
    }
    if (result) {
        suite_report_failure(suite, name, result, true);
    } else if (t.tested > 0) {
        facts_report(suite, name, &t);
    }
    json_free(root);
}

enum { ENV_WIDTH = 8, ENV_HEIGHT = 5 };

// Radiance in column and row coordinates: linear between columns (periodic) and rows (nodes at the poles).
static double envmap_at(const float *map, double u, double v) {
    double x = u * ENV_WIDTH - 0.5, y = v * (ENV_HEIGHT - 1);
    int x0 = (int)floor(x), y0 = (int)fmin(floor(y), ENV_HEIGHT - 2);
    double fx = x - x0, fy = y - y0, sum = 0;
    for (int i = 0; i < 4; i++) {
        int column = (x0 + (i & 1) + ENV_WIDTH) % ENV_WIDTH, row = y0 + (i >> 1);
        sum += (i & 1 ? fx : 1 - fx) * (i >> 1 ? fy : 1 - fy) * (double)map[(row * ENV_WIDTH + column) * 3];
    }
    return sum;
}

// What a camera with a very small field of view sees in direction (u, v): d = (sin 2 pi u sin pi v, cos pi v, -cos 2 pi
// u sin pi v).
static rey_result look_at_envmap(Suite *suite, const char *file, const float *map, double u, double v, Tally *t) {
    const double pi = 3.14159265358979323846;
    char text[4096];
    float image[3];
    snprintf(
        text, sizeof text,
        "<scene version=\"3.0.0\"><sensor type=\"perspective\"><float name=\"fov\" value=\"0.001\"/><transform "
        "name=\"to_world\">"
        "<lookat origin=\"0,0,0\" target=\"%.9g,%.9g,%.9g\" up=\"0.1,0.7,0.3\"/></transform><film type=\"hdrfilm\">"
        "<integer name=\"width\" value=\"1\"/><integer name=\"height\" value=\"1\"/><rfilter "
        "type=\"box\"/></film></sensor>"
        "<integrator type=\"path\"/><emitter type=\"envmap\"><string name=\"filename\" "
        "value=\"%s\"/></emitter></scene>",
        sin(2 * pi * u) * sin(pi * v), cos(pi * v), -cos(2 * pi * u) * sin(pi * v), file);
    rey_scene *scene = NULL;
    rey_result result = facts_load(suite, text, &scene);
    if (!result) {
        rey_render_def def = rey_default_render_def();
        def.spp = 16;
        result = rey_render(scene, &def, image, NULL);
    }
    if (!result) {
        facts_tally(t, "radiance", (double)image[0], envmap_at(map, u, v), 1e-3);
    }
    rey_scene_destroy(scene);
    return result;
}

static void run_envmap(Suite *suite, const char *name) {
    char file[] = "/tmp/reynolds-conformance-XXXXXX.exr";
    float map[ENV_WIDTH * ENV_HEIGHT * 3];
    for (int i = 0; i < ENV_WIDTH * ENV_HEIGHT * 3; i++) {
        map[i] = (float)((i / 3 * 37 % 41) / 41.0);
    }
    int descriptor = mkstemps(file, 4);
    rey_result result = descriptor < 0 ? rey_fail(suite->ctx, REY_ERROR_IO, "no temporary file could be made")
                                       : rey_exr_write(suite->ctx, file, map, ENV_WIDTH, ENV_HEIGHT, 3, NULL);
    Tally t = {0};
    for (int i = 0; i < 40 && !result; i++) { // includes the seam at u = 0, and the neighbourhood of both poles
        double u = i < 8 ? i / 8.0 : fmod(i * 0.618034, 1), v = i < 8 ? 0.4 : 0.002 + 0.996 * fmod(i * 0.754878, 1);
        result = look_at_envmap(suite, file, map, u, v, &t);
    }
    if (result) {
        suite_report_failure(suite, name, result, true);
    } else {
        facts_report(suite, name, &t);
    }
    if (descriptor >= 0) {
        close(descriptor);
        unlink(file);
    }
}

/* ---- scenes that must load ------------------------------------------------------------------------------------ */

static void load_scene(Suite *suite, const char *folder, const char *group, const char *file) {
    char path[8192], name[1024];
    size_t length = strlen(file);
    snprintf(name, sizeof name, "load scenes/%s%s", group, file);
    if (length < 4 || strcmp(file + length - 4, ".xml") || !suite_selects(suite, name)) {
        return;
    }
    snprintf(path, sizeof path, "%s/%s", folder, file);
    rey_scene *scene = NULL;
    rey_result result = rey_scene_load(suite->ctx, path, NULL, 0, &scene);
    if (result) {
        suite_report_failure(suite, name, result, true);
    } else {
        rey_scene_info info;
        rey_scene_get_info(scene, &info);
        suite_report(suite, name, VERDICT_PASS, true, "%lld shapes, %lld parameters", (long long)info.shapes,
                     (long long)info.parameters);
    }
    rey_scene_destroy(scene);
}

// The scenes of a folder, and with deep those of the folders in it; their fragments are not scenes.
static void load_folder(Suite *suite, const char *folder, const char *group, bool deep) {
    struct dirent **entries = NULL;
    int count = scandir(folder, &entries, NULL, alphasort);
    for (int i = 0; i < count; i++) {
        const char *entry = entries[i]->d_name;
        load_scene(suite, folder, group, entry);
        if (deep && entry[0] != '.') {
            char inner[8192], inner_group[512];
            snprintf(inner, sizeof inner, "%s/%s", folder, entry);
            snprintf(inner_group, sizeof inner_group, "%s/", entry);
            load_folder(suite, inner, inner_group, false);
        }
        free(entries[i]);
    }
    free(entries);
}

void run_facts(Suite *suite) {
    static const struct {
        const char *name;
        const char *file; // that holds the numbers, empty = none
        void (*run)(Suite *suite, const char *name);
    } tables[] = {
        {"facts/named_ior", "named_ior.json", run_named_ior},
        {"facts/rgb_from_spectra metals", "rgb_from_spectra.json", run_metals},
        {"facts/spectra", "spectra.json", run_spectra},
        {"facts/sensor fov", "sensor.json", run_fov},
        {"facts/film filters", "film.json", run_filters},
        {"facts/textures bitmap", "textures_volumes_emitters.json", run_bitmaps},
        {"facts/emitters envmap", "", run_envmap},
        {"facts/volumes", "textures_volumes_emitters.json", run_volume_facts},
        {"facts/phases", "textures_volumes_emitters.json", run_phase_facts},
    };
    char folder[4096];
    snprintf(folder, sizeof folder, "%s/facts", suite->folder);
    for (int i = 0; i < COUNT_OF(tables) && !access(folder, R_OK); i++) {
        char path[4096 + 64];
        snprintf(path, sizeof path, "%s/%s", folder, tables[i].file);
        if (!suite_selects(suite, tables[i].name)) {
            continue;
        }
        if (tables[i].file[0] && access(path, R_OK)) {
            suite_report(suite, tables[i].name, VERDICT_SKIP, true, "there is no facts/%s", tables[i].file);
        } else {
            tables[i].run(suite, tables[i].name);
        }
    }
    snprintf(folder, sizeof folder, "%s/data/scenes", suite->folder);
    load_folder(suite, folder, "", true);
}
