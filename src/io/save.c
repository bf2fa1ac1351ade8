// save.c: writes a scene back: the source document with the current values of all parameters. Pictures become EXR files
// and meshes PLY files in a folder beside the XML, so that the result stands alone.
#include "emitter/table.h"
#include "io/build.h"
#include "io/curve.h"
#include "io/file.h"
#include "io/image.h"
#include "io/mesh.h"
#include "io/save.h"
#include "io/vol.h"
#include "shape/sdfgrid.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

typedef struct Writer {
    rey_context *ctx;
    const rey_scene *scene;
    const SceneSource *source;
    Array text;
    const char *folder;      // of the data files, as opened
    const char *folder_name; // the same, as the XML names it
    int files;               // running number of data files
    bool failed;             // out of memory while writing text
} Writer;

static void put(Writer *w, const char *text, size_t bytes) {
    char *at = rey_array_push(w->ctx, &w->text, 1, bytes);
    if (at) {
        memcpy(at, text, bytes);
    } else {
        w->failed = true;
    }
}

static void line(Writer *w, int depth, const char *format, ...) PRINTF_LIKE(3, 4);
static void line(Writer *w, int depth, const char *format, ...) {
    char text[4096];
    va_list arguments;
    va_start(arguments, format);
    int n = vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    for (int i = 0; i < depth; i++) {
        put(w, "    ", 4);
    }
    put(w, text, n < (int)sizeof text ? (size_t)n : sizeof text - 1);
    put(w, "\n", 1);
}

// Escapes what XML and `$` substitution would read.
static const char *escaped(const char *text, char out[1024]) {
    size_t n = 0;
    for (; *text && n < 1024 - 8; text++) {
        const char *word = *text == '&' ? "&amp;" : *text == '<' ? "&lt;" : *text == '"' ? "&quot;" : *text == '$' ? "\\$" : NULL;
        if (word) {
            n += (size_t)snprintf(out + n, 1024 - n, "%s", word);
        } else {
            out[n++] = *text;
        }
    }
    out[n] = 0;
    return out;
}

static void write_matrix(Writer *w, int depth, const char *name, const float m[16]) {
    char text[512];
    size_t n = 0;
    for (int i = 0; i < 16; i++) {
        n += (size_t)snprintf(text + n, sizeof text - n, "%s%.9g", i ? " " : "", (double)m[i]);
    }
    line(w, depth, "<transform name=\"%s\"><matrix value=\"%s\"/></transform>", name, text);
}

static const float *theta(const Writer *w, int32_t at) {
    return w->scene->view.theta + at;
}

// Texture that a property of a node became, -1 = none. property null: the object itself.
static int32_t find_texture(const Writer *w, const rey_xml_node *node, const char *property) {
    for (size_t i = 0; i < w->source->textures.count; i++) {
        TextureSource s = ARRAY_AT(w->source->textures, TextureSource, i);
        bool same = s.property && property ? strcmp(s.property, property) == 0 : s.property == property;
        if (s.node == node && same) {
            return s.texture;
        }
    }
    return -1;
}

static void write_value(Writer *w, int depth, const char *name, int32_t texture) {
    const TextureNode *t = w->scene->view.textures + texture;
    const float *v = theta(w, t->theta);
    if (t->channels == 1) {
        line(w, depth, "<float name=\"%s\" value=\"%.9g\"/>", name, (double)v[0]);
    } else {
        line(w, depth, "<rgb name=\"%s\" value=\"%.9g %.9g %.9g\"/>", name, (double)v[0], (double)v[1], (double)v[2]);
    }
}

// All constants that a node's properties, written or defaults, became.
static void write_constants(Writer *w, int depth, const rey_xml_node *node) {
    for (size_t i = 0; i < w->source->textures.count; i++) {
        TextureSource s = ARRAY_AT(w->source->textures, TextureSource, i);
        if (s.node == node && s.property && strcmp(s.property, "bsdf") != 0) {
            write_value(w, depth, s.property, s.texture);
            if (strcmp(s.property, "int_ior") == 0) {
                line(w, depth, "<float name=\"ext_ior\" value=\"1\"/>");
            }
        }
    }
}

