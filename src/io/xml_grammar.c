// xml_grammar.c: which tags exist and which attributes they take.
#include "io/xml_parts.h"

#include "io/number.h"

#include <string.h>

static const XmlTag tags[] = {
    {"scene", XML_OBJECT, REY_XML_SCENE, 0, {"id"}},
    {"spectrum", XML_VALUE, REY_XML_SPECTRUM_VALUE, 1, {"name", "value", "filename"}}, // the form without a type
#define OBJECT_TAG(symbol, name) {name, XML_OBJECT, REY_XML_##symbol, 1, {"type", "id", "name"}},
    REY_XML_TAGS(OBJECT_TAG)
#undef OBJECT_TAG
        {"boolean", XML_VALUE, REY_XML_BOOLEAN_VALUE, 2, {"name", "value"}},
    {"integer", XML_VALUE, REY_XML_INTEGER_VALUE, 2, {"name", "value"}},
    {"float", XML_VALUE, REY_XML_FLOAT_VALUE, 2, {"name", "value"}},
    {"string", XML_VALUE, REY_XML_STRING_VALUE, 2, {"name", "value"}},
    {"vector", XML_VALUE, REY_XML_VECTOR_VALUE, 1, {"name", "value", "x", "y", "z"}},
    {"point", XML_VALUE, REY_XML_VECTOR_VALUE, 1, {"name", "value", "x", "y", "z"}},
    {"rgb", XML_VALUE, REY_XML_RGB_VALUE, 2, {"name", "value"}},
    {"srgb", XML_VALUE, REY_XML_RGB_VALUE, 2, {"name", "value"}}, // of version 0.x
    {"transform", XML_VALUE, REY_XML_TRANSFORM_VALUE, 1, {"name"}},
    {"translate", XML_OPERATION, XML_TRANSLATE, 0, {"value", "x", "y", "z"}},
    {"scale", XML_OPERATION, XML_SCALE, 0, {"value", "x", "y", "z"}},
    {"rotate", XML_OPERATION, XML_ROTATE, 1, {"angle", "value", "x", "y", "z"}},
    {"lookat", XML_OPERATION, XML_LOOKAT, 2, {"origin", "target", "up"}},
    {"matrix", XML_OPERATION, XML_MATRIX, 1, {"value"}},
    {"ref", XML_SPECIAL, XML_REF, 1, {"id", "name"}},
    {"default", XML_SPECIAL, XML_DEFAULT, 2, {"name", "value"}},
    {"include", XML_SPECIAL, XML_INCLUDE, 1, {"filename"}},
    {"path", XML_SPECIAL, XML_PATH, 1, {"value"}},
    {"alias", XML_SPECIAL, XML_ALIAS, 2, {"id", "as"}},
};

static const char *next_tag(void *user, int i) {
    UNUSED(user);
    return i < COUNT_OF(tags) ? tags[i].name : NULL;
}

// The attributes of an element: those of its tag, and one more of the root.
typedef struct Known {
    const XmlTag *tag;
    const char *extra; // or null
} Known;

static const char *next_attribute(void *user, int i) {
    const Known *known = user;
    int count = 0;
    while (count < COUNT_OF(known->tag->attributes) && known->tag->attributes[count]) {
        count++;
    }
    return i < count ? known->tag->attributes[i] : i == count ? known->extra : NULL;
}

rey_xml_position rey_xml_element_position(const XmlFile *file) {
    return (rey_xml_position){file->name, (int)XML_GetCurrentLineNumber(file->parser),
                              (int)XML_GetCurrentColumnNumber(file->parser) + 1};
}

rey_result rey_xml_find_tag(XmlFile *file, const char *name, bool has_type, const XmlTag **out) {
    if (file->version[0] < 2 && file->reader->frames.count > file->base && strcmp(name, "lookAt") == 0) {
        name = "lookat"; // spelling of version 0.x
    }
    if (file->version[0] >= 2 && strcmp(name, "srgb") == 0) {
        return rey_xml_fail(file->reader->ctx, rey_xml_element_position(file), REY_ERROR_SCENE,
                            "<srgb> is a tag of version 0.x, expected <rgb> with linear components");
    }
    bool typed_spectrum = has_type && strcmp(name, "spectrum") == 0;
    for (int i = 0; i < COUNT_OF(tags); i++) {
        if (strcmp(tags[i].name, name) == 0 && (!typed_spectrum || tags[i].class == XML_OBJECT)) {
            *out = &tags[i];
            return REY_OK;
        }
    }
    if (!file->parent && file->reader->frames.count == file->base) {
        return rey_xml_fail(file->reader->ctx, rey_xml_element_position(file), REY_ERROR_SCENE,
                            "the root element is <%.100s>, expected <scene version=\"3.0.0\">", name);
    }
    return rey_xml_fail_word(file->reader->ctx, rey_xml_element_position(file), name, next_tag, NULL,
                             "unknown tag <%.100s>, expected an object, a value, or one of ref, default, include, "
                             "path, alias",
                             name);
}

