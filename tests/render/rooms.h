// rooms.h: what the tests of whole renders share: the scenes of this folder and the pictures that they show, render
// settings, and the numbers of a test's own random sequence.
#pragma once

#include "../folder.h"
#include "io/image.h"
#include "reynolds/reynolds.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

enum { SIZE = 24, NUMBERS = SIZE * SIZE * 3 };

typedef struct Room {
    rey_context *ctx;
    rey_scene *scene;
} Room;

// splitmix64
static inline double uniform(uint64_t *state) {
    uint64_t z = (*state += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return (double)((z ^ (z >> 31)) >> 11) * 0x1p-53;
}

// [wallace1959]
static inline double normal_of_t(double t, double degrees) {
    double z = sqrt(degrees * log1p(t * t / degrees)) * (8 * degrees + 1) / (8 * degrees + 3);
    return t < 0 ? -z : z;
}

// The pictures that scenes ask for by name: random values in a range, only its ends, or the more the nearer the middle.
typedef enum PictureSort { ANY_VALUES, ONLY_ENDS, BRIGHT_MIDDLE } PictureSort;

typedef struct Picture {
    const char *name;
    int width, height, channels;
    double low, high;
    PictureSort sort;
} Picture;

static const Picture pictures[] = {{"texels", 4, 3, 3, 0.2, 0.8, ANY_VALUES},
                                   {"sky", 8, 5, 3, 0.1, 0.7, ANY_VALUES},
                                   {"grains", 3, 2, 1, 0.3, 0.7, ANY_VALUES},
                                   {"holes", 3, 3, 1, 0, 1, ONLY_ENDS},
                                   {"dawn", 8, 5, 3, 0.05, 2, BRIGHT_MIDDLE}};

static inline double picture_value(const Picture *p, int k, double u) {
    int x = k / p->channels % p->width, y = k / p->channels / p->width;
    double across = 1 - fabs(2 * (x + 0.5) / p->width - 1), down = (y + 0.5) / p->height;
    if (p->sort == BRIGHT_MIDDLE) {
        u = across * across * (1 - 0.8 * down) * (0.7 + 0.3 * u);
    }
    return p->low + (p->high - p->low) * (p->sort == ONLY_ENDS ? u < 0.25 : u);
}

enum { PICTURES = COUNT_OF(pictures), PATH = 64 };

static char pictures_folder[PATH / 2];

static inline void picture_path(int i, char path[PATH]) {
    snprintf(path, PATH, "%s/%s.exr", pictures_folder, pictures[i].name);
}

static inline int write_pictures(void **state) {
    UNUSED(state);
    rey_context *ctx = NULL;
    uint64_t random = 1;
    snprintf(pictures_folder, sizeof pictures_folder, "/tmp/reynolds_rooms_XXXXXX");
    rey_result result = folder_make(pictures_folder) ? rey_context_create(NULL, &ctx) : REY_ERROR_IO;
    for (int i = 0; i < PICTURES && result == REY_OK; i++) {
        const Picture *p = pictures + i;
        float values[128];
        char path[PATH];
        for (int k = 0; k < p->width * p->height * p->channels; k++) {
            values[k] = (float)picture_value(p, k, uniform(&random));
        }
        picture_path(i, path);
        result = rey_exr_write(ctx, path, values, p->width, p->height, p->channels, NULL);
    }
    rey_context_destroy(ctx);
    return result != REY_OK;
}

static inline int remove_pictures(void **state) {
    UNUSED(state);
    return folder_remove(pictures_folder);
}

// A scene of this folder with those pictures that its text names.
static inline rey_scene *room_load(rey_context *ctx, const char *file) {
    static char text[1 << 16], paths[PICTURES][PATH];
    char path[1024];
    snprintf(path, sizeof path, "%s/%s", RENDER_DIR, file);
    FILE *f = fopen(path, "r");
    assert_non_null(f);
    size_t length = fread(text, 1, sizeof text - 1, f);
    fclose(f);
    text[length] = 0;
    rey_define defines[PICTURES];
    int count = 0;
    for (int i = 0; i < PICTURES; i++) {
        char asked[32];
        snprintf(asked, sizeof asked, "$%s", pictures[i].name);
        if (strstr(text, asked)) {
            picture_path(i, paths[i]);
            defines[count++] = (rey_define){pictures[i].name, paths[i]};
        }
    }
    rey_scene *scene;
    if (rey_scene_load(ctx, path, defines, count, &scene) != REY_OK) {
        fail_msg("%s", rey_error(ctx));
    }
    return scene;
}

static inline Room room_open(const char *file, int threads, int lanes) {
    rey_context_def def = rey_default_context_def();
    def.threads = threads;
    def.lanes = lanes;
    Room room;
    assert_int_equal(rey_context_create(&def, &room.ctx), REY_OK);
    room.scene = room_load(room.ctx, file);
    return room;
}

// Texts one after another, up to a null.
static inline void write_texts(const char *path, const char *const *texts) {
    FILE *f = fopen(path, "w");
    assert_non_null(f);
    for (; *texts; texts++) {
        fputs(*texts, f);
    }
    assert_int_equal(fclose(f), 0);
}

// A scene from such texts.
static inline Room room_of(const char *const *texts, int threads, int lanes, const rey_define *defines, int count) {
    rey_context_def def = rey_default_context_def();
    char path[64];
    Room room;
    def.threads = threads;
    def.lanes = lanes;
    snprintf(path, sizeof path, "/tmp/reynolds_room_%ld.xml", (long)getpid());
    write_texts(path, texts);
    assert_int_equal(rey_context_create(&def, &room.ctx), REY_OK);
    rey_result result = rey_scene_load(room.ctx, path, defines, count, &room.scene);
    unlink(path);
    if (result != REY_OK) {
        fail_msg("%s", rey_error(room.ctx));
    }
    return room;
}

static inline void room_close(Room room) {
    rey_scene_destroy(room.scene);
    rey_context_destroy(room.ctx);
}

// The share of their samples that tests take, 1 unless REYNOLDS_TEST_EFFORT says otherwise: coarse errors show with fewer, too.
static inline double sample_share(void) {
    const char *text = getenv("REYNOLDS_TEST_EFFORT");
    return text ? strtod(text, NULL) : 1;
}

static inline rey_render_def def_make(int spp, uint32_t seed, int sets) {
    rey_render_def def = rey_default_render_def();
    def.spp = (int)ceil(spp * sample_share());
    def.seed = seed;
    def.sets = sets;
    def.terms = REY_TERM_INTERIOR;
    return def;
}

static inline void ok(Room room, rey_result result) {
    if (result != REY_OK) {
        fail_msg("%s", rey_error(room.ctx));
    }
}

// Numbers that take long to find: where the environment variable REYNOLDS_TEST_KEEP names a folder, they are kept there from
// run to run, as scripts/mutate.py wants, whose mutants do not change them.
static inline bool kept(const char *name, double *x, size_t n, bool write) {
    const char *folder = getenv("REYNOLDS_TEST_KEEP");
    char path[1024];
    snprintf(path, sizeof path, "%s/%s", folder ? folder : "", name);
    FILE *f = folder ? fopen(path, write ? "wb" : "rb") : NULL;
    bool done = f && (write ? fwrite(x, sizeof *x, n, f) : fread(x, sizeof *x, n, f)) == n;
    return f && fclose(f) == 0 && done;
}

// Of a group's tests those whose name begins with one of the arguments; all without any.
static inline size_t tests_asked(struct CMUnitTest *tests, size_t count, int argc, char **argv) {
    size_t asked = 0;
    for (size_t i = 0; i < count; i++) {
        bool wanted = argc < 2;
        for (int k = 1; k < argc; k++) {
            wanted = wanted || strncmp(tests[i].name, argv[k], strlen(argv[k])) == 0;
        }
        if (wanted) {
            tests[asked++] = tests[i];
        }
    }
    return asked;
}

// Whether the interior term is all that the parameter needs in these rooms.
static inline bool has_interior(const Room room, int param) {
    rey_param_info info;
    rey_param_get_info(room.scene, param, &info);
    // Of the rooms' normals only the lantern's turn away from the camera.
    bool lantern = strncmp(info.name, "lantern.", 8) == 0;
    int jumps = lantern ? 0 : REY_TERM_TERMINATOR;
    jumps |= strstr(info.name, ".normals") && !lantern ? REY_TERM_PRIMARY | REY_TERM_INDIRECT : 0;
    // Nothing stands in the way of lights with this name, and no border of what they cast is in the picture.
    int shadows = strncmp(info.name, "moving_", 7) == 0 ? REY_TERM_INDIRECT | REY_TERM_PRIMARY : 0;
    // Media move in the rooms of test_boundary.
    bool medium = strstr(info.name, "sigma_t.to_world") || strstr(info.name, "albedo.to_world") ||
                  (strncmp(info.name, "shape_", 6) == 0 && (strstr(info.name, "to_world") || strstr(info.name, "positions")));
    bool dropped = strcmp(info.name, "haze.to_world") == 0; // `path` drops light in that room
    return !medium && !dropped && (info.terms & ~jumps & ~shadows) == REY_TERM_INTERIOR;
}
