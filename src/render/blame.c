// blame.c: objects by the names of their parameters.
#include "render/blame.h"

#include "bsdf/table.h"
#include "emitter/table.h"
#include "render/boundary.h"

#include <stdio.h>
#include <string.h>

// A parameter's name without its last parts.
static void owner_of(const char *param, int parts, char name[OBJECT_NAME]) {
    snprintf(name, OBJECT_NAME, "%s", param);
    for (char *dot; parts > 0 && (dot = strrchr(name, '.')) != NULL; parts--) {
        *dot = 0;
    }
}

// By the parameter that places it. One of both is -1.
static void name_placed(const rey_scene *scene, int32_t shape, int32_t instance, char name[OBJECT_NAME]) {
    snprintf(name, OBJECT_NAME, "number %d", (int)(shape < 0 ? instance : shape));
    for (size_t i = 0; i < scene->params.count; i++) {
        const Param *p = &ARRAY_AT(scene->params, Param, i);
        if (shape < 0 ? p->instance == instance : p->geometry == shape) {
            owner_of(p->name, 1, name);
            return;
        }
    }
}

void rey_name_shape(const rey_scene *scene, int32_t shape, char name[OBJECT_NAME]) { name_placed(scene, shape, -1, name); }

void rey_name_instance(const rey_scene *scene, int32_t instance, char name[OBJECT_NAME]) { name_placed(scene, -1, instance, name); }

// The parameter that holds a texture's values; null for textures that have none.
static const Param *param_of(const rey_scene *scene, int32_t texture) {
    for (size_t i = 0; i < scene->params.count && texture >= 0; i++) {
        const Param *p = &ARRAY_AT(scene->params, Param, i);
        if (p->texture == texture || p->to_uv == texture) {
            return p;
        }
    }
    return NULL;
}

void rey_name_texture(const rey_scene *scene, int32_t texture, char name[OBJECT_NAME]) {
    const Param *p = param_of(scene, texture);
    int parts = 1;
    for (int k = 0; k < 2 && !p; k++, parts = 2) { // one made of others has their parameters
        p = param_of(scene, scene->view.textures[texture].child[k]);
    }
    snprintf(name, OBJECT_NAME, "number %d", (int)texture);
    if (p) {
        owner_of(p->name, parts, name);
    }
}

void rey_name_bsdf(const rey_scene *scene, int32_t bsdf, char name[OBJECT_NAME]) {
    const BsdfNode *node = scene->view.bsdfs + bsdf;
    snprintf(name, OBJECT_NAME, "number %d", (int)bsdf);
    for (int k = 0; k < MAX_SLOTS; k++) {
        const Param *p = param_of(scene, node->slot[k]);
        if (p) {
            owner_of(p->name, 2, name);
            return;
        }
    }
    for (int64_t i = 0; i < scene->view.shapes_count; i++) { // a function without numbers is that of a shape
        if (scene->view.shapes[i].bsdf == bsdf) {
            char shape[OBJECT_NAME];
            rey_name_shape(scene, (int32_t)i, shape);
            snprintf(name, OBJECT_NAME, "%.190s.bsdf", shape);
            return;
        }
    }
}

void rey_name_emitter(const rey_scene *scene, int32_t emitter, char name[OBJECT_NAME]) {
    const EmitterRecord *e = scene->view.emitters + emitter;
    const EmitterKind *kind = rey_emitter_kinds + e->kind;
    snprintf(name, OBJECT_NAME, "number %d", (int)emitter);
    for (size_t i = 0; i < scene->params.count; i++) {
        const Param *p = &ARRAY_AT(scene->params, Param, i);
        if (p->emitter == emitter) {
            owner_of(p->name, 1, name);
            return;
        }
    }
    for (int k = 0; k < kind->param_count; k++) {
        const Param *p = kind->params[k].type < EMITTER_PARAM_POSITION ? param_of(scene, e->slot[k]) : NULL;
        if (p) {
            owner_of(p->name, 2, name);
            return;
        }
    }
}

void rey_name_obstacle(const rey_scene *scene, const SensorRecord *sensor, char text[OBJECT_NAME]) {
    ChainObstacle o = rey_chains_obstacle(&scene->view, sensor);
    char name[OBJECT_NAME] = "";
    if (o.shape >= 0) {
        rey_name_shape(scene, o.shape, name);
    } else if (o.bsdf >= 0) {
        rey_name_bsdf(scene, o.bsdf, name);
    } else if (o.texture >= 0) {
        rey_name_texture(scene, o.texture, name);
    }
    snprintf(text, OBJECT_NAME, name[0] ? "%s '%.120s'" : "%s", o.what ? o.what : "nothing", name);
}

bool rey_bsdf_holds(const SceneView *view, int32_t bsdf, bool (*is)(int kind)) {
    bool found = bsdf >= 0 && is(view->bsdfs[bsdf].kind);
    for (int k = 0; bsdf >= 0 && k < MAX_CHILDREN && !found; k++) {
        found = rey_bsdf_holds(view, view->bsdfs[bsdf].child[k], is);
    }
    return found;
}

bool rey_texture_reads(const SceneView *view, int32_t id, const Param *p) {
    if (id < 0) {
        return false;
    }
    const TextureNode *t = view->textures + id;
    return p->texture == id || p->to_uv == id || (t->kind == TEXTURE_ATTRIBUTE && p->attribute >= 0) ||
           (t->kind == TEXTURE_VOLUME && p->theta == view->volumes[t->volume].theta) ||
           rey_texture_reads(view, t->child[0], p) || rey_texture_reads(view, t->child[1], p);
}

bool rey_is_volume(const SceneView *view, const TextureNode *t) {
    UNUSED(view);
    return t->kind == TEXTURE_VOLUME;
}

bool rey_texture_holds(const SceneView *view, int32_t texture, bool (*is)(const SceneView *view, const TextureNode *t)) {
    if (texture < 0) {
        return false;
    }
    const TextureNode *t = view->textures + texture;
    return is(view, t) || rey_texture_holds(view, t->child[0], is) || rey_texture_holds(view, t->child[1], is);
}

bool rey_bsdfs_used(const SceneView *view, bool (*are)(int kind)) {
    for (int64_t i = 0; i < view->bsdfs_count; i++) {
        if (view->bsdfs[i].used && are(view->bsdfs[i].kind)) {
            return true;
        }
    }
    return false;
}

bool rey_name_bender(const rey_scene *scene, char name[OBJECT_NAME]) {
    for (int64_t i = 0; i < scene->view.shapes_count; i++) {
        if (rey_bsdf_holds(&scene->view, scene->view.shapes[i].bsdf, rey_bsdf_bends)) {
            rey_name_shape(scene, (int32_t)i, name);
            return true;
        }
    }
    return false;
}
