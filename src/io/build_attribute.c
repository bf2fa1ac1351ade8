// build_attribute.c: attributes of meshes, the textures that read them, and the table that brings them together.
#include "io/build_attribute.h"

#include "io/lenient.h"
#include "shape/shape.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

// Colours that files give as bytes are numbers up to 255 here, as in other programs of the format.
static rey_result note_byte_colours(Builder *b, const rey_mesh_attribute *attribute, const char *path, int64_t count) {
    float largest = 0;
    bool whole = attribute->channels == 3 && strstr(attribute->name, "color") != NULL;
    for (int64_t i = 0; i < count && whole; i++) {
        whole = attribute->data[i] >= 0 && attribute->data[i] == floorf(attribute->data[i]);
        largest = fmaxf(largest, attribute->data[i]);
    }
    return whole && largest > 1
               ? rey_scene_add_note(b->scene, "the attribute %s of %s has whole numbers up to %g; colours go from 0 to 1",
                                    attribute->name, path, (double)largest)
               : REY_OK;
}

rey_result build_mesh_attribute(Builder *b, const rey_mesh_attribute *attribute, int32_t id, const char *path,
                                int64_t vertices, int64_t faces) {
    rey_scene *scene = b->scene;
    int64_t items = attribute->per_face ? faces : vertices, count = items * attribute->channels;
    int32_t theta = rey_scene_append(scene, &scene->build.theta, sizeof(float), count);
    MeshAttribute *a = rey_array_push(b->ctx, &b->source->attributes, sizeof *a, 1);
    if (theta < 0 || !a) {
        return REY_ERROR_MEMORY;
    }
    memcpy(&ARRAY_AT(scene->build.theta, float, theta), attribute->data, (size_t)count * sizeof(float));
    Param p = {PARAM_DEFAULTS, .theta = theta, .count = (int32_t)count, .dims = 2,
               .shape = {(int32_t)items, attribute->channels}, .terms = REY_TERM_INTERIOR,
               .description = attribute->per_face ? "values per face" : "values per vertex"};
    char name[MAX_PATH_NAME];
    build_join(name, path, attribute->name);
    *a = (MeshAttribute){.shape = id, .theta = theta, .channels = attribute->channels, .per_face = attribute->per_face};
    memcpy(a->name, attribute->name, sizeof a->name);
    TRY(note_byte_colours(b, attribute, path, count));
    a->param = rey_scene_add_param(scene, name, p);
    return a->param < 0 ? REY_ERROR_MEMORY : REY_OK;
}

rey_result build_attribute_texture(Builder *b, rey_xml_node *node, int32_t texture) {
    const char *name;
    TRY(rey_xml_require(b->ctx, node, "name"));
    TRY(rey_xml_get_string(b->ctx, node, "name", "", &name));
    bool per_face = strncmp(name, "face_", 5) == 0;
    AttributeUse *use = rey_array_push(b->ctx, &b->attribute_uses, sizeof *use, 1);
    if (!use) {
        return REY_ERROR_MEMORY;
    }
    if ((!per_face && strncmp(name, "vertex_", 7) != 0) || strlen(name) >= sizeof use->name) {
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE,
                            "the attribute's name is '%s', expected vertex_NAME or face_NAME of at most %zu characters",
                            name, sizeof use->name - 1);
    }
    *use = (AttributeUse){.texture = texture, .node = node};
    memcpy(use->name, name, strlen(name));
    ARRAY_AT(b->scene->build.textures, TextureNode, texture).per_face = per_face;
    return REY_OK;
}

// Does a texture, or one inside it, read attributes, of this row of the table or (-1) any?
static bool reads_attributes(const Builder *b, int32_t texture, int32_t row) {
    const TextureNode *t = texture < 0 ? NULL : &ARRAY_AT(b->scene->build.textures, TextureNode, texture);
    if (t && t->kind == TEXTURE_CHECKERBOARD) {
        return reads_attributes(b, t->child[0], row) || reads_attributes(b, t->child[1], row);
    }
    return t && t->kind == TEXTURE_ATTRIBUTE && (row < 0 || t->attribute == row);
}

static bool bsdf_reads(const Builder *b, int32_t id, int32_t row) {
    const BsdfNode *node = id < 0 ? NULL : &ARRAY_AT(b->scene->build.bsdfs, BsdfNode, id);
    bool reads = false;
    for (int k = 0; k < MAX_SLOTS && node; k++) {
        reads = reads || reads_attributes(b, node->slot[k], row);
    }
    for (int k = 0; k < MAX_CHILDREN && node; k++) {
        reads = reads || bsdf_reads(b, node->child[k], row);
    }
    return reads;
}

static void mark_emitters(Builder *b) {
    for (size_t i = 0; i < b->scene->build.emitters.count; i++) {
        EmitterRecord *e = &ARRAY_AT(b->scene->build.emitters, EmitterRecord, i);
        if (e->shape >= 0) {
            const ShapeRecord *shape = &ARRAY_AT(b->scene->build.shapes, ShapeRecord, e->shape);
            e->attributes = build_is_volume(b, e->slot[0]) || (shape->kind == SHAPE_MESH && reads_attributes(b, e->slot[0], -1));
        }
    }
}

// PREFIX_r PREFIX_g PREFIX_b is PREFIX here and in old releases of Mitsuba, PREFIX_color in new ones.
static bool names_attribute(const char *wanted, const MeshAttribute *a) {
    size_t length = strlen(a->name);
    return strncmp(wanted, a->name, length) == 0 &&
           (!wanted[length] || (a->channels == 3 && strcmp(wanted + length, "_color") == 0));
}

