// texture_steps.c: follows textures and nested scattering functions to find what jumps.
#include "render/texture_steps.h"

#include "bsdf/table.h"
#include "emitter/emitter.h"
#include "emitter/table.h"
#include "render/boundary.h"
#include "shape/shape.h"

#include <math.h>

static bool jumps_itself(const TextureNode *t) {
    return t->kind == TEXTURE_CHECKERBOARD || (t->kind == TEXTURE_ATTRIBUTE && t->per_face) ||
           ((t->kind == TEXTURE_BITMAP || t->kind == TEXTURE_VOLUME) && t->filter == FILTER_NEAREST);
}

static bool texture_jumps(const SceneView *view, int32_t id) {
    return id >= 0 && (jumps_itself(view->textures + id) || texture_jumps(view, view->textures[id].child[0]) ||
                       texture_jumps(view, view->textures[id].child[1]));
}

const char *rey_spots_gap(const SceneView *view, const Param *p) {
    for (int64_t i = 0; i < view->emitters_count; i++) {
        const EmitterRecord *e = view->emitters + i;
        if (e->kind != EMITTER_SPOT || !texture_jumps(view, e->slot[SLOT(Spot, texture)])) {
            continue;
        }
        if (p->texture >= 0 && e->slot[SLOT(Spot, cutoff_angle)] == p->texture) {
            return "the lines along which a spot's texture jumps move with its cutoff_angle";
        }
    }
    return NULL;
}

const char *rey_texture_unknown_step(const SceneView *view, int term, int32_t *texture) {
    // Vertices move over their surfaces where the sensor sees them, and along chains; others are attached to them.
    const bool film = term != REY_TERM_INDIRECT;
    for (int32_t i = 0; i < (int32_t)view->textures_count && film; i++) {
        if (view->textures[i].kind == TEXTURE_VOLUME && jumps_itself(view->textures + i)) {
            *texture = i;
            return "the jumps of volumes with filter_type=\"nearest\"";
        }
    }
    for (int64_t i = 0; i < view->emitters_count && film; i++) {
        const EmitterRecord *e = view->emitters + i;
        const EmitterKind *kind = rey_emitter_kinds + e->kind;
        bool known = e->kind == EMITTER_PROJECTOR || e->kind == EMITTER_SPOT; // light_borders.c
        for (int k = 0; k < kind->param_count && e->shape < 0 && !known; k++) {
            *texture = kind->params[k].type < EMITTER_PARAM_POSITION ? e->slot[k] : -1;
            if (texture_jumps(view, *texture)) {
                return "the jumps of the textures of lights that are no surfaces";
            }
        }
    }
    return NULL;
}

// Whether a texture, or its slope, jumps along lines that a selection moves: to_uv_at as in rey_texture_steps.
static bool has_lines(const SceneView *view, const int32_t *to_uv_at, int32_t id, bool slopes) {
    const TextureNode *t = view->textures + id;
    return id >= 0 && ((to_uv_at[id] >= 0 && (slopes ? t->kind == TEXTURE_BITMAP : jumps_itself(t))) ||
                       has_lines(view, to_uv_at, t->child[0], slopes) || has_lines(view, to_uv_at, t->child[1], slopes));
}

static bool bsdf_has_lines(const SceneView *view, const int32_t *to_uv_at, int32_t id) {
    const BsdfNode *node = view->bsdfs + id;
    bool found = false;
    for (int k = 0; id >= 0 && k < MAX_SLOTS; k++) {
        found |= has_lines(view, to_uv_at, node->slot[k], rey_bsdf_takes_slope(node->kind, k));
    }
    for (int k = 0; id >= 0 && k < MAX_CHILDREN; k++) {
        found |= bsdf_has_lines(view, to_uv_at, node->child[k]);
    }
    return found;
}

static bool emitter_has_lines(const SceneView *view, const int32_t *to_uv_at, int32_t id) {
    bool found = false;
    for (int k = 0; id >= 0 && k < rey_emitter_kinds[view->emitters[id].kind].param_count; k++) {
        bool texture = rey_emitter_kinds[view->emitters[id].kind].params[k].type < EMITTER_PARAM_POSITION;
        found |= texture && has_lines(view, to_uv_at, view->emitters[id].slot[k], false);
    }
    return found;
}

bool rey_lines_selected(const SceneView *view, const int32_t *to_uv_at) {
    bool found = false;
    for (int32_t i = 0; i < (int32_t)view->bsdfs_count && !found; i++) {
        found = bsdf_has_lines(view, to_uv_at, i);
    }
    for (int32_t i = 0; i < (int32_t)view->emitters_count && !found; i++) {
        found = emitter_has_lines(view, to_uv_at, i);
    }
    return found;
}

