// exr.c: OpenEXR through the library's C core.
#include "io/file.h"
#include "io/image.h"

#include <ctype.h>
#include <openexr.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

enum { EXR_MOST_CHANNELS = 256 };

// What the library's callbacks see.
typedef struct Stream {
    rey_context *ctx;
    const char *name;
    const unsigned char *in; // reading
    size_t size;
    bool whole;              // nothing is cut off, although something is wrong
    bool no_memory;          // of our own; the core says so of damaged chunks, too
    float *dropped;          // where channels go that nobody asks for: the core's fast routines take no null for them
    int64_t dropped_room;
    Array out;               // writing
    char message[256];       // of the library, "" = none yet
} Stream;

// The core prints to stderr unless it is given a handler. The first message is the one that explains the others.
static void on_error(exr_const_context_t file, exr_result_t code, const char *message) {
    void *user = NULL;
    UNUSED(code);
    if (file && exr_get_user_data(file, &user) == EXR_ERR_SUCCESS && user) {
        Stream *s = user;
        if (!s->message[0]) {
            snprintf(s->message, sizeof s->message, "%s", message);
            rey_image_make_printable(s->message); // names of a broken file
        }
    }
}

// While it writes, the core calls its handler with the lock held that exr_get_user_data waits for: the code must do.
static void on_write_error(exr_const_context_t file, exr_result_t code, const char *message) {
    UNUSED(file);
    UNUSED(code);
    UNUSED(message);
}

static int64_t on_size(exr_const_context_t file, void *user) {
    UNUSED(file);
    return (int64_t)((Stream *)user)->size;
}

static int64_t on_read(exr_const_context_t file, void *user, void *buffer, uint64_t bytes, uint64_t offset,
                       exr_stream_error_func_ptr_t error) {
    const Stream *s = user;
    UNUSED(file);
    UNUSED(error);
    if (offset > s->size) {
        return -1;
    }
    uint64_t n = bytes < s->size - offset ? bytes : s->size - offset;
    memcpy(buffer, s->in + offset, n);
    return (int64_t)n;
}

static int64_t on_write(exr_const_context_t file, void *user, const void *buffer, uint64_t bytes, uint64_t offset,
                        exr_stream_error_func_ptr_t error) {
    Stream *s = user;
    UNUSED(file);
    UNUSED(error);
    if (offset + bytes > s->out.count && !rey_array_push(s->ctx, &s->out, 1, offset + bytes - s->out.count)) {
        return -1;
    }
    memcpy((char *)s->out.data + offset, buffer, bytes);
    return (int64_t)bytes;
}

static rey_result failed(Stream *s, exr_result_t code) {
    const char *message = s->message[0] ? s->message : exr_get_default_error_message(code);
    if (code == EXR_ERR_OUT_OF_MEMORY) {
        return s->no_memory || !s->whole
                   ? rey_fail(s->ctx, REY_ERROR_MEMORY, "%s: not enough memory for the picture", s->name)
                   : rey_fail(s->ctx, REY_ERROR_FORMAT, "%s: damaged, or needs more memory than there is; expected an OpenEXR file",
                              s->name);
    }
    if (code == EXR_ERR_FEATURE_NOT_IMPLEMENTED) {
        return rey_fail(s->ctx, REY_ERROR_UNSUPPORTED, "%s: %s; expected channels of full resolution that are compressed "
                       "by none, RLE, ZIP, PIZ, PXR24 or B44", s->name, message);
    }
    if (s->whole) {
        return rey_fail(s->ctx, REY_ERROR_FORMAT, "%s: damaged: %s; expected an OpenEXR file", s->name, message);
    }
    return s->in ? rey_fail(s->ctx, REY_ERROR_FORMAT, "%s: broken, or cut off after %zu bytes: %s; expected a whole OpenEXR file",
                            s->name, s->size, message)
                 : rey_fail(s->ctx, REY_ERROR_FORMAT, "%s: cannot be written: %s", s->name, message);
}

// Which channels of the file become the picture's: R G B, or X Y Z, or Y, or (layer.)R G B, or all.
typedef struct ChannelChoice {
    int count;
    bool xyz;                  // to be converted
    int at[EXR_MOST_CHANNELS]; // for each channel of the file, its place in the picture, -1 = dropped
} ChannelChoice;

static const char *base_name(const char *name) {
    const char *dot = strrchr(name, '.');
    return dot ? dot + 1 : name;
}

