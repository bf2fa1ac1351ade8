// xml_element.c: what each element becomes: a node, a property, an operation on a transform, or an effect.
#include "io/xml_parts.h"

#include "io/number.h"

#include <stdio.h>
#include <string.h>

// ---- frames ------------------------------------------------------------------------------------------------------

XmlFrame *rey_xml_top_frame(XmlReader *reader) {
    return reader->frames.count ? &ARRAY_AT(reader->frames, XmlFrame, reader->frames.count - 1) : NULL;
}

XmlFrame *rey_xml_object_frame(XmlReader *reader) {
    for (size_t i = reader->frames.count; i > 0; i--) {
        XmlFrame *frame = &ARRAY_AT(reader->frames, XmlFrame, i - 1);
        if (frame->node) {
            return frame;
        }
    }
    return NULL;
}

void rey_xml_free_frame(rey_context *ctx, XmlFrame *frame) {
    rey_array_free(ctx, &frame->properties);
    rey_array_free(ctx, &frame->children);
    rey_array_free(ctx, &frame->names);
}

static rey_result push_frame(XmlReader *reader, const XmlTag *tag, rey_xml_node *node, bool splice) {
    XmlFrame *frame = rey_array_push(reader->ctx, &reader->frames, sizeof *frame, 1);
    if (!frame) {
        return REY_ERROR_MEMORY;
    }
    frame->tag = tag;
    frame->node = node;
    frame->splice = splice;
    frame->line = rey_xml_element_position(reader->file).line;
    return REY_OK;
}

rey_result rey_xml_claim_name(XmlReader *reader, XmlFrame *frame, const char *name, rey_xml_position at) {
    for (size_t i = 0; i < frame->names.count; i++) {
        if (strcmp(ARRAY_AT(frame->names, const char *, i), name) == 0) {
            return rey_xml_fail(reader->ctx, at, REY_ERROR_SCENE, "'%.100s' is given twice in %s '%.100s'", name,
                                rey_xml_tag_name(frame->node->tag), frame->node->type);
        }
    }
    if (frame->names.count >= XML_MOST_NAMES) {
        return rey_xml_fail(reader->ctx, at, REY_ERROR_SCENE, "more than %d named properties and children in %s",
                            XML_MOST_NAMES, rey_xml_tag_name(frame->node->tag));
    }
    const char **slot = rey_array_push(reader->ctx, &frame->names, sizeof *slot, 1);
    if (!slot) {
        return REY_ERROR_MEMORY;
    }
    *slot = name;
    return REY_OK;
}

static int next_order(const XmlFrame *frame) {
    return (int)(frame->properties.count + frame->children.count);
}

static rey_result add_property(XmlReader *reader, rey_xml_property property) {
    XmlFrame *frame = rey_xml_object_frame(reader);
    rey_result result = rey_xml_claim_name(reader, frame, property.name, property.at);
    property.order = next_order(frame);
    rey_xml_property *slot = result ? NULL : rey_array_push(reader->ctx, &frame->properties, sizeof property, 1);
    if (!slot) {
        return result ? result : REY_ERROR_MEMORY;
    }
    *slot = property;
    return REY_OK;
}

static rey_result add_child(XmlReader *reader, XmlFrame *frame, rey_xml_child child) {
    rey_result result = child.name ? rey_xml_claim_name(reader, frame, child.name, child.at) : REY_OK;
    child.order = next_order(frame);
    rey_xml_child *slot = result ? NULL : rey_array_push(reader->ctx, &frame->children, sizeof child, 1);
    if (!slot) {
        return result ? result : REY_ERROR_MEMORY;
    }
    *slot = child;
    return REY_OK;
}

// Copies an attribute into the document; null when absent or empty. A name of an old file is brought up to date.
static rey_result keep_attribute(XmlFile *file, const XmlAttributes *attributes, const char *name, const char **out) {
    *out = NULL;
    const XmlAttribute *attribute = rey_xml_attribute_named(attributes, name);
    if (!attribute || !attribute->value[0]) {
        return REY_OK;
    }
    *out = rey_xml_keep_text(file->reader->ctx, file->reader->document, attribute->value, strlen(attribute->value));
    if (!*out) {
        return REY_ERROR_MEMORY;
    }
    return file->version[0] < 2 && strcmp(name, "name") == 0 ? rey_xml_upgrade_name(file->reader, out) : REY_OK;
}

// ---- root --------------------------------------------------------------------------------------------------------

