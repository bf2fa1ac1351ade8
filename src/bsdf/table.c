// table.c: the kinds of kinds.inl as data.
#include "bsdf/table.h"

#include "bsdf/bsdf.h"

#include <string.h>

#define PARAM_ROW(type, field, value, low, high, text, option) {PARAM_##type, #field, value, low, high, text, option},
#define CONFIG_ROW(field, value, choices, text) {#field, value, choices, text},

// A zeroed last row keeps the arrays of kinds without parameters well-formed.
#define BSDF_LEAF(ENUM, prefix, Record, name, PARAMS, CONFIG, reference)                                               \
    static const ParamDesc prefix##_params[] = {PARAMS(PARAM_ROW){PARAM_REAL, NULL, 0, 0, 0, NULL, NULL}};             \
    static const ConfigDesc prefix##_configs[] = {CONFIG(CONFIG_ROW){NULL, 0, NULL, NULL}};
#define BSDF_ADAPTER(ENUM, prefix, Record, name, PARAMS, CONFIG, fewest, most, reference)                              \
    BSDF_LEAF(ENUM, prefix, Record, name, PARAMS, CONFIG, reference)
#include "bsdf/kinds.inl"
#undef BSDF_LEAF
#undef BSDF_ADAPTER

const BsdfKind rey_bsdf_kinds[] = {
#define BSDF_LEAF(ENUM, prefix, Record, name, PARAMS, CONFIG, reference)                                               \
    {name, prefix##_params, COUNT_OF(prefix##_params) - 1, prefix##_configs, COUNT_OF(prefix##_configs) - 1, 0, 0,     \
     false, reference},
#define BSDF_ADAPTER(ENUM, prefix, Record, name, PARAMS, CONFIG, fewest, most, reference)                              \
    {name, prefix##_params, COUNT_OF(prefix##_params) - 1, prefix##_configs, COUNT_OF(prefix##_configs) - 1, fewest,   \
     most, true, reference},
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

int32_t rey_bsdf_table_size(int kind) {
    UNUSED(kind);
    return 0;
}

rey_result rey_bsdf_update(rey_scene *scene, int32_t bsdf) {
    UNUSED(scene);
    UNUSED(bsdf);
    return REY_OK;
}
