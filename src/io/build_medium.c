// build_medium.c: participating media, and where they are.
#include "io/build.h"
#include "io/lenient.h"
#include "medium/majorant_build.h"
#include "medium/table.h"

#include <string.h>

enum { HOMOGENEOUS, HETEROGENEOUS };
static const char *const words[] = {"homogeneous", "heterogeneous"};

static const char *medium_word(void *user, int i) {
    UNUSED(user);
    return i < COUNT_OF(words) ? words[i] : NULL;
}

enum { SIGMA_T, ALBEDO, EMISSION };
static const struct {
    const char *name;
    double value;
    float high;
    const char *unit, *text;
} coefficients[] = {{"sigma_t", 1, INFINITY, "1/scene unit", "extinction"},
                    {"albedo", 0.75, 1, "", "share of the extinction that scatters"},
                    {"emission", 0, INFINITY, "W/(m^2 sr scene unit)", "radiance emitted per unit of length"}};

// Colours are in [0, 1], as `scale` is there for more.
static TextureUse coefficient_use(int which) {
    return (TextureUse){REY_COLOUR_REFLECTANCE, true, 0, coefficients[which].high, coefficients[which].unit,
                        coefficients[which].text, 0, NULL};
}

// A volume of colours or numbers.
static rey_result coefficient(Builder *b, rey_xml_node *node, int which, const char *path, int32_t *out) {
    char full[MAX_PATH_NAME];
    const char *name = coefficients[which].name;
    build_join(full, path, name);
    TRY(build_volume_slot(b, node, name, coefficient_use(which), coefficients[which].value, full, out));
    const VolumeNode *v = &ARRAY_AT(b->scene->build.volumes, VolumeNode, *out);
    return v->channels == 1 || v->channels == 3
               ? REY_OK
               : rey_xml_fail_value(b->ctx, node, name, "'%s' has %d channels, expected 1 or 3", name, v->channels);
}

static rey_result build_scale(Builder *b, rey_xml_node *node, const char *path, MediumNode *medium) {
    TextureUse use = {REY_COLOUR_UNBOUNDED, true, 0, INFINITY, "", "factor of sigma_t", 0, NULL};
    double one = 1;
    char name[MAX_PATH_NAME];
    TRY(rey_xml_get_float(b->ctx, node, "scale", 1, &one));
    build_join(name, path, "scale");
    TRY(build_constant(b, node, "scale", use, &one, 1, name, &medium->scale_texture));
    medium->scale = ARRAY_AT(b->scene->build.textures, TextureNode, medium->scale_texture).theta;
    return REY_OK;
}

static rey_result build_medium_phase(Builder *b, rey_xml_node *node, const char *path, MediumNode *medium) {
    char name[MAX_PATH_NAME];
    rey_xml_child *child = rey_xml_child_of(node, REY_XML_BIT(REY_XML_PHASE), 0);
    rey_xml_child *second = rey_xml_child_of(node, REY_XML_BIT(REY_XML_PHASE), 1);
    if (second) {
        return rey_xml_fail(b->ctx, second->at, REY_ERROR_SCENE, "a medium can have one phase function");
    }
    if (!child) {
        return build_isotropic_phase(b, &medium->phase);
    }
    build_join(name, path, "phase_function");
    TRY(build_phase(b, child->node, name, &medium->phase));
    const PhaseNode *phase = &ARRAY_AT(b->scene->build.phases, PhaseNode, medium->phase);
    medium->flakes = phase->kind == rey_phase_kind_find("sggx") ? phase->slot[0] : -1;
    return REY_OK;
}

static bool is_grid(const Builder *b, int32_t volume) {
    return volume >= 0 && ARRAY_AT(b->scene->build.volumes, VolumeNode, volume).kind == VOLUME_GRID;
}

static rey_result build_bounds(Builder *b, const rey_xml_node *node, MediumNode *medium) {
    const VolumeNode *sigma_t = &ARRAY_AT(b->scene->build.volumes, VolumeNode, medium->sigma_t);
    if (!medium->bounded && sigma_t->kind != VOLUME_CONSTANT) {
        const char *name = is_grid(b, medium->sigma_s) ? "sigma_s" : is_grid(b, medium->sigma_a) ? "sigma_a" : "sigma_t";
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE,
                            "'%s' of a homogeneous medium is a grid, which 'heterogeneous' can have", name);
    }
    int32_t size = rey_medium_table_size(sigma_t, medium);
    medium->table = rey_scene_append(b->scene, &b->scene->build.tables, sizeof(float), size);
    return medium->table < 0 ? REY_ERROR_MEMORY : REY_OK;
}