static rey_result check_version(XmlFile *file, const XmlTag *tag, const XmlAttributes *attributes) {
    rey_context *ctx = file->reader->ctx;
    const XmlAttribute *attribute = rey_xml_attribute_named(attributes, "version");
    if (!attribute) {
        return rey_xml_fail(ctx, rey_xml_element_position(file), REY_ERROR_SCENE,
                            "<%s> lacks the attribute 'version', expected for example version=\"3.0.0\"", tag->name);
    }
    const char *c = attribute->value;
    bool good = true;
    for (int i = 0; i < 3 && good; i++) {
        int64_t number = -1;
        good = *c != '+' && rey_parse_integer(c, &c, &number) && number >= 0 && number < 10000 &&
               *c == (i < 2 ? '.' : '\0');
        file->version[i] = (int)number;
        c += i < 2;
    }
    if (!good) {
        return rey_xml_fail(ctx, attribute->at, REY_ERROR_SCENE,
                            "bad version '%.100s', expected three numbers such as 3.0.0", attribute->value);
    }
    if (file->version[0] > 3) {
        return rey_xml_fail(ctx, attribute->at, REY_ERROR_SCENE,
                            "version %.100s of the scene format is not known, expected 3.x or older", attribute->value);
    }
    return REY_OK;
}

// ---- objects -----------------------------------------------------------------------------------------------------

static rey_result begin_object(XmlFile *file, const XmlTag *tag, const XmlAttributes *attributes) {
    XmlReader *reader = file->reader;
    rey_xml_node *node = rey_xml_keep(reader->ctx, reader->document, sizeof *node);
    rey_xml_asked *asked = rey_xml_keep(reader->ctx, reader->document, sizeof *asked);
    rey_xml_node **listed =
        node && asked ? rey_array_push(reader->ctx, &reader->document->nodes, sizeof(rey_xml_node *), 1) : NULL;
    if (!listed) {
        return REY_ERROR_MEMORY;
    }
    *listed = node;
    node->asked = asked;
    node->tag = (rey_xml_tag)tag->which;
    node->at = rey_xml_element_position(file);
    rey_result result = keep_attribute(file, attributes, "id", &node->id);
    if (!result) {
        result = keep_attribute(file, attributes, "name", &node->name);
    }
    if (!result) {
        result = keep_attribute(file, attributes, "type", &node->type);
    }
    if (!result && node->tag == REY_XML_SCENE) {
        node->type = "scene";
    }
    if (!result && node->id) {
        rey_result known = rey_xml_add_id(reader, node->id, node, rey_xml_attribute_named(attributes, "id")->at);
        node->id = known ? NULL : node->id;
        result = rey_xml_overlook(reader, known);
    }
    XmlFrame *parent = rey_xml_object_frame(reader);
    if (!result && parent) {
        result = add_child(reader, parent, (rey_xml_child){.node = node, .name = node->name, .at = node->at});
    }
    if (!result && !parent) {
        reader->document->root = node;
    }
    return result ? result : push_frame(reader, tag, node, false);
}

static rey_result end_object(XmlFile *file, XmlFrame *frame) {
    XmlReader *reader = file->reader;
    rey_result result = file->version[0] < 2 ? rey_xml_upgrade_object(reader, frame) : REY_OK;
    if (!result) {
        result = rey_xml_renew_object(reader, frame);
    }
    if (result) {
        return result;
    }
    rey_xml_node *node = frame->node;
    size_t property_bytes = frame->properties.count * sizeof(rey_xml_property);
    size_t child_bytes = frame->children.count * sizeof(rey_xml_child);
    node->properties = rey_xml_keep(reader->ctx, reader->document, property_bytes);
    node->children = rey_xml_keep(reader->ctx, reader->document, child_bytes);
    if (!node->properties || !node->children) {
        return REY_ERROR_MEMORY;
    }
    if (property_bytes) {
        memcpy(node->properties, frame->properties.data, property_bytes);
    }
    if (child_bytes) {
        memcpy(node->children, frame->children.data, child_bytes);
    }
    node->property_count = (int)frame->properties.count;
    node->child_count = (int)frame->children.count;
    return REY_OK;
}

// ---- values ------------------------------------------------------------------------------------------------------

static rey_result begin_value(XmlFile *file, const XmlTag *tag, const XmlAttributes *attributes) {
    XmlReader *reader = file->reader;
    rey_xml_property property = {.at = rey_xml_element_position(file), .kind = (rey_xml_kind)tag->which,
                                 .point = strcmp(tag->name, "point") == 0};
    rey_result result = keep_attribute(file, attributes, "name", &property.name);
    if (!result && property.kind == REY_XML_TRANSFORM_VALUE) {
        rey_xml_identity(property.matrix);
        result = push_frame(reader, tag, NULL, false);
        if (!result) {
            rey_xml_top_frame(reader)->transform = property; // becomes a property when it is complete
        }
        return result;
    }
    if (!result) {
        result = rey_xml_read_value(reader, tag, attributes, &property);
    }
    if (!result) {
        result = add_property(reader, property);
    }
    return result ? result : push_frame(reader, tag, NULL, false);
}

