// build_bsdf.c: scattering functions, driven by the table of their kinds.
#include "io/build.h"
#include "io/lenient.h"

#include <stdio.h>
#include <string.h>

static const char *bsdf_word(void *user, int i) {
    UNUSED(user);
    return i < rey_bsdf_kind_count ? rey_bsdf_kinds[i].name : NULL;
}

static TextureUse slot_use(const ParamDesc *p) {
    bool real = p->type != PARAM_SPEC && p->type != PARAM_METAL_ETA && p->type != PARAM_METAL_K &&
                p->type != PARAM_NORMAL;
    bool bounded = p->type == PARAM_SPEC && p->high <= 1;
    bool turns = p->type == PARAM_NORMAL || p->type == PARAM_HEIGHT || p->type == PARAM_HEIGHT_SCALE;
    return (TextureUse){bounded ? REY_COLOUR_REFLECTANCE : REY_COLOUR_UNBOUNDED,
                        real,
                        p->low,
                        p->high,
                        "",
                        p->text,
                        turns ? REY_TERM_TERMINATOR : 0,
                        turns ? "the picture jumps where a shading normal turns away from the viewer" : NULL};
}

// Ratio of int_ior and ext_ior.
static rey_result ior_slot(Builder *b, rey_xml_node *node, const ParamDesc *p, const char *path, int32_t *out) {
    double inside, outside;
    TRY(rey_xml_get_ior(b->ctx, node, "int_ior", p->option, &inside));
    TRY(rey_xml_get_ior(b->ctx, node, "ext_ior", "air", &outside));
    if (!(inside > 0) || !(outside > 0)) {
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE, "indices of refraction must be positive, found %g and %g",
                            inside, outside);
    }
    double eta = inside / outside;
    TextureUse use = slot_use(p);
    if (p->type == PARAM_SMOOTH_IOR) {
        use.terms = REY_TERM_SPECULAR;
        use.why = "the index turns the direction of the refracted ray";
    }
    return build_constant(b, node, "int_ior", use, &eta, 1, path, out);
}

// eta or k of a conductor: written out, or from `material`.
static rey_result metal_slot(Builder *b, rey_xml_node *node, const ParamDesc *p, const char *path, int32_t *out) {
    const char *material;
    double eta[3] = {0, 0, 0}, k[3] = {1, 1, 1};
    bool written = rey_xml_has(node, "eta") || rey_xml_has(node, "k");
    TRY(rey_xml_get_string(b->ctx, node, "material", "none", &material));
    if (written && rey_xml_find(node, "material")) {
        return rey_xml_fail(b->ctx, rey_xml_find(node, "material")->at, REY_ERROR_SCENE,
                            "either 'material' or 'eta' and 'k' may be given, not both");
    }
    if (!written && !rey_named_metal(material, eta, k)) {
        const char *nearest = rey_nearest_word(material, rey_named_metal_name, NULL);
        return rey_xml_fail_word(b->ctx, rey_xml_find(node, "material")->at, material, rey_named_metal_name, NULL,
                                 "there is no conductor '%.100s'%s", material,
                                 nearest ? "" : ", expected one such as Ag, Al, Au, Cr, Cu or W, 'none', or 'eta' and 'k'");
    }
    return build_slot(b, node, p->name, slot_use(p), p->type == PARAM_METAL_ETA ? eta : k, 3, path, out);
}

// `specular`, or `eta` in its place.
static rey_result specular_slot(Builder *b, rey_xml_node *node, const ParamDesc *p, const char *path, int32_t *out) {
    double value = (double)p->value;
    char name[MAX_PATH_NAME];
    TextureUse use = slot_use(p);
    bool eta = rey_xml_has(node, "eta");
    if (eta && rey_xml_has(node, p->name)) {
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE, "either 'eta' or '%s' may be given, not both", p->name);
    }
    if (eta) {
        use.low = 1e-3f;
        use.high = INFINITY;
        use.text = "relative index of refraction, interior over exterior";
    }
    build_join(name, path, eta ? "eta" : p->name);
    return build_slot(b, node, eta ? "eta" : p->name, use, &value, 1, name, out);
}

