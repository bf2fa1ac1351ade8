// build_phase.c: phase functions, driven by the table of their kinds.
#include "io/build.h"
#include "io/lenient.h"
#include "medium/table.h"

#include <stdio.h>
#include <string.h>

static const char *phase_word(void *user, int i) {
    UNUSED(user);
    return i < rey_phase_kind_count ? rey_phase_kinds[i].name : NULL;
}

static TextureUse phase_use(const PhaseParam *p) {
    return (TextureUse){REY_COLOUR_UNBOUNDED, true, p->low, p->high, "", p->text, 0, NULL};
}

// A number, or a volume of numbers.
static rey_result number_slot(Builder *b, rey_xml_node *node, const PhaseParam *p, const char *path, int32_t *out) {
    double value = (double)p->value;
    rey_xml_child *child = rey_xml_child_named(node, p->name);
    if (child && child->node->tag == REY_XML_VOLUME) {
        int32_t id;
        TRY(build_volume(b, child->node, phase_use(p), path, &id));
        *out = ARRAY_AT(b->scene->build.volumes, VolumeNode, id).texture;
    } else {
        TRY(build_slot(b, node, p->name, phase_use(p), &value, 1, path, out));
    }
    const TextureNode *t = &ARRAY_AT(b->scene->build.textures, TextureNode, *out);
    return (t->kind == TEXTURE_CONSTANT || t->kind == TEXTURE_VOLUME) && t->channels == 1
               ? REY_OK
               : rey_xml_fail_value(b->ctx, node, p->name, "'%s' of a phase function must be a number or a volume of numbers",
                                    p->name);
}

// A list of numbers as a texture, with the parameter `path`.
static rey_result add_list(Builder *b, rey_xml_node *node, const PhaseParam *p, const double *values, size_t count,
                           const char *path, int32_t *out) {
    float *theta;
    TRY(build_add_texture(b, TEXTURE_TABLE, (int64_t)count, out, &theta));
    TextureNode *t = &ARRAY_AT(b->scene->build.textures, TextureNode, *out);
    t->width = (int32_t)count;
    for (size_t i = 0; i < count; i++) {
        theta[i] = (float)values[i];
        if (!(theta[i] >= p->low && theta[i] <= p->high) || !isfinite(theta[i])) {
            return rey_xml_fail_value(b->ctx, node, p->name, "number %zu of '%s' is %g, expected a number in [%g, %g]",
                                      i + 1, p->name, values[i], (double)p->low, (double)p->high);
        }
    }
    Param param = {PARAM_DEFAULTS, .theta = t->theta, .count = (int32_t)count, .dims = 1, .shape = {(int32_t)count},
                   .low = p->low, .high = p->high, .terms = REY_TERM_INTERIOR, .description = p->text, .texture = *out};
    TRY(build_texture_param(b, path, param) < 0 ? REY_ERROR_MEMORY : REY_OK);
    return build_note_source(b, node, p->name, *out);
}

// Numbers between blanks and commas, at least so many, not all 0.
static rey_result table_slot(Builder *b, rey_xml_node *node, const PhaseParam *p, const char *path, int32_t *out) {
    Array list = {0};
    double sum = 0;
    size_t least = p->type == PHASE_PARAM_TABLE ? 2 : 1;
    rey_result result = build_number_list(b, node, p->name, &list);
    for (size_t i = 0; i < list.count; i++) {
        sum += ARRAY_AT(list, double, i);
    }
    if (result == REY_OK && (list.count < least || list.count > 1 << 20 || !(sum > 0))) {
        result = rey_xml_fail_value(b->ctx, node, p->name,
                                    "'%s' holds %zu numbers with the sum %g, expected %s or more that are not all 0", p->name,
                                    list.count, sum, least == 2 ? "two" : "one");
    }
    if (result == REY_OK) {
        result = add_list(b, node, p, list.data, list.count, path, out);
    }
    rey_array_free(b->ctx, &list);
    return result;
}

// A symmetric matrix is positive definite if its leading minors are positive (Sylvester).
static bool is_positive(const float s[6]) {
    double xx = (double)s[0], yy = (double)s[1], zz = (double)s[2], xy = (double)s[3], xz = (double)s[4], yz = (double)s[5];
    double minor = xx * yy - xy * xy;
    double det = zz * minor - xx * yz * yz - yy * xz * xz + 2 * xy * xz * yz;
    return xx > 0 && minor > 0 && det > 0;
}

// A grid of six numbers, or a list of them for everywhere.
static rey_result matrix_slot(Builder *b, rey_xml_node *node, const PhaseParam *p, const char *path, int32_t *out) {
    rey_xml_child *child = rey_xml_child_named(node, p->name);
    Array list = {0};
    int64_t count = 1;
    if (child && child->node->tag == REY_XML_VOLUME) {
        int32_t id;
        TRY(build_volume(b, child->node, phase_use(p), path, &id));
        const VolumeNode *v = &ARRAY_AT(b->scene->build.volumes, VolumeNode, id);
        if (v->channels != 6) {
            return rey_xml_fail(b->ctx, child->at, REY_ERROR_SCENE, "'%s' has %d channels, expected a grid of 6", p->name,
                                v->channels);
        }
        *out = v->texture;
        count = (int64_t)v->nx * v->ny * v->nz;
    } else {
        rey_result result = build_number_list(b, node, p->name, &list);
        if (result == REY_OK && list.count != 6) {
            result = rey_xml_fail_value(b->ctx, node, p->name, "'%s' holds %zu numbers, expected 6", p->name, list.count);
        }
        if (result == REY_OK) {
            result = add_list(b, node, p, list.data, list.count, path, out);
        }
        rey_array_free(b->ctx, &list);
        TRY(result);
    }
    const TextureNode *t = &ARRAY_AT(b->scene->build.textures, TextureNode, *out);
    for (int64_t i = 0; i < count; i++) {
        if (!is_positive(&ARRAY_AT(b->scene->build.theta, float, t->theta + 6 * i))) {
            return rey_xml_fail_value(b->ctx, node, p->name, "'%s' is not positive definite", p->name);
        }
    }
    return REY_OK;
}

