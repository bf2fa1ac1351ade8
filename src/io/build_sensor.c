// build_sensor.c: cameras, films and filters.
#include "io/build.h"
#include "io/number.h"

#include <string.h>

static const double to_radians = 3.14159265358979323846 / 180;

static const char *sensor_word(void *user, int i) {
    UNUSED(user);
    return i == 0 ? "perspective" : NULL;
}

static const char *filter_word(void *user, int i) {
    static const char *const words[] = {"box", "tent", "gaussian", "mitchell", "catmullrom", "lanczos"};
    UNUSED(user);
    return i < COUNT_OF(words) ? words[i] : NULL;
}

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
        TRY(rey_xml_get_int(b->ctx, node, "lobes", 1, 12, 3, &lobes));
        s->filter_radius = (float)lobes;
        break;
    default:
        break;
    }
    if (!(s->filter_radius > 0 && s->filter_radius <= 12)) {
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE, "the filter's radius is %g pixels, expected up to 12",
                            (double)s->filter_radius);
    }
    return rey_xml_check_unused(b->ctx, node, NULL, NULL);
}

static rey_result get_size(Builder *b, rey_xml_node *node, const char *name, int64_t low, int64_t high, int64_t otherwise,
                           int32_t *out) {
    int64_t value;
    TRY(rey_xml_get_int(b->ctx, node, name, low, high, otherwise, &value));
    *out = (int32_t)value;
    return REY_OK;
}

static rey_result build_film(Builder *b, rey_xml_node *node, SensorRecord *s) {
    static const char *const pixels[] = {"rgb", "rgba", "luminance", "luminance_alpha", "xyz", "xyza"};
    static const char *const components[] = {"float16", "float32", "uint32"};
    static const char *const files[] = {"openexr", "exr", "rgbe", "pfm"};
    enum { LARGEST = 32768 };
    int format;
    bool border;
    s->width = 768;
    s->height = 576;
    if (node && strcmp(node->type, "hdrfilm") != 0) {
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_UNSUPPORTED, "film '%s' is not supported, expected 'hdrfilm'",
                            node->type);
    }
    if (node) {
        TRY(get_size(b, node, "width", 1, LARGEST, 768, &s->width));
        TRY(get_size(b, node, "height", 1, LARGEST, 576, &s->height));
        TRY(get_size(b, node, "crop_offset_x", 0, s->width - 1, 0, &s->crop_x));
        TRY(get_size(b, node, "crop_offset_y", 0, s->height - 1, 0, &s->crop_y));
        TRY(get_size(b, node, "crop_width", 1, s->width - s->crop_x, s->width - s->crop_x, &s->crop_width));
        TRY(get_size(b, node, "crop_height", 1, s->height - s->crop_y, s->height - s->crop_y, &s->crop_height));
        TRY(rey_xml_get_choice(b->ctx, node, "pixel_format", pixels, COUNT_OF(pixels), 0, &format));
        if (format > 1) {
            return rey_xml_fail(b->ctx, node->at, REY_ERROR_UNSUPPORTED, "pixel_format '%s' is not supported yet, expected rgb",
                                pixels[format]);
        }
        TRY(rey_xml_get_choice(b->ctx, node, "component_format", components, COUNT_OF(components), 0, &format));
        TRY(rey_xml_get_choice(b->ctx, node, "file_format", files, COUNT_OF(files), 0, &format));
        TRY(rey_xml_get_bool(b->ctx, node, "sample_border", false, &border));
        s->sample_border = border;
    } else {
        s->crop_width = s->width;
        s->crop_height = s->height;
    }
    rey_xml_child *filter = node ? rey_xml_child_of(node, REY_XML_BIT(REY_XML_RFILTER), 0) : NULL;
    TRY(build_filter(b, filter ? filter->node : NULL, s));
    return node ? rey_xml_check_unused(b->ctx, node, NULL, NULL) : REY_OK;
}

// Horizontal field of view [degrees] from fov and its axis, or from a focal length in 35 mm equivalents.
rey_result build_field_of_view(Builder *b, rey_xml_node *node, double aspect, double *out) {
    static const char *const axes[] = {"x", "y", "diagonal", "smaller", "larger"};
    double fov = 0;
    int axis;
    const char *focal;
    TRY(rey_xml_get_choice(b->ctx, node, "fov_axis", axes, COUNT_OF(axes), 0, &axis));
    TRY(rey_xml_get_string(b->ctx, node, "focal_length", "50mm", &focal));
    if (rey_xml_has(node, "fov")) {
        if (rey_xml_has(node, "focal_length")) {
            return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE, "either 'fov' or 'focal_length' may be given");
        }
        TRY(rey_xml_get_float(b->ctx, node, "fov", 0, &fov));
    } else {
        const char *end = focal;
        double mm = 0;
        if (!rey_parse_real(focal, &end, &mm) || (*end && strcmp(end, "mm") != 0) || !(mm > 0)) {
            return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE, "focal_length is '%s', expected a length such as 50mm", focal);
        }
        fov = 2 * atan(sqrt(36.0 * 36 + 24 * 24) / (2 * mm)) / to_radians;
        axis = 2;
    }
    if (!(fov > 0 && fov < 180)) {
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE, "fov is %g, expected an angle in (0, 180) degrees", fov);
    }
    double t = tan(0.5 * fov * to_radians);
    bool vertical = axis == 1 || (axis == 3 && aspect > 1) || (axis == 4 && aspect < 1);
    if (vertical) {
        t *= aspect;
    } else if (axis == 2) {
        t /= sqrt(1 + 1 / (aspect * aspect));
    }
    *out = 2 * atan(t) / to_radians;
    return REY_OK;
}

