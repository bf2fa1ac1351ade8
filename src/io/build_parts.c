// build_parts.c: an OBJ with several scattering functions, as versions 0.x of the format had it: each is named after a
// material of the file (`usemtl`), one without a name serves all others. Each part becomes a shape of its own, with
// the name of its material in its parameters. A file with one function or none has it everywhere, as in version 3.
#include "io/build_parts.h"

#include "io/obj_materials.h"

#include <stdio.h>
#include <string.h>

typedef struct Parts {
    const Array *runs; // ObjRun
    rey_mesh whole;
    int32_t *of_face;  // per triangle: number of its function among the children
    int32_t *vertices; // per vertex of the whole: that of the part, -1 = not in it
} Parts;

bool build_has_parts(const rey_xml_node *node) {
    return strcmp(node->type, "obj") == 0 && rey_xml_count_children(node, REY_XML_BIT(REY_XML_BSDF)) > 1;
}

static const char *run_name(void *user, int i) {
    const Array *runs = user;
    return (size_t)i < runs->count ? ARRAY_AT(*runs, ObjRun, i).material : NULL;
}

// The function of a material; -1 when there is none.
static int32_t find_bsdf(const rey_xml_node *node, const char *material) {
    int32_t rest = -1;
    int count = rey_xml_count_children(node, REY_XML_BIT(REY_XML_BSDF));
    for (int k = 0; k < count; k++) {
        const rey_xml_child *child = rey_xml_child_of(node, REY_XML_BIT(REY_XML_BSDF), k);
        if (child->name && strcmp(child->name, material) == 0) {
            return k;
        }
        rest = child->name ? rest : k;
    }
    return rest;
}

static rey_result assign_faces(Builder *b, rey_xml_node *node, Parts *parts) {
    for (size_t i = 0; i < parts->runs->count; i++) {
        const ObjRun *run = &ARRAY_AT(*parts->runs, ObjRun, i);
        int64_t end = i + 1 < parts->runs->count ? run[1].triangle : parts->whole.face_count;
        int32_t bsdf = find_bsdf(node, run->material);
        if (end > parts->whole.face_count || run->triangle > end) {
            return rey_xml_fail(b->ctx, node->at, REY_ERROR_FORMAT, "the file changed while it was read");
        }
        if (bsdf < 0 && end > run->triangle) {
            return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE,
                                "no bsdf is named after the material '%.100s' of the file, and none has no name",
                                run->material);
        }
        for (int64_t f = run->triangle; f < end; f++) {
            parts->of_face[f] = bsdf;
        }
    }
    return REY_OK;
}

static void copy_items(float *to, const float *from, int64_t from_item, int64_t to_item, int width) {
    if (to) {
        memcpy(to + width * to_item, from + width * from_item, (size_t)width * sizeof *to);
    }
}

// The triangles of one function, with the vertices that they use.
static rey_result cut(rey_context *ctx, const Parts *parts, int32_t bsdf, rey_mesh *part) {
    const rey_mesh *whole = &parts->whole;
    memset(parts->vertices, 0xff, (size_t)whole->vertex_count * sizeof *parts->vertices);
    for (int64_t f = 0; f < whole->face_count; f++) {
        part->face_count += parts->of_face[f] == bsdf;
        for (int k = 0; k < 3 && parts->of_face[f] == bsdf; k++) {
            int32_t *vertex = &parts->vertices[whole->faces[3 * f + k]];
            *vertex = *vertex < 0 ? (int32_t)part->vertex_count++ : *vertex;
        }
    }
    size_t n = (size_t)part->vertex_count;
    part->faces = rey_alloc_array(ctx, (size_t)part->face_count, 3 * sizeof *part->faces);
    part->positions = rey_alloc_array(ctx, n, 3 * sizeof(float));
    part->normals = whole->normals ? rey_alloc_array(ctx, n, 3 * sizeof(float)) : NULL;
    part->uvs = whole->uvs ? rey_alloc_array(ctx, n, 2 * sizeof(float)) : NULL;
    if (!part->faces || !part->positions || (whole->normals && !part->normals) || (whole->uvs && !part->uvs)) {
        return REY_ERROR_MEMORY;
    }
    for (int64_t v = 0; v < whole->vertex_count; v++) {
        if (parts->vertices[v] >= 0) {
            copy_items(part->positions, whole->positions, v, parts->vertices[v], 3);
            copy_items(part->normals, whole->normals, v, parts->vertices[v], 3);
            copy_items(part->uvs, whole->uvs, v, parts->vertices[v], 2);
        }
    }
    uint32_t *face = part->faces;
    for (int64_t f = 0; f < whole->face_count; f++) {
        for (int k = 0; k < 3 && parts->of_face[f] == bsdf; k++) {
            *face++ = (uint32_t)parts->vertices[whole->faces[3 * f + k]];
        }
    }
    return rey_mesh_weld(ctx, part);
}

