// optimizer.c: Adam [kingma2015 algorithm 1] and gradient descent with momentum, in double precision.
#include "fit/optimizer.h"

#include "fit/lbfgs.h"
#include "fit/rigid.h"

#include <math.h>
#include <string.h>

static const double PI_VALUE = 3.14159265358979323846;
static const double LOGIT_MARGIN = 1e-6; // values stay this far, as a share of the range, inside their bounds
static const double SHARE_FLOOR = 1e-6; // least share of a simplex
static const double SOFTPLUS_FLOOR = 1e-6; // and so far above the lower one, where the variable would be infinite

static bool is_pose(const Unknown *p) {
    return p->parameterisation == PARAMETERISATION_RIGID || p->parameterisation == PARAMETERISATION_SIMILARITY;
}

static bool is_medium(const Unknown *p) {
    return p->parameterisation == PARAMETERISATION_SCATTERING;
}

// Whose numbers are no functions of a variable each.
static bool moves_together(const Unknown *p) {
    return is_pose(p) || p->vertices || is_medium(p) || p->parameterisation == PARAMETERISATION_SIMPLEX;
}

static double to_value(const Unknown *p, double u) {
    switch (p->parameterisation) {
    case PARAMETERISATION_LOG:
        return exp(u);
    case PARAMETERISATION_LOGIT:
        return p->low + (p->high - p->low) / (1 + exp(-u));
    case PARAMETERISATION_SOFTPLUS:
        return p->low + fmax(u, 0) + log1p(exp(-fabs(u)));
    default:
        return u;
    }
}

static double to_variable(const Unknown *p, double x) {
    double s;
    switch (p->parameterisation) {
    case PARAMETERISATION_LOG:
        return log(x);
    case PARAMETERISATION_LOGIT:
        s = fmin(fmax((x - p->low) / (p->high - p->low), LOGIT_MARGIN), 1 - LOGIT_MARGIN);
        return log(s / (1 - s));
    case PARAMETERISATION_SOFTPLUS: // log(e^x - 1)
        s = fmax(x - p->low, SOFTPLUS_FLOOR);
        return s + log(-expm1(-s));
    default:
        return x;
    }
}

// d value / d variable.
static double value_derivative(const Unknown *p, double u) {
    double s;
    switch (p->parameterisation) {
    case PARAMETERISATION_LOG:
        return exp(u);
    case PARAMETERISATION_LOGIT:
        s = 1 / (1 + exp(-u));
        return (p->high - p->low) * s * (1 - s);
    case PARAMETERISATION_SOFTPLUS:
        return 1 / (1 + exp(-u));
    default:
        return 1;
    }
}

// Rounds into the bounds, which a float may otherwise leave by half its last digit.
static float round_inside(const Unknown *p, double x) {
    float f = (float)fmin(fmax(x, p->low), p->high);
    if ((double)f < p->low) {
        f = nextafterf(f, INFINITY);
    }
    if ((double)f > p->high) {
        f = nextafterf(f, -INFINITY);
    }
    return f;
}

// Shares with the sum 1; variables are their logarithms.
static void simplex_begin(const Unknown *p, float *start, double *variable, float *value) {
    double sum = 0;
    for (int64_t i = 0; i < p->count; i++) {
        sum += fmax((double)start[i], SHARE_FLOOR);
    }
    for (int64_t i = 0; i < p->count; i++) {
        double share = fmax((double)start[i], SHARE_FLOOR) / sum;
        variable[i] = log(share);
        start[i] = value[i] = (float)share;
    }
}

static void simplex_follow(const Unknown *p, double *variable, float *value) {
    double most = variable[0], sum = 0;
    for (int64_t i = 1; i < p->count; i++) {
        most = fmax(most, variable[i]);
    }
    for (int64_t i = 0; i < p->count; i++) {
        sum += exp(variable[i] - most);
    }
    for (int64_t i = 0; i < p->count; i++) {
        variable[i] = fmax(variable[i] - most - log(sum), log(SHARE_FLOOR));
        value[i] = (float)exp(variable[i]);
    }
}

