// check_report.c: what `reynolds check` prints.
#include "check.h"

#include <stdio.h>

static int count_verdicts(const Check *checks, int count, Verdict verdict) {
    int n = 0;
    for (int i = 0; i < count; i++) {
        n += checks[i].verdict == verdict;
    }
    return n;
}

static void print_titles(FILE *file) {
    fprintf(file, "%-36s %13s %13s %9s %9s %8s %7s %6s %7s %9s  %s\n", "direction", "derivative", "difference", "step",
            "error/rms", "worst z", "block", "sum z", "fresh z", "reverse", "verdict");
}

static void print_row(FILE *file, const Check *check) {
    const CheckResult *r = &check->result;
    if (check->verdict == VERDICT_REFUSED) {
        fprintf(file, "%-36s %s: %s\n", check->spec, check_verdict_name(check->verdict), check->refusal);
        return;
    }
    char block[32];
    snprintf(block, sizeof block, "%d,%d %c", r->worst_x, r->worst_y, "RGB"[r->worst_channel]);
    fprintf(file, "%-36s %13.6g %13.6g %9.2g %8.2f%% %8.2f %7s %6.2f %7.2f %9.1e  %s\n", check->spec, r->derivative,
            r->difference, check->step.h, 100 * r->relative_error, r->worst_z, block, r->sum_z, check->fresh_z,
            check->reverse_error, check_verdict_name(check->verdict));
}

void check_print_ready(const Check *check, bool first, double threshold, bool partial) {
    Check so_far = *check; // the verdict follows from all directions, and may change
    check_judge(&so_far, threshold, partial);
    if (first) {
        print_titles(stderr);
    }
    print_row(stderr, &so_far);
}

void check_print_table(const Check *checks, int count, double threshold) {
    print_titles(stdout);
    for (int i = 0; i < count; i++) {
        print_row(stdout, &checks[i]);
    }
    int wrong = count_verdicts(checks, count, VERDICT_WRONG), weak = count_verdicts(checks, count, VERDICT_WEAK);
    int undecided = 0;
    for (int i = 0; i < count; i++) {
        undecided += checks[i].undecided;
    }
    printf("%s: |z| of every block and channel up to %.2f, |sum z| below 3, fresh z up to %d, reverse = forward to %g\n",
           wrong ? "FAILED" : undecided ? "undecided" : "passed", threshold, CHECK_FRESH_Z, CHECK_REVERSE_TOLERANCE);
    if (count_verdicts(checks, count, VERDICT_KINK)) {
        printf("%d of %d stand at a kink: the derivative is that of one side\n", count_verdicts(checks, count, VERDICT_KINK),
               count);
    }
    if (undecided) {
        printf("%d of %d are beyond these limits, and too noisy to be called wrong\n", undecided, count);
    }
    if (weak) {
        printf("%d of %d are weak: noise is more than %g %% of the signal, so that they say little; raise --spp\n", weak,
               count, 100 * CHECK_WEAK);
    }
}

void check_print_json(const Session *session, const rey_stats *stats, const Check *checks, int count, double threshold) {
    Json json = json_begin(stdout);
    json_object(&json, NULL);
    bool passed = count_verdicts(checks, count, VERDICT_WRONG) == 0;
    for (int i = 0; i < count; i++) {
        passed = passed && !checks[i].undecided;
    }
    json_bool(&json, "passed", passed);
    json_number(&json, "z_threshold", threshold);
    cli_json_stats(&json, session, stats);
    json_array(&json, "directions");
    for (int i = 0; i < count; i++) {
        const CheckResult *r = &checks[i].result;
        json_object(&json, NULL);
        json_string(&json, "param", checks[i].spec);
        json_string(&json, "verdict", check_verdict_name(checks[i].verdict));
        json_bool(&json, "passed", checks[i].verdict != VERDICT_WRONG && !checks[i].undecided);
        if (checks[i].refusal) {
            json_string(&json, "why", checks[i].refusal);
        }
        json_number(&json, "derivative", r->derivative);
        json_number(&json, "difference", r->difference);
        json_number(&json, "standard_error", r->standard_error);
        json_number(&json, "relative_error", r->relative_error);
        json_number(&json, "worst_z", r->worst_z);
        json_array(&json, "worst_block");
        json_integer(&json, NULL, r->worst_x);
        json_integer(&json, NULL, r->worst_y);
        json_integer(&json, NULL, r->worst_channel);
        json_array_end(&json);
        json_number(&json, "sum_z", r->sum_z);
        json_bool(&json, "replayed", checks[i].replays);
        json_number(&json, "fresh_z", checks[i].fresh_z);
        json_integer(&json, "tests", r->tests);
        json_number(&json, "step", checks[i].step.h);
        json_number(&json, "reverse_error", checks[i].reverse_error);
        json_object_end(&json);
    }
    json_array_end(&json);
    json_object_end(&json);
    json_end(&json);
}
