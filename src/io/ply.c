// ply.c: PLY meshes, text and binary in either byte order.
#include "io/ply.h"

#include "io/file.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

typedef struct PlyMesh { // what is under construction
    rey_mesh *mesh;
    int64_t face_records; // triangles and polygons
    PlyProperty *corners; // the list of vertex indices
    rey_mesh *per_record; // holds the face attributes, one item per record
    Array faces, owners;  // 3 uint32_t per triangle; its record (uint32_t), kept if there are face attributes
} PlyMesh;

// ---- which property goes where -------------------------------------------------------------------------------------

static PlyElement *find_element(PlyReader *r, const char *name) {
    for (int i = 0; i < r->element_count; i++) {
        if (rey_ply_word_is(r->elements[i].name, name)) {
            return &r->elements[i];
        }
    }
    return NULL;
}

static PlyProperty *find_property(PlyReader *r, const PlyElement *element, const char *name, bool list) {
    for (int i = 0; i < element->property_count; i++) {
        PlyProperty *property = &r->properties[element->first_property + i];
        if (property->list == list && rey_ply_word_is(property->name, name)) {
            return property;
        }
    }
    return NULL;
}

// Finds the properties of these names; false when one is missing.
static bool find_group(PlyReader *r, const PlyElement *element, const char *const *names, int count,
                       PlyProperty **group) {
    for (int i = 0; i < count; i++) {
        group[i] = find_property(r, element, names[i], false);
        if (!group[i]) {
            return false;
        }
    }
    return true;
}

static void aim(PlyProperty **group, int channels, float *data) {
    for (int i = 0; i < channels; i++) {
        group[i]->target = data + i;
        group[i]->stride = channels;
    }
}

// Allocates an array for a group of properties and routes them to it.
static float *route(PlyReader *r, PlyProperty **group, int channels, int64_t count) {
    float *data = rey_alloc_array(r->ctx, (size_t)count, (size_t)channels * sizeof *data);
    if (data) {
        aim(group, channels, data);
    }
    return data;
}

static rey_result add_attribute(PlyReader *r, rey_mesh *mesh, bool per_face, PlyWord prefix, PlyProperty **group,
                                int channels) {
    char name[sizeof mesh->attributes->name];
    const char *kind = per_face ? "face_" : "vertex_";
    if (strlen(kind) + (size_t)prefix.length >= sizeof name) {
        return rey_ply_fail(r, "attribute name '%s%.*s' is too long, expected at most %zu characters", kind,
                            prefix.length < 100 ? prefix.length : 100, prefix.text, sizeof name - 1);
    }
    snprintf(name, sizeof name, "%s%.*s", kind, prefix.length, prefix.text);
    for (int i = 0; i < mesh->attribute_count; i++) {
        if (strcmp(mesh->attributes[i].name, name) == 0) {
            return rey_ply_fail(r, "attribute '%s' appears twice", name);
        }
    }
    float *data = rey_mesh_add_attribute(r->ctx, mesh, name, per_face, channels);
    if (!data) {
        return REY_ERROR_MEMORY;
    }
    aim(group, channels, data);
    return REY_OK;
}

// Splits PREFIX_s; false when the name has no such form.
static bool split_name(const PlyProperty *property, PlyWord *prefix, char *suffix) {
    int length = property->name.length;
    if (property->list || property->target || length < 3 || property->name.text[length - 2] != '_') {
        return false;
    }
    *prefix = (PlyWord){property->name.text, length - 2};
    *suffix = property->name.text[length - 1];
    return true;
}

