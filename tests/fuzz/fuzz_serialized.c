// fuzz_serialized.c: any bytes as a serialized file. Nothing may crash, leak or take long; what is accepted is checked.
#include "base/context.h"
#include "io/mesh.h"

#include <math.h>
#include <stdlib.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void check(bool holds) {
    if (!holds) {
        abort();
    }
}

static void check_floats(const float *values, int64_t count) {
    for (int64_t i = 0; values && i < count; i++) {
        check(isfinite(values[i]));
    }
}

static void check_mesh(const rey_mesh *mesh) {
    check(mesh->vertex_count > 0 && mesh->face_count > 0 && mesh->positions != NULL);
    for (int64_t i = 0; i < 3 * mesh->face_count; i++) {
        check(mesh->faces[i] < mesh->vertex_count);
    }
    for (int64_t i = 0; i < mesh->vertex_count; i++) {
        check(mesh->position_index[i] <= i && mesh->position_index[mesh->position_index[i]] == mesh->position_index[i]);
    }
    check_floats(mesh->positions, 3 * mesh->vertex_count);
    check_floats(mesh->normals, 3 * mesh->vertex_count);
    check_floats(mesh->uvs, 2 * mesh->vertex_count);
    for (int i = 0; i < mesh->attribute_count; i++) {
        const rey_mesh_attribute *attribute = &mesh->attributes[i];
        int64_t count = attribute->per_face ? mesh->face_count : mesh->vertex_count;
        check_floats(attribute->data, count * attribute->channels);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    rey_context *ctx;
    if (rey_context_create(NULL, &ctx)) {
        return 0;
    }
    rey_mesh mesh;
    for (int shape_index = 0; shape_index < 2; shape_index++) {
        if (rey_mesh_read_serialized_memory(ctx, "fuzz.serialized", data, size, shape_index, &mesh) == REY_OK) {
            check_mesh(&mesh);
            rey_mesh_free(ctx, &mesh);
        }
    }
    rey_context_destroy(ctx);
    return 0;
}
