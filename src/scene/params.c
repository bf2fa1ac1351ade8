// params.c: named parameters: ranges of theta with a name, a shape, a range and the terms that a derivative needs.
#include "scene/texels.h"

#include <string.h>

static NamedItems params_of(const rey_scene *scene) {
    return (NamedItems){&scene->params, sizeof(Param)};
}

static NamedItems aliases_of(const rey_scene *scene) {
    return (NamedItems){&scene->aliases, sizeof(Alias)};
}

// Room at the end of an array whose items begin with a name, and that name's entry in the table; null on failure.
static void *push_named(rey_scene *scene, Array *array, size_t item_bytes, Names *names, const char *name) {
    char *copy = rey_strdup(scene->ctx, name);
    void *item = copy ? rey_array_push(scene->ctx, array, item_bytes, 1) : NULL;
    if (item) {
        memcpy(item, &copy, sizeof copy);
        if (rey_names_add(scene->ctx, names, (NamedItems){array, item_bytes}, (int32_t)array->count - 1) == REY_OK) {
            return item;
        }
        array->count--;
    }
    rey_free(scene->ctx, copy);
    return NULL;
}

int rey_scene_add_param(rey_scene *scene, const char *name, Param param) {
    Param *p = push_named(scene, &scene->params, sizeof *p, &scene->param_names, name);
    if (!p) {
        return -1;
    }
    param.name = p->name;
    param.unit = param.unit ? param.unit : "";
    param.description = param.description ? param.description : "";
    param.why = param.why ? param.why : "";
    *p = param;
    return (int)scene->params.count - 1;
}

rey_result rey_scene_add_alias(rey_scene *scene, const char *name, int param) {
    if (rey_param_find(scene, name) >= 0) {
        return REY_OK;
    }
    Alias *alias = push_named(scene, &scene->aliases, sizeof *alias, &scene->alias_names, name);
    if (!alias) {
        return REY_ERROR_MEMORY;
    }
    alias->param = param;
    return REY_OK;
}

void rey_scene_forget_params(rey_scene *scene, size_t params, size_t aliases) {
    for (; scene->params.count > params; scene->params.count--) {
        int32_t last = (int32_t)scene->params.count - 1;
        rey_names_remove(&scene->param_names, params_of(scene), last);
        rey_free(scene->ctx, ARRAY_AT(scene->params, Param, last).name);
    }
    for (; scene->aliases.count > aliases; scene->aliases.count--) {
        int32_t last = (int32_t)scene->aliases.count - 1;
        rey_names_remove(&scene->alias_names, aliases_of(scene), last);
        rey_free(scene->ctx, ARRAY_AT(scene->aliases, Alias, last).name);
    }
}

static const Param *param_at(const rey_scene *scene, int i) {
    return scene && i >= 0 && (size_t)i < scene->params.count ? &ARRAY_AT(scene->params, Param, i) : NULL;
}

int rey_param_count(const rey_scene *scene) {
    return scene ? (int)scene->params.count : 0;
}

rey_result rey_param_get_info(const rey_scene *scene, int param, rey_param_info *info) {
    rey_result result = rey_begin(scene ? scene->ctx : NULL, info != NULL);
    if (result != REY_OK) {
        return result;
    }
    const Param *p = param_at(scene, param);
    if (!p) {
        return rey_fail(scene->ctx, REY_ERROR_ARGUMENT, "there is no parameter number %d", param);
    }
    *info = (rey_param_info){.name = p->name, .unit = p->unit, .description = p->description, .count = p->count,
                             .dims = p->dims, .low = p->low, .high = p->high, .terms = p->terms, .why = p->why};
    for (int k = 0; k < p->dims; k++) {
        info->shape[k] = p->shape[k];
    }
    return REY_OK;
}

int rey_scene_grid_channels(const rey_scene *scene, int param) {
    const Param *p = param_at(scene, param);
    const TextureNode *t = p && p->texture >= 0 ? scene->view.textures + p->texture : NULL;
    return t && t->kind == TEXTURE_VOLUME ? t->channels : 0;
}

