// save.c: writes a scene back: every object and property as it was read, with the values that changed since, so that
// loading the result gives the same bits. Its data files go into a folder beside the XML: the result stands alone.
#include "io/file.h"
#include "io/save.h"
#include "io/save_parts.h"
#include "io/xml_parts.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

static rey_result write_node(Writer *w, int depth, const rey_xml_node *node, const char *slot);

// Marks the objects that stand in the file where they were declared: not those inside of what was left out.
static void mark_declared(Writer *w, const rey_xml_node *node) {
    for (int i = 0; i < node->child_count; i++) {
        const rey_xml_child *c = &node->children[i];
        if (!c->ref && !c->ignored) {
            w->declared[c->node->index] = 1;
            mark_declared(w, c->node);
        }
    }
}

static rey_result write_children(Writer *w, int depth, const rey_xml_node *node) {
    for (int i = 0; i < node->child_count; i++) {
        const rey_xml_child *c = &node->children[i];
        if (c->ignored) {
            continue;
        }
        if (c->ref && !w->declared[c->node->index]) {
            w->declared[c->node->index] = 1;
            mark_declared(w, c->node);
            TRY(write_node(w, depth, c->node, c->name));
        } else if (c->ref) {
            rey_save_tag(w, depth, "ref", c->node->id ? c->node->id : c->ref, "name", c->name);
        } else {
            TRY(write_node(w, depth, c->node, c->name));
        }
    }
    return REY_OK;
}

// A constant that was written as an object has become values.
static bool write_constant_object(Writer *w, int depth, const rey_xml_node *node, const char *slot) {
    const Edit *e = rey_save_first_edit(w, node);
    if (!e || e->kind != EDIT_CONSTANT || e->property) {
        return false;
    }
    int32_t texture = ARRAY_AT(w->scene->params, Param, e->param).texture;
    const TextureNode *t = w->scene->view.textures + texture;
    const float *v = w->scene->view.theta + t->theta;
    rey_save_open(w, depth, node, "rawconstant", slot);
    if (t->channels == 1) {
        rey_save_line(w, depth + 1, "<float name=\"value\" value=\"%.9g\"/>", (double)v[0]);
    } else {
        rey_save_line(w, depth + 1, "<vector name=\"value\" value=\"%.9g %.9g %.9g\"/>", (double)v[0], (double)v[1],
                      (double)v[2]);
    }
    rey_save_line(w, depth, "</%s>", rey_xml_tag_name(node->tag));
    return true;
}

static void write_properties(Writer *w, int depth, const rey_xml_node *node) {
    const char *file = rey_save_data_name(w, node);
    char path[1400];
    for (int i = 0; i < node->property_count; i++) {
        const rey_xml_property *p = &node->properties[i];
        if (p->ignored || rey_save_replaces(w, node, p->name)) {
            continue;
        }
        if (file && strcmp(p->name, "filename") == 0) {
            snprintf(path, sizeof path, "%s/%s", w->folder_name, file);
            rey_save_value(w, depth, "string", "filename", path);
        } else {
            rey_save_property(w, depth, p);
        }
    }
}

static rey_result write_node(Writer *w, int depth, const rey_xml_node *node, const char *slot) {
    if (write_constant_object(w, depth, node, slot)) {
        return REY_OK;
    }
    bool mesh = rey_save_has_edit(w, node, EDIT_GEOMETRY) && !rey_save_is_curve_or_grid(node);
    rey_save_open(w, depth, node, mesh ? "ply" : node->type, slot);
    write_properties(w, depth + 1, node);
    TRY(rey_save_write_edits(w, depth + 1, node));
    TRY(write_children(w, depth + 1, node));
    rey_save_line(w, depth, "</%s>", rey_xml_tag_name(node->tag));
    return REY_OK;
}

// Further names of objects, after the objects.
static void write_aliases(Writer *w) {
    const XmlIds *ids = &w->source->document->ids;
    for (size_t i = 0; i < ids->capacity; i++) {
        const XmlId *id = &ids->slots[i];
        if (id->id && id->node->id && strcmp(id->id, id->node->id) != 0 && w->declared[id->node->index]) {
            rey_save_tag(w, 1, "alias", id->node->id, "as", id->id);
        }
    }
}

static rey_result write_all(Writer *w, const char *path) {
    TRY(rey_save_find_edits(w));
    w->declared = rey_alloc(w->ctx, (size_t)rey_xml_node_count(w->source->document) + 1);
    TRY(w->declared ? REY_OK : REY_ERROR_MEMORY);
    mark_declared(w, rey_xml_root(w->source->document));
    TRY(rey_save_list_files(w));
    TRY(rey_save_copy_files(w));
    rey_save_line(w, 0, "<scene version=\"3.0.0\">");
    const rey_xml_node *root = rey_xml_root(w->source->document);
    bool read = w->scene->integrator == NULL;
    for (int i = 0; i < root->child_count; i++) {
        read = read || (!root->children[i].ignored && root->children[i].node->tag == REY_XML_INTEGRATOR);
    }
    if (!read) { // what took the place of one that was left out
        rey_save_line(w, 1, "<integrator type=\"%s\"/>", w->scene->integrator);
    }
    TRY(write_children(w, 1, root));
    write_aliases(w);
    rey_save_line(w, 0, "</scene>");
    return w->failed ? REY_ERROR_MEMORY : rey_file_write(w->ctx, path, w->text.data, w->text.count);
}

static rey_result save(const rey_scene *scene, const char *path, SavedParts parts, bool keeps_files) {
    char folder[3800], stem[1000];
    const char *slash = strrchr(path, '/'), *file = slash ? slash + 1 : path;
    const char *dot = strrchr(file, '.');
    snprintf(stem, sizeof stem, "%.*s_data", (int)(dot ? dot - file : (long)strlen(file)), file);
    snprintf(folder, sizeof folder, "%.*s%s", (int)(file - path), path, stem);
    Writer w = {.ctx = scene->ctx, .scene = scene, .source = scene->document, .folder = folder, .folder_name = stem};
    w.parts = parts;
    w.keeps_files = keeps_files;
    rey_result result = write_all(&w, path);
    rey_save_free_files(&w, result != REY_OK);
    rey_array_free(w.ctx, &w.edits);
    rey_free(w.ctx, w.declared);
    rey_free(w.ctx, w.first_edit);
    rey_free(w.ctx, w.texture_sources);
    rey_names_free(w.ctx, &w.paths);
    rey_array_free(w.ctx, &w.text);
    return result;
}

rey_result rey_mitsuba_save(const rey_scene *scene, const char *path) {
    return save(scene, path, (SavedParts){0}, false);
}

rey_result rey_mitsuba_save_anew(const rey_scene *scene, const char *path) {
    return save(scene, path, (SavedParts){0}, access(path, F_OK) != 0);
}

rey_result rey_mitsuba_save_parts(const rey_scene *scene, const char *path, SavedParts parts) {
    return save(scene, path, parts, false);
}
