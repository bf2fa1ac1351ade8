// names.c: a hash table from names to indices.
#include "scene/names.h"

#include <string.h>

static const char *name_of(NamedItems items, int32_t item) {
    return *(char *const *)(const void *)((const char *)items.array->data + (size_t)item * items.item_bytes);
}

// FNV-1a, 64 bit.
static size_t home(const Names *names, const char *name) {
    uint64_t h = 14695981039346656037u;
    for (; *name; name++) {
        h = (h ^ (unsigned char)*name) * 1099511628211u;
    }
    return (size_t)(h ^ (h >> 32)) & (names->capacity - 1);
}

static size_t next(const Names *names, size_t slot) {
    return (slot + 1) & (names->capacity - 1);
}

static void put(Names *names, NamedItems items, int32_t item) {
    size_t slot = home(names, name_of(items, item));
    while (names->slots[slot]) {
        slot = next(names, slot);
    }
    names->slots[slot] = item + 1;
}

static rey_result grow(rey_context *ctx, Names *names, NamedItems items) {
    Names larger = {.capacity = names->capacity ? names->capacity * 2 : 64, .count = names->count};
    larger.slots = rey_alloc_array(ctx, larger.capacity, sizeof *larger.slots);
    if (!larger.slots) {
        return REY_ERROR_MEMORY;
    }
    // From an empty slot on, so that items of the same name keep their order.
    size_t first = 0;
    while (names->capacity && names->slots[first]) {
        first++;
    }
    for (size_t i = 0; i < names->capacity; i++) {
        int32_t item = names->slots[(first + i) & (names->capacity - 1)] - 1;
        if (item >= 0) {
            put(&larger, items, item);
        }
    }
    rey_free(ctx, names->slots);
    *names = larger;
    return REY_OK;
}

rey_result rey_names_add(rey_context *ctx, Names *names, NamedItems items, int32_t item) {
    if (names->count >= names->capacity / 2 && grow(ctx, names, items) != REY_OK) {
        return REY_ERROR_MEMORY;
    }
    put(names, items, item);
    names->count++;
    return REY_OK;
}

int32_t rey_names_find(const Names *names, NamedItems items, const char *name) {
    if (!names->capacity) {
        return -1;
    }
    for (size_t slot = home(names, name); names->slots[slot]; slot = next(names, slot)) {
        if (strcmp(name_of(items, names->slots[slot] - 1), name) == 0) {
            return names->slots[slot] - 1;
        }
    }
    return -1;
}

void rey_names_remove(Names *names, NamedItems items, int32_t item) {
    if (!names->capacity) {
        return;
    }
    size_t hole = home(names, name_of(items, item));
    while (names->slots[hole] && names->slots[hole] != item + 1) {
        hole = next(names, hole);
    }
    if (!names->slots[hole]) {
        return;
    }
    names->count--;
    // What stands behind moves up, unless that would be before its home.
    for (size_t slot = next(names, hole); names->slots[slot]; slot = next(names, slot)) {
        size_t from = home(names, name_of(items, names->slots[slot] - 1)), mask = names->capacity - 1;
        if (((slot - from) & mask) >= ((slot - hole) & mask)) {
            names->slots[hole] = names->slots[slot];
            hole = slot;
        }
    }
    names->slots[hole] = 0;
}

void rey_names_free(rey_context *ctx, Names *names) {
    rey_free(ctx, names->slots);
    *names = (Names){0};
}

bool rey_name_matches(const char *pattern, const char *name) {
    const char *star = NULL, *resume = NULL;
    while (*name) {
        if (*pattern == '*') {
            star = pattern++;
            resume = name;
        } else if (*pattern == *name) {
            pattern++;
            name++;
        } else if (star) {
            pattern = star + 1;
            name = ++resume;
        } else {
            return false;
        }
    }
    while (*pattern == '*') {
        pattern++;
    }
    return !*pattern;
}

bool rey_name_is_pose(const char *name) {
    const char *dot = strrchr(name, '.');
    return dot && strcmp(dot, ".to_world") == 0;
}