// A number that steers sampling: a constant, but no parameter, as no picture depends on it.
static rey_result rate_slot(Builder *b, rey_xml_node *node, const ParamDesc *p, int32_t *out) {
    double value;
    TRY(rey_xml_get_float(b->ctx, node, p->name, (double)p->value, &value));
    if (!(value >= (double)p->low && value <= 1e6)) {
        return rey_xml_fail_value(b->ctx, node, p->name, "%s is %g, expected a number in [%g, 1e6]", p->name, value,
                                  (double)p->low);
    }
    return build_number(b, (float)value, out);
}

// alpha_u or alpha_v; a single alpha serves both.
static rey_result alpha_slot(Builder *b, rey_xml_node *node, const ParamDesc *p, const char *path, int32_t first,
                             int32_t *out) {
    double value = (double)p->value;
    char name[MAX_PATH_NAME];
    bool both = rey_xml_has(node, "alpha_u") || rey_xml_has(node, "alpha_v");
    if (both) {
        if (rey_xml_has(node, "alpha")) {
            return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE, "either 'alpha' or 'alpha_u' and 'alpha_v' may be given");
        }
        TRY(rey_xml_require(b->ctx, node, p->name));
        build_join(name, path, p->name);
        return build_slot(b, node, p->name, slot_use(p), &value, 1, name, out);
    }
    if (p->type == PARAM_ALPHA_V) {
        *out = first;
        return REY_OK;
    }
    build_join(name, path, "alpha");
    return build_slot(b, node, "alpha", slot_use(p), &value, 1, name, out);
}

// Attributes know nothing of the terms that a shading normal needs, and volumes have no slope on a surface.
static rey_result refuse_attribute(Builder *b, const rey_xml_node *node, int32_t texture) {
    bool attribute = ARRAY_AT(b->scene->build.textures, TextureNode, texture).kind == TEXTURE_ATTRIBUTE;
    bool volume = build_is_volume(b, texture);
    return !attribute && !volume ? REY_OK
                                 : rey_xml_fail(b->ctx, node->at, REY_ERROR_UNSUPPORTED, "the texture of '%s' cannot be a %s",
                                                node->type, volume ? "volume" : "mesh attribute");
}

// The only texture of a bump map, under any name. Its slope jumps between texels, and the jumps move with to_uv.
static rey_result height_slot(Builder *b, rey_xml_node *node, const ParamDesc *p, const char *path, int32_t *out) {
    int count = rey_xml_count_children(node, REY_XML_TEXTURES);
    if (count != 1) {
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE, "'%s' takes one nested texture, found %d", node->type,
                            count);
    }
    rey_xml_child *child = rey_xml_child_of(node, REY_XML_TEXTURES, 0);
    TRY(build_texture(b, child->node, slot_use(p), path, out));
    TRY(refuse_attribute(b, node, *out));
    if (ARRAY_AT(b->scene->build.textures, TextureNode, *out).kind == TEXTURE_CONSTANT) {
        TRY(rey_scene_add_note(b->scene, "warning: %s:%d: the texture of this %s is constant and has no slope: there are no bumps",
                               node->at.file, node->at.line, node->type));
    }
    Param *param;
    for (int i = 0; (param = build_param_of(b, *out, i)); i++) {
        if (param->to_uv == *out) {
            param->terms |= REY_TERM_PRIMARY | REY_TERM_INDIRECT;
            param->why = "the lines along which the slope of the heights jumps, from texel to texel, move over their surfaces";
        }
    }
    return REY_OK;
}

static rey_result height_scale_slot(Builder *b, rey_xml_node *node, const ParamDesc *p, const char *path, int32_t *out) {
    double value;
    TRY(rey_xml_get_float(b->ctx, node, p->name, (double)p->value, &value));
    return build_constant(b, node, p->name, slot_use(p), &value, 1, path, out);
}

// Nothing takes the place of what must be given.
static rey_result refuse_left_out(Builder *b, const rey_xml_node *node, const char *name) {
    const rey_xml_child *child = rey_xml_child_named(node, name);
    bool lost = child && child->ignored;
    return lost ? rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE, "'%s' has no '%s' that can be read", node->type, name) : REY_OK;
}

