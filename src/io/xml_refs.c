// xml_refs.c: ids, and references to them.
#include "io/xml_parts.h"

#include <string.h>

// FNV-1a, 64 bit.
static uint64_t hash_text(const char *text) {
    uint64_t h = 14695981039346656037u;
    for (; *text; text++) {
        h = (h ^ (unsigned char)*text) * 1099511628211u;
    }
    return h ^ (h >> 32);
}

// The slot that holds id, or the empty one where it would go. The table must have room.
static XmlId *id_slot(const XmlIds *ids, const char *id) {
    size_t i = hash_text(id) & (ids->capacity - 1);
    while (ids->slots[i].id && strcmp(ids->slots[i].id, id) != 0) {
        i = (i + 1) & (ids->capacity - 1);
    }
    return &ids->slots[i];
}

rey_xml_node *rey_xml_lookup_id(const XmlIds *ids, const char *id) {
    return ids->capacity ? id_slot(ids, id)->node : NULL;
}

static rey_result grow(rey_context *ctx, XmlIds *ids) {
    XmlIds larger = {.capacity = ids->capacity ? ids->capacity * 2 : 64, .count = ids->count};
    larger.slots = rey_alloc_array(ctx, larger.capacity, sizeof(XmlId));
    if (!larger.slots) {
        return REY_ERROR_MEMORY;
    }
    for (size_t i = 0; i < ids->capacity; i++) {
        if (ids->slots[i].id) {
            *id_slot(&larger, ids->slots[i].id) = ids->slots[i];
        }
    }
    rey_free(ctx, ids->slots);
    *ids = larger;
    return REY_OK;
}

rey_result rey_xml_add_id(XmlReader *reader, const char *id, rey_xml_node *node, rey_xml_position at) {
    XmlIds *ids = &reader->document->ids;
    if (ids->count >= ids->capacity / 2 && grow(reader->ctx, ids)) {
        return REY_ERROR_MEMORY;
    }
    XmlId *slot = id_slot(ids, id);
    if (slot->id) {
        return rey_xml_fail(reader->ctx, at, REY_ERROR_SCENE, "duplicate id '%.100s', first used at %s:%d:%d", id,
                            slot->at.file, slot->at.line, slot->at.column);
    }
    *slot = (XmlId){id, node, at};
    ids->count++;
    return REY_OK;
}

typedef struct IdCursor {
    const XmlIds *ids;
    size_t at;
} IdCursor;

static const char *next_id(void *user, int i) { // called with i = 0, 1, 2, ...
    UNUSED(i);
    IdCursor *cursor = user;
    while (cursor->at < cursor->ids->capacity) {
        const char *id = cursor->ids->slots[cursor->at++].id;
        if (id) {
            return id;
        }
    }
    return NULL;
}

static void remove_child(rey_xml_node *node, int i) {
    node->child_count--;
    memmove(node->children + i, node->children + i + 1, (size_t)(node->child_count - i) * sizeof *node->children);
}

static rey_result link_children(XmlReader *reader, rey_xml_node *node) {
    for (int i = 0; i < node->child_count; i++) {
        rey_xml_child *child = &node->children[i];
        if (!child->ref) {
            continue;
        }
        child->node = rey_xml_lookup_id(&reader->document->ids, child->ref);
        if (!child->node) {
            IdCursor cursor = {&reader->document->ids, 0};
            rey_result result = rey_xml_fail_word(reader->ctx, child->at, child->ref, next_id, &cursor,
                                                  "unknown id '%.100s' in <ref>, expected the id of an object of this scene",
                                                  child->ref);
            result = rey_xml_overlook(reader, result);
            if (result) {
                return result;
            }
            remove_child(node, i--);
        }
    }
    return REY_OK;
}

enum { UNSEEN = -1, OPEN = -2 }; // values of height while the graph is walked

// Heights of everything below a node, depth first. An object that is met again while it is open contains itself.
static rey_result measure(XmlReader *reader, rey_xml_node *node, int depth) {
    node->height = OPEN;
    int height = 0;
    for (int i = 0; i < node->child_count; i++) {
        rey_xml_child *child = &node->children[i];
        if (child->node->height == OPEN) {
            rey_result result = rey_xml_fail(reader->ctx, child->at, REY_ERROR_SCENE,
                                             "reference cycle: '%.100s' contains itself", child->ref ? child->ref : "object");
            result = rey_xml_overlook(reader, result);
            if (result) {
                return result;
            }
            remove_child(node, i--);
            continue;
        }
        if (depth >= REY_XML_DEEPEST) {
            return rey_xml_fail(reader->ctx, child->at, REY_ERROR_SCENE,
                                "objects are nested more than %d deep through references", REY_XML_DEEPEST);
        }
        if (child->node->height == UNSEEN) {
            rey_result result = measure(reader, child->node, depth + 1);
            if (result) {
                return result;
            }
        }
        if (child->node->height + 1 > height) {
            height = child->node->height + 1;
        }
        if (height > REY_XML_DEEPEST) {
            return rey_xml_fail(reader->ctx, child->at, REY_ERROR_SCENE,
                                "objects are nested more than %d deep through references", REY_XML_DEEPEST);
        }
    }
    node->height = height;
    return REY_OK;
}

static rey_result load_spectrum(XmlReader *reader, rey_xml_property *property) {
    rey_context *ctx = reader->ctx;
    double **storage = rey_array_push(ctx, &reader->document->spectra, sizeof(double *), 1);
    char *path = NULL, *text = NULL;
    size_t bytes = 0;
    rey_result result =
        storage ? rey_xml_search(ctx, reader->document, NULL, property->string, &path) : REY_ERROR_MEMORY;
    if (!result && !path) {
        result = rey_xml_not_found(ctx, reader->document, property->at, NULL, property->string);
    }
    if (!result) {
        result = rey_xml_load(reader, property->at, path, false, &text, &bytes);
    }
    if (!result) {
        result = rey_spectrum_read_memory(ctx, path, text, bytes, &property->spectrum, storage);
        result = rey_xml_named_file(ctx, property->at, result);
    }
    rey_free(ctx, text);
    rey_free(ctx, path);
    return result;
}

// <spectrum filename> is read here, because only now are all search folders known.
static rey_result load_spectra(XmlReader *reader, rey_xml_node *node) {
    rey_result result = REY_OK;
    for (int i = 0; i < node->property_count && !result; i++) {
        rey_xml_property *property = &node->properties[i];
        if (property->kind == REY_XML_SPECTRUM_VALUE && property->string) {
            result = load_spectrum(reader, property);
            if (result && !(result = rey_xml_overlook(reader, result))) {
                node->property_count--;
                memmove(property, property + 1, (size_t)(node->property_count - i) * sizeof *property);
                i--;
            }
        }
    }
    return result;
}

rey_result rey_xml_resolve_references(XmlReader *reader) {
    const Array *nodes = &reader->document->nodes;
    for (size_t i = 0; i < nodes->count; i++) {
        rey_xml_node *node = ARRAY_AT(*nodes, rey_xml_node *, i);
        node->height = UNSEEN;
        node->index = (int)i;
        node->built = -1;
        rey_result result = link_children(reader, node);
        if (!result) {
            result = load_spectra(reader, node);
        }
        if (result) {
            return result;
        }
    }
    for (size_t i = 0; i < nodes->count; i++) {
        rey_xml_node *node = ARRAY_AT(*nodes, rey_xml_node *, i);
        rey_result result = node->height == UNSEEN ? measure(reader, node, 0) : REY_OK;
        if (result) {
            return result;
        }
    }
    return REY_OK;
}