const char *rey_lines_unknown(const SceneView *view, const int32_t *to_uv_at, int32_t *bsdf, int32_t *emitter, int32_t *shape) {
    *bsdf = *emitter = *shape = -1;
    for (int32_t i = 0; i < (int32_t)view->bsdfs_count; i++) {
        for (int k = 0; k < MAX_SLOTS && rey_bsdf_opens(view->bsdfs[i].kind); k++) {
            if (has_lines(view, to_uv_at, view->bsdfs[i].slot[k], false)) {
                *bsdf = i;
                return "the jumps of opacities";
            }
        }
    }
    for (int32_t i = 0; i < (int32_t)view->emitters_count; i++) {
        bool area = view->emitters[i].kind == EMITTER_AREA;
        if (!area && emitter_has_lines(view, to_uv_at, i)) {
            *emitter = i;
            return "the jumps of the textures of lights of other kinds than 'area'";
        }
    }
    for (int32_t i = 0; i < (int32_t)view->shapes_count; i++) {
        const ShapeRecord *s = view->shapes + i;
        bool known = s->kind == SHAPE_MESH || s->kind == SHAPE_SPHERE || s->kind == SHAPE_DISK || s->kind == SHAPE_CYLINDER;
        if (!known && (bsdf_has_lines(view, to_uv_at, s->bsdf) || emitter_has_lines(view, to_uv_at, s->emitter))) {
            *shape = i;
            return "the lines along which textures jump on curves and grids of distances";
        }
    }
    return NULL;
}

// Which textures of a shape have been met.
typedef struct Steps {
    rey_scene *scene;
    const int32_t *to_uv_at;
    Array *steps;
    size_t first;
    int32_t shape;
    bool varies; // with uv
    bool oriented; // with the direction of the tangents
    bool framed;   // with all of the parameterisation
} Steps;

static rey_result push_step(Steps *s, TextureStep step) {
    step.shape = s->shape;
    for (size_t i = s->first; i < s->steps->count; i++) {
        const TextureStep *t = &ARRAY_AT(*s->steps, TextureStep, i);
        bool parts = step.sort == STEP_LINES && t->at != step.at;
        if (!parts && t->sort == step.sort && t->u == step.u && t->v == step.v && t->offset == step.offset && t->low == step.low &&
            t->high == step.high) {
            return REY_OK;
        }
    }
    TextureStep *one = rey_array_push(s->scene->ctx, s->steps, sizeof *one, 1);
    if (!one) {
        return REY_ERROR_MEMORY;
    }
    *one = step;
    return REY_OK;
}

// Beyond it doubles do not tell apart what lies NEARLY (marks.c) on a line, and lines could not be counted one by one.
static const double LARGEST_LEVEL = 1e12;

static rey_result fail_large(const Steps *s, int32_t id) {
    const char *name = "";
    for (size_t i = 0; i < s->scene->params.count; i++) {
        const Param *p = &ARRAY_AT(s->scene->params, Param, i);
        name = p->to_uv == id ? p->name : name;
    }
    return rey_fail(s->scene->ctx, REY_ERROR_UNSUPPORTED, "the texture jumps along lines that are too many or too far away to be "
                    "found: %s has numbers beyond %g over its width or height in texels", name, LARGEST_LEVEL);
}

// Lines x' = level / width and y' = level / height, (x', y') = to_uv (x, y); with `slopes`, half a texel further, where those of
// bilinear filtering jump. Behind the border of a picture that is clamped nothing jumps.
static rey_result push_grid(Steps *s, int32_t id, int32_t width, int32_t height, bool clamped, bool slopes) {
    static const float identity[6] = {1, 0, 0, 0, 1, 0};
    const TextureNode *t = s->scene->view.textures + id;
    const float *m = t->to_uv >= 0 ? s->scene->view.theta + t->to_uv : identity;
    int32_t first = s->to_uv_at ? s->to_uv_at[id] : -1;
    rey_result result = REY_OK;
    for (int k = 0; k < 2 && result == REY_OK; k++) {
        double n = k ? height : width;
        if (!(n * ((double)fabsf(m[3 * k]) + (double)fabsf(m[3 * k + 1]) + (double)fabsf(m[3 * k + 2])) <= LARGEST_LEVEL)) {
            return fail_large(s, id);
        }
        result = push_step(s, (TextureStep){.sort = STEP_LINES, .at = first < 0 ? -1 : first + 3 * k, .scale = n,
                                            .u = n * (double)m[3 * k], .v = n * (double)m[3 * k + 1],
                                            .offset = n * (double)m[3 * k + 2] - (slopes ? 0.5 : 0),
                                            .low = !clamped ? -INFINITY : slopes ? 0 : 1,
                                            .high = clamped ? n - 1 : INFINITY});
    }
    return result;
}

