// overlaps.h: which of many boxes overlap.
#pragma once

#include "base/context.h"

typedef struct Box {
    float low[3], high[3];
    int32_t moves;  // pairs of boxes that both stand still are left out
    int32_t family; // so are pairs of boxes of one family; -1: of none
} Box;

static inline bool rey_boxes_apart(const Box *a, const Box *b) {
    bool apart = false;
    for (int k = 0; k < 3; k++) {
        apart |= a->low[k] > b->high[k] || b->low[k] > a->high[k];
    }
    return apart;
}

// Called once for each pair first < second, in an order that depends on the boxes alone; anything but REY_OK ends the search.
typedef rey_result OverlapFn(void *user, int32_t first, int32_t second);

rey_result rey_overlaps_find(rey_context *ctx, const Box *boxes, int32_t count, OverlapFn *found, void *user);
