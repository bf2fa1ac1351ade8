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
