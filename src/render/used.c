// used.c: follows shapes, lights and cameras to the scattering functions, textures and media that they refer to.
#include "render/used.h"

#include "emitter/table.h"
#include "render/motion.h"

typedef struct Marks {
    const SceneView *view;
    int sensor; // the only one that counts, -1 = all do
    uint8_t *shapes, *emitters, *bsdfs, *textures, *volumes, *phases, *media;
} Marks;

static void mark_volume(const Marks *m, int32_t id);

static void mark_texture(const Marks *m, int32_t id) {
    if (id < 0 || m->textures[id]) {
        return;
    }
    const TextureNode *node = m->view->textures + id;
    m->textures[id] = 1;
    if (node->kind == TEXTURE_VOLUME) {
        mark_volume(m, node->volume);
    }
    mark_texture(m, node->child[0]);
    mark_texture(m, node->child[1]);
}

static void mark_volume(const Marks *m, int32_t id) {
    if (id >= 0 && !m->volumes[id]) {
        m->volumes[id] = 1;
        mark_texture(m, m->view->volumes[id].texture);
    }
}

static void mark_bsdf(const Marks *m, int32_t id) {
    if (id < 0 || m->bsdfs[id]) {
        return;
    }
    m->bsdfs[id] = 1;
    for (int k = 0; k < MAX_SLOTS; k++) {
        mark_texture(m, m->view->bsdfs[id].slot[k]);
    }
    for (int k = 0; k < MAX_CHILDREN; k++) {
        mark_bsdf(m, m->view->bsdfs[id].child[k]);
    }
}

static void mark_phase(const Marks *m, int32_t id) {
    if (id < 0 || m->phases[id]) {
        return;
    }
    m->phases[id] = 1;
    for (int k = 0; k < MAX_PHASE_SLOTS; k++) {
        mark_texture(m, m->view->phases[id].slot[k]);
    }
    for (int k = 0; k < MAX_PHASE_CHILDREN; k++) {
        mark_phase(m, m->view->phases[id].child[k]);
    }
}

// Integrators that know no media look at none of their numbers.
static void mark_medium(const Marks *m, int32_t id) {
    if (id < 0 || !m->view->has_media || m->media[id]) {
        return;
    }
    const MediumNode *medium = m->view->media + id;
    m->media[id] = 1;
    mark_volume(m, medium->sigma_t);
    mark_volume(m, medium->albedo);
    mark_volume(m, medium->sigma_s);
    mark_volume(m, medium->sigma_a);
    mark_volume(m, medium->emission);
    mark_texture(m, medium->scale_texture);
    mark_phase(m, medium->phase);
}

static void mark_emitter(const Marks *m, int32_t id) {
    const EmitterRecord *e = m->view->emitters + id;
    const EmitterKind *kind = rey_emitter_kinds + e->kind;
    m->emitters[id] = 1;
    for (int k = 0; k < kind->param_count; k++) {
        mark_texture(m, kind->params[k].type < EMITTER_PARAM_POSITION ? e->slot[k] : -1);
    }
}

static bool is_instanced(const SceneView *view, int32_t group) {
    bool instanced = group < 0; // stands in the scene itself
    for (int64_t i = 0; i < view->instances_count && !instanced; i++) {
        instanced = view->instances[i].group == group;
    }
    return instanced;
}

static void mark_all(const Marks *m) {
    const SceneView *view = m->view;
    for (int64_t i = 0; i < view->shapes_count; i++) {
        const ShapeRecord *shape = view->shapes + i;
        if (is_instanced(view, shape->collection)) {
            m->shapes[i] = 1;
            mark_bsdf(m, shape->bsdf);
            mark_medium(m, shape->interior);
            mark_medium(m, shape->exterior);
        }
    }
    for (int64_t i = 0; i < view->emitters_count; i++) {
        if (view->emitters[i].shape < 0 || m->shapes[view->emitters[i].shape]) {
            mark_emitter(m, (int32_t)i);
        }
    }
    for (int64_t i = 0; i < view->sensors_count; i++) {
        mark_medium(m, m->sensor < 0 || m->sensor == i ? view->sensors[i].medium : -1);
    }
}

// Whether some texture reads a mesh's attribute: entries of one name lie 2 numbers per shape behind the first.
static bool attribute_read(const Marks *m, int32_t entry) {
    for (int64_t i = 0; i < m->view->textures_count; i++) {
        const TextureNode *t = m->view->textures + i;
        if (m->textures[i] && t->kind == TEXTURE_ATTRIBUTE && entry >= t->attribute &&
            entry < t->attribute + 2 * m->view->shapes_count) {
            return true;
        }
    }
    return false;
}

// Whether the sensor that counts, or a part of it, has a sensor's number.
static bool camera_used(const Marks *m, const Param *p) {
    if (m->sensor < 0) {
        return true;
    }
    const SensorRecord *s = m->view->sensors + m->sensor;
    bool used = rey_camera_theta(s, p->camera) == p->theta;
    for (int32_t i = 0; i < s->batch_count; i++) {
        used = used || rey_camera_theta(m->view->batch_sensors + s->batch + i, p->camera) == p->theta;
    }
    return used;
}

static bool is_used(const Marks *m, const Param *p) {
    return p->texture >= 0     ? m->textures[p->texture]
           : p->to_uv >= 0     ? m->textures[p->to_uv]
           : p->geometry >= 0  ? m->shapes[p->geometry]
           : p->normals >= 0   ? m->shapes[p->normals]
           : p->attribute >= 0 ? attribute_read(m, p->attribute)
           : p->emitter >= 0   ? m->emitters[p->emitter]
           : p->volume >= 0    ? m->volumes[p->volume]
           : p->camera >= 0    ? camera_used(m, p)
                               : true;
}

static rey_result find_used(rey_scene *scene, int sensor, bool *used) {
    const SceneView *v = &scene->view;
    const int64_t counts[] = {v->shapes_count,  v->emitters_count, v->bsdfs_count, v->textures_count,
                              v->volumes_count, v->phases_count,   v->media_count};
    Marks m = {.view = v, .sensor = sensor};
    uint8_t **const arrays[] = {&m.shapes, &m.emitters, &m.bsdfs, &m.textures, &m.volumes, &m.phases, &m.media};
    size_t total = 0;
    for (int k = 0; k < COUNT_OF(counts); k++) {
        total += (size_t)counts[k];
    }
    uint8_t *all = rey_alloc(scene->ctx, total);
    if (!all) {
        return REY_ERROR_MEMORY;
    }
    for (int k = 0; k < COUNT_OF(counts); k++) {
        *arrays[k] = k ? *arrays[k - 1] + counts[k - 1] : all;
    }
    mark_all(&m);
    for (size_t i = 0; i < scene->params.count; i++) {
        used[i] = is_used(&m, &ARRAY_AT(scene->params, Param, i));
    }
    rey_free(scene->ctx, all);
    return REY_OK;
}

rey_result rey_params_used(rey_scene *scene, bool *used) { return find_used(scene, -1, used); }

rey_result rey_params_reached(rey_scene *scene, int sensor, bool *reached) { return find_used(scene, sensor, reached); }
