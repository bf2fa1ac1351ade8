// build_integrator.c: integrators, and those that `aov` and `moment` hold.
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
static rey_result get_split(Builder *b, rey_xml_node *node, Integrator *out) {
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
        out->light_samples = (int32_t)light;
        out->scatter_samples = (int32_t)scatter;
        out->split = (int32_t)(light > scatter ? light : scatter);
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

static rey_result get_depths(Builder *b, rey_xml_node *node, Integrator *out) {
    int64_t depth, roulette;
    bool replays = !strncmp(node->type, "prb", 3), projects = strstr(node->type, "_projective") != NULL;
    if (projects) {
        TRY(get_projection(b, node));
    }
    out->drops = is(node, "path");
    if (is(node, "direct")) {
        out->max_depth = 2;
        out->solid = true;
        return get_split(b, node, out);
    }
    TRY(rey_xml_get_int(b->ctx, node, "max_depth", -1, INT32_MAX, replays || projects ? 6 : -1, &depth));
    TRY(rey_xml_get_int(b->ctx, node, "rr_depth", 1, INT32_MAX, 5, &roulette));
    out->max_depth = is(node, "direct_projective") ? 2 : (int32_t)depth;
    out->rr_depth = (int32_t)roulette;
    out->through = strstr(node->type, "volpath") != NULL;
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

// An integrator of its own, with what most of them begin with.
static Integrator *add_integrator(Builder *b, const char *name) {
    Integrator *out = rey_array_push(b->ctx, &b->scene->integrators, sizeof *out, 1);
    if (out) {
        *out = (Integrator){.name = name, .max_depth = -1, .rr_depth = 5};
    }
    return out;
}

static rey_result build_one(Builder *b, rey_xml_node *node);

// Those inside of `aov` and `moment`, in their order.
static rey_result build_nested(Builder *b, rey_xml_node *node) {
    const int32_t first = (int32_t)b->scene->integrators.count;
    rey_xml_child *child;
    for (int i = 0; (child = rey_xml_child_of(node, REY_XML_BIT(REY_XML_INTEGRATOR), i)); i++) {
        TRY(build_one(b, child->node));
        if (b->scene->integrators.count > MOST_CHANNELS / 4) { // each has as many at least; references can make any number
            return rey_xml_fail(b->ctx, child->at, REY_ERROR_UNSUPPORTED, "more than %d integrators", MOST_CHANNELS / 4);
        }
    }
    if (first == (int32_t)b->scene->integrators.count) {
        if (is(node, "moment")) {
            return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE, "'moment' needs a nested integrator");
        }
        Integrator *none = add_integrator(b, "aov"); // no colour
        TRY(none ? REY_OK : REY_ERROR_MEMORY);
        none->max_depth = 0;
    }
    for (size_t i = (size_t)first; i < b->scene->integrators.count && is(node, "moment"); i++) {
        const Integrator *nested = &ARRAY_AT(b->scene->integrators, Integrator, i);
        if (nested->particles) {
            return rey_xml_fail(b->ctx, node->at, REY_ERROR_UNSUPPORTED,
                                "'ptracer' inside 'moment' is not supported: its pixels have no samples of their own");
        }
        if (nested->split) {
            TRY(rey_scene_add_note(b->scene, "%s:%d: the moments of 'direct' are those of single samples, of which it takes %d "
                                   "where the format takes one", node->at.file, node->at.line, nested->split));
        }
    }
    const char *list;
    return is(node, "aov") ? rey_xml_get_string(b->ctx, node, "aovs", "", &list) : REY_OK; // build_channels reads it
}

static rey_result build_one(Builder *b, rey_xml_node *node) {
    const char *name = NULL;
    bool hide;
    for (int i = 0; i < COUNT_OF(words); i++) {
        name = is(node, words[i]) ? words[i] : name;
    }
    if (!name) {
        return build_unknown(b, node, integrator_word, NULL);
    }
    if (is(node, "moment") || is(node, "aov")) {
        TRY(build_nested(b, node));
        TRY(rey_xml_get_bool(b->ctx, node, "hide_emitters", false, &hide));
        return get_ignored(b, node);
    }
    Integrator *out = add_integrator(b, name);
    TRY(out ? REY_OK : REY_ERROR_MEMORY);
    if (is(node, "depth")) {
        out->colour_is_depth = true;
        out->aovs[out->aov_count++] = AOV_DEPTH;
    } else {
        TRY(get_depths(b, node, out));
    }
    out->particles = is(node, "ptracer");
    TRY(rey_xml_get_bool(b->ctx, node, "hide_emitters", false, &hide));
    out->hide_emitters = hide;
    return get_ignored(b, node);
}

rey_result build_integrator(Builder *b, rey_xml_node *node) {
    rey_scene *scene = b->scene;
    TRY(build_one(b, node));
    TRY(build_channels(b, node));
    const char *first = ARRAY_AT(scene->integrators, Integrator, 0).name;
    if (scene->integrators.count > 1) {
        TRY(rey_scene_add_note(scene, "derivatives: %s:%d: '%s' holds %d integrators: R G B and derivatives are those of the "
                               "first, '%s'", node->at.file, node->at.line, node->type, (int)scene->integrators.count, first));
    }
    scene->integrator = rey_strdup(b->ctx, first);
    return scene->integrator ? REY_OK : REY_ERROR_MEMORY;
}

rey_result build_default_integrator(Builder *b) {
    rey_scene_forget_integrators(b->scene);
    b->scene->integrator = rey_strdup(b->ctx, "path");
    return add_integrator(b, "path") && b->scene->integrator ? REY_OK : REY_ERROR_MEMORY;
}