// Contiguous properties PREFIX_s with s running through one of the series become the attribute PREFIX.
static rey_result route_attributes(PlyReader *r, rey_mesh *mesh, const PlyElement *element, bool per_face) {
    static const char *const colors[][3] = {{"r", "g", "b"}, {"red", "green", "blue"}};
    static const char *const series[] = {"xyzw", "rgba", "0123", "1234"};
    PlyProperty *group[4];
    for (int i = 0; i < COUNT_OF(colors); i++) {
        if (find_group(r, element, colors[i], 3, group)) {
            rey_result result = add_attribute(r, mesh, per_face, (PlyWord){"color", 5}, group, 3);
            if (result != REY_OK) {
                return result;
            }
            break;
        }
    }
    PlyProperty *properties = &r->properties[element->first_property];
    for (int i = 0; i < element->property_count;) {
        PlyWord prefix = {NULL, 0}, other;
        char suffix = 0;
        const char *letters = NULL;
        if (split_name(&properties[i], &prefix, &suffix)) {
            for (int s = 0; s < COUNT_OF(series); s++) {
                letters = series[s][0] == suffix ? series[s] : letters;
            }
        }
        if (!letters) {
            i++;
            continue;
        }
        int channels = 0;
        do {
            group[channels] = &properties[i + channels];
            channels++;
        } while (channels < 4 && i + channels < element->property_count &&
                 split_name(&properties[i + channels], &other, &suffix) && other.length == prefix.length &&
                 memcmp(other.text, prefix.text, (size_t)prefix.length) == 0 && suffix == letters[channels]);
        if (channels == 1 || channels == 3) {
            rey_result result = add_attribute(r, mesh, per_face, prefix, group, channels);
            if (result != REY_OK) {
                return result;
            }
        }
        i += channels;
    }
    return REY_OK;
}

static rey_result route_vertices(PlyReader *r, rey_mesh *mesh, const PlyElement *element) {
    static const char *const position_names[] = {"x", "y", "z"}, *const normal_names[] = {"nx", "ny", "nz"};
    static const char *const uv_names[][2] = {{"u", "v"}, {"s", "t"}, {"texture_u", "texture_v"}};
    PlyProperty *group[3];
    if (!find_group(r, element, position_names, 3, group)) {
        return rey_ply_fail(r, "element vertex has no coordinates, expected the properties x, y and z");
    }
    mesh->positions = route(r, group, 3, mesh->vertex_count);
    if (!mesh->positions) {
        return REY_ERROR_MEMORY;
    }
    if (find_group(r, element, normal_names, 3, group)) {
        mesh->normals = route(r, group, 3, mesh->vertex_count);
        if (!mesh->normals) {
            return REY_ERROR_MEMORY;
        }
    }
    for (int i = 0; i < COUNT_OF(uv_names); i++) {
        if (find_group(r, element, uv_names[i], 2, group)) {
            mesh->uvs = route(r, group, 2, mesh->vertex_count);
            if (!mesh->uvs) {
                return REY_ERROR_MEMORY;
            }
            break;
        }
    }
    return route_attributes(r, mesh, element, false);
}

// Bytes that the items of an element take at the least; 0 for an element without properties.
static int64_t least_bytes(const PlyReader *r, const PlyElement *element) {
    int64_t bytes = 0;
    for (int i = 0; i < element->property_count; i++) {
        const PlyProperty *property = &r->properties[element->first_property + i];
        bytes += r->text ? 2 : rey_ply_type_size(property->list ? property->count_type : property->type);
    }
    return bytes;
}

static rey_result check_counts(PlyReader *r, const PlyElement *vertices, const PlyElement *faces) {
    if (!vertices || !faces) {
        return rey_ply_fail(r, "the header has no element %s", vertices ? "face" : "vertex");
    }
    if (faces->count == 0 || vertices->count == 0) {
        return rey_ply_fail(r, "the mesh has no %s", faces->count ? "vertices" : "faces");
    }
    int64_t left = r->end - r->at;
    for (int i = 0; i < r->element_count; i++) {
        const PlyElement *element = &r->elements[i];
        int64_t least = least_bytes(r, element);
        // The last number of a text file needs no space after it.
        if (least && element->count > (left + r->text) / least) {
            return rey_ply_fail(r, "element '%.*s' has %lld items of at least %lld bytes, but only %lld bytes are left",
                                element->name.length < 64 ? element->name.length : 64, element->name.text,
                                (long long)element->count, (long long)least, (long long)left);
        }
    }
    if (vertices->count > MESH_MOST_ITEMS || faces->count > MESH_MOST_ITEMS) {
        return rey_fail(r->ctx, REY_ERROR_UNSUPPORTED, "%s: more than %d vertices or faces", r->path, MESH_MOST_ITEMS);
    }
    return REY_OK;
}

