// names.h: finds items of an array by name: a hash table over their indices.
#pragma once

#include "base/context.h"

// The array that the indices count in; every item begins with its name, a char *.
typedef struct NamedItems {
    const Array *array;
    size_t item_bytes;
} NamedItems;

typedef struct Names {
    int32_t *slots; // index + 1, 0 = empty; open addressing
    size_t capacity, count; // capacity is a power of two, at most half full
} Names;

// Adds an item that is in the array. Of items with the same name the first is found.
rey_result rey_names_add(rey_context *ctx, Names *names, NamedItems items, int32_t item);
// Index of the item of that name, -1 = none.
int32_t rey_names_find(const Names *names, NamedItems items, const char *name);
// Takes out an item that is still in the array.
void rey_names_remove(Names *names, NamedItems items, int32_t item);
void rey_names_free(rey_context *ctx, Names *names);

// Whether a name fits a pattern, in which * stands for any text.
bool rey_name_matches(const char *pattern, const char *name);
// Whether a parameter of this name is a pose, which patterns pass over even where it moves nothing but an environment.
bool rey_name_is_pose(const char *name);
