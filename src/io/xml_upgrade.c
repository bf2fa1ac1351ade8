// xml_upgrade.c: names of files older than version 2, brought up to date while reading.
#include "io/xml_parts.h"

#include <string.h>

static bool is_lower(char c) {
    return c >= 'a' && c <= 'z';
}

static bool is_upper(char c) {
    return c >= 'A' && c <= 'Z';
}

// camelCase to snake_case: toWorld -> to_world, intIOR -> int_ior. A name that begins with a capital stays.
rey_result rey_xml_upgrade_name(XmlReader *reader, const char **name) {
    const char *old = *name;
    char *new = rey_xml_keep(reader->ctx, reader->document, 2 * strlen(old) + 1);
    if (!new) {
        return REY_ERROR_MEMORY;
    }
    size_t n = 0;
    bool lowering = false;
    for (size_t i = 0; old[i]; i++) {
        if (i > 0 && is_lower(old[i - 1]) && is_upper(old[i])) {
            new[n++] = '_';
            lowering = true;
        }
        lowering = lowering && is_upper(old[i]);
        new[n++] = lowering ? (char)(old[i] - 'A' + 'a') : old[i];
    }
    new[n] = '\0';
    *name = new;
    return REY_OK;
}

// Renames the property or child `from`, if there is one; an error when the name is taken.
static rey_result rename_in(XmlReader *reader, XmlFrame *frame, const char *from, const char *to) {
    for (size_t i = 0; i < frame->properties.count; i++) {
        rey_xml_property *property = &ARRAY_AT(frame->properties, rey_xml_property, i);
        if (strcmp(property->name, from) == 0) {
            property->name = to;
            return rey_xml_claim_name(reader, frame, to, property->at);
        }
    }
    for (size_t i = 0; i < frame->children.count; i++) {
        rey_xml_child *child = &ARRAY_AT(frame->children, rey_xml_child, i);
        if (child->name && strcmp(child->name, from) == 0) {
            child->name = to;
            return rey_xml_claim_name(reader, frame, to, child->at);
        }
    }
    return REY_OK;
}

// uoffset, voffset, uscale, vscale -> to_uv. Version 0.x looked a texture up at uv * scale + offset.
static rey_result collect_uv(XmlReader *reader, XmlFrame *frame) {
    static const char *const names[] = {"uscale", "vscale", "uoffset", "voffset"};
    static const int entries[] = {0, 5, 3, 7}; // of the matrix
    rey_xml_property *properties = frame->properties.data;
    rey_xml_property to_uv = {.name = "to_uv", .kind = REY_XML_TRANSFORM_VALUE};
    rey_xml_identity(to_uv.matrix);
    size_t kept = 0;
    for (size_t i = 0; i < frame->properties.count; i++) {
        int which = 0;
        while (which < 4 && strcmp(properties[i].name, names[which]) != 0) {
            which++;
        }
        bool number = properties[i].kind == REY_XML_FLOAT_VALUE || properties[i].kind == REY_XML_INTEGER_VALUE;
        if (which == 4 || !number) {
            properties[kept++] = properties[i];
            continue;
        }
        to_uv.matrix[entries[which]] = properties[i].number;
        if (!to_uv.at.file) {
            to_uv.at = properties[i].at;
            to_uv.order = properties[i].order;
        }
    }
    if (kept == frame->properties.count) {
        return REY_OK;
    }
    rey_result result = rey_xml_claim_name(reader, frame, to_uv.name, to_uv.at);
    properties[kept] = to_uv;
    frame->properties.count = kept + 1;
    return result;
}

rey_result rey_xml_upgrade_object(XmlReader *reader, XmlFrame *frame) {
    const rey_xml_node *node = frame->node;
    if (node->tag == REY_XML_BSDF && strcmp(node->type, "diffuse") == 0) {
        return rename_in(reader, frame, "diffuse_reflectance", "reflectance");
    }
    return node->tag == REY_XML_TEXTURE ? collect_uv(reader, frame) : REY_OK;
}
