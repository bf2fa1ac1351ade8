// build_integrator.c: integrators.
#include "io/build.h"

#include <string.h>

static const char *integrator_word(void *user, int i) {
    static const char *const words[] = {"path", "direct", "moment", "prb"};
    UNUSED(user);
    return i < COUNT_OF(words) ? words[i] : NULL;
}

rey_result build_integrator(Builder *b, rey_xml_node *node) {
    SceneView *view = &b->scene->view;
    int64_t depth, roulette = 5, count;
    double timeout;
    bool hide;
    if (strcmp(node->type, "moment") == 0) {
        rey_xml_child *nested = rey_xml_child_of(node, REY_XML_BIT(REY_XML_INTEGRATOR), 0);
        if (!nested) {
            return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE, "'moment' needs a nested integrator");
        }
        TRY(build_integrator(b, nested->node));
        return rey_xml_check_unused(b->ctx, node, NULL, NULL);
    }
    bool direct = strcmp(node->type, "direct") == 0, prb = strcmp(node->type, "prb") == 0;
    if (!direct && !prb && strcmp(node->type, "path") != 0) {
        return build_unknown(b, node, integrator_word, NULL);
    }
    if (direct) {
        depth = 2;
        TRY(rey_xml_get_int(b->ctx, node, "shading_samples", 0, 1 << 16, 1, &count));
        TRY(rey_xml_get_int(b->ctx, node, "emitter_samples", 0, 1 << 16, 1, &count));
        TRY(rey_xml_get_int(b->ctx, node, "bsdf_samples", 0, 1 << 16, 1, &count));
    } else {
        TRY(rey_xml_get_int(b->ctx, node, "max_depth", -1, INT32_MAX, prb ? 6 : -1, &depth));
        TRY(rey_xml_get_int(b->ctx, node, "rr_depth", 1, INT32_MAX, 5, &roulette));
    }
    TRY(rey_xml_get_bool(b->ctx, node, "hide_emitters", false, &hide));
    TRY(rey_xml_get_float(b->ctx, node, "timeout", 0, &timeout));
    TRY(rey_xml_get_int(b->ctx, node, "block_size", 0, INT32_MAX, 0, &count));
    TRY(rey_xml_get_int(b->ctx, node, "samples_per_pass", 0, INT32_MAX, 0, &count));
    view->max_depth = (int32_t)depth;
    view->rr_depth = (int32_t)roulette;
    view->hide_emitters = hide;
    b->scene->integrator = rey_strdup(b->ctx, node->type);
    if (!b->scene->integrator) {
        return REY_ERROR_MEMORY;
    }
    return rey_xml_check_unused(b->ctx, node, NULL, NULL);
}
