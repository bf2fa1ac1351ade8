// lanes.h: the wide Float that kernels are written in, and every operation on it that C's operators do not give.
//
// LANES = 1 is the scalar reference (and the CUDA form); 8 is AVX2, 16 is AVX-512. With REAL_DOUBLE (and LANES 1) the
// same kernels compile in double precision, for the derivative tests. A Mask lane is 0 or -1. Float, Int, UInt and
// Mask take + - * / & | ^ ~ << >> and mix with scalars; comparisons and selects go through the functions below.
// This is the only file with loops over lanes besides ray packing and the sinks.
#pragma once

#include "base/platform.h"

#include <math.h>
#include <string.h>

#ifndef LANES
#define LANES 1
#endif

#define LANES_CONCAT_(a, b) a##b
#define LANES_CONCAT(a, b) LANES_CONCAT_(a, b)
#define KNAME(name) LANES_CONCAT(name##_w, LANES) // external symbols carry their width

#if LANES == 1
#ifdef REAL_DOUBLE
typedef double real;
#define REAL_EPSILON 2.220446e-16
#else
typedef float real;
#define REAL_EPSILON 5.960464e-8f
#endif
typedef real Float;
typedef int32_t Int;
typedef uint32_t UInt;
typedef int32_t Mask;
#else
#include <immintrin.h>
typedef float real;
#define REAL_EPSILON 5.960464e-8f
typedef float Float __attribute__((vector_size(4 * LANES)));
typedef int32_t Int __attribute__((vector_size(4 * LANES)));
typedef uint32_t UInt __attribute__((vector_size(4 * LANES)));
typedef Int Mask;
#endif

// ---- construction, comparison, selection -------------------------------------------------------------------------

#if LANES == 1
KFN Float f_set(real x) { return x; }
KFN Int i_set(int32_t x) { return x; }
KFN UInt u_set(uint32_t x) { return x; }
KFN Int i_iota(void) { return 0; }
KFN Mask m_lt(Float a, Float b) { return -(a < b); }
KFN Mask m_le(Float a, Float b) { return -(a <= b); }
KFN Mask m_eq(Float a, Float b) { return -(a == b); }
KFN Mask mi_eq(Int a, Int b) { return -(a == b); }
KFN Mask mi_lt(Int a, Int b) { return -(a < b); }
KFN Float f_select(Mask m, Float a, Float b) { return m ? a : b; }
KFN Int i_select(Mask m, Int a, Int b) { return m ? a : b; }
KFN UInt u_select(Mask m, UInt a, UInt b) { return m ? a : b; }
KFN bool m_any(Mask m) { return m != 0; }
KFN bool m_all(Mask m) { return m != 0; }
KFN uint32_t m_bits(Mask m) { return m != 0; }
KFN Mask m_from_bits(uint32_t bits) { return -(int32_t)(bits & 1); }
#else
KFN Float f_set(real x) { return (Float){0} + x; }
KFN Int i_set(int32_t x) { return (Int){0} + x; }
KFN UInt u_set(uint32_t x) { return (UInt){0} + x; }
KFN Mask m_lt(Float a, Float b) { return (Mask)(a < b); }
KFN Mask m_le(Float a, Float b) { return (Mask)(a <= b); }
KFN Mask m_eq(Float a, Float b) { return (Mask)(a == b); }
KFN Mask mi_eq(Int a, Int b) { return (Mask)(a == b); }
KFN Mask mi_lt(Int a, Int b) { return (Mask)(a < b); }
#if LANES == 8
KFN Int i_iota(void) { return (Int){0, 1, 2, 3, 4, 5, 6, 7}; }
KFN Int i_select(Mask m, Int a, Int b) {
    return (Int)_mm256_blendv_epi8((__m256i)b, (__m256i)a, (__m256i)m);
}
KFN uint32_t m_bits(Mask m) { return (uint32_t)_mm256_movemask_ps((__m256)m); }
KFN bool m_all(Mask m) { return m_bits(m) == 0xff; }
KFN Mask m_from_bits(uint32_t bits) { return (Mask)((i_set((int32_t)bits) >> i_iota()) & 1) * -1; }
#else
KFN Int i_iota(void) { return (Int){0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15}; }
KFN Int i_select(Mask m, Int a, Int b) {
    return (Int)_mm512_ternarylogic_epi32((__m512i)m, (__m512i)a, (__m512i)b, 0xca);
}
KFN uint32_t m_bits(Mask m) { return (uint32_t)_mm512_movepi32_mask((__m512i)m); }
KFN bool m_all(Mask m) { return m_bits(m) == 0xffff; }
KFN Mask m_from_bits(uint32_t bits) { return (Mask)_mm512_movm_epi32((__mmask16)bits); }
#endif
KFN Float f_select(Mask m, Float a, Float b) { return (Float)i_select(m, (Int)a, (Int)b); }
KFN UInt u_select(Mask m, UInt a, UInt b) { return (UInt)i_select(m, (Int)a, (Int)b); }
KFN bool m_any(Mask m) { return m_bits(m) != 0; }
#endif

