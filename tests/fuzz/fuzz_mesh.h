// fuzz_mesh.h: what a mesh that a reader accepted must hold to.
#pragma once

#include "fuzz.h"
#include "io/mesh.h"

static inline void check_mesh(const rey_mesh *mesh) {
    check(mesh->vertex_count > 0 && mesh->face_count > 0 && mesh->positions != NULL);
    for (int64_t i = 0; i < 3 * mesh->face_count; i++) {
        check(mesh->faces[i] < mesh->vertex_count);
    }
    for (int64_t i = 0; i < mesh->vertex_count; i++) {
        check(mesh->position_index[i] <= i && mesh->position_index[mesh->position_index[i]] == mesh->position_index[i]);
    }
    check_floats(mesh->positions, 3 * mesh->vertex_count);
    check_floats(mesh->normals, 3 * mesh->vertex_count);
    check_floats(mesh->uvs, 2 * mesh->vertex_count);
    for (int i = 0; i < mesh->attribute_count; i++) {
        const rey_mesh_attribute *attribute = &mesh->attributes[i];
        int64_t count = attribute->per_face ? mesh->face_count : mesh->vertex_count;
        check_floats(attribute->data, count * attribute->channels);
    }
}
