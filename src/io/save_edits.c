// save_edits.c: parameters whose values changed since the scene was loaded, brought back to the properties they came
// from. Everything else is written as it was read.
#include "io/curve.h"
#include "io/image.h"
#include "io/mesh.h"
#include "io/save_parts.h"
#include "io/vol.h"
#include "shape/sdfgrid.h"
#include "shape/shape.h"
#include "shape/update.h"

#include <stdio.h>
#include <string.h>

static const Param *param_at(const Writer *w, int i) {
    return &ARRAY_AT(w->scene->params, Param, i);
}

static const float *theta(const Writer *w, int32_t at) {
    return w->scene->view.theta + at;
}

// ---- whose parameter it is ---------------------------------------------------------------------------------------

static const TextureSource *find_texture(const Writer *w, int32_t texture) {
    int32_t source = w->texture_sources[texture];
    return source >= 0 ? &ARRAY_AT(w->source->textures, TextureSource, source) : NULL;
}

static const ShapeRecord *find_shape(const Writer *w, const rey_xml_node *node) {
    return w->scene->view.shapes + node->built;
}

static NamedItems paths_of(const Writer *w) {
    return (NamedItems){&w->source->paths, sizeof(char *)};
}

// The node whose path and one more word are the parameter's name.
static const rey_xml_node *find_by_name(const Writer *w, const char *name) {
    const char *dot = strrchr(name, '.');
    char path[MAX_PATH_NAME];
    size_t length = dot ? (size_t)(dot - name) : 0;
    snprintf(path, sizeof path, "%.*s", (int)length, name);
    int32_t node = rey_names_find(&w->paths, paths_of(w), path);
    return node >= 0 ? rey_xml_node_at(w->source->document, node) : NULL;
}

// Tables for the two questions above.
static rey_result prepare_finding(Writer *w) {
    size_t textures = (size_t)w->scene->view.textures_count;
    w->texture_sources = rey_alloc_array(w->ctx, textures + 1, sizeof *w->texture_sources);
    TRY(w->texture_sources ? REY_OK : REY_ERROR_MEMORY);
    memset(w->texture_sources, 0xff, (textures + 1) * sizeof *w->texture_sources);
    for (size_t i = w->source->textures.count; i > 0; i--) { // the first counts
        w->texture_sources[ARRAY_AT(w->source->textures, TextureSource, i - 1).texture] = (int32_t)i - 1;
    }
    for (size_t i = 0; i < w->source->paths.count; i++) {
        if (ARRAY_AT(w->source->paths, char *, i)) {
            TRY(rey_names_add(w->ctx, &w->paths, paths_of(w), (int32_t)i));
        }
    }
    return REY_OK;
}

static bool is_texture_object(const Writer *w, const rey_xml_node *node) {
    return (REY_XML_BIT(node->tag) & REY_XML_TEXTURES) && node->built >= 0 &&
           w->scene->view.textures[node->built].kind == TEXTURE_CONSTANT;
}

static Edit find_edit(const Writer *w, int i) {
    const Param *p = param_at(w, i);
    const char *dot = strrchr(p->name, '.'), *leaf = dot ? dot + 1 : p->name;
    const TextureSource *s = p->texture >= 0  ? find_texture(w, p->texture)
                             : p->to_uv >= 0 ? find_texture(w, p->to_uv)
                                             : NULL;
    Edit edit = {.param = i, .next = -1};
    if (s) {
        int32_t kind = w->scene->view.textures[s->texture].kind;
        edit.node = s->node;
        edit.property = is_texture_object(w, s->node) ? NULL : s->property;
        edit.kind = p->texture < 0              ? EDIT_TO_UV
                    : kind == TEXTURE_CONSTANT ? EDIT_CONSTANT
                    : kind == TEXTURE_TABLE    ? EDIT_LIST
                                               : EDIT_TEXELS;
        return edit;
    }
    edit.node = find_by_name(w, p->name);
    edit.property = leaf;
    bool posed = strcmp(leaf, "to_world") == 0;
    edit.kind = edit.node && edit.node->tag == REY_XML_SHAPE && !posed ? EDIT_GEOMETRY : EDIT_LEAF;
    return edit;
}

static bool can_write_leaf(const Param *p) {
    return p->count == 1 || (p->dims == 1 && p->count == 3) || (p->dims == 2 && p->count == 16);
}

