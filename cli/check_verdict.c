// check_verdict.c: what the numbers of `reynolds check` mean.
#include "check.h"

#include <math.h>

const char *check_verdict_name(Verdict verdict) {
    static const char *const names[] = {"ok", "kink", "no effect", "weak", "WRONG", "partial", "refused"};
    return names[verdict];
}

double check_reverse_error(const Check *check, double rounding) {
    double scale = fmax(check->reverse_scale, rounding);
    return scale > 0 ? check->reverse_gap / scale : 0;
}

// Where noise is a large part, rare bright samples decide: agreement says little, and difference must be plain.
static const double plainly = 1.5;

void check_judge(Check *check, double threshold, bool partial) {
    const CheckResult *r = &check->result;
    bool right = fabs(r->worst_z) <= threshold && fabs(r->sum_z) < CHECK_SUM_Z;
    bool plain = !(fabs(r->worst_z) <= plainly * threshold && fabs(r->sum_z) < plainly * CHECK_SUM_Z);
    bool same = check->reverse_error <= CHECK_REVERSE_TOLERANCE && fabs(check->fresh_z) <= CHECK_FRESH_Z;
    bool weak = !(r->relative_error <= CHECK_WEAK) && !plain;
    // Noise that both columns share does not hide errors, but the derivative is not known any better than that.
    bool unknown = !(r->gradient_relative_error <= CHECK_WEAK);
    if (check->verdict == VERDICT_REFUSED) {
        return;
    }
    check->undecided = same && r->tests > 0 && weak && !right;
    check->verdict = !same                  ? VERDICT_WRONG
                     : r->tests == 0        ? VERDICT_NO_EFFECT
                     : weak                 ? VERDICT_WEAK
                     : right && unknown     ? VERDICT_WEAK
                     : right && check->kink ? VERDICT_KINK
                     : right                ? VERDICT_OK
                     : partial              ? VERDICT_PARTIAL
                                            : VERDICT_WRONG;
}
