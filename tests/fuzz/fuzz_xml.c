// fuzz_xml.c: any bytes as a scene file. Nothing may crash, leak or take long; what is accepted must be consistent.
#include "base/context.h"
#include "io/xml.h"

#include <math.h>
#include <stdlib.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void check(bool holds) {
    if (!holds) {
        abort();
    }
}

static const char *no_names(void *user, int i) {
    UNUSED(user);
    UNUSED(i);
    return NULL;
}

static void check_node(rey_context *ctx, rey_xml_node *node) {
    check(node->type != NULL && node->height >= 0 && node->height <= REY_XML_DEEPEST);
    for (int i = 0; i < node->child_count; i++) {
        check(node->children[i].node != NULL && node->children[i].node->height < node->height);
    }
    for (int i = 0; i < node->property_count; i++) {
        rey_xml_property *property = &node->properties[i];
        const double zero[3] = {0};
        double colour[3], ior, matrix[6];
        check(rey_xml_find(node, property->name) == property && property->at.line > 0);
        if (!rey_xml_get_colour(ctx, node, property->name, REY_COLOUR_REFLECTANCE, zero, colour)) {
            check(colour[0] >= 0 && colour[1] <= 1 && isfinite(colour[2]));
        }
        (void)rey_xml_get_ior(ctx, node, property->name, "air", &ior);
        (void)rey_xml_get_transform2(ctx, node, property->name, matrix);
    }
    (void)rey_xml_check_unused(ctx, node, no_names, NULL);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    rey_context *ctx = NULL;
    rey_context_def def = rey_default_context_def();
    def.threads = 1;
    check(rey_context_create(&def, &ctx) == REY_OK);
    rey_xml_document *document = NULL;
    rey_result result = rey_xml_read_memory(ctx, "/nowhere/scene.xml", (const char *)data, size, NULL, 0, &document);
    check((result == REY_OK) == (document != NULL) && (result == REY_OK || rey_error(ctx)[0]));
    for (int i = 0; document && i < rey_xml_node_count(document); i++) {
        check_node(ctx, rey_xml_node_at(document, i));
    }
    rey_xml_free(ctx, document);
    rey_context_destroy(ctx);
    return 0;
}
