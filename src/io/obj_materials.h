// obj_materials.h: which triangles of an OBJ file have which material.
#pragma once

#include "base/context.h"

// From this triangle on, until the next run: the material that `usemtl` names, "" before the first one.
typedef struct ObjRun {
    int64_t triangle;
    char *material;
} ObjRun;

// Runs of a file that rey_mesh_read_obj has read, in its order of triangles. *runs holds ObjRun; free it in any case.
rey_result rey_obj_materials(rey_context *ctx, const char *path, Array *runs);
void rey_obj_materials_free(rey_context *ctx, Array *runs);