// Properties that constants, poses or data files stand for now.
static bool is_replaced(const Writer *w, const rey_xml_node *node, const char *name) {
    static const char *const anywhere[] = {"to_world", "material", "ext_ior", "filename", "raw", "to_uv", "position", "direction",
                                           "center", "radius", "p0", "p1", "shape_index", "flip_tex_coords", "face_normals", "fov", "fov_axis",
                                           "focal_length", "principal_point_offset_x", "principal_point_offset_y",
                                           "alpha", "alpha_u", "alpha_v", "aperture_radius", "focus_distance", "origin"};
    for (int i = 0; i < COUNT_OF(anywhere); i++) {
        if (strcmp(anywhere[i], name) == 0 && (node->tag != REY_XML_RFILTER)) {
            return true;
        }
    }
    return find_texture(w, node, name) >= 0;
}

static void write_property(Writer *w, int depth, const rey_xml_property *p) {
    char text[1024];
    float m[16];
    switch (p->kind) {
    case REY_XML_BOOLEAN_VALUE:
        line(w, depth, "<boolean name=\"%s\" value=\"%s\"/>", p->name, p->boolean ? "true" : "false");
        break;
    case REY_XML_INTEGER_VALUE:
        line(w, depth, "<integer name=\"%s\" value=\"%lld\"/>", p->name, (long long)p->integer);
        break;
    case REY_XML_FLOAT_VALUE:
        line(w, depth, "<float name=\"%s\" value=\"%.17g\"/>", p->name, p->number);
        break;
    case REY_XML_STRING_VALUE:
        line(w, depth, "<string name=\"%s\" value=\"%s\"/>", p->name, escaped(p->string, text));
        break;
    case REY_XML_VECTOR_VALUE:
        line(w, depth, "<vector name=\"%s\" value=\"%.17g %.17g %.17g\"/>", p->name, p->vector[0], p->vector[1], p->vector[2]);
        break;
    case REY_XML_RGB_VALUE:
        line(w, depth, "<rgb name=\"%s\" value=\"%.17g %.17g %.17g\"/>", p->name, p->vector[0], p->vector[1], p->vector[2]);
        break;
    case REY_XML_TRANSFORM_VALUE:
        for (int i = 0; i < 16; i++) {
            m[i] = (float)p->matrix[i];
        }
        write_matrix(w, depth, p->name, m);
        break;
    default:
        break; // spectra become constants
    }
}

// ---- data files --------------------------------------------------------------------------------------------------

static void data_path(Writer *w, const char *kind, const char *ending, char path[4096], char name[1024]) {
    int number = w->files++;
    snprintf(path, 4096, "%s/%s_%d%s", w->folder, kind, number, ending);
    snprintf(name, 1024, "%s/%s_%d%s", w->folder_name, kind, number, ending);
}

static rey_result write_picture(Writer *w, int depth, int32_t texture, const char *kind) {
    const TextureNode *t = w->scene->view.textures + texture;
    char path[4096], name[1024], text[1024];
    data_path(w, kind, ".exr", path, name);
    line(w, depth, "<string name=\"filename\" value=\"%s\"/>", escaped(name, text));
    return rey_exr_write(w->ctx, path, theta(w, t->theta), t->width, t->height, t->channels, NULL);
}

// The attributes of a shape's mesh; their values stay where they are.
static rey_result write_attributes(Writer *w, int32_t shape, rey_mesh *mesh) {
    const Array *all = &w->source->attributes;
    mesh->attributes = rey_alloc_array(w->ctx, all->count + 1, sizeof *mesh->attributes);
    if (!mesh->attributes) {
        return REY_ERROR_MEMORY;
    }
    for (size_t i = 0; i < all->count; i++) {
        const MeshAttribute *a = &ARRAY_AT(*all, MeshAttribute, i);
        if (a->shape == shape) {
            rey_mesh_attribute *to = &mesh->attributes[mesh->attribute_count++];
            *to = (rey_mesh_attribute){.per_face = a->per_face, .channels = a->channels,
                                       .data = w->scene->view.theta + a->theta};
            memcpy(to->name, a->name, sizeof to->name);
        }
    }
    return REY_OK;
}

