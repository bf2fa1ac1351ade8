// converts.c: every scene that loads is written, loaded again, and must have the same parameters and picture, bit for
// bit. --quick leaves the pictures out.
#include "../folder.h"
#include "conformance.h"

#include "base/context.h"

#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

typedef struct Converts {
    Suite *suite;
    char folder[256]; // of the written scenes
    size_t root;      // length of the suite's folder
} Converts;

static bool same_parameters(const rey_scene *a, const rey_scene *b) {
    int count = rey_param_count(a);
    bool same = count == rey_param_count(b);
    for (int i = 0; i < count && same; i++) {
        rey_param_info x, y;
        same = !rey_param_get_info(a, i, &x) && !rey_param_get_info(b, i, &y) && strcmp(x.name, y.name) == 0 &&
               x.count == y.count &&
               memcmp(rey_param_values(a, i), rey_param_values(b, i), (size_t)x.count * sizeof(float)) == 0;
    }
    return same;
}

static rey_result picture(Suite *suite, rey_scene *scene, float **image, size_t *bytes) {
    rey_render_def def = rey_default_render_def();
    int width, height;
    def.spp = 1;
    rey_result result = rey_scene_film_size(scene, 0, &width, &height);
    *image = result ? NULL : suite_image(suite, width, height);
    if (!*image) {
        return result ? result : REY_ERROR_MEMORY;
    }
    *bytes = (size_t)width * (size_t)height * 3 * sizeof **image;
    return rey_render(scene, &def, *image, NULL);
}

static rey_result same_picture(Suite *suite, rey_scene *a, rey_scene *b, bool *same) {
    float *x = NULL, *y = NULL;
    size_t bytes = 0, other = 0;
    rey_result result = picture(suite, a, &x, &bytes);
    result = result ? result : picture(suite, b, &y, &other);
    *same = !result && bytes == other && memcmp(x, y, bytes) == 0;
    rey_free(suite->ctx, x);
    rey_free(suite->ctx, y);
    return result;
}

static void convert_scene(Converts *c, const char *path) {
    Suite *suite = c->suite;
    char name[4200], written[512];
    bool same = true;
    rey_scene *scene = NULL, *again = NULL;
    snprintf(name, sizeof name, "convert %s", path + c->root + 1);
    if (!suite_selects(suite, name) || rey_scene_load(suite->ctx, path, NULL, 0, &scene)) {
        return; // fragments, and what does not exist yet
    }
    snprintf(written, sizeof written, "%s/scene.xml", c->folder);
    rey_result result = rey_scene_save(scene, written);
    result = result ? result : rey_scene_load(suite->ctx, written, NULL, 0, &again);
    bool parameters = !result && same_parameters(scene, again);
    if (!result && !suite->quick && rey_scene_sensor_count(scene) > 0) {
        result = same_picture(suite, scene, again, &same);
    }
    if (result) {
        suite_report(suite, name, VERDICT_FAIL, true, "%s", rey_error(suite->ctx));
    } else {
        suite_report(suite, name, parameters && same ? VERDICT_PASS : VERDICT_FAIL, true, "%s",
                     !parameters ? "parameters differ" : same ? "same bits" : "pictures differ");
    }
    rey_scene_destroy(scene);
    rey_scene_destroy(again);
}

static void convert_folder(Converts *c, const char *folder) {
    struct dirent **entries = NULL;
    int count = scandir(folder, &entries, NULL, alphasort);
    for (int i = 0; i < count; i++) {
        char path[4096];
        struct stat info;
        size_t length = strlen(entries[i]->d_name);
        snprintf(path, sizeof path, "%s/%s", folder, entries[i]->d_name);
        if (entries[i]->d_name[0] != '.' && stat(path, &info) == 0 && S_ISDIR(info.st_mode)) {
            convert_folder(c, path);
        } else if (length > 4 && strcmp(entries[i]->d_name + length - 4, ".xml") == 0) {
            convert_scene(c, path);
        }
        free(entries[i]);
    }
    free(entries);
}

void run_converts(Suite *suite) {
    Converts c = {.suite = suite, .root = strlen(suite->folder)};
    const char *folder = getenv("TMPDIR");
    snprintf(c.folder, sizeof c.folder, "%s/reynolds-converts-XXXXXX", folder && folder[0] ? folder : "/tmp");
    if (!folder_make(c.folder)) {
        suite_report(suite, "convert", VERDICT_FAIL, true, "no temporary folder could be made");
        return;
    }
    convert_folder(&c, suite->folder);
    if (folder_remove(c.folder)) {
        suite_report(suite, "convert", VERDICT_FAIL, true, "%s could not be removed", c.folder);
    }
}