KFN Mask m_gt(Float a, Float b) { return m_lt(b, a); }
KFN Mask m_ge(Float a, Float b) { return m_le(b, a); }
KFN Mask m_ne(Float a, Float b) { return ~m_eq(a, b); }
KFN Mask m_set(bool on) { return (Mask)i_set(on ? -1 : 0); }
KFN int m_count(Mask m) { return __builtin_popcount(m_bits(m)); }
KFN int m_first(Mask m) { return __builtin_ctz(m_bits(m)); } // m must have a lane on
// The first n lanes.
KFN Mask m_first_n(int n) { return mi_lt(i_iota(), i_set(n)); }
KFN Mask m_finite(Float x) { return m_eq(x - x, f_set(0)); }
KFN Float f_zero_unless(Mask m, Float x) { return f_select(m, x, f_set(0)); }

KFN real f_lane(Float x, int lane) {
#if LANES == 1
    UNUSED(lane);
    return x;
#else
    return x[lane];
#endif
}
KFN int32_t i_lane(Int x, int lane) {
#if LANES == 1
    UNUSED(lane);
    return x;
#else
    return x[lane];
#endif
}

// ---- arithmetic --------------------------------------------------------------------------------------------------

#if LANES == 1
#ifdef REAL_DOUBLE
KFN Float f_sqrt(Float x) { return sqrt(x); }
KFN Float f_floor(Float x) { return floor(x); }
KFN Float f_abs(Float x) { return fabs(x); }
KFN Float f_copysign(Float x, Float s) { return copysign(x, s); }
#else
KFN Float f_sqrt(Float x) { return sqrtf(x); }
KFN Float f_floor(Float x) { return floorf(x); }
KFN Float f_abs(Float x) { return fabsf(x); }
KFN Float f_copysign(Float x, Float s) { return copysignf(x, s); }
#endif
KFN Float f_min(Float a, Float b) { return a < b ? a : b; }
KFN Float f_max(Float a, Float b) { return a > b ? a : b; }
KFN Int i_min(Int a, Int b) { return a < b ? a : b; }
KFN Int i_max(Int a, Int b) { return a > b ? a : b; }
KFN Float f_from_i(Int x) { return (Float)x; }
KFN Float f_from_u(UInt x) { return (Float)x; }
KFN Int i_from_f(Float x) { return (Int)x; }
#else
#if LANES == 8
#define SIMD_F(op) _mm256_##op##_ps
#define SIMD_I(op) _mm256_##op##_epi32
typedef __m256 SimdF;
typedef __m256i SimdI;
#else
#define SIMD_F(op) _mm512_##op##_ps
#define SIMD_I(op) _mm512_##op##_epi32
typedef __m512 SimdF;
typedef __m512i SimdI;
#endif
KFN Float f_sqrt(Float x) { return (Float)SIMD_F(sqrt)((SimdF)x); }
KFN Float f_floor(Float x) { return (Float)SIMD_F(floor)((SimdF)x); }
KFN Float f_abs(Float x) { return (Float)((Int)x & 0x7fffffff); }
KFN Float f_copysign(Float x, Float s) { return (Float)(((Int)x & 0x7fffffff) | ((UInt)s & 0x80000000u)); }
KFN Float f_min(Float a, Float b) { return (Float)SIMD_F(min)((SimdF)a, (SimdF)b); }
KFN Float f_max(Float a, Float b) { return (Float)SIMD_F(max)((SimdF)a, (SimdF)b); }
KFN Int i_min(Int a, Int b) { return (Int)SIMD_I(min)((SimdI)a, (SimdI)b); }
KFN Int i_max(Int a, Int b) { return (Int)SIMD_I(max)((SimdI)a, (SimdI)b); }
KFN Float f_from_i(Int x) { return __builtin_convertvector(x, Float); }
KFN Float f_from_u(UInt x) { return __builtin_convertvector(x, Float); }
KFN Int i_from_f(Float x) { return __builtin_convertvector(x, Int); } // truncates
#endif