// ---- ref, default, include, path, alias --------------------------------------------------------------------------

static rey_result do_ref(XmlFile *file, const XmlAttributes *attributes) {
    rey_xml_child child = {.at = rey_xml_element_position(file)};
    rey_result result = keep_attribute(file, attributes, "id", &child.ref);
    if (!result) {
        result = keep_attribute(file, attributes, "name", &child.name);
    }
    return result ? result : add_child(file->reader, rey_xml_object_frame(file->reader), child);
}

static rey_result do_alias(XmlFile *file, const XmlAttributes *attributes) {
    XmlReader *reader = file->reader;
    const XmlAttribute *id = rey_xml_attribute_named(attributes, "id");
    rey_xml_node *node = rey_xml_lookup_id(&reader->document->ids, id->value);
    if (!node) {
        return rey_xml_fail(reader->ctx, id->at, REY_ERROR_SCENE,
                            "unknown id '%.100s' in <alias>, expected an object declared before this line", id->value);
    }
    const char *other = NULL;
    rey_result result = keep_attribute(file, attributes, "as", &other);
    return result ? result : rey_xml_add_id(reader, other, node, rey_xml_attribute_named(attributes, "as")->at);
}

static rey_result do_path(XmlFile *file, const XmlAttributes *attributes) {
    XmlReader *reader = file->reader;
    const XmlAttribute *value = rey_xml_attribute_named(attributes, "value");
    if (rey_xml_top_frame(reader)->tag->which != REY_XML_SCENE) {
        return rey_xml_fail(reader->ctx, rey_xml_element_position(file), REY_ERROR_SCENE,
                            "<path> must stand directly within <scene>");
    }
    char *joined = rey_xml_join(reader->ctx, file->folder, value->value);
    if (!joined) {
        return REY_ERROR_MEMORY;
    }
    rey_result result = REY_OK;
    if (!rey_xml_is_folder(joined)) {
        result = rey_xml_fail(reader->ctx, value->at, REY_ERROR_IO, "'%.400s' is not a folder", joined);
    } else {
        const char *kept = rey_xml_keep_text(reader->ctx, reader->document, joined, strlen(joined));
        const char **slot = kept ? rey_array_push(reader->ctx, &reader->document->folders, sizeof *slot, 1) : NULL;
        if (slot) {
            *slot = kept;
        } else {
            result = REY_ERROR_MEMORY;
        }
    }
    rey_free(reader->ctx, joined);
    return result;
}

static rey_result check_include(XmlFile *file, rey_xml_position at, const char *path) {
    rey_context *ctx = file->reader->ctx;
    if (file->depth + 1 >= REY_XML_INCLUDE_DEPTH) {
        return rey_xml_fail(ctx, at, REY_ERROR_SCENE, "files are included more than %d deep", REY_XML_INCLUDE_DEPTH);
    }
    if (file->reader->file_count >= XML_MOST_INCLUDES) {
        return rey_xml_fail(ctx, at, REY_ERROR_SCENE, "more than %d files are included", XML_MOST_INCLUDES);
    }
    for (const XmlFile *outer = file; outer; outer = outer->parent) {
        if (strcmp(outer->name, path) == 0) {
            return rey_xml_fail(ctx, at, REY_ERROR_SCENE, "'%.400s' includes itself", path);
        }
    }
    return REY_OK;
}

static rey_result do_include(XmlFile *file, const XmlAttributes *attributes) {
    XmlReader *reader = file->reader;
    const XmlAttribute *name = rey_xml_attribute_named(attributes, "filename");
    char *path = NULL, *text = NULL;
    size_t bytes = 0;
    rey_result result = rey_xml_search(reader->ctx, reader->document, file->folder, name->value, &path);
    if (!result && !path) {
        result = rey_xml_not_found(reader->ctx, reader->document, name->at, file->folder, name->value);
    }
    if (!result) {
        result = check_include(file, name->at, path);
    }
    if (!result) {
        result = rey_xml_load(reader, name->at, path, false, &text, &bytes);
    }
    if (!result) {
        result = rey_xml_parse_text(reader, path, text ? text : "", bytes);
    }
    rey_free(reader->ctx, text);
    rey_free(reader->ctx, path);
    return result;
}

