// facts_media.c: lookups in volumes, and values of phase functions, of scenes that were loaded, in double.
#include "facts.h"

#include "io/image.h"
#include "medium/phase.h"
#include "render/update.h"
#include "scene/volume.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { MOST = 256 };

// ---- volumes -----------------------------------------------------------------------------------------------------

typedef struct Grid {
    int n[3]; // z, y, x
    float values[MOST];
} Grid;

// Sets the values of a part of the grid; an index of -1 stands for all along that axis.
static void set(Grid *g, int z, int y, int x, float value) {
    for (int i = 0; i < g->n[0] * g->n[1] * g->n[2]; i++) {
        int at[3] = {i / g->n[2] / g->n[1], i / g->n[2] % g->n[1], i % g->n[2]};
        if ((z < 0 || at[0] == z) && (y < 0 || at[1] == y) && (x < 0 || at[2] == x)) {
            g->values[i] = value;
        }
    }
}

// "1; then [0,0,0]=0,[:,7,:]=.55 in this order", or ".9, [:,0,:]=0".
static void set_by_text(Grid *g, const char *text) {
    float value;
    if (sscanf(text, "%f", &value) == 1) {
        set(g, -1, -1, -1, value);
    }
    for (text = strchr(text, '['); text; text = strchr(text + 1, '[')) {
        char part[3][8];
        int index[3];
        if (sscanf(text, "[%7[^,],%7[^,],%7[^]]]=%f", part[0], part[1], part[2], &value) != 4) {
            continue;
        }
        for (int k = 0; k < 3; k++) {
            index[k] = sscanf(part[k], "%d", &index[k]) == 1 ? index[k] : -1;
        }
        set(g, index[0], index[1], index[2], value);
    }
}

static rey_result test_grid(Suite *suite, const JsonNode *fact, const char *file, Tally *t) {
    char text[2048];
    Grid g = {.n = {0}};
    const JsonNode *shape = json_get(fact, "shape_zyx"), *fill = json_get(fact, "fill"), *list = json_get(fact, "overrides");
    for (int k = 0; k < 3; k++) {
        g.n[k] = (int)facts_item(shape, k);
    }
    if (g.n[0] < 1 || g.n[1] < 1 || g.n[2] < 1 || g.n[0] * g.n[1] * g.n[2] > MOST) {
        return rey_fail(suite->ctx, REY_ERROR_FORMAT, "a grid of the facts has no shape");
    }
    if (fill && fill->kind == JSON_NUMBER) {
        set(&g, -1, -1, -1, (float)fill->number);
    } else {
        set_by_text(&g, json_text(fact, "fill", ""));
    }
    for (const JsonNode *o = list ? list->first : NULL; o; o = o->next) {
        set(&g, (int)facts_item(o, 0), (int)facts_item(o, 1), (int)facts_item(o, 2), (float)facts_item(o, 3));
    }
    bool nearest = strncmp(json_text(fact, "filter", ""), "nearest", 7) == 0;
    const int64_t sizes[3] = {g.n[0], g.n[1], g.n[2]};
    rey_scene *scene = NULL;
    rey_result result = rey_npy_write(suite->ctx, file, g.values, sizes, 3);
    snprintf(text, sizeof text,
             "<scene version=\"3.0.0\"><volume type=\"gridvolume\"><string name=\"filename\" value=\"%s\"/>"
             "<string name=\"filter_type\" value=\"%s\"/></volume></scene>",
             file, nearest ? "nearest" : "trilinear");
    result = result ? result : facts_load(suite, text, &scene);
    result = result ? result : rey_scene_update(scene);
    const JsonNode *lookups = json_get(fact, "lookups");
    for (const JsonNode *l = lookups && !result ? lookups->first : NULL; l; l = l->next) {
        const VolumeNode *v = scene->view.volumes;
        Vec3 p = v3(facts_item(l->first, 0), facts_item(l->first, 1), facts_item(l->first, 2));
        facts_tally(t, "a voxel", volume_eval(&scene->view, v, volume_to_local(&scene->view, v, p, 1)).c[0], facts_item(l, 1),
                    1e-5);
    }
    rey_scene_destroy(scene);
    return result;
}

// The corners of the box are those of the unit cube.
static rey_result test_box(Suite *suite, const JsonNode *fact, Tally *t) {
    char text[1024];
    const JsonNode *scale = json_get(fact, "scale"), *box = json_get(fact, "bbox");
    rey_scene *scene = NULL;
    snprintf(text, sizeof text, "<scene version=\"3.0.0\"><volume type=\"constvolume\"><transform name=\"to_world\"><scale "
                                "x=\"%g\" y=\"%g\" z=\"%g\"/></transform></volume></scene>",
             facts_item(scale, 0), facts_item(scale, 1), facts_item(scale, 2));
    rey_result result = facts_load(suite, text, &scene);
    result = result ? result : rey_scene_update(scene);
    double expected = 0;
    for (const JsonNode *corner = box && !result ? box->first : NULL; corner; corner = corner->next, expected = 1) {
        Vec3 p = v3(facts_item(corner, 0), facts_item(corner, 1), facts_item(corner, 2));
        p = volume_to_local(&scene->view, scene->view.volumes, p, 1);
        facts_tally(t, "a corner", p.x, expected, 1e-5);
        facts_tally(t, "a corner", p.y, expected, 1e-5);
        facts_tally(t, "a corner", p.z, expected, 1e-5);
    }
    rey_scene_destroy(scene);
    return result;
}