int rey_param_find(const rey_scene *scene, const char *name) {
    if (!scene || !name) {
        return -1;
    }
    int32_t param = rey_names_find(&scene->param_names, params_of(scene), name);
    int32_t alias = param < 0 ? rey_names_find(&scene->alias_names, aliases_of(scene), name) : -1;
    return alias >= 0 ? ARRAY_AT(scene->aliases, Alias, alias).param : param;
}

bool rey_param_stays(const rey_scene *scene, int param) {
    const Param *p = &ARRAY_AT(scene->params, Param, param);
    int sharp = p->moves_rims && p->texture >= 0 ? REY_TERM_PRIMARY | REY_TERM_INDIRECT : 0;
    return (p->terms & ~sharp) == REY_TERM_INTERIOR;
}

const char **rey_params_matching(const rey_scene *scene, const char *pattern) {
    const Array *params = &scene->params, *aliases = &scene->aliases;
    const char **names = rey_alloc_array(scene->ctx, params->count, sizeof *names);
    for (size_t i = 0; i < params->count && names; i++) {
        const char *name = ARRAY_AT(*params, Param, i).name;
        names[i] = rey_name_matches(pattern, name) ? name : NULL;
    }
    for (size_t i = 0; i < aliases->count && names; i++) {
        const Alias *alias = &ARRAY_AT(*aliases, Alias, i);
        const char **name = &names[alias->param];
        *name = !*name && rey_name_matches(pattern, alias->name) ? alias->name : *name;
    }
    return names;
}

static const char *param_word(void *user, int i) {
    const rey_scene *scene = user;
    size_t n = scene->params.count;
    if ((size_t)i < n) {
        return ARRAY_AT(scene->params, Param, i).name;
    }
    return (size_t)i < n + scene->aliases.count ? ARRAY_AT(scene->aliases, Alias, (size_t)i - n).name : NULL;
}

const char *rey_param_nearest(const rey_scene *scene, const char *name) {
    const char *word = scene && name ? rey_nearest_word(name, param_word, (void *)(uintptr_t)scene) : NULL;
    int param = word ? rey_param_find(scene, word) : -1; // an alias is meant for the name that is listed
    return param >= 0 ? ARRAY_AT(scene->params, Param, param).name : NULL;
}

const float *rey_param_values(const rey_scene *scene, int param) {
    const Param *p = param_at(scene, param);
    if (p && p->texture >= 0) {
        rey_texels_promote((rey_scene *)(uintptr_t)scene, p->texture, true);
    }
    return p ? scene->view.theta + p->theta : NULL;
}

bool rey_medium_reads(const SceneView *view, const MediumNode *medium, int32_t texture) {
    const int32_t volumes[] = {medium->sigma_t, medium->sigma_s, medium->sigma_a};
    for (int i = 0; i < COUNT_OF(volumes); i++) {
        if (volumes[i] >= 0 && view->volumes[volumes[i]].texture == texture) {
            return true;
        }
    }
    return false;
}

// Derived data that reads a texture: environment distributions, tables of scattering functions.
static void texture_changed(rey_scene *scene, int32_t texture) {
    for (int64_t i = 0; i < scene->view.emitters_count; i++) {
        const EmitterRecord *e = scene->view.emitters + i;
        for (int k = 0; k < MAX_EMITTER_SLOTS && e->table >= 0; k++) {
            scene->dirty_emitters[i] |= e->slot[k] == texture;
        }
    }
    for (int64_t i = 0; i < scene->view.bsdfs_count; i++) {
        const BsdfNode *b = scene->view.bsdfs + i;
        for (int k = 0; k < MAX_SLOTS && b->table >= 0; k++) {
            scene->dirty_bsdfs[i] |= b->slot[k] == texture;
        }
    }
    for (int64_t i = 0; i < scene->view.media_count; i++) {
        const MediumNode *m = scene->view.media + i;
        bool read = rey_medium_reads(&scene->view, m, texture) || m->scale_texture == texture || m->flakes == texture;
        scene->dirty_media[i] |= read;
    }
    for (int64_t i = 0; i < scene->view.phases_count; i++) {
        const PhaseNode *p = scene->view.phases + i;
        for (int k = 0; k < MAX_PHASE_SLOTS && p->table >= 0; k++) {
            scene->dirty_phases[i] |= p->slot[k] == texture;
        }
    }
}