static rey_result add_edit(Writer *w, Edit edit) {
    Edit *slot = rey_array_push(w->ctx, &w->edits, sizeof edit, 1);
    if (!slot) {
        return REY_ERROR_MEMORY;
    }
    edit.next = w->first_edit[edit.node->index];
    *slot = edit;
    w->first_edit[edit.node->index] = (int32_t)w->edits.count - 1;
    return REY_OK;
}

// Volumes that stand in one place have it written in each of them.
static rey_result add_shared_places(Writer *w, const Edit *edit) {
    const Param *p = param_at(w, edit->param);
    for (int i = 0; i < rey_xml_node_count(w->source->document) && p->volume >= 0; i++) {
        const rey_xml_node *node = rey_xml_node_at(w->source->document, i);
        bool placed = node->tag == REY_XML_VOLUME && node->built >= 0 && node != edit->node;
        if (placed && w->scene->view.volumes[node->built].to_world == p->theta) {
            Edit shared = *edit;
            shared.node = node;
            TRY(add_edit(w, shared));
        }
    }
    return REY_OK;
}

rey_result rey_save_find_edits(Writer *w) {
    int nodes = rey_xml_node_count(w->source->document);
    w->first_edit = rey_alloc_array(w->ctx, (size_t)nodes + 1, sizeof *w->first_edit);
    if (!w->first_edit) {
        return REY_ERROR_MEMORY;
    }
    memset(w->first_edit, 0xff, ((size_t)nodes + 1) * sizeof *w->first_edit);
    TRY(prepare_finding(w));
    for (int i = (int)w->scene->params.count - 1; i >= 0; i--) { // each node's list comes out in the parameters' order
        if (param_at(w, i)->version == 0) {
            continue;
        }
        Edit edit = find_edit(w, i);
        if (!edit.node || (edit.kind == EDIT_LEAF && !can_write_leaf(param_at(w, i)))) {
            return rey_fail(w->ctx, REY_ERROR_UNSUPPORTED, "the changed values of '%s' cannot be written into a scene file",
                            param_at(w, i)->name);
        }
        TRY(add_edit(w, edit));
        TRY(add_shared_places(w, &edit));
    }
    return REY_OK;
}

const Edit *rey_save_first_edit(const Writer *w, const rey_xml_node *node) {
    int32_t first = w->first_edit[node->index];
    return first >= 0 ? &ARRAY_AT(w->edits, Edit, first) : NULL;
}

const Edit *rey_save_next_edit(const Writer *w, const Edit *edit) {
    return edit->next >= 0 ? &ARRAY_AT(w->edits, Edit, edit->next) : NULL;
}

bool rey_save_has_edit(const Writer *w, const rey_xml_node *node, EditKind kind) {
    for (const Edit *e = rey_save_first_edit(w, node); e; e = rey_save_next_edit(w, e)) {
        if (e->kind == kind) {
            return true;
        }
    }
    return false;
}

// ---- what an edit replaces ---------------------------------------------------------------------------------------

static bool is_one_of(const char *word, const char *const *list) {
    for (; *list; list++) {
        if (strcmp(word, *list) == 0) {
            return true;
        }
    }
    return false;
}

bool rey_save_is_curve_or_grid(const rey_xml_node *node) {
    return build_is_curve(node->type) || strcmp(node->type, "sdfgrid") == 0;
}

// Properties that say in other words what the leaf says.
static bool leaf_replaces(const char *leaf, const char *property) {
    static const char *const pose[] = {"to_world", "position", "direction", "origin",
                                       "center",   "radius",   "p0",        "p1",     "use_grid_bbox", NULL};
    static const char *const point[] = {"to_world", "position", "direction", NULL};
    static const char *const fov[] = {"fov", "fov_axis", "focal_length", NULL};
    return strcmp(leaf, "to_world") == 0                                    ? is_one_of(property, pose)
           : strcmp(leaf, "position") == 0 || strcmp(leaf, "direction") == 0 ? is_one_of(property, point)
           : strcmp(leaf, "x_fov") == 0                                     ? is_one_of(property, fov)
                                                                            : strcmp(leaf, property) == 0;
}

static bool constant_replaces(const char *constant, const char *property) {
    bool metal = strcmp(constant, "eta") == 0 || strcmp(constant, "k") == 0;
    return strcmp(constant, property) == 0 || (metal && strcmp(property, "material") == 0) ||
           (strcmp(constant, "int_ior") == 0 && strcmp(property, "ext_ior") == 0);
}

