// tensorboard.h: TensorBoard event files: TFRecord framing around protocol-buffer events, written by hand.
#pragma once

#include "base/context.h"

typedef struct TensorBoard TensorBoard;

// Creates folder/events.out.tfevents.SECONDS.HOST. The caller closes it with rey_tensorboard_close.
rey_result rey_tensorboard_open(rey_context *ctx, const char *folder, TensorBoard **out);
rey_result rey_tensorboard_scalar(TensorBoard *board, int64_t step, const char *tag, double value);
// Linear RGB, shown with the sRGB curve.
rey_result rey_tensorboard_image(TensorBoard *board, int64_t step, const char *tag, const float *rgb, int width,
                                 int height);
void rey_tensorboard_close(TensorBoard *board); // accepts null

// The checksum of both: CRC-32C, rotated and offset.
uint32_t rey_tensorboard_checksum(const void *bytes, size_t size);
