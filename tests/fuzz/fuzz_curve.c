// fuzz_curve.c: any bytes as a file of curves; the first byte says how many control points make a segment.
#include "fuzz.h"
#include "io/curve.h"

static void check_curves(const rey_curves *curves, int order) {
    check(curves->points.count > 0 && curves->segments.count > 0);
    check_floats(curves->points.data, 4 * (int64_t)curves->points.count);
    for (size_t i = 0; i < curves->segments.count; i++) {
        int32_t first = ARRAY_AT(curves->segments, int32_t, i);
        check(first >= 0 && (size_t)first + (size_t)order <= curves->points.count);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    rey_context *ctx;
    if (size == 0 || rey_context_create(NULL, &ctx)) {
        return 0;
    }
    rey_curves curves;
    int order = data[0] & 1 ? 2 : 4;
    if (rey_curves_read_memory(ctx, "fuzz.txt", (const char *)data + 1, size - 1, order, &curves) == REY_OK) {
        check_curves(&curves, order);
        rey_curves_free(ctx, &curves);
    }
    rey_context_destroy(ctx);
    return 0;
}
