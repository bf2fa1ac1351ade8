// build_spectrum.c: spectra written as objects.
#include "io/build.h"
#include "io/number.h"

#include <string.h>

static const char *texture_word(void *user, int i) {
    static const char *const words[] = {"bitmap",  "checkerboard", "mesh_attribute", "volume",  "rawconstant", "srgb",
                                        "uniform", "d65",          "blackbody",      "regular", "irregular"};
    UNUSED(user);
    return i < COUNT_OF(words) ? words[i] : NULL;
}

// Emission by temperature. What the colour is follows from it (render/update.c).
static rey_result build_blackbody(Builder *b, rey_xml_node *node, TextureUse use, const char *path, int32_t *out) {
    TextureUse number = {REY_COLOUR_UNBOUNDED, true, 0, INFINITY, "K", "temperature of the black body", use.terms, use.why};
    double temperature = 0, range[2], rgb[3];
    char name[MAX_PATH_NAME];
    int32_t child;
    float *theta;
    TRY(rey_xml_require(b->ctx, node, "temperature"));
    TRY(rey_xml_get_float(b->ctx, node, "wavelength_min", 360, &range[0]));
    TRY(rey_xml_get_float(b->ctx, node, "wavelength_max", 830, &range[1]));
    build_join(name, path, "temperature");
    TRY(build_slot(b, node, "temperature", number, &temperature, 1, name, &child));
    TRY(build_add_texture(b, TEXTURE_BLACKBODY, BLACKBODY_NUMBERS, out, &theta));
    TextureNode *t = &ARRAY_AT(b->scene->build.textures, TextureNode, *out);
    const TextureNode *value = &ARRAY_AT(b->scene->build.textures, TextureNode, child);
    t->child[0] = child;
    t->channels = 3;
    if (value->kind != TEXTURE_CONSTANT || value->channels != 1) {
        return rey_xml_fail_value(b->ctx, node, "temperature", "'temperature' of a blackbody must be a number");
    }
    theta[BLACKBODY_BUILT] = -1;
    theta[BLACKBODY_RANGE] = (float)range[0];
    theta[BLACKBODY_RANGE + 1] = (float)range[1];
    rey_blackbody_to_rgb((double)ARRAY_AT(b->scene->build.theta, float, value->theta), range[0], range[1], rgb, NULL);
    for (int c = 0; c < 3; c++) {
        if (!(rgb[c] >= (double)use.low && rgb[c] <= (double)use.high)) {
            return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE,
                                "the black body's colour has a channel of %g here, expected a number in [%g, %g]", rgb[c],
                                (double)use.low, (double)use.high);
        }
    }
    return build_note_source(b, node, NULL, *out);
}

// Numbers between blanks and commas, as many as there are.
rey_result build_number_list(Builder *b, rey_xml_node *node, const char *name, Array *list) {
    const char *text, *end;
    TRY(rey_xml_require(b->ctx, node, name));
    TRY(rey_xml_get_string(b->ctx, node, name, "", &text));
    while (rey_is_blank(*text) || *text == ',') {
        text++;
    }
    while (*text) {
        double *value = rey_array_push(b->ctx, list, sizeof *value, 1);
        if (!value) {
            return REY_ERROR_MEMORY;
        }
        if (!rey_parse_real(text, &end, value)) {
            return rey_xml_fail_value(b->ctx, node, name, "'%s' must be numbers between commas or blanks", name);
        }
        for (text = end; rey_is_blank(*text) || *text == ',';) {
            text++;
        }
    }
    return REY_OK;
}

// The wavelengths of `regular` (equally spaced) and `irregular`.
static rey_result get_wavelengths(Builder *b, rey_xml_node *node, size_t count, Array *wavelengths) {
    double low, high;
    if (strcmp(node->type, "irregular") == 0) {
        return build_number_list(b, node, "wavelengths", wavelengths);
    }
    TRY(rey_xml_require(b->ctx, node, "wavelength_min"));
    TRY(rey_xml_require(b->ctx, node, "wavelength_max"));
    TRY(rey_xml_get_float(b->ctx, node, "wavelength_min", 0, &low));
    TRY(rey_xml_get_float(b->ctx, node, "wavelength_max", 0, &high));
    double *at = count > 0 ? rey_array_push(b->ctx, wavelengths, sizeof *at, count) : NULL;
    for (size_t i = 0; at && i < count; i++) {
        at[i] = low + (high - low) * (double)i / (double)(count > 1 ? count - 1 : 1);
    }
    return at || count == 0 ? REY_OK : REY_ERROR_MEMORY;
}

