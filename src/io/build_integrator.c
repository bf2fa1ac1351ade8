// build_integrator.c: integrators.
#include "io/build.h"
#include "io/lenient.h"

#include <stdio.h>
#include <string.h>

static const char *const words[] = {"path", "direct", "moment", "volpath", "volpathmis", "prb", "prbvolpath", "depth", "aov",
                                    "ptracer", "prb_basic", "prb_projective", "direct_projective"};

static const char *integrator_word(void *user, int i) {
    UNUSED(user);
    return i < COUNT_OF(words) ? words[i] : NULL;
}

static bool is(const rey_xml_node *node, const char *type) { return strcmp(node->type, type) == 0; }

// Either one count for both kinds of samples, or one for each.
static rey_result get_split(Builder *b, rey_xml_node *node, SceneView *view) {
    enum { MOST = 1 << 12 };
    int64_t shading, light, scatter;
    if (rey_xml_has(node, "shading_samples") &&
        (rey_xml_has(node, "emitter_samples") || rey_xml_has(node, "bsdf_samples"))) {
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE,
                            "either 'shading_samples' or 'emitter_samples' and 'bsdf_samples' may be given");
    }
    TRY(rey_xml_get_int(b->ctx, node, "shading_samples", 1, MOST, 1, &shading));
    TRY(rey_xml_get_int(b->ctx, node, "emitter_samples", 0, MOST, shading, &light));
    TRY(rey_xml_get_int(b->ctx, node, "bsdf_samples", 0, MOST, shading, &scatter));
    if (light + scatter == 0) {
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE,
                            "emitter_samples and bsdf_samples are both 0, expected at least one sample");
    }
    if (light != 1 || scatter != 1) {
        view->light_samples = (int32_t)light;
        view->scatter_samples = (int32_t)scatter;
        view->split = (int32_t)(light > scatter ? light : scatter);
    }
    return REY_OK;
}

// Integrators whose pictures are those of others: how derivatives are sampled, no scene has to say.
static rey_result get_projection(Builder *b, rey_xml_node *node) {
    static const char *const counts[] = {"sppc", "sppp", "sppi", "guiding_rounds"};
    int64_t count;
    bool project;
    const char *word;
    for (int i = 0; i < COUNT_OF(counts); i++) {
        TRY(rey_xml_get_int(b->ctx, node, counts[i], 0, INT32_MAX, 0, &count));
    }
    TRY(rey_xml_get_bool(b->ctx, node, "guiding_proj", true, &project));
    TRY(rey_xml_get_string(b->ctx, node, "guiding", "octree", &word));
    TRY(rey_xml_get_string(b->ctx, node, "project_seed", "both", &word));
    return rey_scene_add_note(b->scene, "%s:%d: '%s' is read as '%s' with its max_depth: every integrator finds the terms of "
                              "moving edges here, with as many samples as --spp and --spp-terms say", node->at.file, node->at.line,
                              node->type, is(node, "direct_projective") ? "direct" : "path");
}

static rey_result get_depths(Builder *b, rey_xml_node *node, SceneView *view) {
    int64_t depth, roulette;
    bool replays = !strncmp(node->type, "prb", 3), projects = strstr(node->type, "_projective") != NULL;
    if (projects) {
        TRY(get_projection(b, node));
    }
    view->drops = is(node, "path");
    if (is(node, "direct")) {
        view->max_depth = 2;
        view->solid = true;
        return get_split(b, node, view);
    }
    TRY(rey_xml_get_int(b->ctx, node, "max_depth", -1, INT32_MAX, replays || projects ? 6 : -1, &depth));
    TRY(rey_xml_get_int(b->ctx, node, "rr_depth", 1, INT32_MAX, 5, &roulette));
    view->max_depth = is(node, "direct_projective") ? 2 : (int32_t)depth;
    view->rr_depth = (int32_t)roulette;
    view->through = strstr(node->type, "volpath") != NULL;
    if (is(node, "volpathmis")) {
        bool spectral;
        return rey_xml_get_bool(b->ctx, node, "use_spectral_mis", true, &spectral);
    }
    return REY_OK;
}

