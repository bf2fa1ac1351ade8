// check_step.c: how far `reynolds check` moves along a direction, and the formulas of its differences: central with
// Richardson's extrapolation over h and h/2, (4 D(h/2) - D(h)) / 3, error O(h^4); where a bound leaves no room on one
// side, the one-sided four-point formula of error O(h^3).
#include "check.h"

#include "base/context.h"

#include <math.h>
#include <string.h>

static const double MOST_MOVED = 1e18; // farther away, coordinates have no squares in single precision

static bool ends_with(const char *text, const char *end) {
    size_t n = strlen(text), m = strlen(end);
    return n >= m && strcmp(text + n - m, end) == 0;
}

// Steps that the bounds of the parameters, and those of radii, allow along the direction, forwards (sign 1) or backwards (-1).
static double room(const rey_scene *scene, const float *original, const Direction *d, double sign) {
    double most = INFINITY;
    for (int k = 0; k < d->count; k++) {
        rey_param_info info;
        if (rey_param_get_info(scene, d->params[k], &info)) {
            continue;
        }
        bool curve = ends_with(info.name, ".control_points");
        for (int64_t i = d->offsets[k]; i < d->offsets[k + 1]; i++) {
            double t = sign * (double)d->tangent[i], v = (double)original[i];
            bool radius = curve && (i - d->offsets[k]) % 4 == 3;
            if (t > 0) {
                most = fmin(most, ((double)info.high - v) / t);
            } else if (t < 0) {
                most = fmin(most, ((radius ? 0 : (double)info.low) - v) / t);
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
        bool pose = ends_with(info.name, ".to_world");
        for (int64_t i = 0; pose && i < info.count; i++) {
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

// The step to begin with; asked: 0 = found by itself.
static Step choose(const rey_scene *scene, const float *original, const Check *check, double asked) {
    const Direction *d = &check->direction;
    double h = asked > 0 ? asked : natural_step(scene, original, check);
    double forward = 0.999 * room(scene, original, d, 1), backward = 0.999 * room(scene, original, d, -1);
    double central = fmin(h, fmin(forward, backward));
    return central > 0 && central >= 0.1 * fmin(h, fmax(forward, backward)) ? check_central_step(central)
                              : check_one_sided_step(fmin(h, fmax(forward, backward) / 3), forward >= backward ? 1 : -1);
}

// Below it the values' rounding to floats is more than 1 % of how far they move; infinite for a direction of zeros.
static double least_step(const float *original, const Direction *d) {
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

// A parameter with entries on both of its bounds cannot move as a whole: those in the upper half of the range move down.
static bool turn_inwards(Session *session, const float *original, Check *check) {
    const Direction *d = &check->direction;
    rey_param_info info;
    bool bare = !check->spec[cli_direction_name_length(check->spec)];
    if (!bare || d->count != 1 || rey_param_get_info(session->scene, d->params[0], &info) || !isfinite(info.low) ||
        !isfinite(info.high)) {
        return false;
    }
    for (int64_t i = 0; i < info.count; i++) {
        d->tangent[i] = original[i] > 0.5f * (info.low + info.high) ? -1 : 1;
    }
    check->step = choose(session->scene, original, check, session->options->step);
    if (check->step.h > 0) {
        cli_session_note(session, "%s has entries on both of its bounds: those in the upper half of its range move down, the "
                         "others up", info.name);
    }
    return check->step.h > 0;
}

// A step beyond what floats hold makes a scene that is none; one that the bounds shorten is not what was asked for.
static rey_result check_asked(Session *session, const float *original, const Check *check) {
    const Direction *d = &check->direction;
    double asked = session->options->step, least = least_step(original, d), largest = 0;
    for (int64_t i = 0; i < d->offsets[d->count]; i++) {
        largest = fmax(largest, fabs((double)d->tangent[i]));
    }
    double farthest = fmax(fabs(check->step.offsets[2]), fabs(check->step.offsets[3]));
    if (asked < least) {
        return rey_fail(session->ctx, REY_ERROR_PARAM, "%s: a step of %g is lost in the rounding of the parameter's values, "
                        "expected %.1g or more", check->spec, asked, least);
    }
    if (farthest * largest > MOST_MOVED) {
        return rey_fail(session->ctx, REY_ERROR_PARAM, "%s: a step of %g is too long, expected %.1g or less", check->spec, asked,
                        MOST_MOVED / largest);
    }
    if (check->step.h < 0.999 * asked) {
        cli_session_note(session, "%s: the step of %g is shortened to %.4g, as far as the parameter's range allows", check->spec,
                         asked, check->step.h);
    }
    return REY_OK;
}

rey_result check_find_step(Session *session, const float *original, Check *check) {
    double asked = session->options->step;
    if (isinf(least_step(original, &check->direction))) {
        return rey_fail(session->ctx, REY_ERROR_PARAM, "%s: the direction is zero, expected one that moves the parameter",
                        check->spec);
    }
    check->step = choose(session->scene, original, check, asked);
    if (!(check->step.h > 0) && !turn_inwards(session, original, check)) {
        return rey_fail(session->ctx, REY_ERROR_PARAM, "%s: the bounds leave no room to move along this direction", check->spec);
    }
    return asked > 0 ? check_asked(session, original, check) : REY_OK;
}