void run_volume_facts(Suite *suite, const char *name) {
    char file[] = "/tmp/reynolds-conformance-XXXXXX.npy";
    int descriptor = mkstemps(file, 4);
    JsonNode *root = facts_read(suite, "textures_volumes_emitters.json");
    const JsonNode *list = json_get(root, "gridvolume"), *constant = json_get(root, "constvolume");
    Tally t = {0};
    rey_result result = descriptor < 0 ? rey_fail(suite->ctx, REY_ERROR_IO, "no temporary file could be made") : REY_OK;
    for (const JsonNode *fact = list ? list->first : NULL; fact && !result; fact = fact->next) {
        result = test_grid(suite, fact, file, &t);
    }
    result = result ? result : test_box(suite, json_get(constant, "example"), &t);
    if (result) {
        suite_report_failure(suite, name, result, true);
    } else {
        facts_report(suite, name, &t);
    }
    json_free(root);
    if (descriptor >= 0) {
        close(descriptor);
        unlink(file);
    }
}

// ---- phase functions ---------------------------------------------------------------------------------------------

// The values of a table as a phase function's property.
static void table_text(const JsonNode *values, char text[512]) {
    size_t used = (size_t)snprintf(text, 512, "<string name=\"values\" value=\"");
    for (const JsonNode *v = values ? values->first : NULL; v && used < 400; v = v->next) {
        used += (size_t)snprintf(text + used, 512 - used, "%g ", v->number);
    }
    snprintf(text + used, 512 - used, "\"/>");
}

static rey_result load_phase(Suite *suite, const char *type, const char *body, rey_scene **scene, PhaseCall *call) {
    char text[1024];
    snprintf(text, sizeof text, "<scene version=\"3.0.0\"><phase type=\"%s\">%s</phase></scene>", type, body);
    rey_result result = facts_load(suite, text, scene);
    result = result ? result : rey_scene_update(*scene);
    *call = (PhaseCall){.scene = result ? NULL : &(*scene)->view};
    return result;
}

// The value at a cosine of the angle of scattering.
static double phase_at(const PhaseCall *call, double cosine) {
    return phase_eval(call, v3(0, 0, 1), v3(sqrt(fmax(0, 1 - cosine * cosine)), 0, -cosine));
}

static rey_result test_isotropic(Suite *suite, const JsonNode *fact, Tally *t) {
    rey_scene *scene = NULL;
    PhaseCall call;
    rey_result result = load_phase(suite, "isotropic", "", &scene, &call);
    if (!result) {
        facts_tally(t, "isotropic", phase_at(&call, 0.3), json_value(fact, "isotropic", NAN), 1e-6);
    }
    rey_scene_destroy(scene);
    return result;
}

static rey_result test_table(Suite *suite, const JsonNode *fact, Tally *t) {
    char text[512];
    rey_scene *scene = NULL;
    PhaseCall call;
    const JsonNode *table = json_get(fact, "tabphase");
    table_text(json_get(table, "values"), text);
    rey_result result = load_phase(suite, "tabphase", text, &scene, &call);
    if (!result) {
        facts_tally(t, "tabphase", phase_at(&call, 1), json_value(table, "at_cos_1", NAN), 1e-6);
    }
    rey_scene_destroy(scene);
    scene = NULL;
    const JsonNode *draw = json_get(fact, "tabphase_sample"), *u = json_get(draw, "sample2"), *wi = json_get(draw, "wi"),
                   *wo = json_get(draw, "wo");
    table_text(json_get(draw, "values"), text);
    result = result ? result : load_phase(suite, "tabphase", text, &scene, &call);
    if (!result) {
        Vec3 from = v3(facts_item(wi, 0), facts_item(wi, 1), facts_item(wi, 2));
        Vec3 d = phase_sample(&call, from, 0.5, (Vec2){facts_item(u, 0), facts_item(u, 1)});
        facts_tally(t, "tabphase_sample", d.x, facts_item(wo, 0), 1e-5);
        facts_tally(t, "tabphase_sample", d.y, facts_item(wo, 1), 1e-5);
        facts_tally(t, "tabphase_sample", d.z, facts_item(wo, 2), 1e-5);
        facts_tally(t, "tabphase_sample", phase_pdf(&call, from, d), json_value(draw, "pdf", NAN), 1e-5);
    }
    rey_scene_destroy(scene);
    return result;
}

// Integrates to 1, and scatters forward for g > 0.
static rey_result test_hg(Suite *suite, Tally *t) {
    enum { STEPS = 20000 };
    rey_scene *scene = NULL;
    PhaseCall call;
    rey_result result = load_phase(suite, "hg", "<float name=\"g\" value=\"0.7\"/>", &scene, &call);
    double sum = 0;
    for (int i = 0; i < STEPS && !result; i++) {
        sum += phase_at(&call, -1 + 2 * (i + 0.5) / STEPS) * (2 * TWO_PI / STEPS);
    }
    if (!result) {
        facts_tally(t, "hg", sum, 1, 1e-4);
        facts_tally(t, "hg", phase_at(&call, 1) > phase_at(&call, -1), 1, 1e-9);
    }
    rey_scene_destroy(scene);
    return result;
}

void run_phase_facts(Suite *suite, const char *name) {
    JsonNode *root = facts_read(suite, "textures_volumes_emitters.json");
    const JsonNode *fact = json_get(root, "phase");
    Tally t = {0};
    rey_result result = test_isotropic(suite, fact, &t);
    result = result ? result : test_table(suite, fact, &t);
    result = result ? result : test_hg(suite, &t);
    if (result) {
        suite_report_failure(suite, name, result, true);
    } else {
        facts_report(suite, name, &t);
    }
    json_free(root);
}