KFN Float f_clamp(Float x, Float low, Float high) { return f_min(f_max(x, low), high); }
KFN Float f_sqr(Float x) { return x * x; }
KFN Float f_safe_sqrt(Float x) { return f_sqrt(f_max(x, f_set(0))); }
KFN Float f_lerp(Float a, Float b, Float t) { return a + (b - a) * t; }
// x^5
KFN Float f_pow5(Float x) { return f_sqr(f_sqr(x)) * x; }
// 1 / x where |x| is not tiny, 0 elsewhere: a safe input for lanes that do not count.
KFN Float f_safe_rcp(Float x) {
    Mask ok = m_gt(f_abs(x), f_set(1e-30f));
    return f_zero_unless(ok, 1.0f / f_select(ok, x, f_set(1)));
}
KFN Float f_sign(Float x) { return f_copysign(f_set(1), x); }

// The bits of each lane in reverse order.
#if LANES == 1
KFN UInt u_reverse_bits(UInt x) {
    x = ((x >> 1) & 0x55555555u) | ((x & 0x55555555u) << 1);
    x = ((x >> 2) & 0x33333333u) | ((x & 0x33333333u) << 2);
    x = ((x >> 4) & 0x0f0f0f0fu) | ((x & 0x0f0f0f0fu) << 4);
    return __builtin_bswap32(x);
}
#else
#if LANES == 8
#define SIMD_BYTES(a, b, c, d) ((SimdI)(UInt)_mm256_broadcastsi128_si256(_mm_setr_epi32((int)(a), (int)(b), (int)(c), (int)(d))))
#define SIMD_LOOKUP _mm256_shuffle_epi8
#else
#define SIMD_BYTES(a, b, c, d) _mm512_broadcast_i32x4(_mm_setr_epi32((int)(a), (int)(b), (int)(c), (int)(d)))
#define SIMD_LOOKUP _mm512_shuffle_epi8
#endif
KFN UInt u_reverse_bits(UInt x) {
    // Halves of bytes by tables of 16 bytes, then the bytes themselves.
    SimdI reversed = SIMD_BYTES(0x0c040800u, 0x0e060a02u, 0x0d050901u, 0x0f070b03u);
    SimdI swapped = SIMD_BYTES(0x00010203u, 0x04050607u, 0x08090a0bu, 0x0c0d0e0fu);
    UInt low = (UInt)SIMD_LOOKUP(reversed, (SimdI)(x & 0x0f0f0f0fu)) << 4;
    UInt high = (UInt)SIMD_LOOKUP(reversed, (SimdI)(x >> 4 & 0x0f0f0f0fu));
    return (UInt)SIMD_LOOKUP((SimdI)(low | high), swapped);
}
#endif

// ---- memory ------------------------------------------------------------------------------------------------------

KFN Float f_load(const real *p) {
    Float x;
    memcpy(&x, p, sizeof x);
    return x;
}
KFN void f_store(real *p, Float x) { memcpy(p, &x, sizeof x); }
KFN Int i_load(const int32_t *p) {
    Int x;
    memcpy(&x, p, sizeof x);
    return x;
}
KFN void i_store(int32_t *p, Int x) { memcpy(p, &x, sizeof x); }

// base[index] per lane. Every lane's index must be valid, dead lanes included.
#if LANES == 1
KFN Float f_gather(const float *base, Int index) { return base[index]; }
KFN Int i_gather(const int32_t *base, Int index) { return base[index]; }
#elif LANES == 8
KFN Float f_gather(const float *base, Int index) { return (Float)_mm256_i32gather_ps(base, (SimdI)index, 4); }
KFN Int i_gather(const int32_t *base, Int index) { return (Int)_mm256_i32gather_epi32(base, (SimdI)index, 4); }
#else
KFN Float f_gather(const float *base, Int index) { return (Float)_mm512_i32gather_ps((SimdI)index, base, 4); }
KFN Int i_gather(const int32_t *base, Int index) { return (Int)_mm512_i32gather_epi32((SimdI)index, base, 4); }
#endif