static rey_result do_special(XmlFile *file, const XmlTag *tag, const XmlAttributes *attributes) {
    rey_result result = REY_OK;
    switch ((XmlSpecial)tag->which) {
    case XML_REF:
        result = do_ref(file, attributes);
        break;
    case XML_DEFAULT:
        result = rey_xml_add_define(file->reader, rey_xml_attribute_named(attributes, "name")->value,
                                    rey_xml_attribute_named(attributes, "value")->value, false,
                                    rey_xml_element_position(file));
        break;
    case XML_INCLUDE:
        result = do_include(file, attributes);
        break;
    case XML_PATH:
        result = do_path(file, attributes);
        break;
    case XML_ALIAS:
        result = do_alias(file, attributes);
        break;
    }
    return result ? result : push_frame(file->reader, tag, NULL, false);
}

// ---- elements ----------------------------------------------------------------------------------------------------

static rey_result check_place(XmlFile *file, const XmlTag *tag, const XmlFrame *parent) {
    rey_context *ctx = file->reader->ctx;
    rey_xml_position at = rey_xml_element_position(file);
    if (!parent) {
        return tag->class == XML_OBJECT
                   ? REY_OK
                   : rey_xml_fail(ctx, at, REY_ERROR_SCENE, "<%s> cannot be the root, expected <scene>", tag->name);
    }
    bool in_object = parent->tag->class == XML_OBJECT;
    bool in_transform = parent->tag->class == XML_VALUE && parent->tag->which == REY_XML_TRANSFORM_VALUE;
    bool scene = tag->class == XML_OBJECT && tag->which == REY_XML_SCENE;
    if (in_transform ? tag->class == XML_OPERATION : in_object && tag->class != XML_OPERATION && !scene) {
        return REY_OK;
    }
    const char *expected = in_transform ? "translate, scale, rotate, lookat or matrix"
                           : in_object  ? "objects and values"
                                        : "nothing";
    return rey_xml_fail(ctx, at, REY_ERROR_SCENE, "<%s> cannot stand within <%s>, expected %s", tag->name,
                        parent->tag->name, expected);
}

rey_result rey_xml_start_element(XmlFile *file, const char *name, const char **given) {
    XmlReader *reader = file->reader;
    bool root = reader->frames.count == file->base;
    bool has_type = false;
    for (const char **a = given; *a; a += 2) {
        has_type = has_type || strcmp(*a, "type") == 0;
    }
    const XmlTag *tag = NULL;
    XmlAttributes attributes;
    rey_result result = rey_xml_find_tag(file, name, has_type, &tag);
    if (!result) {
        result = check_place(file, tag, root ? NULL : rey_xml_top_frame(reader));
    }
    if (!result && reader->frames.count >= REY_XML_DEEPEST) {
        result = rey_xml_fail(reader->ctx, rey_xml_element_position(file), REY_ERROR_SCENE,
                              "elements are nested more than %d deep", REY_XML_DEEPEST);
    }
    if (!result) {
        result = rey_xml_take_attributes(file, tag, root ? "version" : NULL, given, &attributes);
    }
    if (!result && root) {
        result = check_version(file, tag, &attributes);
    }
    if (result) {
        return result;
    }
    switch (tag->class) {
    case XML_OBJECT:
        return root && file->parent && tag->which == REY_XML_SCENE ? push_frame(reader, tag, NULL, true)
                                                                   : begin_object(file, tag, &attributes);
    case XML_VALUE:
        return begin_value(file, tag, &attributes);
    case XML_OPERATION:
        result = rey_xml_apply_operation(reader, tag, &attributes, rey_xml_element_position(file),
                                         rey_xml_top_frame(reader)->transform.matrix);
        return result ? result : push_frame(reader, tag, NULL, false);
    case XML_SPECIAL:
        break;
    }
    return do_special(file, tag, &attributes);
}

rey_result rey_xml_end_element(XmlFile *file) {
    XmlReader *reader = file->reader;
    XmlFrame *frame = rey_xml_top_frame(reader);
    rey_result result = REY_OK;
    if (frame->node) {
        result = end_object(file, frame);
    } else if (frame->tag->class == XML_VALUE && frame->tag->which == REY_XML_TRANSFORM_VALUE) {
        result = rey_xml_overlook(reader, add_property(reader, frame->transform));
        frame = rey_xml_top_frame(reader);
    }
    rey_xml_free_frame(reader->ctx, frame);
    reader->frames.count--;
    return result;
}
