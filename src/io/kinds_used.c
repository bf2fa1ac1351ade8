// kinds_used.c: which plugins a scene uses, and how often; which files it reads.
#include "io/build.h"
#include "io/file.h"
#include "io/mitsuba.h"
#include "io/xml_parts.h"

#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static KindCount *find(const Array *counts, const rey_xml_node *node) {
    for (size_t i = 0; i < counts->count; i++) {
        KindCount *c = &ARRAY_AT(*counts, KindCount, i);
        if (c->tag == (int)node->tag && strcmp(c->type, node->type) == 0) {
            return c;
        }
    }
    return NULL;
}

rey_result rey_mitsuba_kinds(const rey_scene *scene, Array *counts) {
    const SceneSource *source = scene->document;
    *counts = (Array){0};
    for (int tag = 0; tag < REY_XML_TAG_COUNT; tag++) { // in the order of the tags, then of first use
        for (int i = 0; tag != REY_XML_SCENE && i < rey_xml_node_count(source->document); i++) {
            const rey_xml_node *node = rey_xml_node_at(source->document, i);
            KindCount *c = (int)node->tag == tag ? find(counts, node) : NULL;
            if ((int)node->tag == tag && !c) {
                c = rey_array_push(scene->ctx, counts, sizeof *c, 1);
                if (!c) {
                    rey_array_free(scene->ctx, counts);
                    return REY_ERROR_MEMORY;
                }
                *c = (KindCount){tag, rey_xml_tag_name(node->tag), node->type, 0};
            }
            if (c) {
                c->count++;
            }
        }
    }
    return REY_OK;
}

rey_result rey_mitsuba_reads(const rey_scene *scene, const char *beginning, char **out) {
    const SceneSource *source = scene->document;
    size_t length = strlen(beginning);
    *out = NULL;
    for (int i = 0; source && i < rey_xml_node_count(source->document) && !*out; i++) {
        const rey_xml_property *p = rey_xml_find(rey_xml_node_at(source->document, i), "filename");
        char *path = NULL, real[PATH_MAX];
        if (!p || p->kind != REY_XML_STRING_VALUE) {
            continue;
        }
        TRY(rey_xml_search(scene->ctx, source->document, NULL, p->string, &path));
        if (path && realpath(path, real) && !strncmp(real, beginning, length)) {
            *out = path;
        } else {
            rey_free(scene->ctx, path);
        }
    }
    return REY_OK;
}

// The file that a property stands in, or that it names.
static rey_result is_of_property(const rey_scene *scene, const rey_xml_property *p, const char *path, bool *is) {
    const SceneSource *source = scene->document;
    bool names = (p->kind == REY_XML_STRING_VALUE && !strcmp(p->name, "filename")) || p->kind == REY_XML_SPECTRUM_VALUE;
    char *file = NULL;
    *is = rey_file_same(p->at.file, path);
    if (*is || !names || !p->string) {
        return REY_OK;
    }
    rey_result result = rey_xml_search(scene->ctx, source->document, NULL, p->string, &file);
    *is = file && rey_file_same(file, path);
    rey_free(scene->ctx, file);
    return result;
}

rey_result rey_mitsuba_reads_file(const rey_scene *scene, const char *path, bool *reads) {
    const SceneSource *source = scene->document;
    const char *own = source ? rey_mitsuba_file(scene) : NULL;
    *reads = own && rey_file_same(own, path);
    for (int i = 0; source && i < rey_xml_node_count(source->document) && !*reads; i++) {
        const rey_xml_node *node = rey_xml_node_at(source->document, i);
        *reads = rey_file_same(node->at.file, path);
        for (int k = 0; k < node->property_count && !*reads; k++) {
            TRY(is_of_property(scene, &node->properties[k], path, reads));
        }
    }
    return REY_OK;
}

int rey_mitsuba_sensor(const rey_scene *scene, const char *id) {
    const SceneSource *source = scene->document;
    const rey_xml_node *node = source ? rey_xml_find_id(source->document, id) : NULL;
    if (node) {
        return node->tag == REY_XML_SENSOR && node->built >= 0 ? node->built : -1;
    }
    for (int i = 0; i < (int)scene->view.sensors_count; i++) { // by the name that its parameters have
        char name[32];
        snprintf(name, sizeof name, "sensor_%d", i);
        if (!rey_mitsuba_sensor_id(scene, i) && strcmp(id, name) == 0) {
            return i;
        }
    }
    return -1;
}

const char *rey_mitsuba_sensor_id(const rey_scene *scene, int index) {
    const SceneSource *source = scene->document;
    for (int i = 0; source && i < rey_xml_node_count(source->document); i++) {
        const rey_xml_node *node = rey_xml_node_at(source->document, i);
        if (node->tag == REY_XML_SENSOR && node->built == index) {
            return node->id;
        }
    }
    return NULL;
}

void rey_mitsuba_list_sensors(const rey_scene *scene, char *text, size_t size) {
    text[0] = 0;
    for (int i = 0; i < (int)scene->view.sensors_count; i++) {
        size_t used = strlen(text);
        const char *id = rey_mitsuba_sensor_id(scene, i);
        snprintf(text + used, size - used, id ? "%s%d is '%s'" : "%s%d has no id", i ? ", " : "", i, id);
    }
}
