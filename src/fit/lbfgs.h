// lbfgs.h: limited-memory BFGS [nocedal1980] with a line search for the strong Wolfe conditions by bisection [burke2020
// algorithm 2.6, with an upper bound for the slope]: one evaluation a call, so that a fit can stop between any two of them.
// All of the state is one array of doubles, for checkpoints.
//
// Meant for functions with frozen noise: every iteration uses the same random numbers. What is left of it (derivatives of
// moving silhouettes are estimated apart from the picture) is met with a slack in the condition of descent, and where a line
// search fails all the same, with a forgotten memory and a shorter step along the gradient.
#pragma once

#include <stdbool.h>
#include <stdint.h>

enum { LBFGS_MOST_TRIALS = 8, LBFGS_LONGEST = 10 }; // of a step: change of a variable, in units

// Numbers of the state for n variables and so many pairs.
int64_t rey_lbfgs_numbers(int64_t n, int memory);
// The value and gradient at x are given; x moves to where they are wanted next. Variables are scaled such that 1 is the
// largest change in the first step. A zeroed state is a start.
void rey_lbfgs_step(double *state, int64_t n, int memory, double value, const double *gradient, double *x);
// Whether there is a best point yet: not before the first step.
bool rey_lbfgs_has_best(const double *state);
// x becomes the best point so far, where there is one.
void rey_lbfgs_take_best(const double *state, int64_t n, double *x);
// The value there.
double rey_lbfgs_best_value(const double *state);
// The function's estimate has a range, which the trial x has left. True: x is to be evaluated by another estimate, whose range
// is around it, which ends the line search: x is the new best point, or the next step goes back to the old one, to evaluate that
// by the new estimate. False: that has happened, and x comes nearer to the best point instead.
bool rey_lbfgs_leap(double *state, int64_t n, int memory, double *x);
// Forgets everything: the function is another one from here on.
void rey_lbfgs_forget(double *state);
