// spec_rows.h: colours in structure-of-arrays form, one row per channel. Whoever stores colours does it through these.
#pragma once

#include "math/vec.h"

typedef real *SpecRows[SPEC_N];

KFN Float real_gather(const real *base, Int index) {
#if LANES == 1
    return base[index];
#else
    return f_gather(base, index);
#endif
}

KFN Spec spec_load(real *const *rows, int32_t at) {
    Spec s;
    for (int c = 0; c < SPEC_N; c++) {
        s.c[c] = f_load(rows[c] + at);
    }
    return s;
}

KFN void spec_store(real *const *rows, int32_t at, Spec s) {
    for (int c = 0; c < SPEC_N; c++) {
        f_store(rows[c] + at, s.c[c]);
    }
}

KFN Spec spec_gather(real *const *rows, Int index) {
    Spec s;
    for (int c = 0; c < SPEC_N; c++) {
        s.c[c] = real_gather(rows[c], index);
    }
    return s;
}

KFN void spec_scatter(real *const *rows, Int index, Spec s, Mask m) {
    for (int c = 0; c < SPEC_N; c++) {
        f_scatter(rows[c], index, s.c[c], m);
    }
}

KFN void spec_scatter_add(real *const *rows, Int index, Spec s, Mask m) {
    for (int c = 0; c < SPEC_N; c++) {
        f_scatter_add(rows[c], index, s.c[c], m);
    }
}

// Stores the lanes of m one behind the other.
KFN void v3_compress(real *x, real *y, real *z, Vec3 v, Mask m) {
    f_compress(x, v.x, m);
    f_compress(y, v.y, m);
    f_compress(z, v.z, m);
}

KFN void spec_compress(real *const *rows, int32_t at, Spec s, Mask m) {
    for (int c = 0; c < SPEC_N; c++) {
        f_compress(rows[c] + at, s.c[c], m);
    }
}