// Four bytes from byte `index` on, and two halves from half `index` on, which up to three bytes behind them must be readable.
#if LANES == 1
KFN Int i_gather_bytes(const void *base, Int index) {
    Int word;
    memcpy(&word, (const char *)base + index, sizeof word);
    return word;
}
KFN Int i_gather_halves(const void *base, Int index) { return i_gather_bytes((const char *)base + index, index); }
#elif LANES == 8
KFN Int i_gather_bytes(const void *base, Int index) { return (Int)_mm256_i32gather_epi32(base, (SimdI)index, 1); }
KFN Int i_gather_halves(const void *base, Int index) { return (Int)_mm256_i32gather_epi32(base, (SimdI)index, 2); }
#else
KFN Int i_gather_bytes(const void *base, Int index) { return (Int)_mm512_i32gather_epi32((SimdI)index, base, 1); }
KFN Int i_gather_halves(const void *base, Int index) { return (Int)_mm512_i32gather_epi32((SimdI)index, base, 2); }
#endif

// Do all lanes have the same number?
KFN bool i_uniform(Int x) { return m_all(mi_eq(x, i_set(i_lane(x, 0)))); }
// i_gather where they often do.
KFN Int i_gather_shared(const int32_t *base, Int index) {
    return i_uniform(index) ? i_set(base[i_lane(index, 0)]) : i_gather(base, index);
}

// base[index + k] per lane for k = 0, 1, 2, and one entry more is read: arrays have room behind their ends. A load of 16 bytes
// per lane and a transposition, which take a third of the time of three gathers (Zen 4). Not inlined: kernels would take twice
// as long to compile.
#if LANES == 1
static NOINLINE void f_gather3(const float *base, Int index, Float out[3]) {
    for (int k = 0; k < 3; k++) {
        out[k] = base[index + k];
    }
}
static NOINLINE void i_gather3(const int32_t *base, Int index, Int out[3]) { memcpy(out, base + index, 3 * sizeof *out); }
#else
#if LANES == 8
#define SIMD_ROWS(f) _mm256_##f
KFN __m256 simd_rows(const float *base, const int32_t *index) {
    __m256 rows = _mm256_castps128_ps256(_mm_loadu_ps(base + index[0]));
    return _mm256_insertf128_ps(rows, _mm_loadu_ps(base + index[4]), 1);
}
#else
#define SIMD_ROWS(f) _mm512_##f
KFN __m512 simd_rows(const float *base, const int32_t *index) {
    __m512 rows = _mm512_castps128_ps512(_mm_loadu_ps(base + index[0]));
    rows = _mm512_insertf32x4(rows, _mm_loadu_ps(base + index[4]), 1);
    rows = _mm512_insertf32x4(rows, _mm_loadu_ps(base + index[8]), 2);
    return _mm512_insertf32x4(rows, _mm_loadu_ps(base + index[12]), 3);
}
#endif
static NOINLINE void f_gather3(const float *base, Int index, Float out[3]) {
    int32_t at[LANES];
    memcpy(at, &index, sizeof at);
    // Blocks of four lanes: rows[k] has what lanes k, k + 4, ... read.
    SimdF rows[4];
    for (int k = 0; k < 4; k++) {
        rows[k] = simd_rows(base, at + k);
    }
    SimdF xy01 = SIMD_ROWS(unpacklo_ps)(rows[0], rows[1]), xy23 = SIMD_ROWS(unpacklo_ps)(rows[2], rows[3]);
    SimdF z01 = SIMD_ROWS(unpackhi_ps)(rows[0], rows[1]), z23 = SIMD_ROWS(unpackhi_ps)(rows[2], rows[3]);
    out[0] = (Float)SIMD_ROWS(shuffle_ps)(xy01, xy23, 0x44);
    out[1] = (Float)SIMD_ROWS(shuffle_ps)(xy01, xy23, 0xee);
    out[2] = (Float)SIMD_ROWS(shuffle_ps)(z01, z23, 0x44);
}
static NOINLINE void i_gather3(const int32_t *base, Int index, Int out[3]) {
    Float bits[3];
    f_gather3((const float *)base, index, bits);
    for (int k = 0; k < 3; k++) {
        out[k] = (Int)bits[k];
    }
}
#endif

