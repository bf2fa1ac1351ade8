// mitsuba.h: Mitsuba 3 scene files.
#pragma once

#include "scene/scene.h"

enum {
    LOAD_SPARE = 1,  // defines that the scene never uses are no error
    LOAD_LENIENT = 2 // nor is what cannot be read: it is left out, and listed in `ignored`
};

// Loads a scene; derived data is still to be brought up to date. The caller owns *out.
rey_result rey_mitsuba_load(rey_context *ctx, const char *path, const rey_define *defines, int define_count, int flags,
                            rey_scene **out);

// The file that a scene was read from.
const char *rey_mitsuba_file(const rey_scene *scene);

// Of char *: what a lenient reader left out, and why.
const Array *rey_mitsuba_ignored(const rey_scene *scene);

// One plugin that a scene's file declares; texts live as long as the scene.
typedef struct KindCount {
    int tag;
    const char *tag_name, *type; // "bsdf", "diffuse"
    int count;                   // objects, each once however often it is referred to
} KindCount;

// A file of meshes, pictures and the like that a scene reads and whose path begins so, symbolic links followed; null when there is
// none. The caller frees *out with rey_free.
rey_result rey_mitsuba_reads(const rey_scene *scene, const char *beginning, char **out);

// Index of the sensor of this id, -1 where there is none; the id of sensor `index`, null where it has none.
int rey_mitsuba_sensor(const rey_scene *scene, const char *id);
const char *rey_mitsuba_sensor_id(const rey_scene *scene, int index);
// "0 is 'front', 1 has no id": what there is, for messages.
void rey_mitsuba_list_sensors(const rey_scene *scene, char *text, size_t size);

// Whether a scene reads a file: its own one, what it includes, meshes, pictures, spectra and the like.
rey_result rey_mitsuba_reads_file(const rey_scene *scene, const char *path, bool *reads);

// Of KindCount, ordered by tag; the caller frees it with rey_array_free.
rey_result rey_mitsuba_kinds(const rey_scene *scene, Array *counts);