// How the work is divided does not concern the scene. Everything else must be known.
static rey_result get_ignored(Builder *b, rey_xml_node *node) {
    int64_t count;
    double timeout;
    TRY(rey_xml_get_float(b->ctx, node, "timeout", 0, &timeout));
    TRY(rey_xml_get_int(b->ctx, node, "block_size", 0, INT32_MAX, 0, &count));
    TRY(rey_xml_get_int(b->ctx, node, "samples_per_pass", 0, INT32_MAX, 0, &count));
    return build_check_unused(b, node);
}

// ---- channels --------------------------------------------------------------------------------------------------------

static rey_result add_channel(Builder *b, const rey_xml_node *node, const char *prefix, const char *name, char letter,
                              int32_t source, int32_t component) {
    char text[256];
    snprintf(text, sizeof text, "%s%s.%c", prefix, name, letter);
    for (size_t i = 0; i < b->scene->channels.count; i++) {
        if (strcmp(ARRAY_AT(b->scene->channels, Channel, i).name, text) == 0) {
            return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE, "two channels have the name '%s'", text);
        }
    }
    Channel *channel = rey_array_push(b->ctx, &b->scene->channels, sizeof *channel, 1);
    if (!channel) {
        return REY_ERROR_MEMORY;
    }
    *channel = (Channel){rey_strdup(b->ctx, text), source, component};
    return channel->name ? REY_OK : REY_ERROR_MEMORY;
}

// Adds a quantity to those of the picture, and its channels.
static rey_result add_aov(Builder *b, const rey_xml_node *node, const char *name, int32_t kind) {
    static const char *const components[] = {
#define AOV(ENUM, name, components) components,
#include "scene/aovs.inl"
#undef AOV
    };
    SceneView *view = &b->scene->view;
    int32_t first = 0;
    for (int32_t i = 0; i < view->aov_count; i++) {
        first += aov_components(view->aovs[i]);
    }
    if (view->aov_count == MOST_AOVS || first + aov_components(kind) > MOST_AOV_CHANNELS) {
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_UNSUPPORTED, "more than %d quantities or %d channels", MOST_AOVS,
                            MOST_AOV_CHANNELS);
    }
    view->aovs[view->aov_count++] = kind;
    for (int32_t c = 0; c < aov_components(kind); c++) {
        TRY(add_channel(b, node, "", name, components[kind][c], CHANNEL_AOV, first + c));
    }
    return REY_OK;
}

static const char *aov_word(void *user, int i) {
    static const char *const names[] = {
#define AOV(ENUM, name, components) name,
#include "scene/aovs.inl"
#undef AOV
    };
    UNUSED(user);
    return i < COUNT_OF(names) && names[i][0] ? names[i] : NULL;
}

// "NAME:QUANTITY, NAME:QUANTITY, ..."
static rey_result get_aovs(Builder *b, rey_xml_node *node) {
    const char *list;
    TRY(rey_xml_get_string(b->ctx, node, "aovs", "", &list));
    if (!*list) {
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE, "'aov' lacks 'aovs', a list of NAME:QUANTITY");
    }
    while (*list) {
        char item[160], *colon;
        size_t length = strcspn(list, ",");
        if (length >= sizeof item) {
            return rey_xml_fail_value(b->ctx, node, "aovs", "'%.40s...' in 'aovs' is too long", list);
        }
        memcpy(item, list, length);
        list += length + (list[length] == ',');
        while (length > 0 && item[length - 1] == ' ') {
            length--;
        }
        item[length] = '\0';
        const char *name = item + strspn(item, " ");
        colon = strchr(item, ':');
        if (!colon || colon == name) {
            return rey_xml_fail_value(b->ctx, node, "aovs", "'%s' in 'aovs', expected NAME:QUANTITY", item);
        }
        *colon = '\0';
        int kind = -1;
        for (int i = 0; aov_word(NULL, i); i++) {
            kind = strcmp(colon + 1, aov_word(NULL, i)) == 0 ? i : kind;
        }
        if (kind < 0) {
            return rey_xml_fail_word(b->ctx, rey_xml_place(node, "aovs"), colon + 1, aov_word, NULL,
                                     "there is no quantity '%s'", colon + 1);
        }
        TRY(add_aov(b, node, name, kind));
    }
    return REY_OK;
}