static rey_result camera_numbers(Builder *b, rey_xml_node *node, const char *path, SensorRecord *s) {
    double fov = 0, x, y, near_clip, far_clip, ignored, pose[16];
    const char *const why = "a camera that moves or zooms moves silhouettes across the film";
    TRY(build_field_of_view(b, node, (double)s->width / s->height, &fov));
    TRY(rey_xml_get_float(b->ctx, node, "principal_point_offset_x", 0, &x));
    TRY(rey_xml_get_float(b->ctx, node, "principal_point_offset_y", 0, &y));
    TRY(rey_xml_get_float(b->ctx, node, "near_clip", 0.01, &near_clip));
    TRY(rey_xml_get_float(b->ctx, node, "far_clip", 10000, &far_clip));
    TRY(rey_xml_get_float(b->ctx, node, "focus_distance", 0, &ignored));
    TRY(rey_xml_get_float(b->ctx, node, "shutter_open", 0, &ignored));
    TRY(rey_xml_get_float(b->ctx, node, "shutter_close", 0, &ignored));
    if (!(near_clip > 0 && near_clip < far_clip)) {
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE, "near_clip %g and far_clip %g, expected 0 < near < far",
                            near_clip, far_clip);
    }
    s->near_clip = (float)near_clip;
    s->far_clip = (float)far_clip;
    TRY(rey_xml_get_transform(b->ctx, node, "to_world", pose));
    Param p = {PARAM_DEFAULTS, .terms = REY_TERM_INTERIOR | REY_TERM_PRIMARY, .why = why};
    TRY(build_pose(b, pose, path, p, &s->to_world));
    s->fov = rey_scene_append(b->scene, &b->scene->build.theta, sizeof(float), 3);
    if (s->fov < 0) {
        return REY_ERROR_MEMORY;
    }
    s->principal = s->fov + 1;
    static const char *const names[] = {"x_fov", "principal_point_offset_x", "principal_point_offset_y"};
    const double values[] = {fov, x, y};
    for (int k = 0; k < 3; k++) {
        char name[MAX_PATH_NAME];
        ARRAY_AT(b->scene->build.theta, float, s->fov + k) = (float)values[k];
        build_join(name, path, names[k]);
        p.theta = s->fov + k;
        p.count = 1;
        p.unit = k ? "film widths" : "degrees";
        p.description = k ? "shift of the principal point" : "horizontal field of view";
        if (k == 0) {
            p.low = 1e-3f;
            p.high = 179.9f;
        } else {
            p.low = -INFINITY;
            p.high = INFINITY;
        }
        if (rey_scene_add_param(b->scene, name, p) < 0) {
            return REY_ERROR_MEMORY;
        }
    }
    return REY_OK;
}

rey_result build_sensor(Builder *b, rey_xml_node *node, const char *path) {
    SensorRecord s = {.medium = -1};
    bool first;
    TRY(build_visit(b, node, path, &first));
    if (strcmp(node->type, "perspective") != 0) {
        return build_unknown(b, node, sensor_word, NULL);
    }
    rey_xml_child *medium = rey_xml_child_of(node, REY_XML_BIT(REY_XML_MEDIUM), 0);
    if (medium) {
        return rey_xml_fail(b->ctx, medium->at, REY_ERROR_UNSUPPORTED, "participating media are not supported yet");
    }
    rey_xml_child *film = rey_xml_child_of(node, REY_XML_BIT(REY_XML_FILM), 0);
    rey_xml_child *sampler = rey_xml_child_of(node, REY_XML_BIT(REY_XML_SAMPLER), 0);
    TRY(build_film(b, film ? film->node : NULL, &s));
    TRY(build_sampler(b, sampler ? sampler->node : NULL, &s));
    TRY(camera_numbers(b, node, path, &s));
    int32_t id = rey_scene_append(b->scene, &b->scene->build.sensors, sizeof s, 1);
    if (id < 0) {
        return REY_ERROR_MEMORY;
    }
    ARRAY_AT(b->scene->build.sensors, SensorRecord, id) = s;
    node->built = id;
    TRY(rey_xml_check_unused(b->ctx, node, NULL, NULL));
    return build_finish(b, node, path);
}
