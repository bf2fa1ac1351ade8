// parallel.c: a parallel loop over numbered items, on POSIX threads (their synchronisation is visible to
// ThreadSanitizer, which an OpenMP runtime's is not).
#define _GNU_SOURCE
#include "base/parallel.h"

#include <pthread.h>
#include <sched.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <time.h>

enum { MAX_THREADS = 256 };

typedef struct Loop {
    void (*fn)(void *argument, int64_t item, int worker);
    void *argument;
    int64_t count;
    _Atomic int64_t next;
    _Atomic int workers;
} Loop;

static void *loop_run(void *pointer) {
    Loop *loop = pointer;
    int worker = atomic_fetch_add(&loop->workers, 1);
    for (;;) {
        int64_t item = atomic_fetch_add(&loop->next, 1);
        if (item >= loop->count) {
            return NULL;
        }
        loop->fn(loop->argument, item, worker);
    }
}

void rey_parallel_for(int threads, int64_t count, void (*fn)(void *argument, int64_t item, int worker),
                      void *argument) {
    Loop loop = {.fn = fn, .argument = argument, .count = count};
    pthread_t handles[MAX_THREADS];
    int helpers = 0;
    if (threads > MAX_THREADS) {
        threads = MAX_THREADS;
    }
    while (helpers < threads - 1 && helpers < count - 1 &&
           pthread_create(&handles[helpers], NULL, loop_run, &loop) == 0) {
        helpers++;
    }
    loop_run(&loop);
    for (int i = 0; i < helpers; i++) {
        pthread_join(handles[i], NULL);
    }
}

// CPUs that the cgroup's quota pays for, 0 when there is no quota.
static int cgroup_quota(void) {
    FILE *file = fopen("/sys/fs/cgroup/cpu.max", "r");
    if (!file) {
        return 0;
    }
    long long quota = 0, period = 0;
    int found = fscanf(file, "%lld %lld", &quota, &period);
    fclose(file);
    return found == 2 && quota > 0 && period > 0 ? (int)((quota + period - 1) / period) : 0;
}

int rey_available_threads(void) {
    cpu_set_t set;
    int threads = 1;
    if (sched_getaffinity(0, sizeof set, &set) == 0) {
        threads = CPU_COUNT(&set);
    }
    int quota = cgroup_quota();
    if (quota > 0 && quota < threads) {
        threads = quota;
    }
    return threads < 1 ? 1 : threads > MAX_THREADS ? MAX_THREADS : threads;
}

int rey_useful_threads(int asked) {
    enum { MOST_PER_PROCESSOR = 4, FEWEST = 16 };
    int available = rey_available_threads();
    int most = available * MOST_PER_PROCESSOR < FEWEST ? FEWEST : available * MOST_PER_PROCESSOR;
    most = most > MAX_THREADS ? MAX_THREADS : most;
    return asked <= 0 ? available : asked > most ? most : asked;
}

int rey_widest_lanes(void) {
    if (REYNOLDS_WIDEST >= 16 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
        __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512vl")) {
        return 16;
    }
    return REYNOLDS_WIDEST >= 8 && __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") ? 8 : 1;
}

static double clock_seconds(clockid_t clock) {
    struct timespec now;
    clock_gettime(clock, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

double rey_seconds(void) {
    return clock_seconds(CLOCK_MONOTONIC);
}

double rey_thread_seconds(void) {
    return clock_seconds(CLOCK_THREAD_CPUTIME_ID);
}

// What a file of lines "NAME:  NUMBER kB" says [bytes], 0 where it does not.
static int64_t system_figure(const char *path, const char *name) {
    FILE *file = fopen(path, "r");
    char line[128];
    long long kilobytes = 0;
    while (file && !kilobytes && fgets(line, sizeof line, file)) {
        if (strncmp(line, name, strlen(name)) == 0) {
            kilobytes = strtoll(line + strlen(name), NULL, 10);
        }
    }
    if (file) {
        fclose(file);
    }
    return (int64_t)kilobytes * 1024;
}

// getrusage also counts what the parent held before it started this program, so Linux's own figure comes first.
int64_t rey_peak_rss(void) {
    int64_t bytes = system_figure("/proc/self/status", "VmHWM:");
    struct rusage usage;
    if (bytes) {
        return bytes;
    }
    return getrusage(RUSAGE_SELF, &usage) == 0 ? (int64_t)usage.ru_maxrss * 1024 : 0;
}

int64_t rey_memory_left(void) {
    int64_t bytes = system_figure("/proc/meminfo", "MemAvailable:");
    return bytes ? bytes : INT64_MAX;
}
