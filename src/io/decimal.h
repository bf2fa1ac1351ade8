// decimal.h: numbers in text, fast and the same in every locale.
#pragma once

#include "base/platform.h"

// Reads the number at text, which ends before end: [+-] digits [. digits] [e [+-] digits], inf, infinity or nan in any
// case. Returns the character after it, or null when there is no number. The value is the float nearest to the text,
// infinite beyond the range of float.
const char *rey_parse_float(const char *text, const char *end, float *value);

// Reads [+-] digits. Null when there are none or the value is beyond +-10^18.
const char *rey_parse_int(const char *text, const char *end, int64_t *value);