// A mesh's own vertices, which are in the world already. Flat shading is said in the XML.
static rey_result write_mesh(Writer *w, int depth, const ShapeRecord *shape) {
    const SceneView *view = &w->scene->view;
    char path[4096], name[1024], text[1024];
    data_path(w, "mesh", ".ply", path, name);
    line(w, depth, "<string name=\"filename\" value=\"%s\"/>", escaped(name, text));
    if (!(shape->flags & SHAPE_HAS_NORMALS)) {
        line(w, depth, "<boolean name=\"face_normals\" value=\"true\"/>");
    }
    rey_mesh mesh = {.vertex_count = shape->vertex_count, .face_count = shape->triangle_count};
    mesh.positions = view->theta + shape->positions;
    mesh.normals = shape->normals >= 0 ? view->theta + shape->normals : NULL;
    mesh.uvs = shape->uvs >= 0 ? view->theta + shape->uvs : NULL;
    mesh.faces = (uint32_t *)view->triangles + 3 * (size_t)shape->triangle;
    rey_result result = write_attributes(w, (int32_t)(shape - view->shapes), &mesh);
    if (result == REY_OK) {
        result = rey_mesh_write_ply(w->ctx, path, &mesh);
    }
    rey_free(w->ctx, mesh.attributes);
    return result;
}

static rey_result write_curves(Writer *w, int depth, const rey_xml_node *node, const ShapeRecord *shape) {
    char path[4096], name[1024], text[1024];
    data_path(w, "curves", ".txt", path, name);
    line(w, depth, "<string name=\"filename\" value=\"%s\"/>", escaped(name, text));
    return rey_curves_write(w->ctx, path, theta(w, shape->positions), w->scene->view.segments + shape->segment,
                            shape->segment_count, build_curve_order(node->type));
}

static rey_result write_grid(Writer *w, int depth, const ShapeRecord *shape) {
    const float *nodes = w->scene->view.tables + shape->table + SDFGRID_NODES;
    char path[4096], name[1024], text[1024];
    data_path(w, "grid", ".vol", path, name);
    line(w, depth, "<string name=\"filename\" value=\"%s\"/>", escaped(name, text));
    rey_vol vol = {(int32_t)nodes[0], (int32_t)nodes[1], (int32_t)nodes[2], 1, {0, 0, 0, 1, 1, 1},
                   w->scene->view.theta + shape->positions};
    return rey_vol_write(w->ctx, path, &vol);
}

// ---- nodes -------------------------------------------------------------------------------------------------------

static const ShapeRecord *find_shape(const Writer *w, const rey_xml_node *node) {
    for (size_t i = 0; i < w->source->shapes.count; i++) {
        ShapeSource s = ARRAY_AT(w->source->shapes, ShapeSource, i);
        if (s.node == node) {
            return w->scene->view.shapes + s.shape;
        }
    }
    return NULL;
}

static bool is_file_mesh(const rey_xml_node *node) {
    return strcmp(node->type, "obj") == 0 || strcmp(node->type, "ply") == 0 || strcmp(node->type, "serialized") == 0;
}

static rey_result write_shape_parts(Writer *w, int depth, const rey_xml_node *node, const ShapeRecord *shape) {
    int32_t base = find_texture(w, node, "bsdf");
    if (base >= 0) { // the default function, which the file did not name
        line(w, depth, "<bsdf type=\"diffuse\">");
        write_value(w, depth + 1, "reflectance", base);
        line(w, depth, "</bsdf>");
    }
    if (shape->segment_count > 0) {
        return write_curves(w, depth, node, shape);
    }
    if (is_file_mesh(node)) {
        return write_mesh(w, depth, shape);
    }
    write_matrix(w, depth, "to_world", theta(w, shape->to_world));
    return strcmp(node->type, "sdfgrid") == 0 ? write_grid(w, depth, shape) : REY_OK;
}