// ---- data ----------------------------------------------------------------------------------------------------------

static rey_result add_triangle(PlyReader *r, PlyMesh *m, const uint32_t corners[3], int64_t record) {
    if (m->faces.count >= MESH_MOST_ITEMS) {
        return rey_fail(r->ctx, REY_ERROR_UNSUPPORTED, "%s: more than %d triangles", r->path, MESH_MOST_ITEMS);
    }
    uint32_t *face = rey_array_push(r->ctx, &m->faces, 3 * sizeof *face, 1);
    if (!face) {
        return REY_ERROR_MEMORY;
    }
    memcpy(face, corners, 3 * sizeof *face);
    if (m->per_record->attribute_count) {
        uint32_t *owner = rey_array_push(r->ctx, &m->owners, sizeof *owner, 1);
        if (!owner) {
            return REY_ERROR_MEMORY;
        }
        *owner = (uint32_t)record;
    }
    return REY_OK;
}

static rey_result read_corners(PlyReader *r, PlyMesh *m, int64_t record) {
    int64_t count;
    rey_result result = rey_ply_read_length(r, m->corners, &count);
    if (result == REY_OK && count < 3) {
        result =
            rey_ply_fail(r, "face %lld has %lld corners, expected at least 3", (long long)record, (long long)count);
    }
    uint32_t corners[3] = {0}; // the first, the one before and the current
    for (int64_t i = 0; result == REY_OK && i < count; i++) {
        int64_t index;
        result = rey_ply_read_int(r, m->corners->type, &index);
        if (result != REY_OK) {
            break;
        }
        if (index < 0 || index >= m->mesh->vertex_count) {
            return rey_ply_fail(r, "face %lld: vertex index %lld is out of range, expected 0 to %lld",
                                (long long)record, (long long)index, (long long)m->mesh->vertex_count - 1);
        }
        corners[1] = corners[2];
        corners[2] = (uint32_t)index;
        if (i == 0) {
            corners[0] = corners[2];
        } else if (i >= 2) {
            result = add_triangle(r, m, corners, record);
        }
    }
    return result;
}

static rey_result read_item(PlyReader *r, PlyMesh *m, const PlyElement *element, int64_t item) {
    rey_result result = REY_OK;
    for (int i = 0; result == REY_OK && i < element->property_count; i++) {
        const PlyProperty *property = &r->properties[element->first_property + i];
        if (property == m->corners) {
            result = read_corners(r, m, item);
        } else if (property->list) {
            result = rey_ply_skip_list(r, property);
        } else if (!property->target) {
            result = rey_ply_skip_value(r, property->type);
        } else {
            float *target = &property->target[item * property->stride];
            result = rey_ply_read_float(r, property->type, target);
            if (result == REY_OK && !isfinite(*target)) {
                result = rey_ply_fail(r, "%.*s %lld: property %.*s is %g, expected a finite number in float range",
                                      element->name.length, element->name.text, (long long)item,
                                      property->name.length < 64 ? property->name.length : 64, property->name.text,
                                      (double)*target);
            }
        }
    }
    return result;
}

static rey_result read_data(PlyReader *r, PlyMesh *m) {
    for (int i = 0; i < r->element_count; i++) {
        const PlyElement *element = &r->elements[i];
        for (int64_t item = 0; element->property_count && item < element->count; item++) {
            rey_result result = read_item(r, m, element, item);
            if (result != REY_OK) {
                return result;
            }
        }
    }
    return REY_OK;
}

