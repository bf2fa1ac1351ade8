// film_format.c: pictures as a film delivers them: grey, RGB or XYZ, with alpha or without.
#include "math/colour.h"
#include "render/render_parts.h"

#include <string.h>

typedef struct PixelFormat {
    int channels; // with alpha
    const char *const *names;
    bool alpha;
} PixelFormat;

static PixelFormat pixel_format(int32_t format) {
    static const char *const rgba[] = {"R", "G", "B", "A"}, *const ya[] = {"Y", "A"}, *const xyza[] = {"X", "Y", "Z", "A"};
    static const PixelFormat formats[PIXEL_FORMATS] = {
        [PIXEL_RGB] = {3, rgba, false},    [PIXEL_RGBA] = {4, rgba, true},
        [PIXEL_LUMINANCE] = {1, ya, false}, [PIXEL_LUMINANCE_ALPHA] = {2, ya, true},
        [PIXEL_XYZ] = {3, xyza, false},    [PIXEL_XYZA] = {4, xyza, true},
    };
    return formats[format];
}

static const SensorRecord *find_sensor(const rey_scene *scene, int sensor) {
    return scene && sensor >= 0 && sensor < scene->view.sensors_count ? scene->view.sensors + sensor : NULL;
}

int rey_film_channel_count(const rey_scene *scene, int sensor) {
    const SensorRecord *s = find_sensor(scene, sensor);
    return s ? pixel_format(s->pixel_format).channels + rey_channel_count(scene) - 3 : 0;
}

const char *rey_film_channel_name(const rey_scene *scene, int sensor, int channel) {
    const SensorRecord *s = find_sensor(scene, sensor);
    if (!s || channel < 0) {
        return NULL;
    }
    PixelFormat format = pixel_format(s->pixel_format);
    return channel < format.channels ? format.names[channel] : rey_channel_name(scene, channel - format.channels + 3);
}

int rey_film_component(const rey_scene *scene, int sensor) {
    static_assert((int)REY_COMPONENT_FLOAT16 == (int)COMPONENT_FLOAT16 &&
                  (int)REY_COMPONENT_UINT32 == (int)COMPONENT_UINT32, "the same order");
    const SensorRecord *s = find_sensor(scene, sensor);
    return s ? s->component_format : -1;
}

static float xyz_of(const float *colour, int component) {
    const double rgb[3] = {(double)colour[0], (double)colour[1], (double)colour[2]};
    return (float)rey_xyz_of(rgb, component);
}

double rey_film_alpha(const double sums[2]) { return sums[1] > 0 ? fmin(fmax(sums[0] / sums[1], 0), 1) : 0; }

static void convert_pixel(int32_t format, const float *rgb, double alpha, float *out) {
    PixelFormat f = pixel_format(format);
    int colours = f.channels - f.alpha;
    for (int c = 0; c < colours; c++) {
        out[c] = f.names[0][0] == 'R' ? rgb[c] : xyz_of(rgb, colours == 1 ? 1 : c);
    }
    if (f.alpha) {
        out[colours] = (float)alpha;
    }
}

rey_result rey_render_film(rey_scene *scene, const rey_render_def *def, float *image, rey_stats *stats) {
    rey_result result = rey_begin(scene ? scene->ctx : NULL, image != NULL);
    if (result != REY_OK) {
        return result;
    }
    const SensorRecord *s = def ? find_sensor(scene, def->sensor) : NULL;
    if (!s || s->pixel_format == PIXEL_RGB) {
        return rey_render_channels(scene, def, image, stats);
    }
    rey_context *ctx = scene->ctx;
    PixelFormat format = pixel_format(s->pixel_format);
    int from = rey_channel_count(scene), more = from - 3, to = format.channels + more;
    size_t pixels = (size_t)s->crop_width * (size_t)s->crop_height;
    float *picture = rey_alloc_array(ctx, pixels * (size_t)from, sizeof *picture);
    double *alpha = format.alpha ? rey_alloc_array(ctx, pixels, 2 * sizeof *alpha) : NULL;
    result = picture && (alpha || !format.alpha) ? REY_OK : REY_ERROR_MEMORY;
    result = result ? result : rey_render_picture(scene, def, from, picture, alpha, stats);
    for (size_t i = 0; i < pixels && result == REY_OK; i++) {
        double a = alpha ? rey_film_alpha(alpha + 2 * i) : 1;
        convert_pixel(s->pixel_format, picture + i * (size_t)from, a, image + i * (size_t)to);
        memcpy(image + i * (size_t)to + format.channels, picture + i * (size_t)from + 3, (size_t)more * sizeof *image);
    }
    rey_free(ctx, picture);
    rey_free(ctx, alpha);
    return result;
}