static rey_result sampled_colour(Builder *b, rey_xml_node *node, rey_colour_use use, double rgb[3]) {
    Array values = {0}, wavelengths = {0};
    rey_result result = build_number_list(b, node, "values", &values);
    if (result == REY_OK) {
        result = get_wavelengths(b, node, values.count, &wavelengths);
    }
    rey_spectrum s = {.count = (int)values.count, .wavelengths = wavelengths.data, .values = values.data};
    bool good = values.count >= 2 && values.count <= 1 << 24 && values.count == wavelengths.count;
    for (size_t i = 1; good && i < values.count; i++) {
        good = s.wavelengths[i] > s.wavelengths[i - 1];
    }
    if (result == REY_OK && !good) {
        result = rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE,
                              "a spectrum of %zu values at %zu wavelengths, expected two or more values, one for each of its "
                              "ascending wavelengths", values.count, wavelengths.count);
    }
    if (result == REY_OK) {
        rey_spectrum_to_rgb(&s, use, rgb);
    }
    rey_array_free(b->ctx, &values);
    rey_array_free(b->ctx, &wavelengths);
    return result;
}

// Spectra written as objects become constants.
static rey_result build_colour(Builder *b, rey_xml_node *node, TextureUse use, const char *path, int32_t *out) {
    double rgb[3] = {1, 1, 1};
    int count = 3;
    const char *property = NULL;
    if (strcmp(node->type, "rawconstant") == 0 || strcmp(node->type, "uniform") == 0) {
        rey_xml_property *p = rey_xml_find(node, "value");
        property = "value";
        if (p && p->kind == REY_XML_VECTOR_VALUE) {
            TRY(rey_xml_get_vec3(b->ctx, node, "value", rgb, rgb));
        } else {
            TRY(rey_xml_get_float(b->ctx, node, "value", 1, &rgb[0]));
            rgb[1] = rgb[2] = rgb[0];
            count = use.real ? 1 : 3;
        }
    } else if (strcmp(node->type, "srgb") == 0) {
        property = "color";
        TRY(rey_xml_require(b->ctx, node, "color"));
        TRY(rey_xml_get_colour(b->ctx, node, "color", use.colour, rgb, rgb));
        bool unbounded;
        TRY(rey_xml_get_bool(b->ctx, node, "unbounded", false, &unbounded));
    } else if (strcmp(node->type, "d65") == 0) {
        double scale;
        TRY(rey_xml_get_float(b->ctx, node, "scale", 1, &scale));
        if (rey_xml_has(node, "color")) {
            TRY(rey_xml_get_colour(b->ctx, node, "color", REY_COLOUR_EMISSION, rgb, rgb));
        }
        for (int k = 0; k < 3; k++) {
            rgb[k] *= scale;
        }
    } else if (strcmp(node->type, "regular") == 0 || strcmp(node->type, "irregular") == 0) {
        TRY(sampled_colour(b, node, use.colour, rgb));
    } else {
        return build_unknown(b, node, texture_word, NULL);
    }
    return build_constant(b, node, property, use, rgb, count, path, out);
}

// The illuminant in a texture's colours is the texture: white is D65 here. `scale` counts for colours only, as in the format.
static rey_result build_nested(Builder *b, rey_xml_node *node, TextureUse use, const char *path, int32_t *out) {
    double scale;
    TRY(rey_xml_get_float(b->ctx, node, "scale", 1, &scale));
    if (rey_xml_has(node, "color") || rey_xml_count_children(node, REY_XML_TEXTURES) > 1) {
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE, "a d65 spectrum needs either a 'color' or one texture");
    }
    return build_texture(b, rey_xml_child_of(node, REY_XML_TEXTURES, 0)->node, use, path, out);
}

rey_result build_spectrum(Builder *b, rey_xml_node *node, TextureUse use, const char *path, int32_t *out) {
    if (strcmp(node->type, "blackbody") == 0) {
        return build_blackbody(b, node, use, path, out);
    }
    if (strcmp(node->type, "d65") == 0 && rey_xml_count_children(node, REY_XML_TEXTURES) > 0) {
        return build_nested(b, node, use, path, out);
    }
    return build_colour(b, node, use, path, out);
}
