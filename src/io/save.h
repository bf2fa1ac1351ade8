// save.h: Mitsuba 3 scene files, written.
#pragma once

#include "io/mesh.h"
#include "scene/scene.h"

// Writes the scene with its current values to path, and its data files into a folder beside it.
rey_result rey_mitsuba_save(const rey_scene *scene, const char *path);

// A mesh that takes the place of a shape's, whose positions have been set; it has positions and faces alone.
typedef struct SavedMesh {
    int32_t shape;
    rey_mesh mesh;
} SavedMesh;
rey_result rey_mitsuba_save_meshes(const rey_scene *scene, const char *path, const SavedMesh *meshes, int count);
