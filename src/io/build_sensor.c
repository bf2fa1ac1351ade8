// build_sensor.c: cameras.
#include "io/build.h"
#include "io/lenient.h"
#include "io/number.h"
#include "sensor/kinds.h"

#include <stdio.h>
#include <string.h>

static const double to_radians = 3.14159265358979323846 / 180;

// Names in the order of SENSOR_*.
static const char *const sensor_names[] = {
#define SENSOR(ENUM, prefix, name) name,
#include "sensor/kinds.inl"
#undef SENSOR
    "batch"};

static const char *sensor_word(void *user, int i) {
    UNUSED(user);
    return i < COUNT_OF(sensor_names) ? sensor_names[i] : NULL;
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
            return rey_xml_fail_value(b->ctx, node, "focal_length", "either 'fov' or 'focal_length' may be given");
        }
        TRY(rey_xml_get_float(b->ctx, node, "fov", 0, &fov));
    } else {
        const char *end = focal;
        double mm = 0;
        if (!rey_parse_real(focal, &end, &mm) || (*end && strcmp(end, "mm") != 0) || !(mm > 0)) {
            return rey_xml_fail_value(b->ctx, node, "focal_length", "focal_length is '%s', expected a length such as 50mm", focal);
        }
        fov = 2 * atan(sqrt(36.0 * 36 + 24 * 24) / (2 * mm)) / to_radians;
        axis = 2;
    }
    if (!(fov > 0 && fov < 180)) {
        return rey_xml_fail_value(b->ctx, node, "fov", "fov is %g, expected an angle in (0, 180) degrees", fov);
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

static const char *const why_moving = "a sensor that moves or zooms moves silhouettes across its film";

// Consecutive numbers of theta, each with a parameter of its own.
typedef struct SensorNumber {
    const char *name, *unit, *text;
    double value;
    float low, high;
    int32_t camera; // CAMERA_
} SensorNumber;

static rey_result add_numbers(Builder *b, const char *path, const SensorNumber *numbers, int n, int32_t *out) {
    *out = rey_scene_append(b->scene, &b->scene->build.theta, sizeof(float), n);
    for (int k = 0; k < n && *out >= 0; k++) {
        char name[MAX_PATH_NAME];
        ARRAY_AT(b->scene->build.theta, float, *out + k) = (float)numbers[k].value;
        build_join(name, path, numbers[k].name);
        Param p = {PARAM_DEFAULTS, .terms = REY_TERM_INTERIOR | REY_TERM_PRIMARY | REY_TERM_INDIRECT, .why = why_moving};
        p.theta = *out + k;
        p.count = 1;
        p.unit = numbers[k].unit;
        p.description = numbers[k].text;
        p.low = numbers[k].low;
        p.high = numbers[k].high;
        p.camera = numbers[k].camera;
        if (rey_scene_add_param(b->scene, name, p) < 0) {
            return REY_ERROR_MEMORY;
        }
    }
    return *out >= 0 ? REY_OK : REY_ERROR_MEMORY;
}

// A camera's axes must keep their lengths; directions are all that the others take from theirs.
static bool is_rigid(const double m[16]) {
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j <= i; j++) {
            double dot = m[i] * m[j] + m[4 + i] * m[4 + j] + m[8 + i] * m[8 + j];
            if (!(fabs(dot - (i == j)) < 1e-3)) {
                return false;
            }
        }
    }
    return true;
}

static rey_result clip_planes(Builder *b, rey_xml_node *node, SensorRecord *s) {
    double near_clip, far_clip;
    TRY(rey_xml_get_float(b->ctx, node, "near_clip", 0.01, &near_clip));
    TRY(rey_xml_get_float(b->ctx, node, "far_clip", 10000, &far_clip));
    if (!(near_clip > 0 && near_clip < far_clip)) {
        return rey_xml_fail_value(b->ctx, node, near_clip > 0 ? "far_clip" : "near_clip",
                                  "near_clip %g and far_clip %g, expected 0 < near < far", near_clip, far_clip);
    }
    s->near_clip = (float)near_clip;
    s->far_clip = (float)far_clip;
    return REY_OK;
}

static rey_result camera_numbers(Builder *b, rey_xml_node *node, const char *path, SensorRecord *s) {
    double fov = 0, x, y;
    TRY(build_field_of_view(b, node, (double)s->width / s->height, &fov));
    TRY(rey_xml_get_float(b->ctx, node, "principal_point_offset_x", 0, &x));
    TRY(rey_xml_get_float(b->ctx, node, "principal_point_offset_y", 0, &y));
    const SensorNumber numbers[] = {
        {"x_fov", "degrees", "horizontal field of view", fov, 1e-3f, 179.9f, CAMERA_FOV},
        {"principal_point_offset_x", "film widths", "shift of the principal point", x, -INFINITY, INFINITY, CAMERA_PRINCIPAL_X},
        {"principal_point_offset_y", "film widths", "shift of the principal point", y, -INFINITY, INFINITY, CAMERA_PRINCIPAL_Y}};
    TRY(add_numbers(b, path, numbers, COUNT_OF(numbers), &s->fov));
    s->principal = s->fov + 1;
    return REY_OK;
}

