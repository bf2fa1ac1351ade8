// fuzz_vol.c: any bytes as a grid of numbers.
#include "fuzz.h"
#include "io/vol.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    rey_context *ctx;
    if (rey_context_create(NULL, &ctx)) {
        return 0;
    }
    rey_vol vol;
    if (rey_vol_read_memory(ctx, "fuzz.vol", data, size, &vol) == REY_OK) {
        check(vol.nx > 0 && vol.ny > 0 && vol.nz > 0 && vol.channels > 0);
        check_floats(vol.box, 6);
        check_floats(vol.data, (int64_t)vol.nx * vol.ny * vol.nz * vol.channels);
        rey_vol_free(ctx, &vol);
    }
    rey_context_destroy(ctx);
    return 0;
}
