// build_group.c: shading groups: what the lanes of one batch have in common, each once.
#include "io/build.h"

#include <string.h>

static size_t home(const GroupTable *table, const Group *g) {
    const int32_t fields[] = {g->bsdf, g->emitter, g->shape_kind, g->shape_flags, g->interior, g->exterior};
    uint64_t h = 14695981039346656037u; // FNV-1a over whole fields
    for (int i = 0; i < COUNT_OF(fields); i++) {
        h = (h ^ (uint32_t)fields[i]) * 1099511628211u;
        h ^= h >> 29;
    }
    return (size_t)h & (table->capacity - 1);
}

// The slot of an equal group, or the empty one where it would go. Groups that a lenient reader took back leave their
// numbers behind: no group, or another one, has them now.
static int32_t *slot_of(const GroupTable *table, const Array *groups, const Group *g) {
    size_t i = home(table, g);
    for (;; i = (i + 1) & (table->capacity - 1)) {
        size_t number = (size_t)table->slots[i];
        if (!number || (number <= groups->count && memcmp(&ARRAY_AT(*groups, Group, number - 1), g, sizeof *g) == 0)) {
            return &table->slots[i];
        }
    }
}

static rey_result grow(Builder *b) {
    const Array *groups = &b->scene->build.groups;
    GroupTable larger = {.capacity = b->groups.capacity ? b->groups.capacity * 2 : 64, .used = groups->count};
    larger.slots = rey_alloc_array(b->ctx, larger.capacity, sizeof *larger.slots);
    if (!larger.slots) {
        return REY_ERROR_MEMORY;
    }
    for (size_t i = 0; i < groups->count; i++) {
        *slot_of(&larger, groups, &ARRAY_AT(*groups, Group, i)) = (int32_t)i + 1;
    }
    rey_free(b->ctx, b->groups.slots);
    b->groups = larger;
    return REY_OK;
}

rey_result build_group(Builder *b, ShapeRecord *shape) {
    rey_scene *scene = b->scene;
    Group g = {shape->bsdf, shape->emitter, shape->kind, shape->flags, shape->interior, shape->exterior};
    if (b->groups.used >= b->groups.capacity / 2) {
        TRY(grow(b));
    }
    int32_t *slot = slot_of(&b->groups, &scene->build.groups, &g);
    if (!*slot) {
        int32_t group = rey_scene_append(scene, &scene->build.groups, sizeof g, 1);
        if (group < 0) {
            return REY_ERROR_MEMORY;
        }
        ARRAY_AT(scene->build.groups, Group, group) = g;
        *slot = group + 1;
        b->groups.used++;
    }
    shape->group = *slot - 1;
    return REY_OK;
}