// Channels of the picture of the integrator inside an `aov` or a `moment`: its name, or a number where it has none.
static rey_result nested_channels(Builder *b, const rey_xml_node *node, const rey_xml_child *nested) {
    const char *name = nested->name ? nested->name : "_arg_0";
    bool moment = is(node, "moment");
    for (int32_t c = 0; c < 3 && !moment; c++) {
        TRY(add_channel(b, node, "", name, "RGB"[c], CHANNEL_COLOUR, c));
    }
    for (int32_t c = 0; c < 6 && moment; c++) {
        TRY(add_channel(b, node, c < 3 ? "" : "m2_", name, "XYZ"[c % 3], c < 3 ? CHANNEL_MEAN : CHANNEL_SECOND, c % 3));
    }
    b->scene->view.moments = moment;
    return moment || b->scene->view.colour_is_depth ? REY_OK : add_aov(b, node, name, AOV_ALPHA);
}

static rey_result build_wrapper(Builder *b, rey_xml_node *node) {
    SceneView *view = &b->scene->view;
    rey_xml_child *nested = rey_xml_child_of(node, REY_XML_BIT(REY_XML_INTEGRATOR), 0);
    rey_xml_child *second = rey_xml_child_of(node, REY_XML_BIT(REY_XML_INTEGRATOR), 1);
    if (second) {
        return rey_xml_fail(b->ctx, second->at, REY_ERROR_UNSUPPORTED, "'%s' takes one nested integrator, found two",
                            node->type);
    }
    if (!nested && is(node, "moment")) {
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE, "'moment' needs a nested integrator");
    }
    if (nested && (is(nested->node, "aov") || is(nested->node, "moment"))) {
        return rey_xml_fail(b->ctx, nested->at, REY_ERROR_UNSUPPORTED, "'%s' inside '%s' is not supported",
                            nested->node->type, node->type);
    }
    if (nested && is(node, "moment") && is(nested->node, "ptracer")) {
        return rey_xml_fail(b->ctx, nested->at, REY_ERROR_UNSUPPORTED,
                            "'ptracer' inside 'moment' is not supported: its pixels have no samples of their own");
    }
    view->max_depth = nested ? view->max_depth : 0; // no colour
    if (nested) {
        TRY(build_integrator(b, nested->node));
        TRY(nested_channels(b, node, nested));
    } else {
        b->scene->integrator = rey_strdup(b->ctx, node->type);
        TRY(b->scene->integrator ? REY_OK : REY_ERROR_MEMORY);
    }
    return is(node, "aov") ? get_aovs(b, node) : REY_OK;
}

rey_result build_integrator(Builder *b, rey_xml_node *node) {
    SceneView *view = &b->scene->view;
    bool hide, known = false;
    for (int i = 0; i < COUNT_OF(words); i++) {
        known = known || is(node, words[i]);
    }
    if (!known) {
        return build_unknown(b, node, integrator_word, NULL);
    }
    if (is(node, "moment") || is(node, "aov")) {
        TRY(build_wrapper(b, node));
        TRY(rey_xml_get_bool(b->ctx, node, "hide_emitters", false, &hide));
        return get_ignored(b, node);
    }
    if (is(node, "depth")) {
        view->colour_is_depth = true;
        view->aovs[view->aov_count++] = AOV_DEPTH;
    } else {
        TRY(get_depths(b, node, view));
    }
    TRY(rey_xml_get_bool(b->ctx, node, "hide_emitters", false, &hide));
    view->hide_emitters = hide;
    b->scene->integrator = rey_strdup(b->ctx, node->type);
    if (!b->scene->integrator) {
        return REY_ERROR_MEMORY;
    }
    return get_ignored(b, node);
}
