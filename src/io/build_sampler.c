// build_sampler.c: samplers. There are two ways to place samples: independent random points, and scrambled Sobol points,
// which are stratified in every power of two of samples. All other samplers of the format stand for the latter.
#include "io/build.h"
#include "io/lenient.h"

#include <string.h>

static const char *const words[] = {"independent", "stratified", "multijitter", "orthogonal", "ldsampler", "sobol"};

static const char *sampler_word(void *user, int i) {
    UNUSED(user);
    return i < COUNT_OF(words) ? words[i] : NULL;
}

// Parameters that steer how points are stratified: checked, and of no consequence here.
static rey_result get_placement(Builder *b, rey_xml_node *node) {
    bool jitter;
    int64_t strength;
    if (strcmp(node->type, "ldsampler") == 0) {
        return REY_OK;
    }
    TRY(rey_xml_get_bool(b->ctx, node, "jitter", true, &jitter));
    return strcmp(node->type, "orthogonal") == 0 ? rey_xml_get_int(b->ctx, node, "strength", 1, 1 << 24, 2, &strength)
                                                 : REY_OK;
}

rey_result build_sampler(Builder *b, rey_xml_node *node, SensorRecord *s) {
    int64_t count = 4, seed;
    s->sampler = REY_SAMPLER_INDEPENDENT;
    s->spp = (int32_t)count;
    if (!node) {
        return REY_OK;
    }
    int kind = -1;
    for (int i = 0; i < COUNT_OF(words); i++) {
        kind = strcmp(node->type, words[i]) == 0 ? i : kind;
    }
    if (kind < 0) {
        return build_unknown(b, node, sampler_word, NULL);
    }
    s->sampler = kind == 0 ? REY_SAMPLER_INDEPENDENT : REY_SAMPLER_SOBOL;
    TRY(rey_xml_get_int(b->ctx, node, "sample_count", 1, 1 << 24, 4, &count));
    TRY(rey_xml_get_int(b->ctx, node, "seed", 0, UINT32_MAX, 0, &seed));
    s->spp = (int32_t)count;
    if (kind > 0 && strcmp(words[kind], "sobol") != 0) {
        TRY(get_placement(b, node));
        TRY(rey_scene_add_note(b->scene,
                               "%s:%d: the sampler 'sobol' (Owen-scrambled points) takes the place of '%s': it is "
                               "stratified for any sample count, and uses %d as it stands",
                               node->at.file, node->at.line, node->type, s->spp));
    }
    return build_check_unused(b, node);
}
