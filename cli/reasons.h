// reasons.h: why there is no gradient, said once for all parameters of which it holds.
#pragma once

#include "base/context.h"

#include <stdio.h>

typedef struct Reason {
    char *text;  // with NAME in the place of the parameter's name
    char *whole; // of the first parameter, with its name
    int count;   // parameters
} Reason;

typedef struct Reasons {
    Array items; // of Reason
} Reasons;

// Number of the reason that a message gives for the parameter `name`, from 1; 0 when there is no memory.
int reasons_add(rey_context *ctx, Reasons *reasons, const char *message, const char *name);
// "[2] text": reason `number`. Of one parameter it holds its name, of several NAME.
void reasons_print(FILE *file, const Reasons *reasons, int number);
void reasons_free(rey_context *ctx, Reasons *reasons);
