// cases.h: random small scenes for every kind, made from the tables of kinds; directions; statistics.
#pragma once

#include "bsdf/table.h"
#include "kinds.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

typedef struct Random {
    uint64_t state;
} Random;

// splitmix64, independent of the library's own generator.
static inline double uniform(Random *r) {
    uint64_t z = (r->state += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return (double)((z ^ (z >> 31)) >> 11) * 0x1p-53;
}
static inline double between(Random *r, double low, double high) { return low + (high - low) * uniform(r); }
static inline int below(Random *r, int n) { return (int)(uniform(r) * n); }

// A sequence of its own for each number; the environment variable REYNOLDS_TEST_SEED draws other cases.
Random case_random(int number);
// A scene with one function of this kind (and children, for adapters). textured: slots are textures of all sorts,
// otherwise constants. variant enumerates the uniform switches.
void case_make(KindCase *c, Random *r, int kind, int variant, bool textured);
// Number of combinations of a kind's switches.
int case_variants(int kind);
// Scenes with one light: every kind of light, and of shape for area lights.
enum {
    LIGHT_RECTANGLE,
    LIGHT_SPHERE,
    LIGHT_DISK,
    LIGHT_CYLINDER,
    LIGHT_POINT,
    LIGHT_CONSTANT,
    LIGHT_ENVMAP,
    LIGHT_SPOT,
    LIGHT_PROJECTOR,
    LIGHT_DIRECTIONAL,
    LIGHT_COUNT
};
extern const char *const light_names[LIGHT_COUNT];
void case_make_light(KindCase *c, Random *r, int light, bool textured);
// Brings derived tables up to date with theta (poses, environment maps).
void case_update_light(KindCase *c);
// Appends n numbers in the range of a parameter row; returns where they begin.
int case_values(KindCase *c, Random *r, const ParamDesc *p, int n, int owner);
// Appends a texture with values in the range of a parameter row; returns its number.
int case_texture(KindCase *c, Random *r, const ParamDesc *p, int owner, bool textured);
// Sets all values of a parameter of the root; names that it does not have are passed over.
void case_set(KindCase *c, const char *name, double value);
// Brings the root's derived table up to date with theta.
void case_update(KindCase *c);
// Whether the function turns the shading normal.
bool case_turns(const KindCase *c);
// Describes a failing case on standard error.
void case_print(const KindCase *c, const Query *q);

// How many of the widths 1, 8 and 16 the processor has.
int case_width_count(void);

// A unit vector on either side; a quarter of them grazing.
void random_direction(Random *r, double v[3]);

// Probability that a chi-square variable with that many degrees of freedom is larger.
double chi_square_tail(double degrees, double value);
// Probability of a deviation as large as this one, for a normal variable.
double normal_tail(double z);
// Threshold of one of n independent tests such that all pass with probability 1 - level.
double sidak(double level, int n);
