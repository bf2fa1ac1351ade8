// fuzz_image.c: any bytes as a picture. Nothing may crash, leak or take long; what is accepted must be consistent.
#include "base/context.h"
#include "io/image.h"

#include <stdlib.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void check(bool holds) {
    if (!holds) {
        abort();
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    rey_context *ctx;
    if (rey_context_create(NULL, &ctx)) {
        return 0;
    }
    rey_image image;
    if (rey_image_read_memory(ctx, "fuzz.picture", data, size, &image) == REY_OK) {
        check(image.data && image.width > 0 && image.height > 0 && image.channels > 0 && image.channels <= 64);
        check(rey_image_to_rgb(ctx, "fuzz.picture", &image) == REY_OK ? image.channels == 3 : image.channels == 2);
        rey_image_decode_srgb(&image);
    } else {
        check(!image.data && rey_error(ctx)[0]);
    }
    rey_image_free(ctx, &image);
    rey_context_destroy(ctx);
    return 0;
}