bool rey_save_replaces(const Writer *w, const rey_xml_node *node, const char *property) {
    static const char *const mesh[] = {"filename", "to_world", "shape_index", "flip_tex_coords", "face_normals", NULL};
    static const char *const curve[] = {"filename", "to_world", NULL}, *const grid[] = {"filename", NULL};
    static const char *const texels[] = {"filename", "raw", "format", NULL};
    static const char *const voxels[] = {"filename", "to_world", "use_grid_bbox", NULL};
    for (const Edit *e = rey_save_first_edit(w, node); e; e = rey_save_next_edit(w, e)) {
        bool same = false;
        switch (e->kind) {
        case EDIT_CONSTANT:
            same = e->property && constant_replaces(e->property, property);
            break;
        case EDIT_TO_UV:
            same = strcmp(property, "to_uv") == 0;
            break;
        case EDIT_TEXELS:
            same = is_one_of(property, node->tag == REY_XML_VOLUME ? voxels : texels);
            break;
        case EDIT_LIST:
            same = strcmp(property, e->property) == 0;
            break;
        case EDIT_GEOMETRY:
            same = is_one_of(property, build_is_curve(node->type) ? curve : rey_save_is_curve_or_grid(node) ? grid : mesh);
            break;
        case EDIT_LEAF:
            same = leaf_replaces(e->property, property);
            break;
        }
        if (same) {
            return true;
        }
    }
    return false;
}

// ---- values ------------------------------------------------------------------------------------------------------

void rey_save_constant(Writer *w, int depth, const char *name, int32_t texture) {
    const TextureNode *t = w->scene->view.textures + texture;
    const float *v = theta(w, t->theta);
    if (t->channels == 1) {
        rey_save_line(w, depth, "<float name=\"%s\" value=\"%.9g\"/>", name, (double)v[0]);
    } else {
        rey_save_line(w, depth, "<rgb name=\"%s\" value=\"%.9g %.9g %.9g\"/>", name, (double)v[0], (double)v[1],
                      (double)v[2]);
    }
}

// A constant; colours in place of a volume end at 1, those of a constvolume do not.
static void write_value(Writer *w, int depth, const rey_xml_node *node, const char *name, int32_t texture) {
    const TextureNode *t = w->scene->view.textures + texture;
    const float *v = theta(w, t->theta);
    if (node->tag != REY_XML_MEDIUM || t->channels != 3 || !(v[0] > 1 || v[1] > 1 || v[2] > 1)) {
        rey_save_constant(w, depth, name, texture);
        return;
    }
    rey_save_line(w, depth, "<volume type=\"constvolume\" name=\"%s\">", name);
    rey_save_constant(w, depth + 1, "value", texture);
    rey_save_line(w, depth, "</volume>");
}

// What goes with a property: the other half of a metal's index, and what a spot has by default as a share of its cone.
static const char *other_half(const Edit *e) {
    if (strcmp(e->node->type, "spot") == 0) {
        return strcmp(e->property, "cutoff_angle") == 0 ? "beam_width" : NULL;
    }
    bool metal = strstr(e->node->type, "conductor") != NULL;
    return metal && strcmp(e->property, "eta") == 0 ? "k" : metal && strcmp(e->property, "k") == 0 ? "eta" : NULL;
}

// The other half, when other words stood for both, or none for that.
static void write_other_half(Writer *w, int depth, const Edit *e) {
    const char *other = other_half(e);
    if (!other || rey_xml_has(e->node, other)) {
        return;
    }
    for (size_t i = 0; i < w->source->textures.count; i++) {
        const TextureSource *s = &ARRAY_AT(w->source->textures, TextureSource, i);
        if (s->node == e->node && s->property && strcmp(s->property, other) == 0) {
            for (const Edit *f = rey_save_first_edit(w, e->node); f; f = rey_save_next_edit(w, f)) {
                if (f->kind == EDIT_CONSTANT && strcmp(f->property, other) == 0) {
                    return;
                }
            }
            write_value(w, depth, e->node, other, s->texture);
        }
    }
}

static void write_constant(Writer *w, int depth, const Edit *e) {
    int32_t texture = param_at(w, e->param)->texture;
    if (strcmp(e->property, "bsdf") == 0) { // the default function, which the file did not name
        rey_save_line(w, depth, "<bsdf type=\"diffuse\">");
        rey_save_constant(w, depth + 1, "reflectance", texture);
        rey_save_line(w, depth, "</bsdf>");
        return;
    }
    write_value(w, depth, e->node, e->property, texture);
    if (strcmp(e->property, "int_ior") == 0) {
        rey_save_line(w, depth, "<float name=\"ext_ior\" value=\"1\"/>");
    }
    write_other_half(w, depth, e);
}

