// text.h: a growing text.
#pragma once

#include "base/context.h"

typedef struct Text {
    rey_context *ctx;
    Array bytes; // characters, without a zero at the end until rey_text_take
    bool failed; // memory ran out: later calls do nothing
} Text;

void rey_text_add(Text *text, const char *format, ...) PRINTF_LIKE(2, 3);
void rey_text_bytes(Text *text, const void *bytes, size_t size);
void rey_text_base64(Text *text, const unsigned char *bytes, size_t size);
void rey_text_html(Text *text, const char *plain); // & < > " escaped
void rey_text_json(Text *text, const char *plain); // quoted and escaped
void rey_text_number(Text *text, double value); // shortest text that reads back as the same double; null if not finite
void rey_text_free(Text *text);
// The text as a zero-ended string that the caller frees with rey_free; *text is empty afterwards.
rey_result rey_text_take(Text *text, char **out);
