// mesh_write.c: meshes as binary little endian PLY.
#include "io/file.h"
#include "io/mesh.h"

#include <stdio.h>
#include <string.h>

// The part of an attribute's name after vertex_ or face_; null when the reader would not give the same attribute back.
static const char *attribute_prefix(const rey_mesh_attribute *attribute) {
    const char *kind = attribute->per_face ? "face_" : "vertex_";
    if (strncmp(attribute->name, kind, strlen(kind)) != 0 || (attribute->channels != 1 && attribute->channels != 3)) {
        return NULL;
    }
    const char *prefix = attribute->name + strlen(kind);
    for (const char *c = prefix; *c; c++) {
        if ((unsigned char)*c <= ' ' || *c == 127) {
            return NULL;
        }
    }
    return *prefix ? prefix : NULL;
}

static rey_result check_mesh(rey_context *ctx, const char *path, const rey_mesh *mesh) {
    if (mesh->vertex_count < 1 || mesh->face_count < 1 || !mesh->positions || !mesh->faces) {
        return rey_fail(ctx, REY_ERROR_ARGUMENT, "%s: the mesh has no vertices or no faces", path);
    }
    for (int i = 0; i < mesh->attribute_count; i++) {
        const rey_mesh_attribute *attribute = &mesh->attributes[i];
        if (!attribute_prefix(attribute)) {
            return rey_fail(ctx, REY_ERROR_ARGUMENT,
                            "%s: attribute '%s' with %d channels, expected %sNAME without spaces and 1 or 3 channels",
                            path, attribute->name, attribute->channels, attribute->per_face ? "face_" : "vertex_");
        }
    }
    return REY_OK;
}

static bool append(rey_context *ctx, Array *text, const char *format, ...) PRINTF_LIKE(3, 4);

static bool append(rey_context *ctx, Array *text, const char *format, ...) {
    char line[256];
    va_list arguments;
    va_start(arguments, format);
    int length = vsnprintf(line, sizeof line, format, arguments); // names are short: always fits
    va_end(arguments);
    char *to = rey_array_push(ctx, text, 1, (size_t)length);
    if (to) {
        memcpy(to, line, (size_t)length);
    }
    return to != NULL;
}

static bool append_properties(rey_context *ctx, Array *text, const char *names) {
    bool ok = true;
    for (const char *name = names; ok && *name; name += strcspn(name, " "), name += *name == ' ') {
        ok = append(ctx, text, "property float %.*s\n", (int)strcspn(name, " "), name);
    }
    return ok;
}

static bool append_attributes(rey_context *ctx, Array *text, const rey_mesh *mesh, bool per_face) {
    bool ok = true;
    for (int i = 0; i < mesh->attribute_count; i++) {
        const rey_mesh_attribute *attribute = &mesh->attributes[i];
        for (int c = 0; ok && attribute->per_face == per_face && c < attribute->channels; c++) {
            ok = append(ctx, text, "property float %s_%d\n", attribute_prefix(attribute), c);
        }
    }
    return ok;
}

static bool append_header(rey_context *ctx, Array *text, const rey_mesh *mesh) {
    return append(ctx, text, "ply\nformat binary_little_endian 1.0\nelement vertex %lld\n",
                  (long long)mesh->vertex_count) &&
           append_properties(ctx, text, "x y z") && append_properties(ctx, text, mesh->normals ? "nx ny nz" : "") &&
           append_properties(ctx, text, mesh->uvs ? "u v" : "") && append_attributes(ctx, text, mesh, false) &&
           append(ctx, text, "element face %lld\nproperty list uchar int vertex_indices\n",
                  (long long)mesh->face_count) &&
           append_attributes(ctx, text, mesh, true) && append(ctx, text, "end_header\n");
}

static unsigned char *put_uint(unsigned char *to, uint32_t value) {
    for (int i = 0; i < 4; i++) {
        *to++ = (unsigned char)(value >> (8 * i));
    }
    return to;
}

static unsigned char *put_floats(unsigned char *to, const float *values, int64_t item, int width) {
    for (int i = 0; values && i < width; i++) {
        uint32_t bits;
        memcpy(&bits, &values[item * width + i], sizeof bits);
        to = put_uint(to, bits);
    }
    return to;
}

static unsigned char *put_attributes(unsigned char *to, const rey_mesh *mesh, bool per_face, int64_t item) {
    for (int i = 0; i < mesh->attribute_count; i++) {
        const rey_mesh_attribute *attribute = &mesh->attributes[i];
        if (attribute->per_face == per_face) {
            to = put_floats(to, attribute->data, item, attribute->channels);
        }
    }
    return to;
}

static void put_data(unsigned char *to, const rey_mesh *mesh) {
    for (int64_t v = 0; v < mesh->vertex_count; v++) {
        to = put_floats(to, mesh->positions, v, 3);
        to = put_floats(to, mesh->normals, v, 3);
        to = put_floats(to, mesh->uvs, v, 2);
        to = put_attributes(to, mesh, false, v);
    }
    for (int64_t f = 0; f < mesh->face_count; f++) {
        *to++ = 3;
        for (int k = 0; k < 3; k++) {
            to = put_uint(to, mesh->faces[3 * f + k]);
        }
        to = put_attributes(to, mesh, true, f);
    }
}

static size_t data_bytes(const rey_mesh *mesh) {
    size_t per_vertex = 4 * (3 + (mesh->normals ? 3 : 0) + (mesh->uvs ? 2 : 0)), per_face = 13;
    for (int i = 0; i < mesh->attribute_count; i++) {
        size_t bytes = 4 * (size_t)mesh->attributes[i].channels;
        per_vertex += mesh->attributes[i].per_face ? 0 : bytes;
        per_face += mesh->attributes[i].per_face ? bytes : 0;
    }
    return (size_t)mesh->vertex_count * per_vertex + (size_t)mesh->face_count * per_face;
}

rey_result rey_mesh_write_ply(rey_context *ctx, const char *path, const rey_mesh *mesh) {
    rey_result result = check_mesh(ctx, path, mesh);
    if (result != REY_OK) {
        return result;
    }
    Array file = {0};
    size_t bytes = data_bytes(mesh);
    unsigned char *data = append_header(ctx, &file, mesh) ? rey_array_push(ctx, &file, 1, bytes) : NULL;
    if (data) {
        put_data(data, mesh);
        result = rey_file_write(ctx, path, file.data, file.count);
    } else {
        result = REY_ERROR_MEMORY;
    }
    rey_array_free(ctx, &file);
    return result;
}