static void write_sensor_parts(Writer *w, int depth, int32_t built) {
    const SceneView *view = &w->scene->view;
    const SensorRecord *s = built >= 0 ? view->sensors + built : view->batch_sensors + (SENSOR_OF_BATCH - built);
    if (s->to_world >= 0) {
        write_matrix(w, depth, "to_world", theta(w, s->to_world));
    }
    if (s->fov >= 0) {
        const float *principal = theta(w, s->principal);
        line(w, depth, "<float name=\"fov\" value=\"%.9g\"/>", (double)*theta(w, s->fov));
        line(w, depth, "<float name=\"principal_point_offset_x\" value=\"%.9g\"/>", (double)principal[0]);
        line(w, depth, "<float name=\"principal_point_offset_y\" value=\"%.9g\"/>", (double)principal[1]);
    }
    if (s->lens >= 0) {
        line(w, depth, "<float name=\"aperture_radius\" value=\"%.9g\"/>", (double)*theta(w, s->lens));
        line(w, depth, "<float name=\"focus_distance\" value=\"%.9g\"/>", (double)*theta(w, s->lens + 1));
    }
}

static rey_result write_emitter_parts(Writer *w, int depth, const rey_xml_node *node) {
    const EmitterKind *kind = rey_emitter_kinds + rey_emitter_kind_find(node->type);
    if (kind->form == EMITTER_IS_SURFACE) {
        return REY_OK;
    }
    const EmitterRecord *e = w->scene->view.emitters + node->built;
    for (int i = 0; i < kind->param_count; i++) {
        const EmitterParam *row = kind->params + i;
        const float *v = row->type >= EMITTER_PARAM_POSITION ? theta(w, e->slot[i]) : NULL;
        if (row->type == EMITTER_PARAM_IMAGE) {
            TRY(write_picture(w, depth, e->slot[i], "environment"));
        } else if (row->type == EMITTER_PARAM_FOV) {
            line(w, depth, "<float name=\"fov\" value=\"%.9g\"/>",
                 (double)*theta(w, w->scene->view.textures[e->slot[i]].theta));
        } else if (row->type == EMITTER_PARAM_POSITION) {
            line(w, depth, "<point name=\"%s\" value=\"%.9g %.9g %.9g\"/>", row->name, (double)v[0], (double)v[1],
                 (double)v[2]);
        } else if (v) {
            write_matrix(w, depth, "to_world", v);
        }
    }
    return REY_OK;
}

static rey_result write_texture_parts(Writer *w, int depth, const rey_xml_node *node) {
    const TextureNode *t = node->built >= 0 ? w->scene->view.textures + node->built : NULL;
    if (t && t->to_uv >= 0) {
        const float *m = theta(w, t->to_uv); // as 4 x 4: readers drop the translation of a matrix of nine numbers
        const float pose[16] = {m[0], m[1], 0, m[2], m[3], m[4], 0, m[5], 0, 0, 1, 0, 0, 0, 0, 1};
        write_matrix(w, depth, "to_uv", pose);
    }
    if (t && t->kind == TEXTURE_BITMAP) {
        line(w, depth, "<boolean name=\"raw\" value=\"true\"/>");
        return write_picture(w, depth, node->built, "texture");
    }
    return REY_OK;
}

static rey_result write_node(Writer *w, int depth, const rey_xml_node *node, const char *slot);

static rey_result write_children(Writer *w, int depth, const rey_xml_node *node) {
    for (int i = 0; i < node->child_count; i++) {
        const rey_xml_child *c = &node->children[i];
        if (c->ref) {
            char name[128] = "";
            if (c->name) {
                snprintf(name, sizeof name, " name=\"%s\"", c->name);
            }
            line(w, depth, "<ref id=\"%s\"%s/>", c->node->id ? c->node->id : c->ref, name);
        } else {
            TRY(write_node(w, depth, c->node, c->name));
        }
    }
    return REY_OK;
}

