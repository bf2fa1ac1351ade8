// save.h: Mitsuba 3 scene files, written.
#pragma once

#include "io/mesh.h"
#include "scene/scene.h"

// Writes the scene with its current values to path, and its data files into a folder beside it.
rey_result rey_mitsuba_save(const rey_scene *scene, const char *path);
// The same, for a path that a user names: where there is no file yet, what lies in the folder beside it is somebody else's, and a
// file of it that would be replaced is an error.
rey_result rey_mitsuba_save_anew(const rey_scene *scene, const char *path);

// A mesh that takes the place of a shape's, whose positions have been set; it has positions and faces alone.
typedef struct SavedMesh {
    int32_t shape;
    rey_mesh mesh;
} SavedMesh;
// A grid that takes the place of a volume's, whose values have been set; of its channels.
typedef struct SavedGrid {
    int32_t volume;
    int32_t nx, ny, nz;
    float *values; // channel fastest, then x, y, z
} SavedGrid;
typedef struct SavedParts {
    const SavedMesh *meshes;
    int mesh_count;
    const SavedGrid *grids;
    int grid_count;
} SavedParts;
rey_result rey_mitsuba_save_parts(const rey_scene *scene, const char *path, SavedParts parts);
