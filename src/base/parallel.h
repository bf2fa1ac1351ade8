// parallel.h: worker threads and the machine's facts.
#pragma once

#include "base/context.h"

// Calls fn(argument, item, worker) for every item in [0, count), in any order, on up to `threads` workers
// (0 <= worker < threads). Returns when all are done. Falls back to fewer threads when some cannot be started.
void rey_parallel_for(int threads, int64_t count, void (*fn)(void *argument, int64_t item, int worker),
                      void *argument);

int rey_available_threads(void); // affinity mask and cgroup quota, at least 1
// How many workers make sense where `asked` are asked for; 0 asks for as many as are available.
int rey_useful_threads(int asked);
int rey_widest_lanes(void);      // 16 with AVX-512, 8 with AVX2 and FMA, else 1, as far as there are kernels
double rey_seconds(void);        // monotonic wall clock [s]
double rey_thread_seconds(void); // CPU time of the calling thread [s]
int64_t rey_peak_rss(void);      // peak resident memory of the process [bytes]
int64_t rey_memory_left(void);   // memory that may still be used [bytes]; INT64_MAX where the system does not say
