// kinds_used.c: which plugins a scene uses, and how often.
#include "io/build.h"
#include "io/mitsuba.h"

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
