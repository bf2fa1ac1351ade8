// fuzz_nvdb.c: any bytes as a NanoVDB file.
#include "fuzz.h"
#include "io/nvdb.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    rey_context *ctx;
    if (rey_context_create(NULL, &ctx)) {
        return 0;
    }
    rey_nvdb nvdb;
    if (rey_nvdb_open(ctx, "fuzz.nvdb", data, size, &nvdb) == REY_OK) {
        int64_t count = (int64_t)nvdb.nx * nvdb.ny * nvdb.nz * nvdb.channels;
        check(nvdb.nx > 0 && nvdb.ny > 0 && nvdb.nz > 0 && (nvdb.channels == 1 || nvdb.channels == 3));
        float *values = count < 1 << 24 ? rey_alloc_array(ctx, (size_t)count, sizeof *values) : NULL;
        if (values && rey_nvdb_read(ctx, "fuzz.nvdb", &nvdb, values) == REY_OK) {
            check_floats(values, count);
        }
        rey_free(ctx, values);
        rey_nvdb_free(ctx, &nvdb);
    }
    rey_context_destroy(ctx);
    return 0;
}
