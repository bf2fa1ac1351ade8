// fuzz_obj.c: any bytes as an OBJ file.
#include "fuzz_mesh.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    rey_context *ctx;
    if (rey_context_create(NULL, &ctx)) {
        return 0;
    }
    rey_mesh mesh;
    if (rey_mesh_read_obj_memory(ctx, "fuzz.obj", data, size, true, &mesh) == REY_OK) {
        check_mesh(&mesh);
        check(rey_mesh_compute_normals(ctx, &mesh) == REY_OK);
        check_mesh(&mesh);
        rey_mesh_free(ctx, &mesh);
    }
    rey_context_destroy(ctx);
    return 0;
}