static rey_result build_slots(Builder *b, rey_xml_node *node, const PhaseKind *kind, const char *path, PhaseNode *phase) {
    for (int i = 0; i < kind->param_count; i++) {
        const PhaseParam *p = kind->params + i;
        char name[MAX_PATH_NAME];
        build_join(name, path, p->name);
        TRY(kind->children ? rey_xml_require(b->ctx, node, p->name) : REY_OK);
        switch (p->type) {
        case PHASE_PARAM_NUMBER:
            TRY(number_slot(b, node, p, name, &phase->slot[i]));
            break;
        case PHASE_PARAM_TABLE:
        case PHASE_PARAM_WEIGHTS:
            TRY(table_slot(b, node, p, name, &phase->slot[i]));
            break;
        case PHASE_PARAM_MATRIX:
            TRY(matrix_slot(b, node, p, name, &phase->slot[i]));
            break;
        }
    }
    return REY_OK;
}

static rey_result add_phase(Builder *b, PhaseNode phase, int32_t *out) {
    rey_scene *scene = b->scene;
    int32_t size = rey_phase_table_size(scene->build.textures.data, &phase);
    if (size > 0) {
        phase.table = rey_scene_append(scene, &scene->build.tables, sizeof(float), size);
        TRY(phase.table < 0 ? REY_ERROR_MEMORY : REY_OK);
    }
    *out = rey_scene_append(scene, &scene->build.phases, sizeof phase, 1);
    TRY(*out < 0 ? REY_ERROR_MEMORY : REY_OK);
    ARRAY_AT(scene->build.phases, PhaseNode, *out) = phase;
    return REY_OK;
}

static rey_result build_child(Builder *b, rey_xml_node *node, const char *path, int i, int32_t *out) {
    char name[MAX_PATH_NAME], slot[32];
    snprintf(slot, sizeof slot, "phase_%d", i);
    build_join(name, path, slot);
    return build_phase(b, rey_xml_child_of(node, REY_XML_BIT(REY_XML_PHASE), i)->node, name, out);
}

// Any number of functions: each node has one of them and the node with the rest.
static rey_result build_list(Builder *b, rey_xml_node *node, int count, const char *path, PhaseNode *phase) {
    int32_t weights = ARRAY_AT(b->scene->build.textures, TextureNode, phase->slot[0]).width;
    if (count != weights) {
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE, "'%s' has %d weights for %d nested phase functions", node->type,
                            (int)weights, count);
    }
    for (int i = count - 1; i >= 0; i--) {
        TRY(build_child(b, node, path, i, &phase->child[0]));
        if (i > 0) {
            TRY(add_phase(b, *phase, &phase->child[1]));
        }
    }
    return REY_OK;
}

static rey_result build_children(Builder *b, rey_xml_node *node, const PhaseKind *kind, const char *path, PhaseNode *phase) {
    int count = rey_xml_count_children(node, REY_XML_BIT(REY_XML_PHASE));
    if (kind->children == ANY_NUMBER) {
        return build_list(b, node, count, path, phase);
    }
    if (count != kind->children) {
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE, "'%s' takes %d nested phase function%s, found %d", kind->name,
                            kind->children, PLURAL(kind->children), count);
    }
    for (int i = 0; i < count; i++) {
        TRY(build_child(b, node, path, i, &phase->child[i]));
    }
    return REY_OK;
}

rey_result build_phase(Builder *b, rey_xml_node *node, const char *path, int32_t *out) {
    bool first;
    TRY(build_visit(b, node, path, &first));
    if (!first) {
        *out = node->built;
        return REY_OK;
    }
    PhaseNode phase = {.kind = rey_phase_kind_find(node->type), .slot = {-1}, .child = {-1, -1}, .table = -1};
    if (phase.kind < 0) {
        return build_unknown(b, node, phase_word, NULL);
    }
    const PhaseKind *kind = rey_phase_kinds + phase.kind;
    TRY(build_slots(b, node, kind, path, &phase));
    TRY(build_children(b, node, kind, path, &phase));
    TRY(add_phase(b, phase, out));
    node->built = *out;
    TRY(build_check_unused(b, node));
    return build_finish(b, node, path);
}

rey_result build_isotropic_phase(Builder *b, int32_t *out) {
    PhaseNode phase = {.kind = rey_phase_kind_find("isotropic"), .slot = {-1}, .child = {-1, -1}, .table = -1};
    return add_phase(b, phase, out);
}