// Moves the triangles and the face attributes, which are per record so far, into the mesh.
static rey_result finish_faces(PlyReader *r, PlyMesh *m) {
    m->mesh->face_count = (int64_t)m->faces.count;
    m->mesh->faces = m->faces.data;
    m->faces = (Array){0};
    for (int i = 0; i < m->per_record->attribute_count; i++) {
        const rey_mesh_attribute *from = &m->per_record->attributes[i];
        float *to = rey_mesh_add_attribute(r->ctx, m->mesh, from->name, true, from->channels);
        if (!to) {
            return REY_ERROR_MEMORY;
        }
        size_t width = (size_t)from->channels;
        for (size_t f = 0; f < m->owners.count; f++) {
            memcpy(to + width * f, from->data + width * ARRAY_AT(m->owners, uint32_t, f), width * sizeof *to);
        }
    }
    return rey_mesh_weld(r->ctx, m->mesh);
}

static rey_result read_mesh(PlyReader *r, PlyMesh *m, bool flip_tex_coords) {
    rey_result result = rey_ply_read_header(r);
    const PlyElement *vertices = find_element(r, "vertex"), *faces = find_element(r, "face");
    result = result == REY_OK ? check_counts(r, vertices, faces) : result;
    if (result != REY_OK) {
        return result;
    }
    m->corners = find_property(r, faces, "vertex_indices", true);
    m->corners = m->corners ? m->corners : find_property(r, faces, "vertex_index", true);
    if (!m->corners || m->corners->type >= PLY_FLOAT32) {
        return rey_ply_fail(r, "element face has no indices, expected the integer list vertex_indices or vertex_index");
    }
    m->mesh->vertex_count = vertices->count;
    m->per_record->face_count = faces->count;
    result = route_vertices(r, m->mesh, vertices);
    result = result == REY_OK ? route_attributes(r, m->per_record, faces, true) : result;
    if (result != REY_OK) {
        return result;
    }
    if (!rey_array_push(r->ctx, &m->faces, 3 * sizeof(uint32_t), (size_t)faces->count)) {
        return REY_ERROR_MEMORY;
    }
    m->faces.count = 0; // that was to have room for triangles at once
    result = read_data(r, m);
    for (int64_t i = 0; result == REY_OK && flip_tex_coords && m->mesh->uvs && i < m->mesh->vertex_count; i++) {
        m->mesh->uvs[2 * i + 1] = 1 - m->mesh->uvs[2 * i + 1];
    }
    return result == REY_OK ? finish_faces(r, m) : result;
}

rey_result rey_mesh_read_ply_memory(rey_context *ctx, const char *name, const void *bytes, size_t size,
                                    bool flip_tex_coords, rey_mesh *out) {
    *out = (rey_mesh){0};
    PlyReader *r = rey_alloc(ctx, sizeof *r);
    if (!r) {
        return REY_ERROR_MEMORY;
    }
    const char *start = size ? bytes : "";
    r->ctx = ctx;
    r->path = name;
    r->start = r->at = start;
    r->end = start + size;
    rey_mesh per_record = {0};
    PlyMesh m = {.mesh = out, .per_record = &per_record};
    rey_result result = read_mesh(r, &m, flip_tex_coords);
    rey_array_free(ctx, &m.faces);
    rey_array_free(ctx, &m.owners);
    rey_mesh_free(ctx, &per_record);
    rey_free(ctx, r);
    if (result != REY_OK) {
        rey_mesh_free(ctx, out);
    }
    return result;
}

rey_result rey_mesh_read_ply(rey_context *ctx, const char *path, bool flip_tex_coords, rey_mesh *out) {
    *out = (rey_mesh){0};
    unsigned char *bytes;
    size_t size;
    rey_result result = rey_file_read(ctx, path, &bytes, &size);
    if (result == REY_OK) {
        result = rey_mesh_read_ply_memory(ctx, path, bytes, size, flip_tex_coords, out);
        rey_free(ctx, bytes);
    }
    return result;
}