// Exponentiated gradient [kivinen1997]: w_i is multiplied by exp(-rate g_i), without the derivative of w_i, which would hold small
// shares where they are. What all shares have in common is no change.
static void simplex_gradient(const Unknown *p, const float *value, double *g) {
    double mean = 0, sum = 0;
    for (int64_t i = 0; i < p->count; i++) {
        mean += (double)value[i] * g[i];
        sum += (double)value[i];
    }
    for (int64_t i = 0; i < p->count; i++) {
        g[i] -= mean / sum;
    }
}

void rey_unknowns_begin(Unknowns *u) {
    for (size_t k = 0; k < u->items.count; k++) {
        const Unknown *p = &ARRAY_AT(u->items, Unknown, k);
        if (p->vertices) {
            rey_vertices_begin(p->vertices, u->start + p->offset, u->variable + p->offset);
            memcpy(u->value + p->offset, u->start + p->offset, (size_t)p->count * sizeof *u->value);
        }
        if (p->parameterisation == PARAMETERISATION_SIMPLEX) {
            simplex_begin(p, u->start + p->offset, u->variable + p->offset, u->value + p->offset);
        }
        for (int64_t i = p->offset; i < p->offset + p->count && !moves_together(p); i++) {
            u->variable[i] = to_variable(p, fmin(fmax((double)u->start[i], p->low), p->high));
            u->start[i] = u->value[i] = round_inside(p, to_value(p, u->variable[i]));
        }
        for (int64_t i = p->offset; i < p->offset + p->count && (is_pose(p) || is_medium(p)); i++) {
            u->variable[i] = 0;
            u->value[i] = u->start[i];
        }
    }
    for (size_t k = 0; k < u->media.count; k++) {
        rey_scattering_begin(&ARRAY_AT(u->media, Scattering, k), u->value, u->variable);
    }
}

double rey_schedule_factor(const JobSchedule *s, int iteration) {
    double t = fmin((double)iteration / s->length, 1);
    switch (s->kind) {
    case SCHEDULE_COSINE:
        return s->end + (1 - s->end) * 0.5 * (1 + cos(PI_VALUE * t));
    case SCHEDULE_EXPONENTIAL:
        return pow(fmax(s->end, 1e-12), t);
    case SCHEDULE_STEP:
        return pow(s->factor, iteration / s->every);
    default:
        return 1;
    }
}

// The change of each variable of one parameter; g is the gradient in the variables. Of uniform moments the largest of all
// entries counts, which keeps the directions of steps and so their smoothness [nicolet2021 section 4.1].
static void adam_step(const JobOptimizer *o, const Unknown *p, double *variable, double *m, double *v, const double *g,
                      double rate, int iteration) {
    double correct1 = 1 - pow(o->beta1, iteration + 1.0), correct2 = 1 - pow(o->beta2, iteration + 1.0);
    double mean_square = 0, largest = 0;
    for (int64_t i = 0; i < p->count; i++) {
        mean_square += g[i] * g[i] / (double)p->count;
    }
    for (int64_t i = 0; i < p->count; i++) {
        double square = p->moment == MOMENT_SHARED ? mean_square : g[i] * g[i];
        m[i] = o->beta1 * m[i] + (1 - o->beta1) * g[i];
        v[i] = o->beta2 * v[i] + (1 - o->beta2) * square;
        largest = fmax(largest, v[i]);
    }
    for (int64_t i = 0; i < p->count; i++) {
        double second = p->moment == MOMENT_UNIFORM ? largest : v[i];
        variable[i] -= rate * (m[i] / correct1) / (sqrt(second / correct2) + o->epsilon);
    }
}

static void sgd_step(const JobOptimizer *o, const Unknown *p, double *variable, double *velocity, const double *g,
                     double rate) {
    for (int64_t i = 0; i < p->count; i++) {
        velocity[i] = o->momentum * velocity[i] + g[i];
        variable[i] -= rate * velocity[i];
    }
}

