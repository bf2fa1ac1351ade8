// save_text.c: scene files as text: lines, escapes, and properties as they were read. Numbers keep all their bits.
#include "io/save_parts.h"

#include <stdio.h>
#include <string.h>

static void put(Writer *w, const char *text, size_t bytes) {
    char *at = rey_array_push(w->ctx, &w->text, 1, bytes);
    if (at) {
        memcpy(at, text, bytes);
    } else {
        w->failed = true;
    }
}

static void put_text(Writer *w, const char *text) {
    put(w, text, strlen(text));
}

static void put_number(Writer *w, const char *format, double number) {
    char text[64];
    snprintf(text, sizeof text, format, number);
    put_text(w, text);
}

static void indent(Writer *w, int depth) {
    for (int i = 0; i < depth; i++) {
        put(w, "    ", 4);
    }
}

// Escapes what XML and `$` substitution would read, and blanks that XML would take for others.
static void put_escaped(Writer *w, const char *text) {
    for (; *text; text++) {
        switch (*text) {
        case '&':
            put_text(w, "&amp;");
            break;
        case '<':
            put_text(w, "&lt;");
            break;
        case '"':
            put_text(w, "&quot;");
            break;
        case '$':
            put_text(w, "\\$");
            break;
        case '\n':
            put_text(w, "&#10;");
            break;
        case '\t':
            put_text(w, "&#9;");
            break;
        case '\r':
            put_text(w, "&#13;");
            break;
        default:
            put(w, text, 1);
        }
    }
}

static void put_attribute(Writer *w, const char *name, const char *value) {
    put_text(w, " ");
    put_text(w, name);
    put_text(w, "=\"");
    put_escaped(w, value);
    put_text(w, "\"");
}

void rey_save_line(Writer *w, int depth, const char *format, ...) {
    char text[1024];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    indent(w, depth);
    put_text(w, text);
    put_text(w, "\n");
}

static void begin_value(Writer *w, int depth, const char *tag, const char *name) {
    indent(w, depth);
    put_text(w, "<");
    put_text(w, tag);
    put_attribute(w, "name", name);
    put_text(w, " value=\"");
}

static void end_value(Writer *w) {
    put_text(w, "\"/>\n");
}

void rey_save_value(Writer *w, int depth, const char *tag, const char *name, const char *value) {
    begin_value(w, depth, tag, name);
    put_escaped(w, value);
    end_value(w);
}

static void put_numbers(Writer *w, const double *numbers, int count) {
    for (int i = 0; i < count; i++) {
        put_text(w, i ? " " : "");
        put_number(w, "%.17g", numbers[i]);
    }
}

static void put_matrix(Writer *w, int depth, const char *name, const char *format, const double m[16]) {
    indent(w, depth);
    put_text(w, "<transform");
    put_attribute(w, "name", name);
    put_text(w, "><matrix value=\"");
    for (int i = 0; i < 16; i++) {
        put_text(w, i ? " " : "");
        put_number(w, format, m[i]);
    }
    put_text(w, "\"/></transform>\n");
}

void rey_save_matrix(Writer *w, int depth, const char *name, const float m[16]) {
    double numbers[16] = {[15] = 1}; // no pose's last row has an effect, and one other than this cannot be read
    for (int i = 0; i < 12; i++) {
        numbers[i] = (double)m[i];
    }
    put_matrix(w, depth, name, "%.9g", numbers);
}

static void put_spectrum(Writer *w, const rey_spectrum *s) {
    if (s->count == 0) {
        put_number(w, "%.17g", s->flat);
    }
    for (int i = 0; i < s->count; i++) {
        put_text(w, i ? ", " : "");
        put_number(w, "%.17g", s->wavelengths[i]);
        put_number(w, ":%.17g", s->values[i]);
    }
}

void rey_save_property(Writer *w, int depth, const rey_xml_property *p) {
    static const char *const tags[REY_XML_KIND_COUNT] = {
        [REY_XML_BOOLEAN_VALUE] = "boolean", [REY_XML_INTEGER_VALUE] = "integer", [REY_XML_FLOAT_VALUE] = "float",
        [REY_XML_STRING_VALUE] = "string",   [REY_XML_VECTOR_VALUE] = "vector",   [REY_XML_RGB_VALUE] = "rgb",
        [REY_XML_SPECTRUM_VALUE] = "spectrum"};
    char text[32];
    if (p->kind == REY_XML_TRANSFORM_VALUE) {
        put_matrix(w, depth, p->name, "%.17g", p->matrix);
        return;
    }
    bool point = p->kind == REY_XML_VECTOR_VALUE && p->point;
    begin_value(w, depth, point ? "point" : tags[p->kind], p->name);
    switch (p->kind) {
    case REY_XML_BOOLEAN_VALUE:
        put_text(w, p->boolean ? "true" : "false");
        break;
    case REY_XML_INTEGER_VALUE:
        snprintf(text, sizeof text, "%lld", (long long)p->integer);
        put_text(w, text);
        break;
    case REY_XML_FLOAT_VALUE:
        put_number(w, "%.17g", p->number);
        break;
    case REY_XML_STRING_VALUE:
        put_escaped(w, p->string);
        break;
    case REY_XML_SPECTRUM_VALUE:
        put_spectrum(w, &p->spectrum);
        break;
    default:
        put_numbers(w, p->vector, 3);
    }
    end_value(w);
}

void rey_save_tag(Writer *w, int depth, const char *tag, const char *value, const char *other, const char *other_value) {
    indent(w, depth);
    put_text(w, "<");
    put_text(w, tag);
    put_attribute(w, "id", value);
    if (other_value) {
        put_attribute(w, other, other_value);
    }
    put_text(w, "/>\n");
}

void rey_save_open(Writer *w, int depth, const rey_xml_node *node, const char *type, const char *slot) {
    indent(w, depth);
    put_text(w, "<");
    put_text(w, rey_xml_tag_name(node->tag));
    put_attribute(w, "type", type);
    if (node->id) {
        put_attribute(w, "id", node->id);
    }
    if (slot) {
        put_attribute(w, "name", slot);
    }
    put_text(w, ">\n");
}
