// triples.h: hash table from three 32-bit words to their index in an array of such triples. Open addressing with
// linear probing; the table holds index + 1 (0 is free) and never the keys themselves.
#pragma once

#include "base/context.h"

typedef struct Triple {
    uint32_t word[3];
} Triple;

typedef struct TripleTable {
    uint32_t *slots;
    size_t slot_count; // a power of two, at least twice the number of keys; 0 while empty
} TripleTable;

static inline uint64_t triple_hash(const Triple *key) {
    uint64_t hash = key->word[0] | (uint64_t)key->word[1] << 32;
    hash = (hash ^ hash >> 32) * UINT64_C(0x9E3779B97F4A7C15);
    hash = (hash ^ hash >> 29 ^ key->word[2]) * UINT64_C(0xD6E8FEB86659FD93);
    return hash ^ hash >> 32;
}

// The slot that holds key's index + 1, or the free slot (0) where it belongs.
static inline uint32_t *triple_slot(const TripleTable *table, const Triple *keys, const Triple *key) {
    size_t at = (size_t)triple_hash(key) & (table->slot_count - 1);
    while (table->slots[at]) {
        const Triple *other = &keys[table->slots[at] - 1];
        if (other->word[0] == key->word[0] && other->word[1] == key->word[1] && other->word[2] == key->word[2]) {
            break;
        }
        at = (at + 1) & (table->slot_count - 1);
    }
    return &table->slots[at];
}

// Makes room for one more key than the count distinct ones stored; false (and a recorded message) without memory.
static inline bool triple_reserve(rey_context *ctx, TripleTable *table, const Triple *keys, size_t count) {
    if (2 * (count + 1) <= table->slot_count) {
        return true;
    }
    TripleTable larger = {.slot_count = table->slot_count ? 2 * table->slot_count : 64};
    while (larger.slot_count < 2 * (count + 1)) {
        larger.slot_count *= 2;
    }
    larger.slots = rey_alloc_array(ctx, larger.slot_count, sizeof *larger.slots);
    if (!larger.slots) {
        return false;
    }
    if (table->slots) {
        for (size_t i = 0; i < count; i++) {
            *triple_slot(&larger, keys, &keys[i]) = (uint32_t)(i + 1);
        }
    }
    rey_free(ctx, table->slots);
    *table = larger;
    return true;
}

static inline void triple_free(rey_context *ctx, TripleTable *table) {
    rey_free(ctx, table->slots);
    *table = (TripleTable){0};
}