// The places of the unlayered channels that are called by three letters; true when all three are there, once.
static bool choose_three(const exr_attr_chlist_t *list, const char *letters, bool lower, ChannelChoice *choice) {
    int found = 0;
    for (int i = 0; i < list->num_channels; i++) {
        const char *name = list->entries[i].name.str;
        const int letter = lower ? toupper((unsigned char)name[0]) : name[0];
        const char *at = name[0] && !name[1] ? strchr(letters, letter) : NULL;
        choice->at[i] = at ? (int)(at - letters) : -1;
        found += at != NULL;
    }
    choice->count = found == 3 ? 3 : 0;
    return found == 3;
}

// Linear sRGB of CIE XYZ, white D65.
static void xyz_to_rgb(rey_image *image) {
    static const float rows[3][3] = {{3.240479f, -1.537150f, -0.498535f}, {-0.969256f, 1.875991f, 0.041556f},
                                     {0.055648f, -0.204043f, 1.057311f}};
    for (int64_t i = 0; i < (int64_t)image->width * image->height; i++) {
        float *p = image->data + 3 * i, xyz[3] = {p[0], p[1], p[2]};
        for (int c = 0; c < 3; c++) {
            p[c] = rows[c][0] * xyz[0] + rows[c][1] * xyz[1] + rows[c][2] * xyz[2];
        }
    }
}

static ChannelChoice choose_channels(const exr_attr_chlist_t *list) {
    static const char *const rgb[] = {"R", "G", "B"}, *const words[] = {"red", "green", "blue"};
    ChannelChoice choice = {0};
    if (choose_three(list, "RGB", false, &choice) || choose_three(list, "RGB", true, &choice)) {
        return choice;
    }
    if (choose_three(list, "XYZ", false, &choice)) {
        choice.xyz = true;
        return choice;
    }
    for (int layered = 0; layered < 2 && choice.count == 0; layered++) {
        bool taken[4] = {false};
        for (int i = 0; i < list->num_channels; i++) {
            const char *name = list->entries[i].name.str;
            const char *word = layered ? base_name(name) : name;
            choice.at[i] = -1;
            for (int c = 0; c < 3; c++) {
                if ((strcasecmp(word, rgb[c]) == 0 || strcasecmp(word, words[c]) == 0) && !taken[c]) {
                    choice.at[i] = c;
                    taken[c] = true;
                }
            }
            taken[3] |= strcmp(word, "Y") == 0;
        }
        if (taken[0] && taken[1] && taken[2]) {
            choice.count = 3;
        } else if (taken[3]) {
            choice.count = 1;
            bool first = true;
            for (int i = 0; i < list->num_channels; i++) {
                const char *name = list->entries[i].name.str;
                bool grey = strcmp(layered ? base_name(name) : name, "Y") == 0;
                choice.at[i] = grey && first ? 0 : -1;
                first = first && !grey;
            }
        }
    }
    if (choice.count == 0) {
        choice.count = list->num_channels;
        for (int i = 0; i < list->num_channels; i++) {
            choice.at[i] = i;
        }
    }
    return choice;
}

// Sends a channel of a chunk to where nobody looks; false: out of memory.
static bool drop_channel(Stream *s, exr_coding_channel_info_t *c) {
    int64_t room = (int64_t)c->width * c->height;
    if (room > s->dropped_room || !s->dropped) {
        rey_free(s->ctx, s->dropped);
        s->dropped = rey_alloc_array(s->ctx, (size_t)room + 1, sizeof *s->dropped);
        s->dropped_room = room;
    }
    c->user_data_type = EXR_PIXEL_FLOAT;
    c->user_bytes_per_element = 4;
    c->user_pixel_stride = 4;
    c->user_line_stride = 4 * c->width;
    c->decode_to_ptr = (uint8_t *)s->dropped;
    return s->dropped != NULL;
}

