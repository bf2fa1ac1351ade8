// build_instance.c: shapegroups, which are invisible themselves, and their instances; merge, whose shapes stand in the
// scene as they are: shading groups bring together what it would.
#include "io/build.h"
#include "io/lenient.h"
#include "shape/affine.h"
#include "shape/instance.h"

#include <stdio.h>
#include <string.h>

static const char *const instance_why = "moving an instance moves silhouettes, seen by the camera and by other path vertices";

// The shapes inside a node.
static rey_result build_shapes_of(Builder *b, rey_xml_node *node, const char *path) {
    for (int i = 0; i < node->child_count; i++) {
        rey_xml_child *child = &node->children[i];
        char name[MAX_PATH_NAME], full[MAX_PATH_NAME];
        if (child->node->tag != REY_XML_SHAPE) {
            return rey_xml_fail(b->ctx, child->at, REY_ERROR_SCENE, "a %s holds shapes, not a %s", node->type,
                                rey_xml_tag_name(child->node->tag));
        }
        child->used = true;
        snprintf(name, sizeof name, "shape_%d", i);
        build_join(full, path, child->node->id ? child->node->id : name);
        Snapshot s = build_snapshot(b);
        TRY(build_forgive(b, &s, child, "", build_shape(b, child->node, full), NULL));
    }
    return node->child_count ? REY_OK
                             : rey_scene_add_note(b->scene, "warning: %s:%d: this %s holds no shapes, and shows nothing",
                                                  node->at.file, node->at.line, node->type);
}

rey_result build_shapegroup(Builder *b, rey_xml_node *node, const char *path) {
    if (node->built >= 0) {
        return REY_OK;
    }
    if (b->collection >= 0) {
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE, "a shapegroup cannot stand inside a shapegroup");
    }
    TRY(build_name(b, node, path));
    b->collection = node->built = b->scene->view.collections++;
    TRY(build_shapes_of(b, node, path));
    b->collection = -1;
    return build_check_unused(b, node);
}

rey_result build_merge(Builder *b, rey_xml_node *node, const char *path) {
    TRY(build_shapes_of(b, node, path));
    return build_check_unused(b, node);
}

// The group that an instance shows; it may be declared later in the file.
static rey_result instance_group(Builder *b, rey_xml_node *node, const char *path, int32_t *group) {
    rey_xml_child *child = rey_xml_child_of(node, REY_XML_BIT(REY_XML_SHAPE), 0);
    if (!child || rey_xml_count_children(node, REY_XML_BIT(REY_XML_SHAPE)) != 1 ||
        strcmp(child->node->type, "shapegroup") != 0) {
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE, "an instance needs one shapegroup");
    }
    TRY(build_shapegroup(b, child->node, child->node->id ? child->node->id : path));
    *group = child->node->built;
    return REY_OK;
}

rey_result build_instance(Builder *b, rey_xml_node *node, const char *path) {
    rey_scene *scene = b->scene;
    InstanceRecord instance;
    double m[16];
    float pose[16];
    if (b->collection >= 0) {
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE, "an instance cannot stand inside a shapegroup");
    }
    TRY(build_name(b, node, path));
    TRY(instance_group(b, node, path, &instance.group));
    TRY(rey_xml_get_transform(b->ctx, node, "to_world", m));
    for (int k = 0; k < 16; k++) {
        pose[k] = (float)m[k];
    }
    double inverse[12];
    if (!rey_affine_inverse(pose, inverse)) {
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE, "the instance's to_world cannot be inverted");
    }
    int32_t id = rey_scene_append(scene, &scene->build.instances, sizeof instance, 1);
    Param p = {PARAM_DEFAULTS, .terms = REY_TERM_INTERIOR | REY_TERM_PRIMARY | REY_TERM_INDIRECT, .why = instance_why,
               .instance = id};
    instance.table = rey_scene_append(scene, &scene->build.tables, sizeof(float), INSTANCE_TABLE);
    if (id < 0 || instance.table < 0) {
        return REY_ERROR_MEMORY;
    }
    TRY(build_pose(b, m, path, p, &instance.to_world));
    ARRAY_AT(scene->build.instances, InstanceRecord, id) = instance;
    node->built = id;
    return build_check_unused(b, node);
}
