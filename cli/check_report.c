// check_report.c: what `reynolds check` prints.
#include "check.h"

#include <math.h>
#include <stdio.h>
#include <unistd.h>

enum { DIRECTION_WIDTH = 36 }; // columns of the first column

static int count_verdicts(const Check *checks, int count, Verdict verdict) {
    int n = 0;
    for (int i = 0; i < count; i++) {
        n += checks[i].verdict == verdict;
    }
    return n;
}

static void print_titles(FILE *file) {
    fprintf(file, "%-*s %13s %9s %13s %9s %9s %8s %7s %6s %7s %9s  %s\n", DIRECTION_WIDTH, "direction", "derivative", "+-",
            "difference", "step", "error/rms", "worst z", "block", "sum z", "fresh z", "reverse", "verdict");
}

// What rounds to 0 at `digits` has no sign.
static double unsigned_zero(double value, int digits) {
    return fabs(value) < 0.5 * pow(10, -digits) ? 0 : value;
}

static void print_row(FILE *file, const Check *check, const char *verdict) {
    const CheckResult *r = &check->result;
    char block[32], noise[32] = "-", fresh[32] = "-"; // of what moves the differences are of fresh paths themselves
    double percent = 100 * r->relative_error;
    if (check->replays) {
        snprintf(fresh, sizeof fresh, "%.2f", unsigned_zero(check->fresh_z, 2));
    }
    if (r->tests > 0) {
        snprintf(noise, sizeof noise, percent < 1e5 ? "%.2f%%" : "%.1e%%", percent);
    }
    snprintf(block, sizeof block, "%d,%d %c", r->worst_x, r->worst_y, "RGB"[r->worst_channel]);
    fprintf(file, "%-*s %13.6g %9.1e %13.6g %9.2g %9s %8.2f %7s %6.2f %7s %9.1e  %s\n", cli_pad(check->spec, DIRECTION_WIDTH),
            check->spec, r->derivative + 0.0, r->gradient_standard_error, r->difference + 0.0, check->step.h, noise,
            unsigned_zero(r->worst_z, 2), block, unsigned_zero(r->sum_z, 2), fresh, check->reverse_error, verdict);
}

// "refused [2]"; *number is the reason's.
static rey_result print_refusal(rey_context *ctx, FILE *file, const Check *check, Reasons *reasons, int *number) {
    *number = reasons_add(ctx, reasons, check->refusal, check->spec);
    fprintf(file, "%-*s %s [%d]\n", cli_pad(check->spec, DIRECTION_WIDTH), check->spec, check_verdict_name(check->verdict),
            *number);
    return *number ? REY_OK : REY_ERROR_MEMORY;
}

rey_result check_print_ready(rey_context *ctx, Check *check, bool first, double threshold, double loosest,
                             bool partial, Reasons *reasons) {
    Check tight = *check, loose = *check;
    if (first) {
        print_titles(stderr);
    }
    check->shown = true;
    if (check->verdict == VERDICT_REFUSED) {
        int number;
        rey_result result = print_refusal(ctx, stderr, check, reasons, &number);
        if (!result && ARRAY_AT(reasons->items, Reason, number - 1).count == 1) {
            reasons_print(stderr, reasons, number);
        }
        return result;
    }
    check_judge(&tight, threshold, partial);
    check_judge(&loose, loosest, partial);
    check->open = tight.verdict != loose.verdict;
    print_row(stderr, check, check->open ? "open: see below" : check_verdict_name(tight.verdict));
    return REY_OK;
}

static rey_result print_rows(rey_context *ctx, const Check *checks, int count) {
    Reasons reasons = {0};
    rey_result result = REY_OK;
    bool stand = count > 0 && checks[0].shown && isatty(STDOUT_FILENO) && isatty(STDERR_FILENO);
    for (int i = 0; i < count && stand; i++) {
        if (checks[i].open) {
            print_row(stdout, &checks[i], check_verdict_name(checks[i].verdict));
        }
    }
    if (stand) {
        return REY_OK;
    }
    print_titles(stdout);
    for (int i = 0; i < count && !result; i++) {
        int number;
        if (checks[i].verdict == VERDICT_REFUSED) {
            result = print_refusal(ctx, stdout, &checks[i], &reasons, &number);
        } else {
            print_row(stdout, &checks[i], check_verdict_name(checks[i].verdict));
        }
    }
    for (int i = 1; i <= (int)reasons.items.count; i++) {
        reasons_print(stdout, &reasons, i);
    }
    reasons_free(ctx, &reasons);
    return result;
}

