// check.h: what the parts of `reynolds check` share.
#pragma once

#include "check_stats.h"
#include "cli.h"
#include "reasons.h"

enum { CHECK_POINTS = 4, CHECK_HALVINGS = 6, CHECK_SHORTENINGS = 2 };

// difference = sum of weights * picture(theta + offset * direction); rough: the same of lower order, whose distance from
// the difference says how much the step matters; plain: the simplest quotient over the whole step.
typedef struct Step {
    double h;
    double offsets[CHECK_POINTS], weights[CHECK_POINTS], rough[CHECK_POINTS], plain[CHECK_POINTS];
} Step;

typedef enum Verdict {
    VERDICT_OK,
    VERDICT_KINK,    // right on one side of a corner of the picture
    VERDICT_NO_EFFECT,
    VERDICT_WEAK,    // too noisy to say
    VERDICT_WRONG,
    VERDICT_PARTIAL, // of --all with --terms: terms are left out, and the difference shows it
    VERDICT_REFUSED  // of --all: no complete derivative
} Verdict;

typedef struct Check { // one direction
    const char *spec;
    Direction direction;
    Step step;
    bool replays;         // the difference is taken along the derivative's own paths
    CheckResult result;
    bool kink;            // the difference is that of one side
    bool doubtful;        // differences of a shorter step agreed, as far as their noise tells
    double fresh_z;       // of that against the plain quotient of fresh paths; 0 where nothing is replayed
    double reverse_gap, reverse_scale; // |reverse - forward| on the first set, and what is summed up
    double reverse_error;              // the one over the other, see check_reverse_error
    Verdict verdict;
    bool undecided;       // weak, and beyond the limits all the same
    int left_out;         // terms that it needs and --terms does not name; the difference has them
    bool shown, open;     // its row went to standard error already; with a verdict that might change
    char *refusal;        // why there is no complete derivative; owned
} Check;

Step check_central_step(double h);
Step check_one_sided_step(double h, double sign);
// The step to begin with, found or as --step asks for; original: the values of the direction's parameters.
rey_result check_find_step(Session *session, const float *original, Check *check);

// Largest difference between forward and reverse mode, which sum the same samples in float in another order.
#define CHECK_REVERSE_TOLERANCE 1e-4
// A direction whose noise is a larger part of its signal than this is weak.
#define CHECK_WEAK 0.1
// Fresh paths contradict replayed ones beyond this: a mean over few sets of heavy tails is skewed.
#define CHECK_FRESH_Z 5
// Limit of the sum of the blocks' z over its standard deviation.
#define CHECK_SUM_Z 3

// The gap between the modes over what is summed up, or over the rounding of a derivative where that is more: the shares of
// one that vanishes cancel within a sample, and what is left of them has no digits to agree in.
double check_reverse_error(const Check *check, double rounding);

const char *check_verdict_name(Verdict verdict);
// Sets the verdict, unless it is a refusal. threshold: of |z|; partial: terms are left out on request.
void check_judge(Check *check, double threshold, bool partial);
// A row on standard error as soon as it is known. The limit of |z| rises with the number of tests, from `threshold` now to
// `loosest` at most: a verdict that may change with it is open. reasons: of what was refused so far.
rey_result check_print_ready(rey_context *ctx, Check *check, bool first, double threshold, double loosest,
                             bool partial, Reasons *reasons);
// The table; on a terminal that has the rows already, only those that were open.
rey_result check_print_table(rey_context *ctx, const Check *checks, int count, double threshold);
void check_print_json(const Session *session, const rey_stats *stats, const Check *checks, int count, double threshold);
