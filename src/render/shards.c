// shards.c: the gradients that parts of a derivative gather. Large ones are few: each takes eight bytes per number.
#include "render/shards.h"

#include "base/parallel.h"
#include "render/dropped.h"
#include "render/motion.h"

enum { MOST_SHARDS = 8, FEWEST_SHARDS = 2 };
enum { MOST_NUMBERS = 1 << 27 }; // of all shards, where they are more than the fewest
static const int64_t watched = 1 << 30; // bytes from which on it is asked whether they can be had

rey_result rey_shards_fit(const Render *r) {
    const int64_t each = r->shards * (int64_t)sizeof(double) + (r->request.values ? (int64_t)sizeof(float) : 0); // with a direction
    const int64_t bytes = r->gradient_size * each;
    const int64_t left = bytes < watched ? INT64_MAX : rey_memory_left();
    if (bytes <= left) {
        return REY_OK;
    }
    return rey_fail(r->scene->ctx, REY_ERROR_MEMORY,
                    "out of memory: a gradient of %lld numbers takes %.1f GB besides its result, %.1f GB are left",
                    (long long)r->gradient_size, (double)bytes * 1e-9, (double)left * 1e-9);
}

int32_t rey_shards_count(int32_t tiles, int64_t numbers) {
    int32_t shards = MOST_SHARDS;
    while (shards > FEWEST_SHARDS && numbers > MOST_NUMBERS / shards) {
        shards /= 2;
    }
    return tiles < shards ? tiles : shards;
}

rey_result rey_shards_begin(Render *r) {
    r->shards = rey_shards_count(r->tiles, r->gradient_size);
    rey_result result = rey_shards_fit(r);
    if (result == REY_OK) {
        r->gradients = rey_alloc_array(r->scene->ctx, (size_t)(r->gradient_size + 1) * (size_t)r->shards, sizeof(double));
        result = r->gradients ? REY_OK : REY_ERROR_MEMORY;
    }
    return result;
}

rey_result rey_shards_sum(Render *r) {
    for (int64_t i = 0; i < r->gradient_size; i++) {
        double sum = 0;
        for (int32_t k = 0; k < r->shards; k++) {
            sum += r->gradients[k * r->gradient_size + i];
        }
        r->gradients[i] = sum;
    }
    rey_dropped_gradient(r, r->gradients);
    return rey_motion_gradient(r, r->gradients);
}
