// tensorboard.h: TensorBoard event files: TFRecord framing around protocol-buffer events, written by hand.
#pragma once

#include "base/context.h"

typedef struct TensorBoard TensorBoard;

// Creates folder/events.out.tfevents.SECONDS.HOST. Steps from `first` on in older files of the folder no longer count.
// The caller closes *out with rey_tensorboard_close, also after a failure.
rey_result rey_tensorboard_open(rey_context *ctx, const char *folder, int64_t first, TensorBoard **out);
rey_result rey_tensorboard_scalar(TensorBoard *board, int64_t step, const char *tag, double value);
// Linear RGB, shown with the sRGB curve.
rey_result rey_tensorboard_image(TensorBoard *board, int64_t step, const char *tag, const float *rgb, int width,
                                 int height);
void rey_tensorboard_close(TensorBoard *board); // accepts null

// The checksum of both: CRC-32C, rotated and offset.
uint32_t rey_tensorboard_checksum(const void *bytes, size_t size);
