// absent.c: what is said of a parameter that a scene does not have. Other renderers give shapes more, or other, parameters.
#include "scene/absent.h"

#include <stdio.h>
#include <string.h>

// The shape that an object's name stands for, null where it is none.
static const ShapeRecord *shape_named(const rey_scene *scene, const char *object) {
    static const char *const leaves[] = {"positions", "to_world"};
    char name[1024];
    for (int i = 0; i < COUNT_OF(leaves); i++) {
        snprintf(name, sizeof name, "%s.%s", object, leaves[i]);
        int param = rey_param_find(scene, name);
        const Param *p = param >= 0 ? &ARRAY_AT(scene->params, Param, param) : NULL;
        if (p && p->geometry >= 0) {
            return scene->view.shapes + p->geometry;
        }
    }
    return NULL;
}

// Why a shape has no parameter of this name, null where that is not known.
static const char *reason(const ShapeRecord *shape, const char *leaf) {
    bool mesh = shape->triangle_count > 0, posed = shape->to_world >= 0;
    leaf += strncmp(leaf, "vertex_", 7) == 0 ? 7 : 0; // older names
    if (strcmp(leaf, "to_world") == 0) {
        return mesh ? "meshes have no pose of their own; their positions move, or the to_world of an instance" : NULL;
    }
    if (strcmp(leaf, "positions") == 0) {
        return mesh ? NULL : "it has no vertices; its to_world moves it";
    }
    if (strcmp(leaf, "normals") == 0) {
        return !mesh   ? "it has no vertices, and its normals are those of its surface"
               : posed ? "rectangles and cubes have flat faces without vertex normals; meshes of obj, ply or serialized have some"
                       : "the faces of this mesh are flat and have no vertex normals";
    }
    if (strcmp(leaf, "texcoords") == 0) {
        return !mesh   ? "it has no vertices, and its texture coordinates are those of its surface"
               : posed ? "those of rectangles and cubes are what they are; the to_uv of a texture moves it"
                       : "this mesh has no texture coordinates";
    }
    return strcmp(leaf, "faces") == 0 ? "which vertices a triangle joins is no number that could change a little" : NULL;
}

// Of a medium's coefficients: a medium has two of four. Null where that is not why.
static const char *other_coefficients(const rey_scene *scene, const char *name) {
    static const char *const words[] = {".sigma_t", ".albedo", ".sigma_s", ".sigma_a"};
    static const char *const leaves[] = {"value", "data"};
    for (int i = 0; i < COUNT_OF(words); i++) {
        const char *at = strstr(name, words[i]);
        for (int k = 0; k < COUNT_OF(leaves) && at; k++) {
            char other[1024];
            snprintf(other, sizeof other, "%.*s%s.%s", (int)(at - name), name, words[i < 2 ? 2 : 0], leaves[k]);
            if (rey_param_find(scene, other) >= 0) {
                return i < 2 ? "this medium is written with sigma_s and sigma_a" : "this medium is written with sigma_t and albedo";
            }
        }
    }
    return NULL;
}

// A parameter of an object that is named alone, null where there is none.
static const char *first_below(const rey_scene *scene, const char *object) {
    size_t length = strlen(object);
    size_t count = scene->params.count, all = count + scene->aliases.count;
    for (size_t i = 0; i < all && length; i++) {
        const char *name = i < count ? ARRAY_AT(scene->params, Param, i).name : ARRAY_AT(scene->aliases, Alias, i - count).name;
        if (!strncmp(name, object, length) && name[length] == '.') {
            return name;
        }
    }
    return NULL;
}

// Of a bitmap or checkerboard that is written without one, which would be the same as one that moves nothing.
static const char *unwritten(const rey_scene *scene, const char *object, const char *leaf) {
    const char *below = leaf && strcmp(leaf, "to_uv") == 0 ? first_below(scene, object) : NULL;
    const char *rest = below ? below + strlen(object) + 1 : "";
    int data = strcmp(rest, "data") == 0 ? rey_param_find(scene, below) : -1;
    bool texture = strncmp(rest, "color0.", 7) == 0 || (data >= 0 && ARRAY_AT(scene->params, Param, data).texture >= 0);
    return texture ? "it is one where the texture has a transform of this name, such as <transform name=\"to_uv\"/>" : NULL;
}

void rey_param_absent(const rey_scene *scene, const char *name, char text[ABSENT_BYTES]) {
    char object[1024];
    const char *dot = strrchr(name, '.');
    snprintf(object, sizeof object, "%.*s", dot ? (int)(dot - name) : 0, name);
    const ShapeRecord *shape = dot ? shape_named(scene, object) : NULL;
    const char *why = shape ? reason(shape, dot + 1) : other_coefficients(scene, name);
    why = why ? why : unwritten(scene, object, dot ? dot + 1 : NULL);
    const char *nearest = why ? NULL : rey_param_nearest(scene, name);
    const char *below = why || nearest ? NULL : first_below(scene, name);
    text[0] = 0;
    if (below) {
        snprintf(text, ABSENT_BYTES, "; there is '%.600s'", below);
    } else if (why) {
        snprintf(text, ABSENT_BYTES, ": %s", why);
    } else if (nearest) {
        snprintf(text, ABSENT_BYTES, ", did you mean '%.600s'?", nearest);
    }
}
