// xml_value.c: numbers, lists of numbers and spectra in attributes.
#include "io/xml_parts.h"

#include "io/image.h"
#include "io/number.h"

#include <stdlib.h>
#include <string.h>
#include <strings.h>

static bool is_separator(char c) {
    return rey_is_blank(c) || c == ',';
}

static const char *skip_blanks(const char *text) {
    while (rey_is_blank(*text)) {
        text++;
    }
    return text;
}

static const char *skip_separators(const char *text) {
    while (is_separator(*text)) {
        text++;
    }
    return text;
}

// Is a word of the text one for what is not finite?
static bool names_endless(const char *text) {
    static const char *const words[] = {"inf", "infinity", "nan"};
    bool endless = false;
    for (const char *c = skip_separators(text); *c && !endless; c = skip_separators(c)) {
        c += *c == '+' || *c == '-';
        size_t length = strcspn(c, " ,\t\n\r");
        for (int i = 0; i < COUNT_OF(words); i++) {
            endless = endless || (length == strlen(words[i]) && strncasecmp(c, words[i], length) == 0);
        }
        c += length;
    }
    return endless;
}

// Numbers that are not finite, or not in the single precision that they end up in, are no numbers here.
static rey_result fail_value(XmlReader *reader, const XmlAttribute *attribute, const char *expected) {
    bool endless = names_endless(attribute->value);
    return rey_xml_fail(reader->ctx, attribute->at, REY_ERROR_SCENE, "bad %s '%.60s%s'%s, expected %s", attribute->name,
                        attribute->value, strlen(attribute->value) > 60 ? "..." : "",
                        endless ? ": numbers are finite" : "", expected);
}

// Numbers separated by blanks and commas; *count becomes -1 when something else is in the list or there are more than
// `most`.
static void read_list(const char *text, int most, double *out, int *count) {
    *count = 0;
    for (const char *c = skip_separators(text); *c; c = skip_separators(c)) {
        if (*count == most || !rey_parse_single(c, &c, &out[*count]) || (*c && !is_separator(*c))) {
            *count = -1;
            return;
        }
        ++*count;
    }
}

rey_result rey_xml_read_numbers(XmlReader *reader, const XmlAttribute *attribute, int most, double *out, int *count) {
    read_list(attribute->value, most, out, count);
    return *count < 0 ? fail_value(reader, attribute, "numbers up to 3.4e38 separated by blanks or commas") : REY_OK;
}

rey_result rey_xml_read_vector(XmlReader *reader, const XmlAttributes *attributes, double otherwise, double out[3]) {
    static const char *const axes[] = {"x", "y", "z"};
    const XmlAttribute *value = rey_xml_attribute_named(attributes, "value");
    for (int i = 0; i < 3; i++) {
        const XmlAttribute *axis = rey_xml_attribute_named(attributes, axes[i]);
        int count = 1;
        out[i] = otherwise;
        if (axis && value) {
            return rey_xml_fail(reader->ctx, axis->at, REY_ERROR_SCENE, "give either 'value' or x, y, z, not both");
        }
        if (axis) {
            read_list(axis->value, 1, &out[i], &count);
        }
        if (count != 1) {
            return fail_value(reader, axis, "one number up to 3.4e38");
        }
    }
    if (value) {
        int count;
        read_list(value->value, 3, out, &count);
        if (count != 1 && count != 3) {
            return fail_value(reader, value, "one or three numbers up to 3.4e38");
        }
        if (count == 1) {
            out[1] = out[2] = out[0];
        }
    }
    return REY_OK;
}

// ---- spectra -----------------------------------------------------------------------------------------------------

static int count_pairs(const char *text) {
    int count = 0;
    for (; *text; text++) {
        count += *text == ':';
    }
    return count;
}

// "400:0.3, 500:0.4": wavelengths first, values after them, in one block of the document.
static rey_result read_pairs(XmlReader *reader, const XmlAttribute *attribute, int count, rey_spectrum *out) {
    double *wavelengths = rey_xml_keep(reader->ctx, reader->document, (size_t)count * 2 * sizeof(double));
    if (!wavelengths) {
        return REY_ERROR_MEMORY;
    }
    double *values = wavelengths + count;
    int i = 0;
    for (const char *c = skip_separators(attribute->value); *c; c = skip_separators(c), i++) {
        if (i == count || !rey_parse_single(c, &c, &wavelengths[i]) || *c++ != ':' ||
            !rey_parse_single(c, &c, &values[i]) || (*c && !is_separator(*c))) {
            return fail_value(reader, attribute, "one number, or pairs such as 400:0.1, 500:0.2 (wavelength in nm)");
        }
        if (i > 0 && wavelengths[i] <= wavelengths[i - 1]) {
            return rey_xml_fail(reader->ctx, attribute->at, REY_ERROR_SCENE,
                                "wavelength %g follows %g, expected ascending wavelengths", wavelengths[i],
                                wavelengths[i - 1]);
        }
    }
    if (i != count || count < 2) {
        return fail_value(reader, attribute, "one number, or at least two pairs such as 400:0.1, 500:0.2");
    }
    *out = (rey_spectrum){.count = count, .wavelengths = wavelengths, .values = values};
    return REY_OK;
}

