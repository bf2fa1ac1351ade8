// lbfgs.c: one step of limited-memory BFGS at a time.
#include "fit/lbfgs.h"

#include <math.h>
#include <string.h>

static const double DESCENT = 1e-4, CURVATURE = 0.9; // c1 and c2 of the Wolfe conditions
static const double SLACK = 1e-3;                    // of the value: what noise may hide
static const double LEAST_COSINE = 1e-8;             // between s and y of a pair that is kept

// The state: scalars, then vectors of n.
enum { STARTED, PAIRS, NEXT, VALUE, SLOPE, STEP, LOW, HIGH, FARTHEST, TRIALS, SHORTER, SCALARS };
// STARTED. LEAPING: the trial's value is another estimate than the best point's. RETURNING: such a trial was no better, and the
// best point is to be evaluated by the new estimate. HELD: it was, and no trial may leave that one's range before the point moves.
enum { UNSTARTED, SEARCHING, LEAPING, RETURNING, HELD };
enum { POSITION, GRADIENT, DIRECTION, VECTORS };

typedef struct Lbfgs {
    double *scalar, *position, *gradient, *direction, *s, *y;
    int64_t n;
    int memory;
} Lbfgs;

static Lbfgs open_state(double *state, int64_t n, int memory) {
    double *vectors = state + SCALARS;
    return (Lbfgs){state, vectors + POSITION * n, vectors + GRADIENT * n, vectors + DIRECTION * n, vectors + VECTORS * n,
                   vectors + (VECTORS + memory) * n, n, memory};
}

int64_t rey_lbfgs_numbers(int64_t n, int memory) {
    return SCALARS + (VECTORS + 2 * (int64_t)memory) * n;
}

static double dot(const double *a, const double *b, int64_t n) {
    double sum = 0;
    for (int64_t i = 0; i < n; i++) {
        sum += a[i] * b[i];
    }
    return sum;
}

static double largest(const double *a, int64_t n) {
    double most = 0;
    for (int64_t i = 0; i < n; i++) {
        most = fmax(most, fabs(a[i]));
    }
    return most;
}

static void add(double *a, double factor, const double *b, int64_t n) {
    for (int64_t i = 0; i < n; i++) {
        a[i] += factor * b[i];
    }
}

// direction = -H gradient by two loops over the pairs [nocedal1980 section 4].
static void find_direction(Lbfgs *l) {
    int count = (int)l->scalar[PAIRS], next = (int)l->scalar[NEXT];
    double alpha[64];
    for (int64_t i = 0; i < l->n; i++) {
        l->direction[i] = -l->gradient[i];
    }
    for (int k = 0; k < count; k++) {
        int at = (next - 1 - k + 2 * l->memory) % l->memory;
        const double *s = l->s + at * l->n, *y = l->y + at * l->n;
        alpha[k] = dot(s, l->direction, l->n) / dot(s, y, l->n);
        add(l->direction, -alpha[k], y, l->n);
    }
    if (count) {
        int last = (next - 1 + l->memory) % l->memory;
        const double *s = l->s + last * l->n, *y = l->y + last * l->n;
        double scale = dot(s, y, l->n) / dot(y, y, l->n);
        for (int64_t i = 0; i < l->n; i++) {
            l->direction[i] *= scale;
        }
    }
    for (int k = count - 1; k >= 0; k--) {
        int at = (next - 1 - k + 2 * l->memory) % l->memory;
        const double *s = l->s + at * l->n, *y = l->y + at * l->n;
        double beta = dot(y, l->direction, l->n) / dot(s, y, l->n);
        add(l->direction, alpha[k] - beta, s, l->n);
    }
}

// A new line from the best point.
static void begin_line(Lbfgs *l, double *x) {
    double *c = l->scalar;
    find_direction(l);
    c[SLOPE] = dot(l->direction, l->gradient, l->n);
    if (!(c[SLOPE] < 0)) {
        c[PAIRS] = c[NEXT] = 0;
        find_direction(l);
        c[SLOPE] = dot(l->direction, l->gradient, l->n);
    }
    double size = largest(l->direction, l->n);
    double longest = c[PAIRS] > 0 ? LBFGS_LONGEST : pow(0.25, c[SHORTER]);
    c[STEP] = c[PAIRS] > 0 ? 1 : INFINITY;
    c[STEP] = size > 0 ? fmin(c[STEP], longest / size) : 0;
    c[LOW] = c[TRIALS] = 0;
    c[HIGH] = c[FARTHEST] = INFINITY;
    memcpy(x, l->position, (size_t)l->n * sizeof *x);
    add(x, c[STEP], l->direction, l->n);
}

