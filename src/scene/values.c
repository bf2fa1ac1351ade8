// values.c: the values of one scene's parameters for another scene, by name.
#include "scene/values.h"

#include "scene/absent.h"

#include <stdio.h>
#include <string.h>

static bool ends_in(const char *name, const char *leaf) {
    const char *dot = strrchr(name, '.');
    return strcmp(dot ? dot + 1 : name, leaf) == 0;
}

static void shape_text(const Param *p, char text[64]) {
    snprintf(text, 64, "%s", p->dims ? "" : "1");
    for (int i = 0; i < p->dims; i++) {
        size_t used = strlen(text);
        snprintf(text + used, 64 - used, "%s%d", i ? "x" : "", (int)p->shape[i]);
    }
}

// A mesh that was written for a shape whose vertices moved holds what the shape computes by itself.
static bool is_computed(const rey_scene *scene, const Param *p) {
    char name[1024];
    const char *dot = strrchr(p->name, '.');
    if (!dot || (!ends_in(p->name, "texcoords") && !ends_in(p->name, "normals"))) {
        return false;
    }
    snprintf(name, sizeof name, "%.*s.positions", (int)(dot - p->name), p->name);
    return rey_param_find(scene, name) >= 0;
}

// By its name, or by one of its further names: an object that became a value when it was written has another first one.
static int find_by_names(const rey_scene *scene, const rey_scene *from, int param) {
    int own = rey_param_find(scene, ARRAY_AT(from->params, Param, param).name);
    for (size_t i = 0; i < from->aliases.count && own < 0; i++) {
        Alias alias = ARRAY_AT(from->aliases, Alias, i);
        own = alias.param == param ? rey_param_find(scene, alias.name) : -1;
    }
    return own;
}

// Number of the scene's parameter for one of `from`; -1 where it needs none.
static rey_result find_own(const rey_scene *scene, const rey_scene *from, int param, const char *path, int *own) {
    const Param *p = &ARRAY_AT(from->params, Param, param);
    *own = find_by_names(scene, from, param);
    if (*own < 0) {
        char absent[ABSENT_BYTES];
        rey_param_absent(scene, p->name, absent);
        return is_computed(scene, p) ? REY_OK
                                     : rey_fail(scene->ctx, REY_ERROR_PARAM,
                                                "%s: the scene has no parameter '%s', which this file has%s", path, p->name,
                                                absent);
    }
    const Param *q = &ARRAY_AT(scene->params, Param, *own);
    if (q->dims != p->dims || memcmp(q->shape, p->shape, sizeof *q->shape * (size_t)q->dims) != 0) {
        char found[64], expected[64];
        shape_text(p, found);
        shape_text(q, expected);
        return rey_fail(scene->ctx, REY_ERROR_PARAM, "%s: '%s' has the shape %s, expected %s as in the scene", path,
                        p->name, found, expected);
    }
    return REY_OK;
}

rey_result rey_values_check(const rey_scene *scene, const rey_scene *from, const char *path) {
    rey_result result = REY_OK;
    for (size_t i = 0; i < from->params.count && result == REY_OK; i++) {
        int own;
        result = find_own(scene, from, (int)i, path, &own);
    }
    return result;
}

rey_result rey_values_copy(rey_scene *scene, const rey_scene *from, const char *path, ValuesPhase phase) {
    rey_result result = REY_OK;
    for (size_t i = 0; i < from->params.count && result == REY_OK; i++) {
        const Param *p = &ARRAY_AT(from->params, Param, i);
        ValuesPhase when = ends_in(p->name, "to_world") ? VALUES_POSES : p->geometry >= 0 ? VALUES_VERTICES : VALUES_REST;
        int own = -1;
        result = when == phase ? find_own(scene, from, (int)i, path, &own) : REY_OK;
        if (result == REY_OK && own >= 0) {
            const float *values = rey_param_values(from, (int)i);
            if (memcmp(rey_param_values(scene, own), values, (size_t)p->count * sizeof *values) != 0) {
                result = rey_scene_set(scene, own, values, p->count);
            }
        }
    }
    return result;
}