static rey_result lens_numbers(Builder *b, rey_xml_node *node, const char *path, SensorRecord *s) {
    double radius, focus;
    if (!rey_xml_has(node, "aperture_radius")) {
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE, "a thinlens needs its aperture_radius");
    }
    TRY(rey_xml_get_float(b->ctx, node, "aperture_radius", 0, &radius));
    TRY(rey_xml_get_float(b->ctx, node, "focus_distance", (double)s->far_clip, &focus));
    if (!(radius > 0) || !(focus > 0)) {
        return rey_xml_fail_value(b->ctx, node, radius > 0 ? "focus_distance" : "aperture_radius",
                                  "aperture_radius %g and focus_distance %g, expected positive numbers", radius, focus);
    }
    const SensorNumber numbers[] = {
        {"aperture_radius", "scene units", "radius of the aperture", radius, 1e-6f, INFINITY, CAMERA_APERTURE},
        {"focus_distance", "scene units", "distance along the axis that is sharp", focus, 1e-6f, INFINITY, CAMERA_FOCUS}};
    return add_numbers(b, path, numbers, COUNT_OF(numbers), &s->lens);
}

// to_world, or for sensors that only have a direction: that, and an origin.
static rey_result sensor_pose(Builder *b, rey_xml_node *node, const char *path, SensorRecord *s) {
    double pose[16], origin[3] = {0, 0, 0};
    bool meter = s->kind == SENSOR_RADIANCEMETER, camera = s->kind == SENSOR_PERSPECTIVE || s->kind == SENSOR_THINLENS;
    if ((meter || s->kind == SENSOR_DISTANT) && rey_xml_has(node, "direction")) {
        TRY(build_direction(b, node, pose));
        TRY(meter ? rey_xml_get_vec3(b->ctx, node, "origin", origin, origin) : REY_OK);
        for (int k = 0; k < 3; k++) {
            pose[4 * k + 3] = origin[k];
        }
    } else {
        TRY(rey_xml_get_transform(b->ctx, node, "to_world", pose));
    }
    if (camera && !is_rigid(pose)) {
        return rey_xml_fail_value(b->ctx, node, "to_world", "to_world of a %s may turn and move it, but not scale or shear it",
                                  node->type);
    }
    Param p = {PARAM_DEFAULTS, .terms = REY_TERM_INTERIOR | REY_TERM_PRIMARY | REY_TERM_INDIRECT, .why = why_moving};
    p.camera = s->kind == SENSOR_DISTANT ? -1 : CAMERA_POSE;
    return build_pose(b, pose, path, p, &s->to_world);
}

static rey_result distant_target(Builder *b, rey_xml_node *node, const char *path, SensorRecord *s) {
    double target[3] = {0, 0, 0};
    rey_xml_child *shape = rey_xml_child_of(node, REY_XML_BIT(REY_XML_SHAPE), 0);
    if (s->crop_width != 1 || s->crop_height != 1) {
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE, "the film of a %s has %d x %d pixels, expected 1 x 1",
                            node->type, (int)s->crop_width, (int)s->crop_height);
    }
    if (shape) {
        char name[MAX_PATH_NAME];
        build_join(name, path, "target");
        TRY(build_target_shape(b, shape->node, name, &s->shape));
        s->aim = SENSOR_AIM_SHAPE;
        return REY_OK;
    }
    s->aim = rey_xml_has(node, "target") ? SENSOR_AIM_POINT : SENSOR_AIM_SCENE;
    TRY(rey_xml_get_vec3(b->ctx, node, "target", target, target));
    for (int k = 0; k < 3; k++) {
        s->target[k] = (float)target[k];
    }
    return REY_OK;
}