// Decodes one chunk (scanlines or a tile) into the picture at pixel (x, y).
static exr_result_t decode_chunk(Stream *s, exr_context_t file, const exr_chunk_info_t *chunk, exr_decode_pipeline_t *pipeline,
                                 bool fresh, const ChannelChoice *choice, rey_image *image, int64_t x, int64_t y) {
    exr_result_t code = fresh ? exr_decoding_initialize(file, 0, chunk, pipeline)
                              : exr_decoding_update(file, 0, chunk, pipeline);
    if (code != EXR_ERR_SUCCESS) {
        return code;
    }
    for (int i = 0; i < pipeline->channel_count; i++) {
        exr_coding_channel_info_t *c = &pipeline->channels[i];
        if (choice->at[i] < 0) {
            if (!drop_channel(s, c)) {
                s->no_memory = true;
                return EXR_ERR_OUT_OF_MEMORY;
            }
            continue;
        }
        if (c->x_samples != 1 || c->y_samples != 1 || x < 0 || y < 0 || x + c->width > image->width ||
            y + c->height > image->height) {
            return EXR_ERR_FEATURE_NOT_IMPLEMENTED;
        }
        c->user_data_type = EXR_PIXEL_FLOAT;
        c->user_bytes_per_element = 4;
        c->user_pixel_stride = image->channels * 4;
        c->user_line_stride = image->width * image->channels * 4;
        c->decode_to_ptr = (uint8_t *)(image->data + (y * image->width + x) * image->channels + choice->at[i]);
    }
    code = fresh ? exr_decoding_choose_default_routines(file, 0, pipeline) : EXR_ERR_SUCCESS;
    return code == EXR_ERR_SUCCESS ? exr_decoding_run(file, 0, pipeline) : code;
}

static exr_result_t read_scanlines(Stream *s, exr_context_t file, const exr_attr_box2i_t *window, const ChannelChoice *choice,
                                   rey_image *image) {
    exr_decode_pipeline_t pipeline = EXR_DECODE_PIPELINE_INITIALIZER;
    int32_t lines;
    exr_result_t code = exr_get_scanlines_per_chunk(file, 0, &lines);
    for (int64_t y = window->min.y; y <= window->max.y && code == EXR_ERR_SUCCESS; y += lines) {
        exr_chunk_info_t chunk;
        code = exr_read_scanline_chunk_info(file, 0, (int)y, &chunk);
        if (code == EXR_ERR_SUCCESS) {
            code = decode_chunk(s, file, &chunk, &pipeline, y == window->min.y, choice, image, 0, y - window->min.y);
        }
    }
    exr_decoding_destroy(file, &pipeline);
    return code;
}

static exr_result_t read_tiles(Stream *s, exr_context_t file, const ChannelChoice *choice, rey_image *image) {
    exr_decode_pipeline_t pipeline = EXR_DECODE_PIPELINE_INITIALIZER;
    int32_t width, height;
    exr_result_t code = exr_get_tile_sizes(file, 0, 0, 0, &width, &height);
    bool fresh = true;
    for (int64_t y = 0; y < image->height && code == EXR_ERR_SUCCESS; y += height) {
        for (int64_t x = 0; x < image->width && code == EXR_ERR_SUCCESS; x += width) {
            exr_chunk_info_t chunk;
            code = exr_read_tile_chunk_info(file, 0, (int)(x / width), (int)(y / height), 0, 0, &chunk);
            if (code == EXR_ERR_SUCCESS) {
                code = decode_chunk(s, file, &chunk, &pipeline, fresh, choice, image, x, y);
                fresh = false;
            }
        }
    }
    exr_decoding_destroy(file, &pipeline);
    return code;
}

// Whether the first and the last chunk are there, one of which ends the file.
static bool is_whole(exr_context_t file, exr_storage_t storage, const exr_attr_box2i_t *window) {
    exr_chunk_info_t chunk;
    if (storage == EXR_STORAGE_SCANLINE) {
        return exr_read_scanline_chunk_info(file, 0, window->min.y, &chunk) == EXR_ERR_SUCCESS &&
               exr_read_scanline_chunk_info(file, 0, window->max.y, &chunk) == EXR_ERR_SUCCESS;
    }
    int32_t width, height;
    return exr_get_tile_sizes(file, 0, 0, 0, &width, &height) == EXR_ERR_SUCCESS &&
           exr_read_tile_chunk_info(file, 0, 0, 0, 0, 0, &chunk) == EXR_ERR_SUCCESS &&
           exr_read_tile_chunk_info(file, 0, (window->max.x - window->min.x) / width, (window->max.y - window->min.y) / height,
                                    0, 0, &chunk) == EXR_ERR_SUCCESS;
}