// One row of the table: two numbers per shape.
static rey_result fill_row(Builder *b, const AttributeUse *use, int32_t *first) {
    rey_scene *scene = b->scene;
    int64_t shapes = (int64_t)scene->build.shapes.count;
    *first = rey_scene_append(scene, &scene->build.attributes, sizeof(int32_t), 2 * shapes);
    if (*first < 0) {
        return REY_ERROR_MEMORY;
    }
    int32_t *row = shapes ? &ARRAY_AT(scene->build.attributes, int32_t, *first) : NULL;
    for (int64_t i = 0; i < shapes; i++) {
        row[2 * i] = -1;
        row[2 * i + 1] = 1;
    }
    for (size_t i = 0; i < b->source->attributes.count; i++) {
        const MeshAttribute *a = &ARRAY_AT(b->source->attributes, MeshAttribute, i);
        if (names_attribute(use->name, a) && row[2 * a->shape] < 0) {
            row[2 * a->shape] = a->theta;
            row[2 * a->shape + 1] = a->channels;
            ARRAY_AT(scene->params, Param, a->param).attribute = *first + 2 * a->shape;
        }
    }
    return REY_OK;
}

// The attributes of a shape, one by one.
typedef struct ShapeAttributes {
    const Builder *b;
    int32_t shape;
} ShapeAttributes;
static const char *attribute_at(void *user, int i) {
    const ShapeAttributes *of = user;
    const Array *all = &of->b->source->attributes;
    for (size_t k = 0; k < all->count; k++) {
        if (ARRAY_AT(*all, MeshAttribute, k).shape == of->shape && i-- == 0) {
            return ARRAY_AT(*all, MeshAttribute, k).name;
        }
    }
    return NULL;
}

// "the ply 'quilt'", or by the line where one without an id stands.
static void name_shape(const Builder *b, int32_t shape, char text[128]) {
    snprintf(text, 128, "a shape");
    for (size_t i = 0; i < b->source->shapes.count; i++) {
        const ShapeSource *source = &ARRAY_AT(b->source->shapes, ShapeSource, i);
        if (source->shape == shape && source->node->id) {
            snprintf(text, 128, "the %.30s '%.80s'", source->node->type, source->node->id);
        } else if (source->shape == shape) {
            snprintf(text, 128, "the %.30s in line %d", source->node->type, source->node->at.line);
        }
    }
}

// A name that a shape does not have is misspelled, or the texture is used for one shape too many: it would read 0 there.
static rey_result check_use(Builder *b, const AttributeUse *use, int32_t row, int32_t shape) {
    const ShapeRecord *s = &ARRAY_AT(b->scene->build.shapes, ShapeRecord, shape);
    const EmitterRecord *e = s->emitter < 0 ? NULL : &ARRAY_AT(b->scene->build.emitters, EmitterRecord, s->emitter);
    bool has = ARRAY_AT(b->scene->build.attributes, int32_t, row + 2 * shape) >= 0;
    if (has || !(bsdf_reads(b, s->bsdf, row) || (e && reads_attributes(b, e->slot[0], row)))) {
        return REY_OK;
    }
    ShapeAttributes of = {b, shape};
    char name[128], list[512] = "";
    name_shape(b, shape, name);
    for (int i = 0; attribute_at(&of, i); i++) {
        size_t used = strlen(list);
        snprintf(list + used, sizeof list - used, "%s%s", i ? ", " : "; it has ", attribute_at(&of, i));
    }
    return rey_xml_fail_value(b->ctx, use->node, "name", "%s has no attribute '%s'%s", name, use->name,
                              list[0]                 ? list
                              : s->kind == SHAPE_MESH ? ": its file has none"
                                                      : ": meshes of files have them");
}

static rey_result check_uses(Builder *b) {
    for (size_t i = 0; i < b->attribute_uses.count; i++) {
        const AttributeUse *use = &ARRAY_AT(b->attribute_uses, AttributeUse, i);
        int32_t row = ARRAY_AT(b->scene->build.textures, TextureNode, use->texture).attribute;
        bool first = true; // of the textures that read it
        for (size_t k = 0; k < i; k++) {
            const AttributeUse *other = &ARRAY_AT(b->attribute_uses, AttributeUse, k);
            first = first && ARRAY_AT(b->scene->build.textures, TextureNode, other->texture).attribute != row;
        }
        for (size_t k = 0; k < b->scene->build.shapes.count && first; k++) {
            TRY(build_overlook(b, ": it is 0 there", check_use(b, use, row, (int32_t)k)));
        }
    }
    return REY_OK;
}

rey_result build_attribute_tables(Builder *b) {
    for (size_t i = 0; i < b->attribute_uses.count; i++) {
        const AttributeUse *use = &ARRAY_AT(b->attribute_uses, AttributeUse, i);
        int32_t row = -1;
        for (size_t k = 0; k < i && row < 0; k++) {
            const AttributeUse *other = &ARRAY_AT(b->attribute_uses, AttributeUse, k);
            if (strcmp(other->name, use->name) == 0) {
                row = ARRAY_AT(b->scene->build.textures, TextureNode, other->texture).attribute;
            }
        }
        if (row < 0) {
            TRY(fill_row(b, use, &row));
        }
        ARRAY_AT(b->scene->build.textures, TextureNode, use->texture).attribute = row;
    }
    mark_emitters(b);
    return check_uses(b);
}
