// build_film.c: films and their reconstruction filters.
#include "io/build.h"
#include "io/lenient.h"
#include "sensor/filter.h"

#include <string.h>

static const char *filter_word(void *user, int i) {
    static const char *const words[] = {"box", "tent", "gaussian", "mitchell", "catmullrom", "lanczos"};
    UNUSED(user);
    return i < COUNT_OF(words) ? words[i] : NULL;
}

static const char *film_word(void *user, int i) {
    UNUSED(user);
    return i < 1 ? "hdrfilm" : NULL;
}

enum { MOST_LOBES = 12 }; // more would need a finer table of the filter

static rey_result build_filter(Builder *b, rey_xml_node *node, SensorRecord *s) {
    double a, c;
    int64_t lobes;
    int kind = -1;
    const char *type = node ? node->type : "gaussian";
    for (int i = 0; filter_word(NULL, i); i++) {
        kind = strcmp(type, filter_word(NULL, i)) == 0 ? i : kind;
    }
    if (kind < 0) {
        return build_unknown(b, node, filter_word, NULL);
    }
    s->filter = kind;
    s->filter_radius = kind == FILM_BOX ? 0.5f : 2;
    s->filter_a = 0.5f;
    if (kind == FILM_CATMULLROM) {
        s->filter_a = 0;
        s->filter_b = 0.5f;
    }
    if (!node) {
        return REY_OK;
    }
    switch (kind) {
    case FILM_TENT:
        TRY(rey_xml_get_float(b->ctx, node, "radius", 1, &a));
        s->filter_radius = (float)a;
        break;
    case FILM_GAUSSIAN:
        TRY(rey_xml_get_float(b->ctx, node, "stddev", 0.5, &a));
        s->filter_a = (float)a;
        s->filter_radius = (float)(4 * a);
        break;
    case FILM_MITCHELL:
        TRY(rey_xml_get_float(b->ctx, node, "B", 1.0 / 3, &a));
        TRY(rey_xml_get_float(b->ctx, node, "C", 1.0 / 3, &c));
        s->filter_a = (float)a;
        s->filter_b = (float)c;
        break;
    case FILM_LANCZOS:
        TRY(rey_xml_get_int(b->ctx, node, "lobes", 1, MOST_LOBES, 3, &lobes));
        s->filter_radius = (float)lobes;
        break;
    default:
        break;
    }
    if (!(s->filter_radius > 0 && s->filter_radius <= MOST_FILTER_RADIUS)) {
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE, "the filter's radius is %g pixels, expected up to %d",
                            (double)s->filter_radius, MOST_FILTER_RADIUS);
    }
    return build_check_unused(b, node);
}

static rey_result get_size(Builder *b, rey_xml_node *node, const char *name, int64_t low, int64_t high, int64_t otherwise,
                           int32_t *out) {
    int64_t value;
    TRY(rey_xml_get_int(b->ctx, node, name, low, high, otherwise, &value));
    *out = (int32_t)value;
    return REY_OK;
}

// The format's default of components is float16; files get float32 unless the scene says otherwise. What kind of file
// is written, the name of the output says.
static rey_result build_formats(Builder *b, rey_xml_node *node, SensorRecord *s) {
    static const char *const pixels[] = {"rgb", "rgba", "luminance", "luminance_alpha", "xyz", "xyza"};
    static const char *const components[] = {"float16", "float32", "uint32"};
    static const char *const files[] = {"openexr", "exr", "rgbe", "pfm"};
    enum { FILE_RGBE = 2, FILE_PFM = 3 };
    int pixel, component, file;
    TRY(rey_xml_get_choice(b->ctx, node, "pixel_format", pixels, COUNT_OF(pixels), PIXEL_RGB, &pixel));
    TRY(rey_xml_get_choice(b->ctx, node, "component_format", components, COUNT_OF(components), COMPONENT_FLOAT32,
                           &component));
    TRY(rey_xml_get_choice(b->ctx, node, "file_format", files, COUNT_OF(files), 0, &file));
    if (file >= FILE_RGBE) { // these know neither alpha nor XYZ nor other components
        pixel = file == FILE_PFM && pixel == PIXEL_LUMINANCE ? PIXEL_LUMINANCE : PIXEL_RGB;
        component = COMPONENT_FLOAT32;
    }
    s->pixel_format = pixel;
    s->component_format = component;
    return REY_OK;
}

rey_result build_film(Builder *b, rey_xml_node *node, SensorRecord *s) {
    enum { LARGEST = 32768 };
    bool border;
    s->component_format = COMPONENT_FLOAT32;
    s->width = 768;
    s->height = 576;
    if (node && strcmp(node->type, "hdrfilm") != 0) {
        return build_unknown(b, node, film_word, NULL);
    }
    if (node) {
        TRY(get_size(b, node, "width", 1, LARGEST, 768, &s->width));
        TRY(get_size(b, node, "height", 1, LARGEST, 576, &s->height));
        TRY(get_size(b, node, "crop_offset_x", 0, s->width - 1, 0, &s->crop_x));
        TRY(get_size(b, node, "crop_offset_y", 0, s->height - 1, 0, &s->crop_y));
        TRY(get_size(b, node, "crop_width", 1, s->width - s->crop_x, s->width - s->crop_x, &s->crop_width));
        TRY(get_size(b, node, "crop_height", 1, s->height - s->crop_y, s->height - s->crop_y, &s->crop_height));
        TRY(build_formats(b, node, s));
        TRY(rey_xml_get_bool(b->ctx, node, "sample_border", false, &border));
        s->sample_border = border;
    } else {
        s->crop_width = s->width;
        s->crop_height = s->height;
    }
    rey_xml_child *filter = node ? rey_xml_child_of(node, REY_XML_BIT(REY_XML_RFILTER), 0) : NULL;
    TRY(build_filter(b, filter ? filter->node : NULL, s));
    return node ? build_check_unused(b, node) : REY_OK;
}