static rey_result build_slots(Builder *b, rey_xml_node *node, const BsdfKind *kind, const char *path, BsdfNode *bsdf) {
    for (int i = 0; i < kind->param_count; i++) {
        const ParamDesc *p = &kind->params[i];
        double value = (double)p->value;
        bsdf->surface |= p->type == PARAM_HEIGHT;
        bsdf->turns |= p->type == PARAM_HEIGHT || p->type == PARAM_NORMAL;
        char name[MAX_PATH_NAME];
        build_join(name, path, p->name);
        switch (p->type) {
        case PARAM_IOR:
        case PARAM_SMOOTH_IOR:
            TRY(ior_slot(b, node, p, name, &bsdf->slot[i]));
            break;
        case PARAM_SPECULAR:
            TRY(specular_slot(b, node, p, path, &bsdf->slot[i]));
            break;
        case PARAM_RATE:
            TRY(rate_slot(b, node, p, &bsdf->slot[i]));
            break;
        case PARAM_METAL_ETA:
        case PARAM_METAL_K:
            TRY(metal_slot(b, node, p, name, &bsdf->slot[i]));
            break;
        case PARAM_ALPHA_U:
        case PARAM_ALPHA_V:
            TRY(alpha_slot(b, node, p, path, i ? bsdf->slot[i - 1] : -1, &bsdf->slot[i]));
            break;
        case PARAM_HEIGHT:
            TRY(height_slot(b, node, p, name, &bsdf->slot[i]));
            break;
        case PARAM_HEIGHT_SCALE:
            TRY(height_scale_slot(b, node, p, name, &bsdf->slot[i]));
            break;
        default:
            TRY(strcmp(p->option, "required") == 0 ? rey_xml_require(b->ctx, node, p->name) : REY_OK);
            TRY(build_slot(b, node, p->name, slot_use(p), &value, 1, name, &bsdf->slot[i]));
            TRY(strcmp(p->option, "required") == 0 ? refuse_left_out(b, node, p->name) : REY_OK);
            TRY(p->type == PARAM_NORMAL ? refuse_attribute(b, node, bsdf->slot[i]) : REY_OK);
        }
    }
    return REY_OK;
}

// Is the property or texture there, and not the number 0?
static bool is_given(const rey_xml_node *node, const char *name) {
    const rey_xml_property *p = rey_xml_find(node, name);
    bool zero = p && (p->kind == REY_XML_FLOAT_VALUE || p->kind == REY_XML_INTEGER_VALUE) && p->number == 0;
    return rey_xml_has(node, name) && !zero;
}

// Position of the property's word in "a|b|c"; booleans are "false|true".
static rey_result build_config(Builder *b, rey_xml_node *node, const ConfigDesc *c, int32_t *out) {
    char words[128];
    const char *list[8];
    int count = 0, choice = c->value;
    if (strncmp(c->choices, "given ", 6) == 0) {
        *out = is_given(node, c->choices + 6);
        return REY_OK;
    }
    if (strcmp(c->choices, "false|true") == 0) {
        bool on;
        TRY(rey_xml_get_bool(b->ctx, node, c->name, c->value != 0, &on));
        *out = on;
        return REY_OK;
    }
    strncpy(words, c->choices, sizeof words - 1);
    words[sizeof words - 1] = 0;
    for (char *word = words; word && count < COUNT_OF(list);) {
        char *bar = strchr(word, '|');
        list[count++] = word;
        if (bar) {
            *bar++ = 0;
        }
        word = bar;
    }
    TRY(rey_xml_get_choice(b->ctx, node, c->name, list, count, c->value, &choice));
    *out = choice;
    return REY_OK;
}

