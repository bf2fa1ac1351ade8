// io_xml.h: what the tests of the XML reader share.
#pragma once

#include "base/context.h"
#include "io/xml.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>
#include <cmocka.h>

#define DATA TEST_DATA_DIR "/xml/"

static inline rey_context *make_context(void) {
    rey_context *ctx = NULL;
    assert_int_equal(rey_context_create(NULL, &ctx), REY_OK);
    return ctx;
}

static inline int setup(void **state) {
    *state = make_context();
    return 0;
}

static inline int teardown(void **state) {
    rey_context_destroy(*state);
    return 0;
}

static inline rey_xml_document *read_text(rey_context *ctx, const char *text) {
    rey_xml_document *document = NULL;
    rey_result result = rey_xml_read_memory(ctx, DATA "text.xml", text, strlen(text), NULL, 0, &document);
    if (result) {
        fail_msg("%s", rey_error(ctx));
    }
    return document;
}

static inline rey_xml_document *read_file(rey_context *ctx, const char *name, const rey_define *defines, int count) {
    rey_xml_document *document = NULL;
    if (rey_xml_read(ctx, name, defines, count, &document)) {
        fail_msg("%s", rey_error(ctx));
    }
    return document;
}
