// fuzz_serialized.c: any bytes as a serialized file.
#include "fuzz_mesh.h"

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
