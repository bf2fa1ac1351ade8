// tensorboard.c: record = u64 length, checksum of it, bytes, checksum of them. Event: 1 wall time (double), 2 step
// (int64), 3 file version (string), 5 summary, 7 session (1 status, 1 = start); summary: 1 value; value: 1 tag, 2
// number (float), 4 image; image: 1 height, 2 width, 3 colour space (3 = RGB), 4 PNG bytes.
#include "fit/tensorboard.h"

#include "io/image.h"

#include <stdio.h>
#include <errno.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

struct TensorBoard {
    rey_context *ctx;
    FILE *file;
    char path[4200];
};

uint32_t rey_tensorboard_checksum(const void *bytes, size_t size) {
    uint32_t crc = 0xffffffffu;
    for (size_t i = 0; i < size; i++) {
        crc ^= ((const unsigned char *)bytes)[i];
        for (int bit = 0; bit < 8; bit++) {
            crc = crc >> 1 ^ (0x82f63b78u & (0u - (crc & 1u)));
        }
    }
    crc = ~crc;
    return (crc >> 15 | crc << 17) + 0xa282ead8u;
}

// A message that grows; `failed` is kept until the end.
typedef struct Message {
    rey_context *ctx;
    Array bytes;
    bool failed;
} Message;

static void put_bytes(Message *m, const void *bytes, size_t size) {
    unsigned char *end = size && !m->failed ? rey_array_push(m->ctx, &m->bytes, 1, size) : NULL;
    if (end) {
        memcpy(end, bytes, size);
    } else if (size) {
        m->failed = true;
    }
}

static void put_varint(Message *m, uint64_t value) {
    do {
        unsigned char byte = (unsigned char)((value & 127) | (value > 127 ? 128 : 0));
        put_bytes(m, &byte, 1);
        value >>= 7;
    } while (value);
}

enum { WIRE_VARINT = 0, WIRE_DOUBLE = 1, WIRE_BYTES = 2, WIRE_FLOAT = 5 };
static void put_key(Message *m, int field, int wire) {
    put_varint(m, (uint64_t)(field << 3 | wire));
}

static void put_field(Message *m, int field, const void *bytes, size_t size) {
    put_key(m, field, WIRE_BYTES);
    put_varint(m, size);
    put_bytes(m, bytes, size);
}

static void put_message(Message *m, int field, Message *inner) {
    put_field(m, field, inner->bytes.data, inner->bytes.count);
    m->failed = m->failed || inner->failed;
    rey_array_free(inner->ctx, &inner->bytes);
}

static Message begin_event(TensorBoard *board) {
    Message event = {.ctx = board->ctx};
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    double seconds = (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
    put_key(&event, 1, WIRE_DOUBLE);
    put_bytes(&event, &seconds, sizeof seconds);
    return event;
}

static rey_result write_event(TensorBoard *board, Message *event) {
    rey_result result = REY_OK;
    if (event->failed) {
        result = rey_fail_memory(board->ctx, event->bytes.count);
    } else {
        uint64_t length = event->bytes.count;
        uint32_t head = rey_tensorboard_checksum(&length, sizeof length);
        uint32_t tail = rey_tensorboard_checksum(event->bytes.data, event->bytes.count);
        bool written = fwrite(&length, sizeof length, 1, board->file) == 1 &&
                       fwrite(&head, sizeof head, 1, board->file) == 1 &&
                       fwrite(event->bytes.data, 1, length, board->file) == length &&
                       fwrite(&tail, sizeof tail, 1, board->file) == 1 && !fflush(board->file);
        result = written ? REY_OK : rey_fail(board->ctx, REY_ERROR_IO, "%s: cannot write: %s", board->path,
                                                 strerror(errno));
    }
    rey_array_free(board->ctx, &event->bytes);
    return result;
}

rey_result rey_tensorboard_open(rey_context *ctx, const char *folder, int64_t first, TensorBoard **out) {
    *out = NULL;
    TensorBoard *board = rey_alloc(ctx, sizeof *board);
    if (!board) {
        return REY_ERROR_MEMORY;
    }
    char host[256] = "localhost";
    gethostname(host, sizeof host - 1);
    board->ctx = ctx;
    snprintf(board->path, sizeof board->path, "%.3800s/events.out.tfevents.%lld.%s", folder, (long long)time(NULL),
             host);
    board->file = fopen(board->path, "ab");
    if (!board->file) {
        rey_result result = rey_fail(ctx, REY_ERROR_IO, "%s: cannot open for writing", board->path);
        rey_free(ctx, board);
        return result;
    }
    *out = board;
    Message event = begin_event(board);
    put_field(&event, 3, "brain.Event:2", strlen("brain.Event:2"));
    rey_result result = write_event(board, &event);
    if (result) {
        return result;
    }
    Message start = begin_event(board), session = {.ctx = ctx};
    put_key(&start, 2, WIRE_VARINT);
    put_varint(&start, (uint64_t)first);
    put_key(&session, 1, WIRE_VARINT);
    put_varint(&session, 1);
    put_message(&start, 7, &session);
    return write_event(board, &start);
}

// Puts a summary of one value into an event of this step. The value's own fields are in `value`, which is consumed.
static rey_result write_value(TensorBoard *board, int64_t step, Message *value) {
    Message event = begin_event(board), summary = {.ctx = board->ctx};
    put_key(&event, 2, WIRE_VARINT);
    put_varint(&event, (uint64_t)step);
    put_message(&summary, 1, value);
    put_message(&event, 5, &summary);
    return write_event(board, &event);
}

rey_result rey_tensorboard_scalar(TensorBoard *board, int64_t step, const char *tag, double number) {
    Message value = {.ctx = board->ctx};
    float single = (float)number;
    put_field(&value, 1, tag, strlen(tag));
    put_key(&value, 2, WIRE_FLOAT);
    put_bytes(&value, &single, sizeof single);
    return write_value(board, step, &value);
}

rey_result rey_tensorboard_image(TensorBoard *board, int64_t step, const char *tag, const float *rgb, int width,
                                 int height) {
    size_t pixels = (size_t)width * (size_t)height, size = 0;
    unsigned char *png = NULL, *rgb8 = rey_alloc_array(board->ctx, pixels, 3);
    rey_result result = rgb8 ? REY_OK : REY_ERROR_MEMORY;
    if (!result) {
        rey_image_to_srgb8(rgb, (int64_t)pixels, rgb8);
        result = rey_png_encode(board->ctx, rgb8, width, height, &png, &size);
    }
    if (!result) {
        Message image = {.ctx = board->ctx}, value = {.ctx = board->ctx};
        put_key(&image, 1, WIRE_VARINT);
        put_varint(&image, (uint64_t)height);
        put_key(&image, 2, WIRE_VARINT);
        put_varint(&image, (uint64_t)width);
        put_key(&image, 3, WIRE_VARINT);
        put_varint(&image, 3);
        put_field(&image, 4, png, size);
        put_field(&value, 1, tag, strlen(tag));
        put_message(&value, 4, &image);
        result = write_value(board, step, &value);
    }
    rey_free(board->ctx, rgb8);
    rey_free(board->ctx, png);
    return result;
}

void rey_tensorboard_close(TensorBoard *board) {
    if (board) {
        fclose(board->file);
        rey_free(board->ctx, board);
    }
}
