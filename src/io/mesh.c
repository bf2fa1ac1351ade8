// mesh.c: what all meshes share: life cycle, attributes, welding of positions.
#include "io/mesh.h"

#include "io/triples.h"

#include <string.h>

void rey_mesh_free(rey_context *ctx, rey_mesh *mesh) {
    rey_free(ctx, mesh->positions);
    rey_free(ctx, mesh->normals);
    rey_free(ctx, mesh->uvs);
    rey_free(ctx, mesh->faces);
    rey_free(ctx, mesh->position_index);
    for (int i = 0; i < mesh->attribute_count; i++) {
        rey_free(ctx, mesh->attributes[i].data);
    }
    rey_free(ctx, mesh->attributes);
    *mesh = (rey_mesh){0};
}

float *rey_mesh_add_attribute(rey_context *ctx, rey_mesh *mesh, const char *name, bool per_face, int channels) {
    if (strlen(name) >= sizeof mesh->attributes->name) {
        rey_fail(ctx, REY_ERROR_FORMAT, "mesh attribute name '%s' is too long, expected at most %zu characters", name,
                 sizeof mesh->attributes->name - 1);
        return NULL;
    }
    rey_mesh_attribute attribute = {.per_face = per_face, .channels = channels};
    memcpy(attribute.name, name, strlen(name));
    size_t count = (size_t)(per_face ? mesh->face_count : mesh->vertex_count);
    size_t held = (size_t)mesh->attribute_count;
    rey_mesh_attribute *list = rey_alloc_array(ctx, held + 1, sizeof *list);
    attribute.data = list ? rey_alloc_array(ctx, count, (size_t)channels * sizeof *attribute.data) : NULL;
    if (!attribute.data) {
        rey_free(ctx, list);
        return NULL;
    }
    if (held) {
        memcpy(list, mesh->attributes, held * sizeof *list);
    }
    list[held] = attribute;
    rey_free(ctx, mesh->attributes);
    mesh->attributes = list;
    mesh->attribute_count++;
    return attribute.data;
}

rey_result rey_mesh_weld(rey_context *ctx, rey_mesh *mesh) {
    size_t count = (size_t)mesh->vertex_count;
    TripleTable table = {0};
    Triple *keys = rey_alloc_array(ctx, count, sizeof *keys);
    uint32_t *first = rey_alloc_array(ctx, count, sizeof *first);
    if (!keys || !first || !triple_reserve(ctx, &table, keys, count)) {
        rey_free(ctx, keys);
        rey_free(ctx, first);
        return REY_ERROR_MEMORY;
    }
    for (size_t i = 0; i < count; i++) {
        float position[3];
        for (int k = 0; k < 3; k++) {
            position[k] = mesh->positions[3 * i + (size_t)k] + 0.0f; // -0 becomes 0
        }
        memcpy(&keys[i], position, sizeof keys[i]);
        uint32_t *slot = triple_slot(&table, keys, &keys[i]);
        if (!*slot) {
            *slot = (uint32_t)(i + 1);
        }
        first[i] = *slot - 1;
    }
    triple_free(ctx, &table);
    rey_free(ctx, keys);
    rey_free(ctx, mesh->position_index);
    mesh->position_index = first;
    return REY_OK;
}