// Position of the attribute's name, found in the text of the start tag. The tag's own position when the file is in an
// encoding where ASCII is not ASCII. expat has checked the tag, so its text is well-formed.
static rey_xml_position attribute_position(const XmlFile *file, const char *name) {
    rey_xml_position at = rey_xml_element_position(file), here = at;
    XML_Index index = XML_GetCurrentByteIndex(file->parser);
    size_t length = strlen(name);
    if (index < 0 || (size_t)index >= file->bytes || file->text[index] != '<') {
        return at;
    }
    char quote = '\0';
    for (size_t i = (size_t)index; i + length < file->bytes; i++) {
        const char *c = file->text + i;
        if (quote) {
            quote = *c == quote ? '\0' : quote;
        } else if (*c == '"' || *c == '\'') {
            quote = *c;
        } else if (*c == '>') {
            break;
        } else if (rey_is_blank(c[0]) && memcmp(c + 1, name, length) == 0 && i + length + 1 < file->bytes &&
                   (rey_is_blank(c[length + 1]) || c[length + 1] == '=')) {
            here.line += *c == '\n';
            here.column = *c == '\n' ? 1 : here.column + 1;
            return here;
        }
        here.line += *c == '\n';
        here.column = *c == '\n' ? 1 : here.column + ((*c & 0xc0) != 0x80);
    }
    return at;
}

const XmlAttribute *rey_xml_attribute_named(const XmlAttributes *attributes, const char *name) {
    for (int i = 0; i < attributes->count; i++) {
        if (strcmp(attributes->items[i].name, name) == 0) {
            return &attributes->items[i];
        }
    }
    return NULL;
}

static bool takes(Known *known, const char *name) {
    const char *one;
    for (int i = 0; (one = next_attribute(known, i)); i++) {
        if (strcmp(one, name) == 0) {
            return true;
        }
    }
    return false;
}

// An attribute that the element does not take, with the nearest that it does, or with all of them where none is near.
static rey_result unknown_attribute(const XmlFile *file, Known *known, const char *name) {
    char list[128];
    const char *inner = known->tag->class == XML_OBJECT ? "; properties are elements within it" : "";
    rey_xml_list_words(name, next_attribute, known, list, sizeof list);
    return rey_xml_fail_word(file->reader->ctx, attribute_position(file, name), name, next_attribute, known,
                             "unknown attribute '%.100s' of <%s>%s%s", name, known->tag->name, list, list[0] ? inner : "");
}

rey_result rey_xml_take_attributes(XmlFile *file, const XmlTag *tag, const char *extra, const char **given,
                                   XmlAttributes *out) {
    rey_context *ctx = file->reader->ctx;
    Known known = {tag, extra};
    out->count = 0;
    for (; given[0]; given += 2) {
        const char *name = given[0];
        if (file->version[0] < 2 && strcmp(name, "intent") == 0 && tag->class == XML_VALUE) {
            continue; // of version 0.x: the plugin decides what a colour is meant as
        }
        if (!takes(&known, name)) {
            rey_result unknown = rey_xml_overlook(file->reader, unknown_attribute(file, &known, name));
            if (unknown) {
                return unknown;
            }
            continue;
        }
        XmlAttribute *item = &out->items[out->count++];
        item->name = name;
        item->at = attribute_position(file, name);
        rey_result result = rey_xml_substitute(file->reader, given[1], item->at, &item->value);
        if (result) {
            return result;
        }
    }
    for (int i = 0; i < tag->required; i++) {
        const XmlAttribute *item = rey_xml_attribute_named(out, tag->attributes[i]);
        if (!item) {
            return rey_xml_fail(ctx, rey_xml_element_position(file), REY_ERROR_SCENE, "<%s> lacks the attribute '%s'",
                                tag->name, tag->attributes[i]);
        }
        if (!item->value[0] && strcmp(item->name, "value") != 0) {
            return rey_xml_fail(ctx, item->at, REY_ERROR_SCENE, "attribute '%s' of <%s> is empty", item->name,
                                tag->name);
        }
    }
    return REY_OK;
}
