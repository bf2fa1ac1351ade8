// check_step.c: how far `reynolds check` moves along a direction, and the formulas of its differences: central with
// Richardson's extrapolation over h and h/2, (4 D(h/2) - D(h)) / 3, error O(h^4); where a bound leaves no room on one
// side, the one-sided four-point formula of error O(h^3).
#include "check.h"

#include <math.h>
#include <string.h>

// Steps that the bounds of the parameters allow along the direction, forwards (sign 1) or backwards (-1).
static double room(const rey_scene *scene, const float *original, const Direction *d, double sign) {
    double most = INFINITY;
    for (int k = 0; k < d->count; k++) {
        rey_param_info info;
        if (rey_param_get_info(scene, d->params[k], &info)) {
            continue;
        }
        for (int64_t i = d->offsets[k]; i < d->offsets[k + 1]; i++) {
            double t = sign * (double)d->tangent[i], v = (double)original[i];
            if (t > 0) {
                most = fmin(most, ((double)info.high - v) / t);
            } else if (t < 0) {
                most = fmin(most, ((double)info.low - v) / t);
            }
        }
    }
    return fmax(most, 0);
}

// Whether parameter k of a direction is a pose that turns, scales or shears: its translation, in the scene's units,
// whatever they are, must not set the step of the other entries.
static bool is_turning_pose(const rey_scene *scene, const Direction *d, int k) {
    rey_param_info info;
    bool turns = false;
    if (rey_param_get_info(scene, d->params[k], &info) == REY_OK) {
        const char *dot = strrchr(info.name, '.');
        for (int64_t i = 0; dot && strcmp(dot, ".to_world") == 0 && i < info.count; i++) {
            turns |= i % 4 != 3 && d->tangent[d->offsets[k] + i] != 0;
        }
    }
    return turns;
}

// A step that moves the entries by about 10 % of their size (root mean square; at least 0.05, so that black moves too).
// Samples jump where a moved lobe meets an edge, a noise in the differences of variance ~ 1/h that asks for a long
// step; the error of the extrapolated difference, h^4 f^(5) / 480, is still below 1e-4 of f' for f ~ theta^-2. Replayed
// paths have no such noise, and a fifth of it does.
static double natural_step(const rey_scene *scene, const float *original, const Check *check) {
    const Direction *d = &check->direction;
    double squares = 0, largest = 0;
    int64_t moved = 0;
    for (int k = 0; k < d->count; k++) {
        bool turns = is_turning_pose(scene, d, k);
        for (int64_t i = d->offsets[k]; i < d->offsets[k + 1]; i++) {
            if (d->tangent[i] != 0 && !(turns && (i - d->offsets[k]) % 4 == 3)) {
                squares += (double)original[i] * (double)original[i];
                largest = fmax(largest, fabs((double)d->tangent[i]));
                moved++;
            }
        }
    }
    double scale = moved ? fmax(sqrt(squares / (double)moved), 0.05) : 1;
    return largest > 0 ? (check->replays ? 0.02 : 0.1) * scale / largest : 0;
}

Step check_central_step(double h) {
    return (Step){.h = h,
                  .offsets = {h / 2, -h / 2, h, -h},
                  .weights = {4 / (3 * h), -4 / (3 * h), -1 / (6 * h), 1 / (6 * h)},
                  .rough = {1 / h, -1 / h, 0, 0},
                  .plain = {0, 0, 1 / (2 * h), -1 / (2 * h)}};
}

Step check_one_sided_step(double h, double sign) {
    double k = sign / h;
    return (Step){.h = h,
                  .offsets = {0, sign * h, 2 * sign * h, 3 * sign * h},
                  .weights = {-11 * k / 6, 3 * k, -1.5 * k, k / 3},
                  .rough = {-1.5 * k, 2 * k, -0.5 * k, 0},
                  .plain = {-k / 3, 0, 0, k / 3}};
}

Step check_choose_step(const rey_scene *scene, const float *original, const Check *check, double asked) {
    const Direction *d = &check->direction;
    double h = asked > 0 ? asked : natural_step(scene, original, check);
    double forward = 0.999 * room(scene, original, d, 1), backward = 0.999 * room(scene, original, d, -1);
    double central = fmin(h, fmin(forward, backward));
    return central >= 0.1 * h ? check_central_step(central)
                              : check_one_sided_step(fmin(h, fmax(forward, backward) / 3), forward >= backward ? 1 : -1);
}

double check_least_step(const float *original, const Direction *d) {
    double spacings = 0, moves = 0;
    for (int64_t i = 0; i < d->offsets[d->count]; i++) {
        double t = (double)d->tangent[i], v = fabs((double)original[i]);
        double spacing = t != 0 ? (double)nextafterf((float)v, INFINITY) - v : 0;
        spacings += spacing * spacing;
        moves += t * t;
    }
    // The nearest points lie half a step away, and rounding moves them by half of the spacing at most.
    return moves > 0 ? 100 * sqrt(spacings / moves) : INFINITY;
}