static rey_result read_part(Stream *s, exr_context_t file, rey_image *out) {
    const exr_attr_chlist_t *list;
    exr_attr_box2i_t window;
    exr_storage_t storage;
    exr_result_t code = exr_get_channels(file, 0, &list);
    code = code == EXR_ERR_SUCCESS ? exr_get_data_window(file, 0, &window) : code;
    code = code == EXR_ERR_SUCCESS ? exr_get_storage(file, 0, &storage) : code;
    if (code != EXR_ERR_SUCCESS) {
        return failed(s, code);
    }
    if (list->num_channels < 1 || list->num_channels > EXR_MOST_CHANNELS ||
        (storage != EXR_STORAGE_SCANLINE && storage != EXR_STORAGE_TILED)) {
        return rey_fail(s->ctx, REY_ERROR_UNSUPPORTED, "%s: expected scanlines or tiles of 1 to %d channels", s->name,
                        EXR_MOST_CHANNELS);
    }
    for (int i = 0; i < list->num_channels; i++) {
        const char *chroma = base_name(list->entries[i].name.str);
        if (strcmp(chroma, "RY") == 0 || strcmp(chroma, "BY") == 0) {
            return rey_fail(s->ctx, REY_ERROR_UNSUPPORTED,
                            "%s: luminance and chroma (Y, RY, BY) are not read, expected R G B, X Y Z or Y alone", s->name);
        }
    }
    ChannelChoice choice = choose_channels(list);
    int64_t width = (int64_t)window.max.x - window.min.x + 1, height = (int64_t)window.max.y - window.min.y + 1;
    rey_result result = rey_image_check_claim(s->ctx, s->name, width, height, s->size);
    if (result == REY_OK) {
        result = rey_image_new(s->ctx, s->name, width, height, choice.count, out);
    }
    if (result != REY_OK) {
        return result;
    }
    code = storage == EXR_STORAGE_TILED ? read_tiles(s, file, &choice, out) : read_scanlines(s, file, &window, &choice, out);
    if (code == EXR_ERR_SUCCESS && choice.xyz) {
        xyz_to_rgb(out);
    }
    s->whole = code != EXR_ERR_SUCCESS && is_whole(file, storage, &window);
    return code == EXR_ERR_SUCCESS ? REY_OK : failed(s, code);
}

rey_result rey_exr_read(rey_context *ctx, const char *name, const unsigned char *bytes, size_t size, rey_image *out) {
    Stream stream = {.ctx = ctx, .name = name, .in = bytes, .size = size};
    exr_context_initializer_t options = EXR_DEFAULT_CONTEXT_INITIALIZER;
    exr_context_t file = NULL;
    options.error_handler_fn = on_error;
    options.user_data = &stream;
    options.read_fn = on_read;
    options.size_fn = on_size;
    options.max_image_width = options.max_image_height = IMAGE_LARGEST;
    exr_result_t code = exr_start_read(&file, name, &options);
    rey_result result = code == EXR_ERR_SUCCESS ? read_part(&stream, file, out) : failed(&stream, code);
    if (file) {
        exr_finish(&file);
    }
    rey_free(ctx, stream.dropped);
    return result;
}

// ---- writing -----------------------------------------------------------------------------------------------------

// The core wants channels sorted by name.
static void sort_channels(int channels, const char *const *names, int order[EXR_MOST_CHANNELS]) {
    for (int i = 0; i < channels; i++) {
        int j = i;
        for (; j > 0 && strcmp(names[order[j - 1]], names[i]) > 0; j--) {
            order[j] = order[j - 1];
        }
        order[j] = i;
    }
}

// Names of 32 characters and more are marked in the file.
static bool has_long_name(int channels, const char *const *names) {
    bool found = false;
    for (int i = 0; i < channels; i++) {
        found = found || strlen(names[i]) > 31;
    }
    return found;
}

typedef struct Compression {
    exr_result_t (*core)(exr_encode_pipeline_t *pipeline);
} Compression;

// Readers take a chunk that is as long as its raw data for raw data, which a compressed stream can be by chance:
// OpenEXR 3.1 writes such streams all the same (its issue 2306). They are replaced by the raw data.
static exr_result_t compress_chunk(exr_encode_pipeline_t *pipeline) {
    exr_result_t code = ((const Compression *)pipeline->encoding_user_data)->core(pipeline);
    if (code == EXR_ERR_SUCCESS && pipeline->compressed_bytes == pipeline->packed_bytes) {
        memcpy(pipeline->compressed_buffer, pipeline->packed_buffer, pipeline->packed_bytes);
    }
    return code;
}

