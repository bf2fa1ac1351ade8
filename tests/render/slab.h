// slab.h: what the tests in slab.xml share: a slab of some medium, and means over many seeds of what is seen of it.
#pragma once

#include "rooms.h"

enum { PIXELS = 16, SETS = 16, MOST_DEFINES = 10 };

static int slab_estimator = REY_ESTIMATOR_PROBE;

static const double pi = 3.14159265358979323846;

typedef struct Case {
    const char *text; // of the message
    rey_define defines[MOST_DEFINES];
    double value[3];
    const char *param;
    float tangent[16];
    double derivative[3];
} Case;

static inline Room slab_open(const rey_define *defines, int threads) {
    rey_context_def def = rey_default_context_def();
    def.threads = threads;
    Room room;
    int count = 0;
    while (count < MOST_DEFINES && defines[count].name) {
        count++;
    }
    assert_int_equal(rey_context_create(&def, &room.ctx), REY_OK);
    if (rey_scene_load(room.ctx, RENDER_DIR "/slab.xml", defines, count, &room.scene) != REY_OK) {
        fail_msg("%s", rey_error(room.ctx));
    }
    return room;
}

// Mean over pixels and independent seeds, with its standard error; with tangent null of the picture.
static inline void mean_of(Room room, int param, const float *tangent, int spp, double *mean, double *error) {
    double sum[3] = {0}, squares[3] = {0};
    for (int s = 0; s < SETS; s++) {
        float image[3 * PIXELS];
        rey_render_def def = def_make(spp, (uint32_t)s, 1);
        def.estimator = slab_estimator;
        ok(room, tangent ? rey_jvp(room.scene, &def, (rey_selection){&param, 1}, tangent, image, NULL, NULL)
                         : rey_render(room.scene, &def, image, NULL));
        for (int c = 0; c < 3; c++) {
            double one = 0;
            for (int i = 0; i < PIXELS; i++) {
                one += (double)image[3 * i + c] / PIXELS;
            }
            sum[c] += one;
            squares[c] += one * one;
        }
    }
    for (int c = 0; c < 3; c++) {
        mean[c] = sum[c] / SETS;
        error[c] = sqrt(fmax(squares[c] / SETS - mean[c] * mean[c], 0) / (SETS - 1));
    }
}

static inline void define(Case *c, const char *name, const char *value) {
    int count = 0;
    while (c->defines[count].name && strcmp(c->defines[count].name, name) != 0) {
        count++;
    }
    assert_true(count < MOST_DEFINES);
    c->defines[count] = (rey_define){name, value};
}
