// shards.h: the gradients that parts of a derivative gather, which are then added up.
#pragma once

#include "render/render_parts.h"

// How many parts of `tiles` tiles have a gradient of so many numbers of their own, whatever the threads, so that sums do not
// depend on these.
int32_t rey_shards_count(int32_t tiles, int64_t numbers);
// Whether what they, and the direction of a request, will take can be had: the system promises memory that it does not have, and
// ends whoever then uses it.
rey_result rey_shards_fit(const Render *r);
// Makes room for them where they fit.
rey_result rey_shards_begin(Render *r);
// Adds them up in the first one.
rey_result rey_shards_sum(Render *r);