static void keep_pair(Lbfgs *l, const double *gradient, const double *x) {
    double *c = l->scalar, *s = l->s + (int)c[NEXT] * l->n, *y = l->y + (int)c[NEXT] * l->n;
    for (int64_t i = 0; i < l->n; i++) {
        s[i] = x[i] - l->position[i];
        y[i] = gradient[i] - l->gradient[i];
    }
    if (dot(s, y, l->n) > LEAST_COSINE * sqrt(dot(s, s, l->n) * dot(y, y, l->n))) {
        c[NEXT] = ((int)c[NEXT] + 1) % l->memory;
        c[PAIRS] = fmin(c[PAIRS] + 1, l->memory);
    }
}

static void accept(Lbfgs *l, double value, const double *gradient, double *x) {
    memcpy(l->position, x, (size_t)l->n * sizeof *x);
    memcpy(l->gradient, gradient, (size_t)l->n * sizeof *x);
    l->scalar[VALUE] = value;
    begin_line(l, x);
}

// The next trial on the line.
static void search(Lbfgs *l, double *x) {
    double *c = l->scalar, size = largest(l->direction, l->n);
    if (isfinite(c[HIGH])) {
        c[STEP] = 0.5 * (c[LOW] + c[HIGH]);
    } else {
        c[STEP] = fmin(2 * c[STEP], LBFGS_LONGEST / size);
    }
    memcpy(x, l->position, (size_t)l->n * sizeof *x);
    add(x, c[STEP], l->direction, l->n);
}

void rey_lbfgs_step(double *state, int64_t n, int memory, double value, const double *gradient, double *x) {
    Lbfgs l = open_state(state, n, memory);
    double *c = l.scalar;
    if (c[STARTED] == UNSTARTED || c[STARTED] == RETURNING) {
        c[STARTED] = c[STARTED] == UNSTARTED ? SEARCHING : HELD;
        accept(&l, value, gradient, x);
        return;
    }
    double slope = dot(l.direction, gradient, n);
    bool descends = value <= c[VALUE] + DESCENT * c[STEP] * c[SLOPE] + SLACK * fabs(c[VALUE]);
    // As far as a step may go, or nearly.
    bool longest = c[STEP] * largest(l.direction, n) > 0.999 * LBFGS_LONGEST || 2 * c[STEP] >= c[FARTHEST];
    bool flat = fabs(slope) <= -CURVATURE * c[SLOPE] || (slope < 0 && longest);
    bool last = ++c[TRIALS] >= LBFGS_MOST_TRIALS, leaping = c[STARTED] == LEAPING;
    if (leaping && !descends) {
        rey_lbfgs_take_best(state, n, x);
        c[STARTED] = RETURNING;
        return;
    }
    if (descends && (flat || last || leaping)) {
        c[SHORTER] = 0;
        c[STARTED] = SEARCHING;
        keep_pair(&l, gradient, x);
        accept(&l, value, gradient, x);
        return;
    }
    if (last) {
        c[PAIRS] = c[NEXT] = 0;
        c[SHORTER]++;
        begin_line(&l, x);
        return;
    }
    if (!descends || slope > 0) {
        c[HIGH] = c[STEP];
    } else {
        c[LOW] = c[STEP];
    }
    search(&l, x);
}

bool rey_lbfgs_leap(double *state, int64_t n, int memory, double *x) {
    Lbfgs l = open_state(state, n, memory);
    double *c = l.scalar;
    if (c[STARTED] == HELD) {
        c[HIGH] = c[FARTHEST] = c[STEP];
        search(&l, x);
        return false;
    }
    c[STARTED] = c[STARTED] == SEARCHING ? LEAPING : c[STARTED];
    return true;
}

bool rey_lbfgs_has_best(const double *state) { return state[STARTED] != UNSTARTED; }

void rey_lbfgs_take_best(const double *state, int64_t n, double *x) {
    if (rey_lbfgs_has_best(state)) {
        memcpy(x, state + SCALARS + POSITION * n, (size_t)n * sizeof *x);
    }
}

double rey_lbfgs_best_value(const double *state) {
    return state[VALUE];
}

void rey_lbfgs_forget(double *state) {
    memset(state, 0, SCALARS * sizeof *state);
}
