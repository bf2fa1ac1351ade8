// build_integrator.c: integrators.
#include "io/build.h"

#include <string.h>

static const char *const words[] = {"path", "direct", "moment", "volpath", "volpathmis", "prb"};

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

static rey_result get_depths(Builder *b, rey_xml_node *node, SceneView *view) {
    int64_t depth, roulette;
    if (is(node, "direct")) {
        view->max_depth = 2;
        return get_split(b, node, view);
    }
    TRY(rey_xml_get_int(b->ctx, node, "max_depth", -1, INT32_MAX, is(node, "prb") ? 6 : -1, &depth));
    TRY(rey_xml_get_int(b->ctx, node, "rr_depth", 1, INT32_MAX, 5, &roulette));
    view->max_depth = (int32_t)depth;
    view->rr_depth = (int32_t)roulette;
    view->through = strncmp(node->type, "volpath", 7) == 0;
    if (is(node, "volpathmis")) {
        bool spectral;
        return rey_xml_get_bool(b->ctx, node, "use_spectral_mis", true, &spectral);
    }
    return REY_OK;
}

rey_result build_integrator(Builder *b, rey_xml_node *node) {
    SceneView *view = &b->scene->view;
    int64_t count;
    double timeout;
    bool hide, known = false;
    for (int i = 0; i < COUNT_OF(words); i++) {
        known = known || is(node, words[i]);
    }
    if (!known) {
        return build_unknown(b, node, integrator_word, NULL);
    }
    if (is(node, "moment")) {
        rey_xml_child *nested = rey_xml_child_of(node, REY_XML_BIT(REY_XML_INTEGRATOR), 0);
        if (!nested) {
            return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE, "'moment' needs a nested integrator");
        }
        TRY(build_integrator(b, nested->node));
        return rey_xml_check_unused(b->ctx, node, NULL, NULL);
    }
    TRY(get_depths(b, node, view));
    TRY(rey_xml_get_bool(b->ctx, node, "hide_emitters", false, &hide));
    TRY(rey_xml_get_float(b->ctx, node, "timeout", 0, &timeout));
    TRY(rey_xml_get_int(b->ctx, node, "block_size", 0, INT32_MAX, 0, &count));
    TRY(rey_xml_get_int(b->ctx, node, "samples_per_pass", 0, INT32_MAX, 0, &count));
    view->hide_emitters = hide;
    b->scene->integrator = rey_strdup(b->ctx, node->type);
    if (!b->scene->integrator) {
        return REY_ERROR_MEMORY;
    }
    return rey_xml_check_unused(b->ctx, node, NULL, NULL);
}