static rey_result write_node(Writer *w, int depth, const rey_xml_node *node, const char *slot) {
    const char *tag = rey_xml_tag_name(node->tag);
    const char *type = node->tag == REY_XML_SHAPE && is_file_mesh(node) ? "ply" : node->type;
    // Constants that were written as objects have become values; only their type and parameters matter.
    bool constant = (node->tag == REY_XML_TEXTURE || node->tag == REY_XML_SPECTRUM) && node->built >= 0 &&
                    w->scene->view.textures[node->built].kind == TEXTURE_CONSTANT;
    char id[300] = "", name[300] = "";
    if (node->id) {
        snprintf(id, sizeof id, " id=\"%s\"", node->id);
    }
    if (slot) {
        snprintf(name, sizeof name, " name=\"%s\"", slot);
    }
    if (constant) {
        const TextureNode *t = w->scene->view.textures + node->built;
        const float *v = theta(w, t->theta);
        line(w, depth, "<texture type=\"rawconstant\"%s%s>", id, name);
        if (t->channels == 1) {
            line(w, depth + 1, "<float name=\"value\" value=\"%.9g\"/>", (double)v[0]);
        } else {
            line(w, depth + 1, "<vector name=\"value\" value=\"%.9g %.9g %.9g\"/>", (double)v[0], (double)v[1], (double)v[2]);
        }
        line(w, depth, "</texture>");
        return REY_OK;
    }
    line(w, depth, "<%s type=\"%s\"%s%s>", tag, type, id, name);
    for (int i = 0; i < node->property_count; i++) {
        if (!is_replaced(w, node, node->properties[i].name)) {
            write_property(w, depth + 1, &node->properties[i]);
        }
    }
    write_constants(w, depth + 1, node);
    const ShapeRecord *shape = node->tag == REY_XML_SHAPE ? find_shape(w, node) : NULL;
    if (shape) {
        TRY(write_shape_parts(w, depth + 1, node, shape));
    } else if (node->tag == REY_XML_SHAPE && strcmp(node->type, "instance") == 0) {
        write_matrix(w, depth + 1, "to_world", theta(w, w->scene->view.instances[node->built].to_world));
    } else if (node->tag == REY_XML_SENSOR) {
        write_sensor_parts(w, depth + 1, node->built);
    } else if (node->tag == REY_XML_EMITTER) {
        TRY(write_emitter_parts(w, depth + 1, node));
    } else if (node->tag == REY_XML_TEXTURE) {
        TRY(write_texture_parts(w, depth + 1, node));
    }
    TRY(write_children(w, depth + 1, node));
    line(w, depth, "</%s>", tag);
    return REY_OK;
}

rey_result rey_mitsuba_save(const rey_scene *scene, const char *path) {
    char folder[3800], stem[1000];
    const char *slash = strrchr(path, '/'), *file = slash ? slash + 1 : path;
    const char *dot = strrchr(file, '.');
    snprintf(stem, sizeof stem, "%.*s_data", (int)(dot ? dot - file : (long)strlen(file)), file);
    snprintf(folder, sizeof folder, "%.*s%s", (int)(file - path), path, stem);
    Writer w = {.ctx = scene->ctx, .scene = scene, .source = scene->document, .folder = folder, .folder_name = stem};
    if (mkdir(folder, 0777) != 0 && errno != EEXIST) {
        return rey_fail(w.ctx, REY_ERROR_IO, "%s: the folder could not be made: %s", folder, strerror(errno));
    }
    line(&w, 0, "<scene version=\"3.0.0\">");
    rey_result result = write_children(&w, 1, rey_xml_root(w.source->document));
    line(&w, 0, "</scene>");
    if (result == REY_OK) {
        result = w.failed ? REY_ERROR_MEMORY : rey_file_write(w.ctx, path, w.text.data, w.text.count);
    }
    rey_array_free(w.ctx, &w.text);
    return result;
}
