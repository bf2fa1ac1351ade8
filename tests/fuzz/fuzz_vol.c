// fuzz_vol.c: any bytes as a grid of numbers, in VOL and NPY files.
#include "fuzz.h"
#include "io/npy.h"
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
    rey_npy npy;
    if (rey_npy_header(ctx, "fuzz.npy", data, size, size, &npy) == REY_OK) {
        float value;
        check(npy.count >= 0 && npy.dims <= NPY_MOST_DIMS);
        for (int64_t i = 0; i < npy.count && i < 1 << 16; i++) {
            const uint8_t *at = data + npy.data + (size_t)npy.item * (size_t)i;
            check(rey_npy_decode(ctx, "fuzz.npy", npy.item, at, (size_t)i, 1, &value) != REY_OK || isfinite(value));
        }
    }
    rey_context_destroy(ctx);
    return 0;
}