static void write_leaf(Writer *w, int depth, const Edit *e) {
    const Param *p = param_at(w, e->param);
    const float *v = theta(w, p->theta);
    const char *name = strcmp(e->property, "x_fov") == 0 ? "fov" : e->property;
    if (p->count == 1) {
        rey_save_line(w, depth, "<float name=\"%s\" value=\"%.9g\"/>", name, (double)v[0]);
    } else if (p->count == 16) {
        rey_save_matrix(w, depth, name, v);
    } else {
        rey_save_line(w, depth, "<%s name=\"%s\" value=\"%.9g %.9g %.9g\"/>",
                      strcmp(name, "direction") == 0 ? "vector" : "point", name, (double)v[0], (double)v[1], (double)v[2]);
    }
}

static void write_to_uv(Writer *w, int depth, const Edit *e) {
    const float *m = theta(w, param_at(w, e->param)->theta); // 4 x 4: a matrix of nine numbers has no translation
    const float pose[16] = {m[0], m[1], 0, m[2], m[3], m[4], 0, m[5], 0, 0, 1, 0, 0, 0, 0, 1};
    rey_save_matrix(w, depth, "to_uv", pose);
}

// Numbers, as many as there are.
static rey_result write_list(Writer *w, int depth, const Edit *e) {
    const Param *p = param_at(w, e->param);
    enum { ROOM = 18 };
    char *text = rey_alloc_array(w->ctx, (size_t)p->count + 1, ROOM);
    size_t used = 0;
    TRY(text ? REY_OK : REY_ERROR_MEMORY);
    for (int32_t i = 0; i < p->count; i++) {
        used += (size_t)snprintf(text + used, ROOM, "%s%.9g", i ? ", " : "", (double)theta(w, p->theta)[i]);
    }
    rey_save_value(w, depth, "string", e->property, text);
    rey_free(w->ctx, text);
    return REY_OK;
}

// ---- data files --------------------------------------------------------------------------------------------------

// The voxels of a grid, and where it stands: its box may have come from the file that this one replaces.
static rey_result write_voxels(Writer *w, int depth, int32_t volume) {
    const VolumeNode *v = w->scene->view.volumes + volume;
    char path[4096];
    TRY(rey_save_new_file(w, depth, "volume", ".vol", path));
    rey_save_matrix(w, depth, "to_world", theta(w, v->to_world));
    rey_vol vol = {v->nx, v->ny, v->nz, v->channels, {0, 0, 0, 1, 1, 1}, w->scene->view.theta + v->theta};
    for (int i = 0; i < w->parts.grid_count; i++) {
        const SavedGrid *grid = &w->parts.grids[i];
        if (grid->volume == volume) {
            vol = (rey_vol){grid->nx, grid->ny, grid->nz, v->channels, {0, 0, 0, 1, 1, 1}, grid->values};
        }
    }
    return rey_vol_write(w->ctx, path, &vol);
}

static rey_result write_texels(Writer *w, int depth, const Edit *e) {
    const TextureNode *t = w->scene->view.textures + param_at(w, e->param)->texture;
    if (t->kind == TEXTURE_VOLUME) {
        return write_voxels(w, depth, t->volume);
    }
    bool bitmap = (REY_XML_BIT(e->node->tag) & REY_XML_TEXTURES) != 0;
    char path[4096];
    TRY(rey_save_new_file(w, depth, bitmap ? "texture" : "environment", ".exr", path));
    if (bitmap) {
        rey_save_line(w, depth, "<boolean name=\"raw\" value=\"true\"/>");
    }
    return rey_exr_write(w->ctx, path, theta(w, t->theta), t->width, t->height, t->channels, NULL);
}

