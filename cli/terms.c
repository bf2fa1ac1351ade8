// terms.c: lists of the terms of a derivative, as text and as JSON.
#include "cli.h"

#include <stdio.h>

void cli_terms_text(int terms, char *text, size_t size) {
    size_t used = 0;
    snprintf(text, size, "none");
    for (int bit = 1; bit <= REY_TERM_ALL; bit <<= 1) {
        if (terms & bit && used < size) {
            int n = snprintf(text + used, size - used, "%s%s", used ? "," : "", rey_term_name(bit));
            used += (size_t)n;
        }
    }
}

void cli_json_terms(Json *json, const char *key, int terms) {
    json_array(json, key);
    for (int bit = 1; bit <= REY_TERM_ALL; bit <<= 1) {
        if (terms & bit) {
            json_string(json, NULL, rey_term_name(bit));
        }
    }
    json_array_end(json);
}