// Differences know no terms: where some are left out on request, that is what they differ by.
static void print_left_out(const Check *checks, int count) {
    int terms = 0, directions = 0;
    char text[128];
    for (int i = 0; i < count; i++) {
        int left = checks[i].verdict == VERDICT_REFUSED ? 0 : checks[i].left_out & TERMS_ESTIMATED;
        terms |= left;
        directions += left != 0;
    }
    if (directions) {
        cli_terms_text(terms, text, sizeof text);
        printf("--terms leaves out %s of what %d of %d need, which the differences have\n", text, directions, count);
    }
}

rey_result check_print_table(rey_context *ctx, const Check *checks, int count, double threshold) {
    rey_result result = print_rows(ctx, checks, count);
    int wrong = count_verdicts(checks, count, VERDICT_WRONG), weak = count_verdicts(checks, count, VERDICT_WEAK);
    int undecided = 0, shared = 0;
    bool replayed = false;
    char fresh[32] = "";
    for (int i = 0; i < count; i++) {
        undecided += checks[i].undecided;
        shared += checks[i].verdict == VERDICT_WEAK && checks[i].result.relative_error <= CHECK_WEAK;
        replayed = replayed || (checks[i].verdict != VERDICT_REFUSED && checks[i].replays);
    }
    if (replayed) {
        snprintf(fresh, sizeof fresh, ", fresh z up to %d", CHECK_FRESH_Z);
    }
    if (count_verdicts(checks, count, VERDICT_REFUSED) == count) {
        printf("nothing was checked: all directions are refused\n");
        return result;
    }
    printf("%s: |z| of every block and channel up to %.2f, |sum z| below 3%s, reverse = forward to %g\n",
           wrong ? "FAILED" : undecided ? "undecided" : "passed", threshold, fresh, CHECK_REVERSE_TOLERANCE);
    print_left_out(checks, count);
    if (count_verdicts(checks, count, VERDICT_KINK)) {
        printf("%d of %d stand at a kink: the derivative is that of one side\n", count_verdicts(checks, count, VERDICT_KINK),
               count);
    }
    if (undecided) {
        printf("%d of %d are beyond these limits, and too noisy to be called wrong\n", undecided, count);
    }
    if (weak > shared) {
        printf("%d of %d are weak: error/rms, the noise of what is compared over the derivative, is above %g %%, so that they say "
               "little; raise --spp\n", weak - shared, count, 100 * CHECK_WEAK);
    }
    if (shared) {
        printf("%d of %d are weak: derivative and difference agree, and share a noise that is more than %g %% of the derivative's "
               "blocks, so that the derivative is known no better than that; raise --spp\n", shared, count, 100 * CHECK_WEAK);
    }
    return result;
}

void check_print_json(const Session *session, const rey_stats *stats, const Check *checks, int count, double threshold) {
    Json json = json_begin(stdout);
    json_object(&json, NULL);
    bool passed = count_verdicts(checks, count, VERDICT_WRONG) == 0 && count_verdicts(checks, count, VERDICT_REFUSED) < count;
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
        cli_json_terms(&json, "left_out", checks[i].left_out & TERMS_ESTIMATED);
        json_bool(&json, "passed", checks[i].verdict != VERDICT_WRONG && !checks[i].undecided);
        if (checks[i].refusal) {
            json_string(&json, "why", checks[i].refusal);
        }
        json_number(&json, "derivative", r->derivative);
        json_number(&json, "gradient_standard_error", r->gradient_standard_error);
        json_number(&json, "difference", r->difference);
        json_number(&json, "standard_error", r->standard_error);
        json_number(&json, "relative_error", r->relative_error);
        json_number(&json, "gradient_relative_error", r->gradient_relative_error);
        json_number(&json, "worst_z", r->worst_z);
        json_array(&json, "worst_block");
        json_integer(&json, NULL, r->worst_x);
        json_integer(&json, NULL, r->worst_y);
        json_integer(&json, NULL, r->worst_channel);
        json_array_end(&json);
        json_number(&json, "sum_z", r->sum_z);
        json_bool(&json, "replayed", checks[i].replays);
        json_number(&json, "fresh_z", checks[i].replays ? checks[i].fresh_z : (double)NAN);
        json_integer(&json, "tests", r->tests);
        json_number(&json, "step", checks[i].step.h);
        json_number(&json, "reverse_error", checks[i].reverse_error);
        json_object_end(&json);
    }
    json_array_end(&json);
    json_object_end(&json);
    json_end(&json);
}