rey_result rey_scene_set(rey_scene *scene, int param, const float *values, int64_t count) {
    Param *p = (Param *)(uintptr_t)param_at(scene, param);
    if (!p || !values) {
        return rey_fail(scene->ctx, REY_ERROR_ARGUMENT, "there is no parameter number %d", param);
    }
    if (count != p->count) {
        return rey_fail(scene->ctx, REY_ERROR_PARAM, "%s has %d value%s, %lld given", p->name, (int)p->count, PLURAL(p->count),
                        (long long)count);
    }
    for (int64_t i = 0; i < count; i++) {
        if (!(values[i] >= p->low && values[i] <= p->high) || !isfinite(values[i])) {
            return rey_fail(scene->ctx, REY_ERROR_PARAM, "%s[%lld] = %g, expected a number in [%g, %g]", p->name,
                            (long long)i, (double)values[i], (double)p->low, (double)p->high);
        }
    }
    if (p->texture >= 0) {
        rey_texels_promote(scene, p->texture, false);
    }
    memmove(scene->view.theta + p->theta, values, (size_t)count * sizeof *values);
    p->version++;
    return REY_OK;
}

static void mark_change(rey_scene *scene, const Param *p) {
    if (p->texture >= 0) {
        texture_changed(scene, p->texture);
    }
    if (p->geometry >= 0) {
        bool pose = p->theta == scene->view.shapes[p->geometry].to_world;
        scene->dirty_shapes[p->geometry] |= pose ? SHAPE_DIRTY_POSE : SHAPE_DIRTY_VERTICES;
    }
    if (p->instance >= 0) {
        scene->dirty_instances[p->instance] = 1;
    }
    if (p->emitter >= 0) {
        scene->dirty_emitters[p->emitter] = 1;
    }
    if (p->volume >= 0) {
        scene->dirty_volumes[p->volume] = 1;
    }
}

void rey_scene_mark_changes(rey_scene *scene) {
    for (size_t i = 0; i < scene->params.count; i++) {
        Param *p = &ARRAY_AT(scene->params, Param, i);
        if (p->version != p->built) {
            mark_change(scene, p);
            p->built = p->version;
            scene->dirty = true;
        }
    }
}

rey_result rey_param_set(rey_scene *scene, int param, const float *values, int64_t count) {
    rey_result result = rey_begin(scene ? scene->ctx : NULL, values != NULL);
    return result == REY_OK ? rey_scene_set(scene, param, values, count) : result;
}

int64_t rey_selection_size(const rey_scene *scene, rey_selection selection) {
    int64_t size = 0;
    for (int i = 0; selection.params && i < selection.count; i++) {
        const Param *p = param_at(scene, selection.params[i]);
        size += p ? p->count : 0;
    }
    return size;
}

const char *rey_term_name(int bit) {
    switch (bit) {
    case REY_TERM_INTERIOR:
        return "interior";
    case REY_TERM_PRIMARY:
        return "primary";
    case REY_TERM_INDIRECT:
        return "indirect";
    case REY_TERM_SPECULAR:
        return "specular";
    case REY_TERM_MEDIUM:
        return "medium";
    case REY_TERM_TERMINATOR:
        return "terminator";
    default:
        return NULL;
    }
}

int rey_terms_of(const char *text, const char **wrong) {
    int terms = 0;
    for (*wrong = text;; (*wrong)++) {
        size_t length = strcspn(*wrong, ",");
        int found = 0;
        for (int bit = 1; bit <= REY_TERM_ALL; bit <<= 1) {
            const char *name = rey_term_name(bit);
            found |= strlen(name) == length && !strncmp(name, *wrong, length) ? bit : 0;
        }
        if (!found) {
            return 0;
        }
        terms |= found;
        *wrong += length;
        if (!**wrong) {
            return terms;
        }
    }
}