// Children in document order, numbered in their names where there can be several.
static rey_result build_children(Builder *b, rey_xml_node *node, const BsdfKind *kind, const char *path, BsdfNode *bsdf) {
    int count = rey_xml_count_children(node, REY_XML_BIT(REY_XML_BSDF));
    if (count < kind->fewest_children || count > kind->most_children) {
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE, "'%s' takes %d%s nested bsdf, found %d", kind->name,
                            kind->fewest_children, kind->most_children > kind->fewest_children ? " or 2" : "", count);
    }
    for (int i = 0; i < count; i++) {
        char name[MAX_PATH_NAME], child[32], number[16];
        snprintf(number, sizeof number, "_%d", i);
        snprintf(child, sizeof child, "%s%s", kind->child, kind->most_children > 1 ? number : "");
        build_join(name, path, child);
        TRY(build_bsdf(b, rey_xml_child_of(node, REY_XML_BIT(REY_XML_BSDF), i)->node, name, &bsdf->child[i]));
        const BsdfNode *nested = &ARRAY_AT(b->scene->build.bsdfs, BsdfNode, bsdf->child[i]);
        bsdf->surface |= nested->surface;
        bsdf->turns |= nested->turns;
        bsdf->transmits |= nested->transmits;
        bsdf->spreads |= nested->spreads;
        bsdf->glossy |= nested->glossy;
        bsdf->aims &= nested->aims;
    }
    return REY_OK;
}

static rey_result add_bsdf(Builder *b, int kind, BsdfNode bsdf, int32_t *out) {
    rey_scene *scene = b->scene;
    int32_t size = rey_bsdf_table_size(kind);
    bsdf.kind = kind;
    bsdf.spreads |= rey_bsdf_spreads(kind);
    bsdf.glossy |= rey_bsdf_glossy(kind);
    bsdf.aims &= !bsdf.transmits && !rey_bsdf_bends(kind);
    bsdf.table = -1;
    if (size > 0) {
        bsdf.table = rey_scene_append(scene, &scene->build.tables, sizeof(float), size);
        if (bsdf.table < 0) {
            return REY_ERROR_MEMORY;
        }
    }
    *out = rey_scene_append(scene, &scene->build.bsdfs, sizeof bsdf, 1);
    if (*out < 0) {
        return REY_ERROR_MEMORY;
    }
    ARRAY_AT(scene->build.bsdfs, BsdfNode, *out) = bsdf;
    return REY_OK;
}

static BsdfNode empty_bsdf(void) {
    BsdfNode bsdf = {.child = {-1, -1}, .aims = true};
    for (int i = 0; i < MAX_SLOTS; i++) {
        bsdf.slot[i] = -1;
    }
    return bsdf;
}

rey_result build_default_bsdf(Builder *b, rey_xml_node *node, double reflectance, const char *path, int32_t *out) {
    int kind = rey_bsdf_kind_find("diffuse");
    const ParamDesc *p = &rey_bsdf_kinds[kind].params[0];
    BsdfNode bsdf = empty_bsdf();
    char name[MAX_PATH_NAME];
    double rgb[3] = {reflectance, reflectance, reflectance};
    build_join(name, path, "reflectance");
    TRY(build_constant(b, node, "bsdf", slot_use(p), rgb, 3, name, &bsdf.slot[0]));
    return add_bsdf(b, kind, bsdf, out);
}

rey_result build_bsdf(Builder *b, rey_xml_node *node, const char *path, int32_t *out) {
    bool first;
    TRY(build_visit(b, node, path, &first));
    if (!first) {
        *out = node->built;
        return REY_OK;
    }
    int index = rey_bsdf_kind_find(node->type);
    if (index < 0) {
        return build_unknown(b, node, bsdf_word, NULL);
    }
    const BsdfKind *kind = &rey_bsdf_kinds[index];
    BsdfNode bsdf = empty_bsdf();
    TRY(build_slots(b, node, kind, path, &bsdf));
    for (int i = 0; i < kind->config_count; i++) {
        TRY(build_config(b, node, &kind->configs[i], &bsdf.config[i]));
        bsdf.transmits |= strcmp(kind->configs[i].name, "transmits") == 0 && bsdf.config[i] != 0;
    }
    bsdf.transmits |= kind->transmits;
    TRY(build_children(b, node, kind, path, &bsdf));
    if (strcmp(kind->name, "twosided") == 0 && bsdf.transmits && !bsdf.config[0]) {
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE,
                            "a bsdf inside 'twosided' lets light through; 'allow_transmission' accepts that");
    }
    TRY(add_bsdf(b, index, bsdf, out));
    node->built = *out;
    TRY(build_check_unused(b, node));
    return build_finish(b, node, path);
}