// slopes: it is the slope that is looked up (texture_gradient.h).
static rey_result add_texture(Steps *s, int32_t id, bool slopes) {
    if (id < 0) {
        return REY_OK;
    }
    const TextureNode *t = s->scene->view.textures + id;
    rey_result result = REY_OK;
    s->varies |= t->kind == TEXTURE_BITMAP || t->kind == TEXTURE_CHECKERBOARD;
    if (t->kind == TEXTURE_CHECKERBOARD) {
        result = push_grid(s, id, 2, 2, false, false);
    } else if (t->kind == TEXTURE_BITMAP && (t->filter == FILTER_NEAREST) != slopes) { // those of nearest texels are 0
        result = push_grid(s, id, t->width, t->height, t->wrap == WRAP_CLAMP, slopes);
    } else if (t->kind == TEXTURE_ATTRIBUTE && t->per_face) {
        result = push_step(s, (TextureStep){.sort = STEP_FACES, .at = -1});
    }
    for (int k = 0; k < 2 && result == REY_OK; k++) {
        result = add_texture(s, t->child[k], slopes);
    }
    return result;
}

static rey_result add_bsdf(Steps *s, int32_t id) {
    const BsdfNode *node = s->scene->view.bsdfs + id;
    rey_result result = REY_OK;
    s->oriented |= id >= 0 && rey_bsdf_oriented(&s->scene->view, node);
    s->framed |= id >= 0 && node->surface;
    for (int k = 0; id >= 0 && k < MAX_SLOTS && result == REY_OK; k++) {
        result = add_texture(s, node->slot[k], rey_bsdf_takes_slope(node->kind, k));
    }
    for (int k = 0; id >= 0 && k < MAX_CHILDREN && result == REY_OK; k++) {
        result = add_bsdf(s, s->scene->view.bsdfs[id].child[k]);
    }
    return result;
}

static rey_result add_emitter(Steps *s, int32_t id) {
    const EmitterRecord *e = s->scene->view.emitters + id;
    const EmitterKind *kind = id >= 0 ? rey_emitter_kinds + e->kind : NULL;
    rey_result result = REY_OK;
    for (int k = 0; kind && k < kind->param_count && result == REY_OK; k++) {
        result = kind->params[k].type < EMITTER_PARAM_POSITION ? add_texture(s, e->slot[k], false) : REY_OK;
    }
    return result;
}

rey_result rey_texture_steps(rey_scene *scene, const int32_t *to_uv_at, Array *steps) {
    rey_result result = REY_OK;
    for (int32_t i = 0; i < scene->view.shapes_count && result == REY_OK; i++) {
        const ShapeRecord *shape = scene->view.shapes + i;
        Steps s = {.scene = scene, .to_uv_at = to_uv_at, .steps = steps, .first = steps->count, .shape = i};
        if (shape->flags & SHAPE_UNSEEN) {
            continue;
        }
        result = add_bsdf(&s, shape->bsdf);
        result = result == REY_OK ? add_emitter(&s, shape->emitter) : result;
        if (result == REY_OK && s.varies) {
            result = push_step(&s, (TextureStep){.sort = STEP_SEAMS, .at = -1});
        }
        if (result == REY_OK && s.oriented) {
            result = push_step(&s, (TextureStep){.sort = STEP_TANGENTS, .at = -1});
        }
        if (result == REY_OK && s.framed) {
            result = push_step(&s, (TextureStep){.sort = STEP_FRAMES, .at = -1});
        }
    }
    return result;
}

rey_result rey_light_steps(rey_scene *scene, int32_t texture, Array *steps) {
    Steps s = {.scene = scene, .steps = steps, .first = steps->count, .shape = -1};
    return add_texture(&s, texture, false);
}

StepRecord rey_step_record(const TextureStep *s) {
    return (StepRecord){(float)s->u, (float)s->v, (float)s->offset, (float)s->low, (float)s->high, (float)s->scale, s->sort, s->at};
}

rey_result rey_texture_step_records(rey_scene *scene, const int32_t *to_uv_at, Array *records, Array *step_at) {
    Array steps = {0};
    rey_result result = rey_texture_steps(scene, to_uv_at, &steps);
    size_t count = (size_t)scene->view.shapes_count, k = 0;
    if (result == REY_OK && steps.count > 0) {
        StepRecord *to = rey_array_push(scene->ctx, records, sizeof *to, steps.count);
        int32_t *at = to ? rey_array_push(scene->ctx, step_at, sizeof *at, count + 1) : NULL;
        for (size_t i = 0; at && i <= count; i++) {
            at[i] = (int32_t)k;
            for (; k < steps.count && ARRAY_AT(steps, TextureStep, k).shape == (int32_t)i; k++) {
                to[k] = rey_step_record(&ARRAY_AT(steps, TextureStep, k));
            }
        }
        result = at ? REY_OK : REY_ERROR_MEMORY;
    }
    rey_array_free(scene->ctx, &steps);
    return result;
}