// base[index] per lane where all indices lie in the NEAR_LANES entries from `first` on, which must all be readable: two loads
// and a permutation.
enum { NEAR_LANES = 2 * LANES };
#if LANES == 1
KFN Float f_near(const real *base, int32_t first, Int index) {
    UNUSED(first);
    return base[index];
}
KFN Int i_near(const int32_t *base, int32_t first, Int index) {
    UNUSED(first);
    return base[index];
}
#elif LANES == 8
KFN Float f_near(const real *base, int32_t first, Int index) {
    Int at = index - first;
    __m256 low = _mm256_permutevar8x32_ps(_mm256_loadu_ps(base + first), (SimdI)at);
    __m256 high = _mm256_permutevar8x32_ps(_mm256_loadu_ps(base + first + 8), (SimdI)at);
    return (Float)_mm256_blendv_ps(low, high, (__m256)(at << 28)); // bit 3 becomes the sign
}
#else
KFN Float f_near(const real *base, int32_t first, Int index) {
    return (Float)_mm512_permutex2var_ps(_mm512_loadu_ps(base + first), (SimdI)(index - first),
                                         _mm512_loadu_ps(base + first + 16));
}
#endif
#if LANES > 1
KFN Int i_near(const int32_t *base, int32_t first, Int index) { return (Int)f_near((const real *)base, first, index); }
#endif

// Stores the lanes of m one after the other from p on (up to LANES entries behind them may be overwritten).
#if LANES == 16
KFN void f_compress(real *p, Float x, Mask m) {
    _mm512_storeu_ps(p, _mm512_maskz_compress_ps((__mmask16)m_bits(m), (SimdF)x));
}
KFN void i_compress(int32_t *p, Int x, Mask m) {
    _mm512_storeu_si512(p, _mm512_maskz_compress_epi32((__mmask16)m_bits(m), (SimdI)x));
}
#else
KFN void f_compress(real *p, Float x, Mask m) {
    for (uint32_t bits = m_bits(m); bits; bits &= bits - 1) {
        *p++ = f_lane(x, __builtin_ctz(bits));
    }
}
KFN void i_compress(int32_t *p, Int x, Mask m) {
    for (uint32_t bits = m_bits(m); bits; bits &= bits - 1) {
        *p++ = i_lane(x, __builtin_ctz(bits));
    }
}
#endif

KFN void f_scatter(real *base, Int index, Float x, Mask m) {
    for (uint32_t bits = m_bits(m); bits; bits &= bits - 1) {
        int lane = __builtin_ctz(bits);
        base[i_lane(index, lane)] = f_lane(x, lane);
    }
}
KFN void i_scatter(int32_t *base, Int index, Int x, Mask m) {
    for (uint32_t bits = m_bits(m); bits; bits &= bits - 1) {
        int lane = __builtin_ctz(bits);
        base[i_lane(index, lane)] = i_lane(x, lane);
    }
}
KFN void f_scatter_add(real *base, Int index, Float x, Mask m) {
    for (uint32_t bits = m_bits(m); bits; bits &= bits - 1) {
        int lane = __builtin_ctz(bits);
        base[i_lane(index, lane)] += f_lane(x, lane);
    }
}
KFN void f_scatter_add_double(double *base, Int index, Float x, Mask m) {
    for (uint32_t bits = m_bits(m); bits; bits &= bits - 1) {
        int lane = __builtin_ctz(bits);
        base[i_lane(index, lane)] += (double)f_lane(x, lane);
    }
}
// The same for base[index] and base[index + 1], which gain x and y.
KFN void f_scatter_add_doubles(double *base, Int index, Float x, Float y, Mask m) {
    for (uint32_t bits = m_bits(m); bits; bits &= bits - 1) {
        int lane = __builtin_ctz(bits);
        double *p = base + i_lane(index, lane);
        p[0] += (double)f_lane(x, lane);
        p[1] += (double)f_lane(y, lane);
    }
}
// And for three in a row, which gain x[0], x[1] and x[2].
KFN void f_scatter_add_double3(double *base, Int index, const Float x[3], Mask m) {
    for (uint32_t bits = m_bits(m); bits; bits &= bits - 1) {
        int lane = __builtin_ctz(bits);
        double *p = base + i_lane(index, lane);
        p[0] += (double)f_lane(x[0], lane);
        p[1] += (double)f_lane(x[1], lane);
        p[2] += (double)f_lane(x[2], lane);
    }
}
// Sum over the lanes of m, in double and in lane order.
KFN double f_sum(Float x, Mask m) {
    double sum = 0;
    x = f_zero_unless(m, x);
    for (int lane = 0; lane < LANES; lane++) {
        sum += (double)f_lane(x, lane);
    }
    return sum;
}
