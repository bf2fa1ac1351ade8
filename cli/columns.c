// columns.c: columns of tables, as wide as the characters that they show: names may hold letters of several bytes.
#include "cli.h"

#include <string.h>

int cli_text_width(const char *text) {
    int count = 0;
    for (; *text; text++) {
        count += (*text & 0xC0) != 0x80; // the bytes of a character in UTF-8 after its first one are 10xxxxxx
    }
    return count;
}

int cli_pad(const char *text, int width) {
    return width + (int)strlen(text) - cli_text_width(text);
}