static rey_result build_part(Builder *b, rey_xml_node *node, const char *path, const rey_mesh *mesh,
                             rey_xml_child *bsdf, ShapeRecord shape) {
    char name[MAX_PATH_NAME];
    int32_t id = rey_scene_append(b->scene, &b->scene->build.shapes, sizeof shape, 1);
    TRY(id < 0 ? REY_ERROR_MEMORY : REY_OK);
    build_join(name, path, bsdf->name ? bsdf->name : "others");
    TRY(build_copy_mesh(b, mesh, id, name, &shape));
    TRY(build_surface(b, node, bsdf, id, name, &shape));
    ARRAY_AT(b->scene->build.shapes, ShapeRecord, id) = shape;
    node->built = id;
    return REY_OK;
}

static rey_result build_each(Builder *b, rey_xml_node *node, const char *path, const Parts *parts, ShapeRecord shape) {
    int count = rey_xml_count_children(node, REY_XML_BIT(REY_XML_BSDF));
    for (int k = 0; k < count; k++) {
        rey_mesh part = {0};
        rey_xml_child *bsdf = rey_xml_child_of(node, REY_XML_BIT(REY_XML_BSDF), k);
        rey_result result = cut(b->ctx, parts, k, &part);
        if (result == REY_OK && part.face_count == 0 && bsdf->name) {
            result = rey_xml_fail_word(b->ctx, bsdf->at, bsdf->name, run_name, (void *)(uintptr_t)parts->runs,
                                       "no face of the file has the material '%.100s'", bsdf->name);
        } else if (result == REY_OK && part.face_count > 0) {
            result = build_part(b, node, path, &part, bsdf, shape);
        }
        rey_mesh_free(b->ctx, &part);
        TRY(result);
    }
    return REY_OK;
}

rey_result build_parts(Builder *b, rey_xml_node *node, const char *path, ShapeRecord shape) {
    char *file = NULL;
    bool smooth; // the parts' normals stay those of the whole
    Array runs = {0};
    Parts parts = {.runs = &runs};
    if (rey_xml_count_children(node, REY_XML_BIT(REY_XML_SENSOR))) {
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_UNSUPPORTED, "a shape of several bsdfs cannot have a sensor");
    }
    rey_result result = build_load_mesh(b, node, &parts.whole, &smooth);
    if (result == REY_OK) {
        result = rey_xml_resolve_file(b->ctx, b->source->document, node, "filename", &file);
    }
    if (result == REY_OK) {
        result = rey_xml_named_file(b->ctx, node->at, rey_obj_materials(b->ctx, file, &runs));
    }
    if (result == REY_OK) {
        parts.of_face = rey_alloc_array(b->ctx, (size_t)parts.whole.face_count, sizeof *parts.of_face);
        parts.vertices = rey_alloc_array(b->ctx, (size_t)parts.whole.vertex_count, sizeof *parts.vertices);
        result = parts.of_face && parts.vertices ? assign_faces(b, node, &parts) : REY_ERROR_MEMORY;
    }
    if (result == REY_OK) {
        result = build_each(b, node, path, &parts, shape);
    }
    rey_free(b->ctx, file);
    rey_obj_materials_free(b->ctx, &runs);
    rey_free(b->ctx, parts.of_face);
    rey_free(b->ctx, parts.vertices);
    rey_mesh_free(b->ctx, &parts.whole);
    return result;
}