static rey_result read_spectrum(XmlReader *reader, const XmlAttributes *attributes, rey_xml_property *property) {
    const XmlAttribute *value = rey_xml_attribute_named(attributes, "value");
    const XmlAttribute *filename = rey_xml_attribute_named(attributes, "filename");
    if (!value == !filename) {
        return rey_xml_fail(reader->ctx, property->at, REY_ERROR_SCENE,
                            "<spectrum> needs either 'value' or 'filename'");
    }
    if (filename) { // loaded when the whole scene has been read
        property->string = rey_xml_keep_text(reader->ctx, reader->document, filename->value, strlen(filename->value));
        return property->string ? REY_OK : REY_ERROR_MEMORY;
    }
    int pairs = count_pairs(value->value);
    if (pairs > 0) {
        return read_pairs(reader, value, pairs, &property->spectrum);
    }
    int count;
    read_list(value->value, 1, &property->spectrum.flat, &count);
    return count == 1 ? REY_OK
                      : fail_value(reader, value, "one number, or pairs such as 400:0.1, 500:0.2 (wavelength in nm)");
}

// ---- values ------------------------------------------------------------------------------------------------------

static rey_result read_boolean(XmlReader *reader, const XmlAttribute *value, bool *out) {
    *out = strcasecmp(value->value, "true") == 0;
    return *out || strcasecmp(value->value, "false") == 0 ? REY_OK : fail_value(reader, value, "true or false");
}

static rey_result read_integer(XmlReader *reader, const XmlAttribute *value, rey_xml_property *property) {
    const char *end = skip_blanks(value->value);
    if (!rey_parse_integer(end, &end, &property->integer) || *skip_blanks(end)) {
        return fail_value(reader, value, "an integer");
    }
    property->number = (double)property->integer;
    return REY_OK;
}

static rey_result read_float(XmlReader *reader, const XmlAttribute *value, double *out) {
    const char *end = skip_blanks(value->value);
    return rey_parse_single(end, &end, out) && !*skip_blanks(end) ? REY_OK : fail_value(reader, value, "a number up to 3.4e38");
}

// Components in the sRGB curve, as numbers or as #rrggbb.
static rey_result read_srgb(XmlReader *reader, const XmlAttributes *attributes, double out[3]) {
    const XmlAttribute *value = rey_xml_attribute_named(attributes, "value");
    rey_result result = REY_OK;
    if (value->value[0] == '#') {
        const char *digits = value->value + 1;
        unsigned long bits = strtoul(digits, NULL, 16);
        if (strlen(digits) != 6 || strspn(digits, "0123456789abcdefABCDEF") != 6) {
            return fail_value(reader, value, "#rrggbb or three numbers");
        }
        for (int i = 0; i < 3; i++) {
            out[i] = (double)(bits >> (16 - 8 * i) & 0xff) / 255;
        }
    } else {
        result = rey_xml_read_vector(reader, attributes, 0, out);
    }
    for (int i = 0; i < 3; i++) {
        out[i] = (double)rey_srgb_decode((float)out[i]);
    }
    return result;
}

rey_result rey_xml_read_value(XmlReader *reader, const XmlTag *tag, const XmlAttributes *attributes,
                              rey_xml_property *property) {
    const XmlAttribute *value = rey_xml_attribute_named(attributes, "value");
    switch ((rey_xml_kind)tag->which) {
    case REY_XML_BOOLEAN_VALUE:
        return read_boolean(reader, value, &property->boolean);
    case REY_XML_INTEGER_VALUE:
        return read_integer(reader, value, property);
    case REY_XML_FLOAT_VALUE:
        return read_float(reader, value, &property->number);
    case REY_XML_STRING_VALUE:
        property->string = rey_xml_keep_text(reader->ctx, reader->document, value->value, strlen(value->value));
        return property->string ? REY_OK : REY_ERROR_MEMORY;
    case REY_XML_RGB_VALUE:
        if (strcmp(tag->name, "srgb") == 0) {
            return read_srgb(reader, attributes, property->vector);
        }
        return rey_xml_read_vector(reader, attributes, 0, property->vector);
    case REY_XML_VECTOR_VALUE:
        return rey_xml_read_vector(reader, attributes, 0, property->vector);
    case REY_XML_SPECTRUM_VALUE:
        return read_spectrum(reader, attributes, property);
    case REY_XML_TRANSFORM_VALUE:
    case REY_XML_KIND_COUNT:
        break;
    }
    return rey_xml_fail(reader->ctx, property->at, REY_ERROR_SCENE, "<%s> has no value", tag->name);
}
