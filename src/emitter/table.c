// table.c: the kinds of kinds.inl as data.
#include "emitter/table.h"

#include "emitter/emitter.h"

#include <string.h>

#define PARAM_ROW(type, field, value, low, high, text, unit) {EMITTER_PARAM_##type, #field, value, low, high, text, unit},
#define EMITTER_SURFACE(ENUM, prefix, Record, name, PARAMS, table)                                                     \
    static const EmitterParam prefix##_params[] = {PARAMS(PARAM_ROW)};                                                 \
    static_assert(COUNT_OF(prefix##_params) <= MAX_EMITTER_SLOTS, "more slots are needed");
#define EMITTER_ENVIRONMENT EMITTER_SURFACE
#define EMITTER_DELTA EMITTER_SURFACE
#include "emitter/kinds.inl"
#undef EMITTER_SURFACE
#undef EMITTER_ENVIRONMENT
#undef EMITTER_DELTA

#define KIND_ROW(prefix, name, form, table)                                                                            \
    {name, form, prefix##_params, COUNT_OF(prefix##_params), table##_size, table##_follow},

const EmitterKind rey_emitter_kinds[] = {
#define EMITTER_SURFACE(ENUM, prefix, Record, name, PARAMS, table) KIND_ROW(prefix, name, EMITTER_IS_SURFACE, table)
#define EMITTER_ENVIRONMENT(ENUM, prefix, Record, name, PARAMS, table)                                                 \
    KIND_ROW(prefix, name, EMITTER_IS_ENVIRONMENT, table)
#define EMITTER_DELTA(ENUM, prefix, Record, name, PARAMS, table) KIND_ROW(prefix, name, EMITTER_IS_DELTA, table)
#include "emitter/kinds.inl"
#undef EMITTER_SURFACE
#undef EMITTER_ENVIRONMENT
#undef EMITTER_DELTA
};

const int rey_emitter_kind_count = EMITTER_KIND_COUNT;

int rey_emitter_kind_find(const char *name) {
    for (int i = 0; i < EMITTER_KIND_COUNT; i++) {
        if (strcmp(rey_emitter_kinds[i].name, name) == 0) {
            return i;
        }
    }
    return -1;
}
