// table.c: the kinds of kinds.inl as data.
#include "medium/table.h"

#include "medium/phase.h"

#include <string.h>

#define PARAM_ROW(type, field, value, low, high, text) {PHASE_PARAM_##type, #field, value, low, high, text},
// A zeroed last row keeps the arrays of kinds without parameters well-formed.
#define PHASE_LEAF(ENUM, prefix, Record, name, PARAMS, reference)                                                      \
    static const PhaseParam prefix##_params[] = {PARAMS(PARAM_ROW){PHASE_PARAM_NUMBER, NULL, 0, 0, 0, NULL}};          \
    static_assert(COUNT_OF(prefix##_params) - 1 <= MAX_PHASE_SLOTS, "more slots are needed");
#define PHASE_ADAPTER(ENUM, prefix, Record, name, PARAMS, children, reference)                                         \
    PHASE_LEAF(ENUM, prefix, Record, name, PARAMS, reference)
#include "medium/kinds.inl"
#undef PHASE_LEAF
#undef PHASE_ADAPTER

const PhaseKind rey_phase_kinds[] = {
#define PHASE_LEAF(ENUM, prefix, Record, name, PARAMS, reference)                                                      \
    {name, prefix##_params, COUNT_OF(prefix##_params) - 1, 0, reference},
#define PHASE_ADAPTER(ENUM, prefix, Record, name, PARAMS, children, reference)                                         \
    {name, prefix##_params, COUNT_OF(prefix##_params) - 1, children, reference},
#include "medium/kinds.inl"
#undef PHASE_LEAF
#undef PHASE_ADAPTER
};

const int rey_phase_kind_count = PHASE_KIND_COUNT;

int rey_phase_kind_find(const char *name) {
    for (int i = 0; i < PHASE_KIND_COUNT; i++) {
        if (strcmp(rey_phase_kinds[i].name, name) == 0) {
            return i;
        }
    }
    return -1;
}

int32_t rey_phase_table_size(const TextureNode *textures, const PhaseNode *node) {
    return node->kind == PHASE_TABPHASE ? textures[node->slot[0]].width - 1 : 0;
}

// Cumulative shares of the cells.
void rey_phase_update(const SceneView *view, const PhaseNode *node) {
    if (node->kind != PHASE_TABPHASE) {
        return;
    }
    const TextureNode *t = view->textures + node->slot[0];
    const float *values = view->theta + t->theta;
    double sum = 0, integral = 0;
    for (int32_t i = 0; i < t->width - 1; i++) {
        integral += (double)values[i] + (double)values[i + 1];
    }
    for (int32_t i = 0; i < t->width - 1; i++) {
        sum += (double)values[i] + (double)values[i + 1];
        view->tables[node->table + i] = i + 2 == t->width ? 1 : (float)(sum / integral);
    }
}