// Polynomial-decay averaging [shamir2013 section 4]: needs no horizon, and forgets the start.
static void average_values(const JobOptimizer *o, Unknowns *u, int iteration) {
    double weight = (o->average + 1) / (iteration + 1 + o->average);
    for (size_t k = 0; k < u->items.count; k++) {
        const Unknown *p = &ARRAY_AT(u->items, Unknown, k);
        bool rigid = is_pose(p); // means of rotations are none
        for (int64_t i = p->offset; i < p->offset + p->count; i++) {
            u->average[i] += weight * ((rigid ? u->variable[i] : (double)u->value[i]) - u->average[i]);
        }
    }
}

// Replaces the gradient in the values by that in the variables; returns the square of its length.
static double to_variable_gradient(const Unknowns *u, const Unknown *p, double *g) {
    double square = 0;
    if (is_pose(p)) {
        rey_rigid_gradient(u->start + p->offset, u->variable + p->offset, g);
        g[RIGID_VARIABLES] *= p->parameterisation == PARAMETERISATION_SIMILARITY;
    }
    if (p->vertices) {
        rey_vertices_gradient(p->vertices, g);
    }
    if (p->parameterisation == PARAMETERISATION_SIMPLEX) {
        simplex_gradient(p, u->value + p->offset, g);
    }
    for (int64_t i = 0; i < p->count; i++) {
        g[i] *= value_derivative(p, u->variable[p->offset + i]);
        square += g[i] * g[i];
    }
    return square;
}

// The values of one parameter after its variables moved; variables stay where their values are within the bounds.
static void follow_variables(Unknowns *u, const Unknown *p) {
    double *variable = u->variable + p->offset;
    if (is_pose(p)) {
        rey_rigid_pose(u->start + p->offset, variable, u->value + p->offset);
        return;
    }
    if (p->vertices) {
        rey_vertices_follow(p->vertices, variable, u->value + p->offset);
        return;
    }
    if (p->parameterisation == PARAMETERISATION_SIMPLEX) {
        simplex_follow(p, variable, u->value + p->offset);
        return;
    }
    if (is_medium(p)) {
        return;
    }
    for (int64_t i = 0; i < p->count; i++) {
        double x = fmin(fmax(to_value(p, variable[i]), p->low), p->high);
        if (x <= p->low || x >= p->high) {
            variable[i] = to_variable(p, x);
        }
        u->value[p->offset + i] = round_inside(p, x);
    }
}

double rey_unknowns_regularise(Unknowns *u) {
    double sum = 0;
    for (size_t k = 0; k < u->items.count; k++) {
        const Unknown *p = &ARRAY_AT(u->items, Unknown, k);
        if (p->vertices) {
            sum += rey_vertices_regularise(p->vertices, u->value + p->offset, u->gradient + p->offset);
        }
        if (p->grid.nx) {
            sum += rey_voxels_regularise(p->grid, p->regularisers, u->value + p->offset, u->gradient + p->offset);
        }
    }
    return sum;
}

void rey_unknowns_hold(Unknowns *u) {
    for (size_t k = 0; k < u->items.count; k++) {
        const Unknown *p = &ARRAY_AT(u->items, Unknown, k);
        for (int64_t i = 0; p->carved && i < p->count; i++) {
            u->gradient[p->offset + i] *= !p->carved[i];
        }
    }
}

static double rate_of(const JobOptimizer *o, const Unknown *p) {
    return p->learning_rate > 0 ? p->learning_rate : o->learning_rate;
}

// Scales all variables by their learning rates' power.
static void scale_by_rates(const JobOptimizer *o, Unknowns *u, double *numbers, int power) {
    for (size_t k = 0; k < u->items.count; k++) {
        const Unknown *p = &ARRAY_AT(u->items, Unknown, k);
        double factor = power > 0 ? rate_of(o, p) : 1 / rate_of(o, p);
        for (int64_t i = p->offset; i < p->offset + p->count; i++) {
            numbers[i] *= factor;
        }
    }
}

