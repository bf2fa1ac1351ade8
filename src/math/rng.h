// rng.h: randomness as a pure function of (seed, set, sensor, term, pixel, sample, dimension), with dimension a function
// of (bounce, purpose). No state: replays, widths, threads and machines draw the same numbers, bit for bit.
//
// independent: the four-word hash pcg4d [jarzynski2020 section 4].
// sobol: the first two Sobol dimensions, Owen-scrambled and index-shuffled anew for every (pixel, dimension), "padded"
// [burley2020]. The nested uniform scramble is the hash of Laine and Karras with the constants of [vegdahl2021].
#pragma once

#include "math/vec.h"

typedef struct SampleKey {
    UInt pixel;
    UInt sample;
    uint32_t scramble; // rng_scramble(seed, set, sensor, term)
    bool sobol;        // uniform
} SampleKey;

typedef struct UInt4 {
    UInt x, y, z, w;
} UInt4;

// [jarzynski2020 listing "pcg4d"]
KFN UInt4 rng_hash4(UInt4 v) {
    v.x = v.x * 1664525u + 1013904223u;
    v.y = v.y * 1664525u + 1013904223u;
    v.z = v.z * 1664525u + 1013904223u;
    v.w = v.w * 1664525u + 1013904223u;
    v.x = v.x + v.y * v.w;
    v.y = v.y + v.z * v.x;
    v.z = v.z + v.x * v.y;
    v.w = v.w + v.y * v.z;
    v.x = v.x ^ (v.x >> 16);
    v.y = v.y ^ (v.y >> 16);
    v.z = v.z ^ (v.z >> 16);
    v.w = v.w ^ (v.w >> 16);
    v.x = v.x + v.y * v.w;
    v.y = v.y + v.z * v.x;
    v.z = v.z + v.x * v.y;
    v.w = v.w + v.y * v.z;
    return v;
}

// One word of good quality from two: rounds of the 32-bit finaliser of MurmurHash3.
KFN uint32_t rng_mix(uint32_t state, uint32_t word) {
    state = (state ^ word) + 0x9e3779b9u;
    state = (state ^ (state >> 16)) * 0x85ebca6bu;
    state = (state ^ (state >> 13)) * 0xc2b2ae35u;
    return state ^ (state >> 16);
}

// The scramble word of a SampleKey. Sets are independent repetitions of the whole estimate.
KFN uint32_t rng_scramble(uint32_t seed, uint32_t set, uint32_t sensor, uint32_t term) {
    return rng_mix(rng_mix(rng_mix(rng_mix(0, seed), set), sensor), term);
}

// A permutation in which every bit depends on itself and the lower bits only; on bit-reversed input this is a nested
// uniform scramble [laine2011 section 3.1, constants of vegdahl2021]. The seed must be well mixed.
KFN UInt rng_owen_reversed(UInt x, UInt seed) {
    x = x ^ (x * 0x3d20adeau);
    x = x + seed;
    x = x * ((seed >> 16) | 1u);
    x = x ^ (x * 0x05526c56u);
    x = x ^ (x * 0x53a22864u);
    return x;
}

// Sobol dimension 1 with the digits in reverse order: the Pascal matrix modulo 2, whose entry (i, j) is 1 where the bits
// of i are a subset of those of j, as a five-step butterfly.
KFN UInt rng_sobol1_reversed(UInt index) {
    index = index ^ ((index & 0xaaaaaaaau) >> 1);
    index = index ^ ((index & 0xccccccccu) >> 2);
    index = index ^ ((index & 0xf0f0f0f0u) >> 4);
    index = index ^ ((index & 0xff00ff00u) >> 8);
    return index ^ ((index & 0xffff0000u) >> 16);
}

// The 24 leading bits as a number in [0, 1 - 2^-24]: exact, also in double, so that every build sees the same samples.
KFN Float rng_unit(UInt bits) { return f_from_i((Int)(bits >> 8)) * 5.9604644775390625e-8f; }

KFN UInt4 rng_seeds(const SampleKey *key, UInt sample, uint32_t dimension) {
    UInt4 v = {key->pixel, sample, u_set(dimension), u_set(key->scramble)};
    return rng_hash4(v);
}

KFN UInt rng_shuffled_index(UInt sample, UInt seed) {
    return u_reverse_bits(rng_owen_reversed(u_reverse_bits(sample), seed));
}

// Two numbers in [0, 1). Different dimensions, pixels and scrambles are independent of each other.
KFN Vec2 rng_2d(const SampleKey *key, uint32_t dimension) {
    if (!key->sobol) {
        UInt4 h = rng_seeds(key, key->sample, dimension);
        return (Vec2){rng_unit(h.x), rng_unit(h.y)};
    }
    UInt4 h = rng_seeds(key, u_set(0), dimension);
    UInt index = rng_shuffled_index(key->sample, h.z);
    UInt x = u_reverse_bits(rng_owen_reversed(index, h.x));
    UInt y = u_reverse_bits(rng_owen_reversed(rng_sobol1_reversed(index), h.y));
    return (Vec2){rng_unit(x), rng_unit(y)};
}

// One number in [0, 1): the first of rng_2d.
KFN Float rng_1d(const SampleKey *key, uint32_t dimension) {
    if (!key->sobol) {
        return rng_unit(rng_seeds(key, key->sample, dimension).x);
    }
    UInt4 h = rng_seeds(key, u_set(0), dimension);
    UInt index = rng_shuffled_index(key->sample, h.z);
    return rng_unit(u_reverse_bits(rng_owen_reversed(index, h.x)));
}