static exr_result_t write_chunks(exr_context_t file, const float *data, int width, int height, int channels,
                                 const int *order) {
    exr_encode_pipeline_t pipeline = EXR_ENCODE_PIPELINE_INITIALIZER;
    Compression compression;
    int32_t lines;
    exr_result_t code = exr_get_scanlines_per_chunk(file, 0, &lines);
    for (int y = 0; y < height && code == EXR_ERR_SUCCESS; y += lines) {
        exr_chunk_info_t chunk;
        code = exr_write_scanline_chunk_info(file, 0, y, &chunk);
        if (code == EXR_ERR_SUCCESS) {
            code = y == 0 ? exr_encoding_initialize(file, 0, &chunk, &pipeline)
                          : exr_encoding_update(file, 0, &chunk, &pipeline);
        }
        for (int c = 0; c < channels && code == EXR_ERR_SUCCESS; c++) {
            exr_coding_channel_info_t *info = &pipeline.channels[c];
            info->user_data_type = EXR_PIXEL_FLOAT;
            info->user_bytes_per_element = 4;
            info->user_pixel_stride = channels * 4;
            info->user_line_stride = width * channels * 4;
            info->encode_from_ptr = (const uint8_t *)(data + (int64_t)y * width * channels + order[c]);
        }
        if (code == EXR_ERR_SUCCESS && y == 0) {
            code = exr_encoding_choose_default_routines(file, 0, &pipeline);
            compression.core = pipeline.compress_fn;
            pipeline.compress_fn = compress_chunk;
            pipeline.encoding_user_data = &compression;
        }
        code = code == EXR_ERR_SUCCESS ? exr_encoding_run(file, 0, &pipeline) : code;
    }
    exr_encoding_destroy(file, &pipeline);
    return code;
}

rey_result rey_exr_write(rey_context *ctx, const char *path, const float *data, int width, int height, int channels,
                         const char *const *names) {
    return rey_exr_write_as(ctx, path, data, width, height, channels, names, REY_COMPONENT_FLOAT32);
}

rey_result rey_exr_write_as(rey_context *ctx, const char *path, const float *data, int width, int height, int channels,
                            const char *const *names, int component) {
    static const exr_pixel_type_t types[] = {[REY_COMPONENT_FLOAT16] = EXR_PIXEL_HALF,
                                             [REY_COMPONENT_FLOAT32] = EXR_PIXEL_FLOAT,
                                             [REY_COMPONENT_UINT32] = EXR_PIXEL_UINT};
    static const char *const rgb[] = {"R", "G", "B"}, *const grey[] = {"Y"};
    int order[EXR_MOST_CHANNELS], part;
    Stream stream = {.ctx = ctx, .name = path};
    exr_context_initializer_t options = EXR_DEFAULT_CONTEXT_INITIALIZER;
    exr_context_t file = NULL;
    if (!names) {
        names = channels == 1 ? grey : rgb;
    }
    if (channels > EXR_MOST_CHANNELS) {
        return rey_fail(ctx, REY_ERROR_UNSUPPORTED, "%s: a picture of %d channels, expected up to %d", path, channels,
                        EXR_MOST_CHANNELS);
    }
    options.error_handler_fn = on_write_error;
    options.user_data = &stream;
    options.write_fn = on_write;
    sort_channels(channels, names, order);
    exr_result_t code = exr_start_write(&file, path, EXR_WRITE_FILE_DIRECTLY, &options);
    if (code == EXR_ERR_SUCCESS && has_long_name(channels, names)) {
        code = exr_set_longname_support(file, 1);
    }
    code = code == EXR_ERR_SUCCESS ? exr_add_part(file, "image", EXR_STORAGE_SCANLINE, &part) : code;
    if (code == EXR_ERR_SUCCESS) {
        code = exr_initialize_required_attr_simple(file, 0, width, height, EXR_COMPRESSION_ZIP);
    }
    for (int c = 0; c < channels && code == EXR_ERR_SUCCESS; c++) {
        code = exr_add_channel(file, 0, names[order[c]], types[component], EXR_PERCEPTUALLY_LINEAR, 1, 1);
    }
    code = code == EXR_ERR_SUCCESS ? exr_write_header(file) : code;
    code = code == EXR_ERR_SUCCESS ? write_chunks(file, data, width, height, channels, order) : code;
    if (file) {
        exr_result_t end = exr_finish(&file);
        code = code == EXR_ERR_SUCCESS ? end : code;
    }
    rey_result result = code == EXR_ERR_SUCCESS ? rey_file_write(ctx, path, stream.out.data, stream.out.count)
                                                : failed(&stream, code);
    rey_array_free(ctx, &stream.out);
    return result;
}