static void follow_all(Unknowns *u) {
    for (size_t k = 0; k < u->items.count; k++) {
        follow_variables(u, &ARRAY_AT(u->items, Unknown, k));
    }
    for (size_t k = 0; k < u->media.count; k++) {
        rey_scattering_follow(&ARRAY_AT(u->media, Scattering, k), u->variable, u->value);
    }
}

// Entries that lie on a bound which the gradient pushes against do not take part.
static void hold_bounds(Unknowns *u) {
    for (size_t k = 0; k < u->items.count; k++) {
        const Unknown *p = &ARRAY_AT(u->items, Unknown, k);
        for (int64_t i = p->offset; i < p->offset + p->count && !moves_together(p); i++) {
            double x = (double)u->value[i], g = u->gradient[i];
            if ((g > 0 && x <= p->low) || (g < 0 && x >= p->high)) {
                u->gradient[i] = 0;
            }
        }
    }
}

// In variables divided by their rates, in which gradients are multiplied by them.
static void lbfgs_step(const JobOptimizer *o, Unknowns *u, double loss) {
    hold_bounds(u);
    scale_by_rates(o, u, u->variable, -1);
    scale_by_rates(o, u, u->gradient, 1);
    rey_lbfgs_step(u->lbfgs, u->count, o->memory, loss, u->gradient, u->variable);
    scale_by_rates(o, u, u->variable, 1);
    follow_all(u);
}

void rey_optimizer_restart(const JobOptimizer *o, Unknowns *u) {
    if (o->kind == OPTIMIZER_LBFGS && rey_lbfgs_has_best(u->lbfgs)) { // a second time, rounding would change the variables
        scale_by_rates(o, u, u->variable, -1);
        rey_lbfgs_take_best(u->lbfgs, u->count, u->variable);
        scale_by_rates(o, u, u->variable, 1);
        rey_lbfgs_forget(u->lbfgs);
        follow_all(u);
    }
}

bool rey_optimizer_leap(const JobOptimizer *o, Unknowns *u) {
    if (o->kind != OPTIMIZER_LBFGS) {
        return true;
    }
    scale_by_rates(o, u, u->variable, -1);
    bool anew = rey_lbfgs_leap(u->lbfgs, u->count, o->memory, u->variable);
    scale_by_rates(o, u, u->variable, 1);
    follow_all(u);
    return anew;
}

double rey_optimizer_step(const JobOptimizer *o, Unknowns *u, int iteration, double loss) {
    double factor = rey_schedule_factor(&o->schedule, iteration), norm = 0;
    for (size_t k = 0; k < u->media.count; k++) {
        rey_scattering_gradient(&ARRAY_AT(u->media, Scattering, k), u->variable, u->gradient);
    }
    for (size_t k = 0; k < u->items.count; k++) {
        const Unknown *p = &ARRAY_AT(u->items, Unknown, k);
        double *variable = u->variable + p->offset, *g = u->gradient + p->offset;
        double rate = rate_of(o, p) * factor;
        norm += to_variable_gradient(u, p, g);
        if (o->kind == OPTIMIZER_ADAM) {
            adam_step(o, p, variable, u->first + p->offset, u->second + p->offset, g, rate, iteration);
        } else if (o->kind == OPTIMIZER_SGD) {
            sgd_step(o, p, variable, u->first + p->offset, g, rate);
        }
    }
    if (o->kind == OPTIMIZER_LBFGS) {
        lbfgs_step(o, u, loss);
    } else {
        follow_all(u);
    }
    average_values(o, u, iteration);
    return sqrt(norm);
}

void rey_unknowns_take_average(Unknowns *u) {
    for (size_t k = 0; k < u->items.count; k++) {
        const Unknown *p = &ARRAY_AT(u->items, Unknown, k);
        if (is_pose(p)) {
            rey_rigid_pose(u->start + p->offset, u->average + p->offset, u->value + p->offset);
            continue;
        }
        for (int64_t i = p->offset; i < p->offset + p->count; i++) {
            u->value[i] = round_inside(p, u->average[i]);
        }
    }
}
