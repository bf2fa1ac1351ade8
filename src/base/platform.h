// platform.h: what differs between compilers and targets. The only place with #ifdef on either.
#pragma once

#include <assert.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#if defined(__CUDACC__)
#define KFN static __device__ __forceinline__
#define RESTRICT __restrict__
#define NOINLINE
#else
#define KFN static inline __attribute__((always_inline, unused)) // kernel function
#define RESTRICT restrict
#define NOINLINE __attribute__((noinline, unused))
#endif

#define PRINTF_LIKE(text, first) __attribute__((format(__printf__, text, first)))
#define ALIGNED(n) __attribute__((aligned(n)))
#define COUNT_OF(array) ((int)(sizeof(array) / sizeof((array)[0])))
#define PLURAL(n) ((n) == 1 ? "" : "s") // "%d view%s"
#define UNUSED(x) ((void)(x))
