// sphere.h: chi-square test of directions against a density on the sphere. The grid is graded around the densest
// sample, so that narrow lobes fill many cells; each cell's expected count is integrated adaptively.
#pragma once

#include "cases.h"

// Densities of n unit directions.
typedef void density_fn(void *user, int n, double (*d)[3], double *pdf);

enum { CELLS_THETA = 18, CELLS_PHI = 8, CELLS = CELLS_THETA * CELLS_PHI };

typedef struct SphereGrid {
    double s[3], t[3], n[3];          // the pole is n
    double rings[CELLS_THETA + 1];
    int side;                         // -1 or 1: only directions with that sign of z; 0: all
    bool edges;                       // the density ends abruptly: quadrature does not trust its first agreement
    density_fn *density;
    void *user;
} SphereGrid;

static inline void grid_direction(const SphereGrid *g, double theta, double phi, double d[3]) {
    double x = sin(theta) * cos(phi), y = sin(theta) * sin(phi), z = cos(theta);
    for (int k = 0; k < 3; k++) {
        d[k] = g->s[k] * x + g->t[k] * y + g->n[k] * z;
    }
}

// narrow: half the width of the smallest ring.
static inline SphereGrid grid_make(const double pole[3], double narrow, int side, density_fn *density, void *user) {
    const double pi = 3.14159265358979323846;
    SphereGrid g = {.side = side, .density = density, .user = user};
    memcpy(g.n, pole, sizeof g.n);
    double a[3] = {fabs(pole[0]) < 0.5, 0, 0};
    a[1] = 1 - a[0];
    double along = a[0] * pole[0] + a[1] * pole[1], size = 0;
    for (int k = 0; k < 3; k++) {
        g.s[k] = a[k] - along * pole[k];
        size += g.s[k] * g.s[k];
    }
    for (int k = 0; k < 3; k++) {
        g.s[k] /= sqrt(size);
    }
    for (int k = 0; k < 3; k++) {
        int i = (k + 1) % 3, j = (k + 2) % 3;
        g.t[k] = g.n[i] * g.s[j] - g.n[j] * g.s[i];
    }
    for (int i = 1; i <= CELLS_THETA; i++) {
        g.rings[i] = narrow * pow(pi / narrow, (i - 1.0) / (CELLS_THETA - 1));
    }
    g.rings[CELLS_THETA] = pi;
    return g;
}

// Cell of a direction, -1 on the other side.
static inline int grid_cell(const SphereGrid *g, const double d[3]) {
    if (g->side * d[2] < 0) {
        return -1;
    }
    double x = 0, y = 0, z = 0;
    for (int k = 0; k < 3; k++) {
        x += g->s[k] * d[k];
        y += g->t[k] * d[k];
        z += g->n[k] * d[k];
    }
    double theta = atan2(hypot(x, y), z), phi = atan2(y, x) / 6.283185307179586;
    int i = 0, j = (int)((phi - floor(phi)) * CELLS_PHI);
    while (i < CELLS_THETA - 1 && theta >= g->rings[i + 1]) {
        i++;
    }
    return i * CELLS_PHI + (j < CELLS_PHI ? j : CELLS_PHI - 1);
}

enum { GAUSS = 4, POINTS = GAUSS * GAUSS };

static inline double grid_quadrature(const SphereGrid *g, double t0, double t1, double p0, double p1) {
    static const double x[GAUSS] = {0.06943184420297371, 0.33000947820757187, 0.66999052179242813, 0.93056815579702629};
    static const double w[GAUSS] = {0.17392742256872693, 0.32607257743127307, 0.32607257743127307, 0.17392742256872693};
    double d[POINTS][3], pdf[POINTS], sum = 0;
    for (int k = 0; k < POINTS; k++) {
        grid_direction(g, t0 + (t1 - t0) * x[k / GAUSS], p0 + (p1 - p0) * x[k % GAUSS], d[k]);
    }
    g->density(g->user, POINTS, d, pdf);
    for (int k = 0; k < POINTS; k++) {
        double sine = sin(t0 + (t1 - t0) * x[k / GAUSS]);
        sum += g->side * d[k][2] < 0 ? 0 : w[k / GAUSS] * w[k % GAUSS] * pdf[k] * sine;
    }
    return sum * (t1 - t0) * (p1 - p0);
}

static inline double grid_integral(const SphereGrid *g, double t0, double t1, double p0, double p1, double whole,
                                   double tolerance, int depth, int forced) {
    double tm = 0.5 * (t0 + t1), pm = 0.5 * (p0 + p1), part[4], sum = 0;
    for (int k = 0; k < 4; k++) {
        part[k] = grid_quadrature(g, k & 1 ? tm : t0, k & 1 ? t1 : tm, k & 2 ? pm : p0, k & 2 ? p1 : pm);
        sum += part[k];
    }
    if (depth == 0 || (fabs(sum - whole) <= tolerance && forced <= 0)) {
        return sum;
    }
    sum = 0;
    for (int k = 0; k < 4; k++) {
        sum += grid_integral(g, k & 1 ? tm : t0, k & 1 ? t1 : tm, k & 2 ? pm : p0, k & 2 ? p1 : pm, part[k],
                             0.5 * tolerance, depth - 1, forced - 1);
    }
    return sum;
}

// Probability of each cell. Lobes far narrower than a cell can slip through the first points of the quadrature: where
// counts and integral differ, the cell is cut finely before any comparison.
static inline void grid_probabilities(const SphereGrid *g, const int counts[CELLS], int n, double p[CELLS]) {
    for (int i = 0; i < CELLS; i++) {
        double t0 = g->rings[i / CELLS_PHI], t1 = g->rings[i / CELLS_PHI + 1];
        double p0 = 6.283185307179586 * (i % CELLS_PHI) / CELLS_PHI, p1 = p0 + 6.283185307179586 / CELLS_PHI;
        double whole = grid_quadrature(g, t0, t1, p0, p1);
        p[i] = grid_integral(g, t0, t1, p0, p1, whole, g->edges ? 2e-6 : 1e-5, 8, g->edges ? 2 : 1);
        if (fabs(counts[i] - n * p[i]) > 2 * sqrt(n * p[i] + 1)) {
            p[i] = grid_integral(g, t0, t1, p0, p1, whole, 1e-6, 10, 4);
        }
    }
}

// Probability of counts at least this far from n p; cells that expect fewer than 8 are pooled with what is left over.
static inline double chi_square_test(int cells, const double *p, const int *counts, int n) {
    double pooled_p = 1, value = 0;
    int pooled = n, degrees = 0;
    for (int i = 0; i < cells; i++) {
        if (n * p[i] >= 8) {
            value += (counts[i] - n * p[i]) * (counts[i] - n * p[i]) / (n * p[i]);
            pooled_p -= p[i];
            pooled -= counts[i];
            degrees++;
        }
    }
    // What is left over: too small a share for the approximation is bounded as a Poisson count.
    if (n * pooled_p >= 8) {
        value += (pooled - n * pooled_p) * (pooled - n * pooled_p) / (n * pooled_p);
    } else {
        degrees--;
        double expected = n * fmax(pooled_p, 0) + 1;
        if (pooled > expected + 8 * sqrt(expected) + 8 || pooled_p < -2e-3) {
            return 0;
        }
    }
    return degrees > 0 ? chi_square_tail(degrees, value) : 1;
}
