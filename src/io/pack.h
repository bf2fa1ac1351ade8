// pack.h: pictures whose numbers fit into 8 or 16 bits each, without loss (scene/texels.h).
#pragma once

#include "io/image.h"

typedef struct PackedImage {
    int32_t storage;      // TEXELS_
    unsigned char *bytes; // owned; null = not packed
} PackedImage;

// Packs a picture where every number stays what it is, and frees its floats then. srgb: the numbers are encoded, and are
// decoded when they are read.
rey_result rey_image_pack(rey_context *ctx, rey_image *image, bool srgb, PackedImage *out);
// What packed numbers stand for.
void rey_pack_levels(float *levels);