// The attributes of a shape's mesh; their values stay where they are.
static rey_result list_attributes(Writer *w, int32_t shape, rey_mesh *mesh) {
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

// Normals that follow vertices which have moved since the scene was last brought up to date. To be freed; null: there are none.
static rey_result find_moved_normals(Writer *w, const ShapeRecord *shape, float **normals) {
    const SceneView *view = &w->scene->view;
    bool moved = false;
    for (size_t i = 0; i < w->scene->params.count; i++) {
        const Param *p = &ARRAY_AT(w->scene->params, Param, i);
        moved |= p->geometry == shape - view->shapes && p->theta == shape->positions && p->version != p->built;
    }
    *normals = NULL;
    if (!moved || !(shape->flags & SHAPE_SMOOTH_NORMALS)) {
        return REY_OK;
    }
    *normals = rey_alloc_array(w->ctx, (size_t)shape->vertex_count, 3 * sizeof **normals);
    return *normals ? rey_shape_normals(w->scene, shape, *normals) : REY_ERROR_MEMORY;
}

// A mesh's own vertices, which are in the world already. Flat shading is said in the XML.
static rey_result write_mesh(Writer *w, int depth, const ShapeRecord *shape) {
    const SceneView *view = &w->scene->view;
    char path[4096];
    TRY(rey_save_new_file(w, depth, "mesh", ".ply", path));
    if (shape->normals < 0) {
        rey_save_line(w, depth, "<boolean name=\"face_normals\" value=\"true\"/>");
    }
    for (int i = 0; i < w->parts.mesh_count; i++) {
        if (w->parts.meshes[i].shape == shape - view->shapes) {
            return rey_mesh_write_ply(w->ctx, path, &w->parts.meshes[i].mesh);
        }
    }
    rey_mesh mesh = {.vertex_count = shape->vertex_count, .face_count = shape->triangle_count};
    mesh.positions = view->theta + shape->positions;
    mesh.normals = shape->normals >= 0 ? view->theta + shape->normals : NULL;
    mesh.uvs = shape->uvs >= 0 ? view->theta + shape->uvs : NULL;
    mesh.faces = (uint32_t *)view->triangles + 3 * (size_t)shape->triangle;
    float *moved;
    rey_result result = find_moved_normals(w, shape, &moved);
    mesh.normals = moved ? moved : mesh.normals;
    result = result == REY_OK ? list_attributes(w, (int32_t)(shape - view->shapes), &mesh) : result;
    result = result == REY_OK ? rey_mesh_write_ply(w->ctx, path, &mesh) : result;
    rey_free(w->ctx, moved);
    rey_free(w->ctx, mesh.attributes);
    return result;
}

static rey_result write_grid(Writer *w, int depth, const ShapeRecord *shape) {
    const float *nodes = w->scene->view.tables + shape->table + SDFGRID_NODES;
    char path[4096];
    TRY(rey_save_new_file(w, depth, "grid", ".vol", path));
    rey_vol vol = {(int32_t)nodes[0], (int32_t)nodes[1], (int32_t)nodes[2], 1, {0, 0, 0, 1, 1, 1},
                   w->scene->view.theta + shape->positions};
    return rey_vol_write(w->ctx, path, &vol);
}

static rey_result write_geometry(Writer *w, int depth, const rey_xml_node *node) {
    const ShapeRecord *shape = find_shape(w, node);
    char path[4096];
    if (!shape) {
        return rey_fail(w->ctx, REY_ERROR_UNSUPPORTED, "the changed geometry of a %s cannot be written", node->type);
    }
    if (shape->segment_count > 0) {
        TRY(rey_save_new_file(w, depth, "curves", ".txt", path));
        return rey_curves_write(w->ctx, path, theta(w, shape->positions), w->scene->view.segments + shape->segment,
                                shape->segment_count, build_curve_order(node->type));
    }
    return shape->kind == SHAPE_MESH ? write_mesh(w, depth, shape) : write_grid(w, depth, shape);
}

rey_result rey_save_write_edits(Writer *w, int depth, const rey_xml_node *node) {
    bool geometry = rey_save_has_edit(w, node, EDIT_GEOMETRY), mesh = geometry && !rey_save_is_curve_or_grid(node);
    bool voxels = node->tag == REY_XML_VOLUME && rey_save_has_edit(w, node, EDIT_TEXELS);
    for (const Edit *e = rey_save_first_edit(w, node); e; e = rey_save_next_edit(w, e)) {
        switch (e->kind) {
        case EDIT_CONSTANT:
            write_constant(w, depth, e);
            break;
        case EDIT_TO_UV:
            write_to_uv(w, depth, e);
            break;
        case EDIT_TEXELS:
            TRY(write_texels(w, depth, e));
            break;
        case EDIT_LIST:
            TRY(write_list(w, depth, e));
            break;
        case EDIT_LEAF:
            if (!mesh && !voxels) { // a mesh's vertices are in the world, and a grid's pose goes with its voxels
                write_leaf(w, depth, e);
            }
            break;
        case EDIT_GEOMETRY:
            break;
        }
    }
    return geometry ? write_geometry(w, depth, node) : REY_OK;
}
