// lenient.c: parts of a scene that cannot be read, left out.
#include "io/lenient.h"

#include <stdio.h>
#include <string.h>

Snapshot build_snapshot(const Builder *b) {
    Snapshot s = {.params = b->scene->params.count,
                  .aliases = b->scene->aliases.count,
                  .source_textures = b->source->textures.count,
                  .source_shapes = b->source->shapes.count,
                  .source_attributes = b->source->attributes.count,
                  .attribute_uses = b->attribute_uses.count,
                  .named = b->named.count,
                  .collection = b->collection,
                  .collections = b->scene->view.collections};
#define ARRAY(type, name, comment) s.name = b->scene->build.name.count;
#include "scene/arrays.inl"
#undef ARRAY
    return s;
}

static void take_back(Builder *b, const Snapshot *s) {
    rey_scene *scene = b->scene;
    for (size_t i = s->named; i < b->named.count; i++) { // these objects may still be built by whoever else refers to them
        rey_xml_node *node = ARRAY_AT(b->named, rey_xml_node *, i);
        rey_free(b->ctx, ARRAY_AT(b->source->paths, char *, node->index));
        ARRAY_AT(b->source->paths, char *, node->index) = NULL;
        node->built = -1;
    }
    rey_scene_forget_params(scene, s->params, s->aliases);
    b->source->textures.count = s->source_textures;
    b->source->shapes.count = s->source_shapes;
    b->source->attributes.count = s->source_attributes;
    b->attribute_uses.count = s->attribute_uses;
    b->named.count = s->named;
    b->texture_params.count = b->texture_params.count < s->textures ? b->texture_params.count : s->textures;
    b->collection = s->collection;
    scene->view.collections = s->collections;
    if (scene->view.environment >= (int32_t)s->emitters) {
        scene->view.environment = -1;
    }
#define ARRAY(type, name, comment) scene->build.name.count = s->name;
#include "scene/arrays.inl"
#undef ARRAY
}

rey_result build_remember(Builder *b, const char *text, const char *instead) {
    size_t length = strlen(text) + strlen(instead) + 1;
    for (size_t i = 0; i < b->source->ignored.count; i++) { // what is read again is listed once
        const char *known = ARRAY_AT(b->source->ignored, char *, i);
        if (known && strncmp(known, text, strlen(text)) == 0 && strcmp(known + strlen(text), instead) == 0) {
            return REY_OK;
        }
    }
    char **slot = rey_array_push(b->ctx, &b->source->ignored, sizeof *slot, 1);
    char *copy = slot ? rey_alloc(b->ctx, length) : NULL;
    if (!copy) {
        return REY_ERROR_MEMORY; // an entry of null stays behind, which is no entry
    }
    snprintf(copy, length, "%s%s", text, instead);
    *slot = copy;
    return REY_OK;
}

rey_result build_forgive(Builder *b, const Snapshot *s, rey_xml_child *child, const char *instead, rey_result result,
                         bool *left_out) {
    bool forgive = result != REY_OK && result != REY_ERROR_MEMORY && b->lenient;
    if (left_out) {
        *left_out = forgive;
    }
    if (!forgive) {
        return result;
    }
    take_back(b, s);
    child->ignored = child->used = true;
    return build_remember(b, rey_error(b->ctx), instead);
}

// The places of parts that a sensor does without.
#define OPTIONAL_PARTS (REY_XML_BIT(REY_XML_FILM) | REY_XML_BIT(REY_XML_RFILTER) | REY_XML_BIT(REY_XML_SAMPLER))

static bool stands_at(rey_xml_position at, const char *error) {
    char place[4096];
    int length = snprintf(place, sizeof place, "%s:%d:%d: ", at.file, at.line, at.column);
    return length < (int)sizeof place && strncmp(error, place, (size_t)length) == 0;
}

// Takes the property or part that an error names out of a node, or out of what stands within it.
static bool take_out(rey_xml_node *node, const char *error) {
    for (int i = 0; i < node->property_count; i++) {
        rey_xml_property *p = node->properties + i;
        if (stands_at(p->at, error) && strcmp(p->name, "filename") != 0) { // without it there is nothing
            node->property_count--;
            memmove(p, p + 1, (size_t)(node->property_count - i) * sizeof *p);
            return true;
        }
    }
    for (int i = 0; i < node->child_count; i++) {
        rey_xml_child *child = node->children + i;
        if (child->ref || child->ignored) {
            continue;
        }
        if ((REY_XML_BIT(child->node->tag) & OPTIONAL_PARTS) && stands_at(child->node->at, error)) {
            child->ignored = child->used = true;
            node->child_count--;
            memmove(child, child + 1, (size_t)(node->child_count - i) * sizeof *child);
            return true;
        }
        if (take_out(child->node, error)) {
            return true;
        }
    }
    return false;
}

rey_result build_take_out(Builder *b, const Snapshot *s, rey_xml_node *node, rey_result result, bool *again) {
    *again = result != REY_OK && result != REY_ERROR_MEMORY && b->lenient && take_out(node, rey_error(b->ctx));
    if (!*again) {
        return result;
    }
    take_back(b, s);
    return build_remember(b, rey_error(b->ctx), "");
}

rey_result build_overlook(Builder *b, const char *instead, rey_result result) {
    bool overlook = result != REY_OK && result != REY_ERROR_MEMORY && b->lenient;
    return overlook ? build_remember(b, rey_error(b->ctx), instead) : result;
}

rey_result build_check_unused(Builder *b, rey_xml_node *node) {
    while (rey_xml_check_unused(b->ctx, node, NULL, NULL) != REY_OK) {
        if (!b->lenient) {
            return REY_ERROR_SCENE;
        }
        TRY(build_remember(b, rey_error(b->ctx), ""));
        rey_xml_ignore_unused(node);
    }
    return REY_OK;
}
