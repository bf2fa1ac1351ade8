// table.c: the kinds of kinds.inl as data.
#include "bsdf/table.h"

#include "bsdf/bsdf.h"
#include "math/rough_transmittance.h"

#include <string.h>

#define PARAM_ROW(type, field, value, low, high, text, option) {PARAM_##type, #field, value, low, high, text, option},
#define CONFIG_ROW(field, value, choices, text) {#field, value, choices, text},

// A zeroed last row keeps the arrays of kinds without parameters well-formed.
#define BSDF_LEAF(ENUM, prefix, Record, name, sides, PARAMS, CONFIG, reference)                                        \
    static const ParamDesc prefix##_params[] = {PARAMS(PARAM_ROW){PARAM_REAL, NULL, 0, 0, 0, NULL, NULL}};             \
    static const ConfigDesc prefix##_configs[] = {CONFIG(CONFIG_ROW){NULL, 0, NULL, NULL}};
#define BSDF_ADAPTER(ENUM, prefix, Record, name, sides, PARAMS, CONFIG, fewest, most, child, reference)                \
    BSDF_LEAF(ENUM, prefix, Record, name, sides, PARAMS, CONFIG, reference)
#include "bsdf/kinds.inl"
#undef BSDF_LEAF
#undef BSDF_ADAPTER

const BsdfKind rey_bsdf_kinds[] = {
#define BSDF_LEAF(ENUM, prefix, Record, name, sides, PARAMS, CONFIG, reference)                                        \
    {name, prefix##_params, COUNT_OF(prefix##_params) - 1, prefix##_configs, COUNT_OF(prefix##_configs) - 1, 0, 0,     \
     NULL, false, sides, reference},
#define BSDF_ADAPTER(ENUM, prefix, Record, name, sides, PARAMS, CONFIG, fewest, most, child, reference)                \
    {name, prefix##_params, COUNT_OF(prefix##_params) - 1, prefix##_configs, COUNT_OF(prefix##_configs) - 1, fewest,   \
     most, child, true, sides, reference},
#include "bsdf/kinds.inl"
#undef BSDF_LEAF
#undef BSDF_ADAPTER
};

const int rey_bsdf_kind_count = BSDF_KIND_COUNT;

int rey_bsdf_kind_find(const char *name) {
    for (int i = 0; i < BSDF_KIND_COUNT; i++) {
        if (strcmp(rey_bsdf_kinds[i].name, name) == 0) {
            return i;
        }
    }
    return -1;
}

bool rey_bsdf_opens(int kind) { return kind == BSDF_THINDIELECTRIC || kind == BSDF_MASK || kind == BSDF_NULL; }

bool rey_bsdf_bends(int kind) {
    return kind == BSDF_CONDUCTOR || kind == BSDF_DIELECTRIC || kind == BSDF_PLASTIC || rey_bsdf_opens(kind);
}

bool rey_bsdf_spreads(int kind) {
    return !rey_bsdf_kinds[kind].adapter && (kind == BSDF_PLASTIC || !rey_bsdf_bends(kind));
}

bool rey_bsdf_glossy(int kind) {
    bool rough = kind == BSDF_ROUGHCONDUCTOR || kind == BSDF_ROUGHDIELECTRIC || kind == BSDF_ROUGHPLASTIC;
    return rough || kind == BSDF_PRINCIPLED || kind == BSDF_PRINCIPLEDTHIN;
}

bool rey_bsdf_mirrors(int kind) { return rey_bsdf_bends(kind) && kind != BSDF_MASK && kind != BSDF_NULL; }

bool rey_bsdf_refracts(int kind) { return kind == BSDF_DIELECTRIC; }

bool rey_bsdf_passes(int kind) { return kind == BSDF_NULL; }

bool rey_bsdf_samples_alike(int kind) { return kind == BSDF_DIFFUSE || kind == BSDF_NULL; }

bool rey_bsdf_tints(int kind) { return kind == BSDF_THINDIELECTRIC; }

// Whether a number is 0 everywhere.
static bool is_none(const SceneView *view, int32_t texture) {
    const TextureNode *t = texture >= 0 ? view->textures + texture : NULL;
    return t && t->kind == TEXTURE_CONSTANT && view->theta[t->theta] == 0;
}

bool rey_bsdf_ends(const SceneView *view, const BsdfNode *node) {
    const BsdfKind *kind = rey_bsdf_kinds + node->kind;
    bool ends = node->kind == BSDF_ROUGHDIELECTRIC && node->config[0] == 1;
    for (int k = 0; k < kind->param_count && node->kind == BSDF_PRINCIPLED; k++) {
        ends |= strcmp(kind->params[k].name, "spec_trans") == 0 && !is_none(view, node->slot[k]);
    }
    return ends;
}

bool rey_bsdf_turns(int kind) { return kind == BSDF_NORMALMAP || kind == BSDF_BUMPMAP; }

// Of TURNED_CONFIG the second switch.
bool rey_bsdf_cuts(const BsdfNode *node) { return rey_bsdf_turns(node->kind) && !node->config[1]; }

bool rey_bsdf_oriented(const SceneView *view, const BsdfNode *node) {
    const BsdfKind *kind = rey_bsdf_kinds + node->kind;
    bool oriented = rey_bsdf_turns(node->kind);
    for (int k = 0; k < kind->param_count; k++) {
        const ParamDesc *p = kind->params + k;
        const TextureNode *t = node->slot[k] >= 0 ? view->textures + node->slot[k] : NULL;
        oriented |= p->type == PARAM_ALPHA_V && node->slot[k] != node->slot[k - 1]; // "alpha" fills both
        oriented |= t && !is_none(view, node->slot[k]) && strcmp(p->name, "anisotropic") == 0;
    }
    return oriented;
}

bool rey_bsdf_takes_slope(int kind, int slot) {
    return slot < rey_bsdf_kinds[kind].param_count && rey_bsdf_kinds[kind].params[slot].type == PARAM_HEIGHT;
}

int32_t rey_bsdf_table_size(int kind) {
    return kind == BSDF_ROUGHPLASTIC ? COAT_TABLE_SIZE : 0;
}

// The coat's transmittance, tabulated for the current roughness and index.
static void roughplastic_update(rey_scene *scene, const BsdfNode *node) {
    const SceneView *view = &scene->view;
    double eta = (double)view->theta[view->textures[node->slot[0]].theta];
    double alpha = (double)view->theta[view->textures[node->slot[3]].theta];
    double internal, by_alpha, by_eta;
    float *table = view->tables + node->table;
    rey_rough_transmittance(node->config[0] == 1, fmax(alpha, (double)MICROFACET_ALPHA_MIN), eta, table,
                            table + COAT_BY_ALPHA, table + COAT_BY_ETA, &internal, &by_alpha, &by_eta);
    if (alpha <= (double)MICROFACET_ALPHA_MIN) { // as of microfacet_alpha_adj
        memset(table + COAT_BY_ALPHA, 0, (COAT_BY_ETA - COAT_BY_ALPHA) * sizeof *table);
        by_alpha = 0;
    }
    table[COAT_INTERNAL] = (float)internal;
    table[COAT_INTERNAL + 1] = (float)by_alpha;
    table[COAT_INTERNAL + 2] = (float)by_eta;
}

rey_result rey_bsdf_update(rey_scene *scene, int32_t bsdf) {
    const BsdfNode *node = scene->view.bsdfs + bsdf;
    if (node->kind == BSDF_ROUGHPLASTIC) {
        roughplastic_update(scene, node);
    }
    return REY_OK;
}