static rey_result build_single(Builder *b, rey_xml_node *node, const char *path, SensorRecord *s) {
    double ignored;
    TRY(clip_planes(b, node, s));
    TRY(rey_xml_get_float(b->ctx, node, "shutter_open", 0, &ignored));
    TRY(rey_xml_get_float(b->ctx, node, "shutter_close", 0, &ignored));
    switch (s->kind) {
    case SENSOR_PERSPECTIVE:
        TRY(rey_xml_get_float(b->ctx, node, "focus_distance", 0, &ignored));
        TRY(sensor_pose(b, node, path, s));
        return camera_numbers(b, node, path, s);
    case SENSOR_THINLENS:
        TRY(sensor_pose(b, node, path, s));
        TRY(camera_numbers(b, node, path, s));
        return lens_numbers(b, node, path, s);
    case SENSOR_IRRADIANCEMETER:
        return s->shape >= 0 ? REY_OK
                             : rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE, "an irradiancemeter belongs inside of a shape");
    case SENSOR_DISTANT:
        TRY(sensor_pose(b, node, path, s));
        return distant_target(b, node, path, s);
    default:
        return sensor_pose(b, node, path, s);
    }
}

// What every sensor has. shape: that it belongs to, else -1; batch: that it is one of, or null.
static rey_result build_record(Builder *b, rey_xml_node *node, int32_t shape, const SensorRecord *batch, const char *path,
                               SensorRecord *s);

static rey_result build_batch(Builder *b, rey_xml_node *node, const char *path, SensorRecord *s) {
    int n = rey_xml_count_children(node, REY_XML_BIT(REY_XML_SENSOR));
    if (n == 0) {
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE, "a batch without sensors, expected one or more <sensor> in it");
    }
    if (s->width % n != 0) {
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE,
                            "a batch of %d sensors has a film %d pixels wide, expected a multiple of their number", n,
                            (int)s->width);
    }
    s->batch_count = n;
    s->batch = rey_scene_append(b->scene, &b->scene->build.batch_sensors, sizeof *s, n);
    TRY(s->batch < 0 ? REY_ERROR_MEMORY : REY_OK);
    for (int i = 0; i < n; i++) {
        char name[MAX_PATH_NAME], number[32];
        SensorRecord part;
        rey_xml_child *child = rey_xml_child_of(node, REY_XML_BIT(REY_XML_SENSOR), i);
        snprintf(number, sizeof number, "sensor_%d", i);
        build_join(name, path, number);
        TRY(build_record(b, child->node, -1, s, name, &part));
        if (part.kind == SENSOR_BATCH) {
            return rey_xml_fail(b->ctx, child->at, REY_ERROR_SCENE, "a batch cannot stand inside of a batch");
        }
        ARRAY_AT(b->scene->build.batch_sensors, SensorRecord, s->batch + i) = part;
        child->node->built = SENSOR_OF_BATCH - (s->batch + i);
    }
    return REY_OK;
}

static rey_result build_record(Builder *b, rey_xml_node *node, int32_t shape, const SensorRecord *batch, const char *path,
                               SensorRecord *s) {
    bool first;
    *s = (SensorRecord){.kind = -1, .to_world = -1, .fov = -1, .lens = -1, .shape = shape, .medium = -1};
    TRY(build_visit(b, node, path, &first));
    for (int i = 0; i < COUNT_OF(sensor_names); i++) {
        s->kind = strcmp(node->type, sensor_names[i]) == 0 ? i : s->kind;
    }
    if (s->kind < 0) {
        return build_unknown(b, node, sensor_word, NULL);
    }
    if (shape >= 0 && s->kind != SENSOR_IRRADIANCEMETER) {
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE, "the sensor of a shape must be an irradiancemeter");
    }
    char name[MAX_PATH_NAME];
    build_join(name, path, "medium");
    TRY(build_medium_slot(b, node, NULL, name, &s->medium));
    rey_xml_child *film = rey_xml_child_of(node, REY_XML_BIT(REY_XML_FILM), 0);
    rey_xml_child *sampler = rey_xml_child_of(node, REY_XML_BIT(REY_XML_SAMPLER), 0);
    TRY(build_film(b, film ? film->node : NULL, s));
    if (batch) { // it sees its slice of the batch's film, whatever film it brings
        s->crop_x = s->crop_y = 0;
        s->width = s->crop_width = batch->width / batch->batch_count;
        s->height = s->crop_height = batch->height;
    }
    TRY(build_sampler(b, sampler ? sampler->node : NULL, s));
    TRY(s->kind == SENSOR_BATCH ? build_batch(b, node, path, s) : build_single(b, node, path, s));
    TRY(build_check_unused(b, node));
    return build_finish(b, node, path);
}

rey_result build_sensor(Builder *b, rey_xml_node *node, int32_t shape, const char *path) {
    SensorRecord s;
    TRY(build_record(b, node, shape, NULL, path, &s));
    node->built = rey_scene_append(b->scene, &b->scene->build.sensors, sizeof s, 1);
    if (node->built < 0) {
        return REY_ERROR_MEMORY;
    }
    ARRAY_AT(b->scene->build.sensors, SensorRecord, node->built) = s;
    return REY_OK;
}
