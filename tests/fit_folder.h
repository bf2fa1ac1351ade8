// fit_folder.h: a folder of its own for the fits of a test, with what it fits to.
#pragma once

#include "fit/fit.h"
#include "folder.h"
#include "io/file.h"
#include "io/image.h"

#include <string.h>

typedef struct Fixture {
    rey_context *ctx;
    char folder[64];
} Fixture;

// A context of two threads and a new folder; null on failure.
static inline Fixture *fixture_make(void) {
    Fixture *f = calloc(1, sizeof *f);
    rey_context_def def = rey_default_context_def();
    def.threads = 2;
    if (!f || rey_context_create(&def, &f->ctx)) {
        return NULL;
    }
    snprintf(f->folder, sizeof f->folder, "/tmp/reynolds_test_fit_XXXXXX");
    return folder_make(f->folder) ? f : NULL;
}

static inline int tear_down(void **state) {
    Fixture *f = *state;
    int status = folder_remove(f->folder);
    rey_context_destroy(f->ctx);
    free(f);
    return status;
}

static inline void path_of(const Fixture *f, const char *name, char path[128]) {
    snprintf(path, 128, "%s/%s", f->folder, name);
}

static inline int write_text(const Fixture *f, const char *name, const char *text) {
    char path[128];
    path_of(f, name, path);
    return rey_file_write(f->ctx, path, text, strlen(text));
}

// Renders truth.xml, whose films have size x size pixels, at most 8 x 8, into target_0.exr...
static inline int write_targets_of_truth(const Fixture *f, int views, int size, int spp) {
    char path[128], name[32];
    rey_scene *scene = NULL;
    path_of(f, "truth.xml", path);
    int wrong = rey_scene_load(f->ctx, path, NULL, 0, &scene);
    for (int v = 0; v < views && !wrong; v++) {
        float image[8 * 8 * 3];
        rey_render_def render = rey_default_render_def();
        render.spp = spp;
        render.seed = 77;
        render.sensor = v;
        snprintf(name, sizeof name, "target_%d.exr", v);
        path_of(f, name, path);
        wrong = rey_render(scene, &render, image, NULL) || rey_exr_write(f->ctx, path, image, size, size, 3, NULL);
    }
    rey_scene_destroy(scene);
    return wrong;
}