rey_result build_medium(Builder *b, rey_xml_node *node, const char *path, int32_t *out) {
    bool first, ignored;
    TRY(build_visit(b, node, path, &first));
    if (!first) {
        *out = node->built;
        return REY_OK;
    }
    MediumNode medium = {.sigma_s = -1, .sigma_a = -1, .emission = -1, .flakes = -1};
    medium.bounded = strcmp(node->type, words[HETEROGENEOUS]) == 0;
    if (!medium.bounded && strcmp(node->type, words[HOMOGENEOUS]) != 0) {
        return build_unknown(b, node, medium_word, NULL);
    }
    // How distances and lights are sampled does not concern the scene.
    TRY(rey_xml_get_bool(b->ctx, node, "sample_emitters", true, &ignored));
    TRY(rey_xml_get_bool(b->ctx, node, "has_spectral_extinction", true, &ignored));
    if (rey_xml_has(node, "sigma_s") || rey_xml_has(node, "sigma_a")) {
        TRY(build_scattering(b, node, path, &medium));
    } else {
        TRY(coefficient(b, node, SIGMA_T, path, &medium.sigma_t));
        TRY(coefficient(b, node, ALBEDO, path, &medium.albedo));
    }
    if (rey_xml_has(node, "emission")) {
        TRY(coefficient(b, node, EMISSION, path, &medium.emission));
    }
    TRY(build_scale(b, node, path, &medium));
    TRY(build_medium_phase(b, node, path, &medium));
    TRY(build_bounds(b, node, &medium));
    *out = rey_scene_append(b->scene, &b->scene->build.media, sizeof medium, 1);
    TRY(*out < 0 ? REY_ERROR_MEMORY : REY_OK);
    ARRAY_AT(b->scene->build.media, MediumNode, *out) = medium;
    node->built = *out;
    TRY(build_check_unused(b, node));
    return build_finish(b, node, path);
}

rey_result build_medium_slot(Builder *b, rey_xml_node *node, const char *name, const char *path, int32_t *out) {
    rey_xml_child *child = name ? rey_xml_child_named(node, name) : rey_xml_child_of(node, REY_XML_BIT(REY_XML_MEDIUM), 0);
    bool left_out;
    *out = -1;
    if (!child) {
        return REY_OK;
    }
    if (child->node->tag != REY_XML_MEDIUM) {
        return rey_xml_fail(b->ctx, child->at, REY_ERROR_SCENE, "'%s' must be a medium, not a %s", name,
                            rey_xml_tag_name(child->node->tag));
    }
    Snapshot s = build_snapshot(b);
    TRY(build_forgive(b, &s, child, "", build_medium(b, child->node, path, out), &left_out));
    *out = left_out ? -1 : *out;
    return REY_OK;
}

rey_result build_media_use(Builder *b) {
    const rey_scene *scene = b->scene;
    const rey_xml_position at = rey_xml_root(b->source->document)->at;
    bool used = false;
    for (size_t i = 0; i < scene->build.shapes.count; i++) {
        const ShapeRecord *shape = &ARRAY_AT(scene->build.shapes, ShapeRecord, i);
        used = used || shape->interior >= 0 || shape->exterior >= 0;
    }
    for (size_t i = 0; i < scene->build.sensors.count; i++) {
        used = used || ARRAY_AT(scene->build.sensors, SensorRecord, i).medium >= 0;
    }
    for (size_t i = 0; i < scene->build.batch_sensors.count; i++) {
        used = used || ARRAY_AT(scene->build.batch_sensors, SensorRecord, i).medium >= 0;
    }
    for (size_t i = 0; i < scene->integrators.count && used; i++) {
        Integrator *integrator = &ARRAY_AT(scene->integrators, Integrator, i);
        integrator->has_media = integrator->through;
        if (!integrator->through) {
            TRY(rey_scene_add_note(b->scene, "%s:%d: '%s' sees no participating media: 'volpath' does", at.file, at.line,
                                   integrator->name));
        }
    }
    return REY_OK;
}
