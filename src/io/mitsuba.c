// mitsuba.c: loads a Mitsuba 3 scene: walks the document in order, names what it finds, and freezes the flat scene.
#include "bsdf/ends.h"
#include "emitter/table.h"
#include "io/build.h"
#include "io/lenient.h"
#include "io/load.h"
#include "io/mitsuba.h"
#include "io/xml_parts.h"

#include <stdio.h>
#include <string.h>

void build_join(char out[MAX_PATH_NAME], const char *a, const char *b) {
    snprintf(out, MAX_PATH_NAME, "%s%s%s", a, *a ? "." : "", b);
}

// Names every parameter of a node, whose names begin with `from`, under `to` as well.
static rey_result alias_prefix(Builder *b, const rey_xml_node *node, const char *from, const char *to) {
    const NodeNames *names = &ARRAY_AT(b->names, NodeNames, node->index);
    size_t length = strlen(from), params = names->params ? names->params : b->scene->params.count;
    size_t aliases = names->params ? names->aliases : b->scene->aliases.count;
    if (strcmp(from, to) == 0) {
        return REY_OK;
    }
    for (size_t i = names->first_param; i < params; i++) {
        const char *name = ARRAY_AT(b->scene->params, Param, i).name;
        if (strncmp(name, from, length) == 0 && name[length] == '.') {
            char alias[MAX_PATH_NAME];
            build_join(alias, to, name + length + 1);
            TRY(rey_scene_add_alias(b->scene, alias, (int)i));
        }
    }
    for (size_t i = names->first_alias; i < aliases; i++) {
        Alias old = ARRAY_AT(b->scene->aliases, Alias, i);
        if (strncmp(old.name, from, length) == 0 && old.name[length] == '.') {
            char alias[MAX_PATH_NAME];
            build_join(alias, to, old.name + length + 1);
            TRY(rey_scene_add_alias(b->scene, alias, old.param));
        }
    }
    return REY_OK;
}

rey_result build_name(Builder *b, rey_xml_node *node, const char *path) {
    char **kept = &ARRAY_AT(b->source->paths, char *, node->index);
    if (*kept) {
        return REY_OK;
    }
    ARRAY_AT(b->names, NodeNames, node->index) =
        (NodeNames){.first_param = b->scene->params.count, .first_alias = b->scene->aliases.count};
    rey_xml_node **named = rey_array_push(b->ctx, &b->named, sizeof *named, 1);
    if (named) {
        *named = node;
        *kept = rey_strdup(b->ctx, path);
    }
    return *kept ? REY_OK : REY_ERROR_MEMORY;
}

rey_result build_visit(Builder *b, rey_xml_node *node, const char *path, bool *first) {
    const char *former = ARRAY_AT(b->source->paths, char *, node->index);
    *first = node->built < 0;
    if (!*first) {
        return former ? alias_prefix(b, node, former, path) : REY_OK;
    }
    return build_name(b, node, path);
}

rey_result build_finish(Builder *b, rey_xml_node *node, const char *path) {
    NodeNames *names = &ARRAY_AT(b->names, NodeNames, node->index);
    names->params = b->scene->params.count;
    names->aliases = b->scene->aliases.count;
    return node->id ? alias_prefix(b, node, path, node->id) : REY_OK;
}

rey_result build_pose(Builder *b, const double matrix[16], const char *path, Param p, int32_t *out) {
    char name[MAX_PATH_NAME];
    *out = rey_scene_append(b->scene, &b->scene->build.theta, sizeof(float), 16);
    if (*out < 0) {
        return REY_ERROR_MEMORY;
    }
    for (int k = 0; k < 16; k++) {
        ARRAY_AT(b->scene->build.theta, float, *out + k) = (float)matrix[k];
    }
    p.theta = *out;
    p.count = 16;
    p.dims = 2;
    p.shape[0] = p.shape[1] = 4;
    p.description = "pose: local to world, row-major";
    build_join(name, path, "to_world");
    return rey_scene_add_param(b->scene, name, p) < 0 ? REY_ERROR_MEMORY : REY_OK;
}

// Stable name of a top-level object: its id, or its class with a running number.
static void top_level_name(const rey_xml_node *node, int counts[REY_XML_TAG_COUNT], char out[MAX_PATH_NAME]) {
    int number = counts[node->tag]++;
    if (node->id) {
        snprintf(out, MAX_PATH_NAME, "%s", node->id);
    } else {
        snprintf(out, MAX_PATH_NAME, "%s_%d", rey_xml_tag_name(node->tag), number);
    }
}

static rey_result build_child(Builder *b, rey_xml_child *child, int counts[REY_XML_TAG_COUNT]) {
    rey_xml_node *node = child->node;
    char name[MAX_PATH_NAME];
    int32_t unused;
    child->used = true;
    top_level_name(node, counts, name);
    switch (node->tag) {
    case REY_XML_BSDF:
        return build_bsdf(b, node, name, &unused);
    case REY_XML_SHAPE:
        return build_shape(b, node, name);
    case REY_XML_EMITTER:
        return build_emitter(b, node, -1, name, &unused);
    case REY_XML_SENSOR:
        return build_sensor(b, node, -1, name);
    case REY_XML_TEXTURE:
    case REY_XML_SPECTRUM: {
        TextureUse use = {REY_COLOUR_UNBOUNDED, false, -INFINITY, INFINITY, "", "texture", 0, NULL};
        return build_texture(b, node, use, name, &unused);
    }
    case REY_XML_INTEGRATOR:
        if (b->scene->integrator) {
            return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE, "a scene can have only one integrator");
        }
        return build_integrator(b, node);
    case REY_XML_VOLUME: {
        TextureUse use = {REY_COLOUR_UNBOUNDED, true, -INFINITY, INFINITY, "", "values over space", 0, NULL};
        return build_volume(b, node, use, name, &unused);
    }
    case REY_XML_PHASE:
        return build_phase(b, node, name, &unused);
    case REY_XML_MEDIUM:
        return build_medium(b, node, name, &unused);
    default:
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE, "a %s cannot stand at the top level of a scene",
                            rey_xml_tag_name(node->tag));
    }
}

// Whether a scattering function, or one inside of it, is of such a kind (bsdf/table.h). There is no view yet.
static bool kind_within(const rey_scene *scene, int32_t bsdf, bool (*is)(int kind)) {
    const BsdfNode *node = &ARRAY_AT(scene->build.bsdfs, BsdfNode, bsdf);
    bool within = is(node->kind);
    for (int i = 0; i < MAX_CHILDREN && !within; i++) {
        within = node->child[i] >= 0 && kind_within(scene, node->child[i], is);
    }
    return within;
}

// Whether a texture turns the normals of a function that bends paths.
static bool texture_turns_mirror(const rey_scene *scene, int32_t texture) {
    bool turns = false;
    for (size_t i = 0; i < scene->build.bsdfs.count && !turns; i++) {
        const BsdfNode *node = &ARRAY_AT(scene->build.bsdfs, BsdfNode, i);
        if (!rey_bsdf_turns(node->kind) || !kind_within(scene, (int32_t)i, rey_bsdf_bends)) {
            continue;
        }
        for (int k = 0; k < MAX_SLOTS; k++) {
            const TextureNode *t = node->slot[k] >= 0 && node->slot[k] < (int32_t)scene->build.textures.count
                                       ? &ARRAY_AT(scene->build.textures, TextureNode, node->slot[k])
                                       : NULL;
            turns |= t && (node->slot[k] == texture || t->child[0] == texture || t->child[1] == texture);
        }
    }
    return turns;
}

// In scenes with media, surfaces that light passes undeviated and undimmed only separate media.
static bool only_separates(const rey_scene *scene, const ShapeRecord *shape) {
    return scene->view.has_media && rey_bsdf_passes(ARRAY_AT(scene->build.bsdfs, BsdfNode, shape->bsdf).kind);
}

// Whether a parameter moves nothing else.
static bool moves_border(const rey_scene *scene, const Param *p) {
    bool all = scene->view.has_media && (p->geometry >= 0 || p->instance >= 0);
    for (size_t i = 0; i < scene->build.shapes.count && all; i++) {
        const ShapeRecord *shape = &ARRAY_AT(scene->build.shapes, ShapeRecord, i);
        bool moves = p->geometry >= 0 ? p->geometry == (int32_t)i
                                      : shape->collection == ARRAY_AT(scene->build.instances, InstanceRecord, p->instance).group;
        all = !moves || (only_separates(scene, shape) && shape->emitter < 0);
    }
    return all;
}

static void mark_used(const rey_scene *scene, int32_t bsdf) {
    BsdfNode *node = &ARRAY_AT(scene->build.bsdfs, BsdfNode, bsdf);
    node->used = 1;
    for (int i = 0; i < MAX_CHILDREN; i++) {
        if (node->child[i] >= 0 && !ARRAY_AT(scene->build.bsdfs, BsdfNode, node->child[i]).used) {
            mark_used(scene, node->child[i]);
        }
    }
}

// Behind smooth mirrors and glass, and behind surfaces that let paths pass, what moves needs a term of its own, and so do normals
// that turn, of such mirrors and of what these show; what moves needs another where the normals of maps turn away from the viewer.
// Scattering functions that no shape has do not count.
static void name_further_terms(Builder *b) {
    rey_scene *scene = b->scene;
    bool bends = false, turns = false;
    for (size_t i = 0; i < scene->build.shapes.count; i++) {
        const ShapeRecord *shape = &ARRAY_AT(scene->build.shapes, ShapeRecord, i);
        mark_used(scene, shape->bsdf);
        bends |= kind_within(scene, shape->bsdf, rey_bsdf_bends) && !only_separates(scene, shape);
        turns |= ARRAY_AT(scene->build.bsdfs, BsdfNode, shape->bsdf).turns != 0;
    }
    const int moving = (bends ? REY_TERM_SPECULAR : 0) | (turns ? REY_TERM_TERMINATOR : 0);
    for (size_t i = 0; i < scene->params.count; i++) {
        Param *p = &ARRAY_AT(scene->params, Param, i);
        p->terms |= p->geometry >= 0 || p->instance >= 0 || p->camera >= 0 || p->normals >= 0 ? moving : 0;
        p->terms |= p->to_uv >= 0 && (p->terms & REY_TERM_PRIMARY) ? moving & REY_TERM_SPECULAR : 0; // lines of textures
        p->terms |= p->emitter >= 0 && (p->terms & REY_TERM_INDIRECT) ? moving & REY_TERM_SPECULAR : 0; // its shadows
        int32_t texture = p->texture >= 0 ? p->texture : p->to_uv;
        bool mirror = (p->terms & REY_TERM_TERMINATOR) && texture >= 0 && texture_turns_mirror(scene, texture);
        p->terms |= mirror ? REY_TERM_SPECULAR : 0;
        p->terms |= p->terms & REY_TERM_SPECULAR ? REY_TERM_INDIRECT : 0; // what chains turn moves shadows of what lies behind them
        p->terms = moves_border(scene, p) ? REY_TERM_INTERIOR : p->terms;
    }
}

// Whether a parameter moves the ends of one of these functions, which shapes have.
static bool moves_ends(const rey_scene *scene, const Param *p, const Array *bsdfs) {
    const bool all = p->geometry >= 0 || p->instance >= 0 || p->camera >= 0;
    bool moves = false;
    for (size_t i = 0; i < bsdfs->count && !moves; i++) {
        const int32_t shape = ARRAY_AT(*bsdfs, int32_t, i);
        moves = all || rey_bsdf_ends_move(&scene->view, scene->view.shapes[shape].bsdf, p, p->normals == shape);
    }
    return moves;
}

// Finds the parameters that move the ends of rough refraction in the light of a point or of one direction, which scattering does
// not find: there they are curves like those of the terms of what moves.
static rey_result name_rims(Builder *b) {
    rey_scene *scene = b->scene;
    Array ending = {0};
    bool sharp = false;
    for (int64_t i = 0; i < scene->view.emitters_count; i++) {
        sharp |= rey_emitter_kinds[scene->view.emitters[i].kind].form == EMITTER_IS_DELTA;
    }
    for (int32_t i = 0; i < scene->view.shapes_count && sharp; i++) {
        if (!rey_bsdf_ends_within(&scene->view, scene->view.shapes[i].bsdf)) {
            continue;
        }
        int32_t *shape = rey_array_push(b->ctx, &ending, sizeof *shape, 1);
        if (!shape) {
            rey_array_free(b->ctx, &ending);
            return REY_ERROR_MEMORY;
        }
        *shape = i;
    }
    for (size_t i = 0; i < scene->params.count && ending.count > 0; i++) {
        Param *p = &ARRAY_AT(scene->params, Param, i);
        const EmitterRecord *e = p->emitter >= 0 ? scene->view.emitters + p->emitter : NULL;
        const bool light = e && rey_emitter_kinds[e->kind].form == EMITTER_IS_DELTA;
        // What turns mirrored and refracted rays moves what they see.
        const bool points = p->geometry >= 0 || p->instance >= 0 || p->camera >= 0 || (!e && (p->terms & REY_TERM_SPECULAR));
        p->moves_rims = light || (points && p->terms != REY_TERM_INTERIOR) || moves_ends(scene, p, &ending);
        p->why = p->moves_rims && !p->why ? "it moves where rough refraction ends, and with it the light of points and of single "
                                            "directions" : p->why;
        p->terms |= p->moves_rims && p->terms ? REY_TERM_PRIMARY | REY_TERM_INDIRECT : 0;
    }
    rey_array_free(b->ctx, &ending);
    return REY_OK;
}

// A scene whose integrator could not be read is rendered by the usual one.
static rey_result replace_integrator(Builder *b, const rey_xml_node *root) {
    bool ignored = false;
    for (int i = 0; i < root->child_count; i++) {
        ignored = ignored || (root->children[i].ignored && root->children[i].node->tag == REY_XML_INTEGRATOR);
    }
    return ignored && !b->scene->integrator ? build_default_integrator(b) : REY_OK;
}

// Does a scattering function let light pass and scatter it, too?
static bool passes(const Builder *b, int32_t id, bool *mixed) {
    const BsdfNode *bsdf = &ARRAY_AT(b->scene->build.bsdfs, BsdfNode, id);
    const char *name = rey_bsdf_kinds[bsdf->kind].name;
    bool through = strcmp(name, "null") == 0 || strcmp(name, "thindielectric") == 0 || strcmp(name, "mask") == 0;
    for (int i = 0; i < MAX_CHILDREN && bsdf->child[i] >= 0; i++) {
        through = passes(b, bsdf->child[i], mixed) || through;
    }
    *mixed = *mixed || (through && bsdf->child[0] >= 0);
    return through;
}

// What `path` drops is dropped only where a surface can have scattered light to the camera and let the path pass.
static void find_drops(Builder *b) {
    bool mixed = false;
    for (size_t i = 0; i < b->scene->build.bsdfs.count; i++) {
        passes(b, (int32_t)i, &mixed);
    }
    for (size_t i = 0; i < b->scene->integrators.count; i++) {
        Integrator *integrator = &ARRAY_AT(b->scene->integrators, Integrator, i);
        integrator->drops = integrator->drops && integrator->hide_emitters && mixed;
    }
}

const char *rey_mitsuba_file(const rey_scene *scene) {
    const SceneSource *source = scene->document;
    const char *file = source ? rey_xml_root(source->document)->at.file : NULL;
    return file ? file : "scene";
}

// <alias>: parameters under the further names of what they belong to.
static rey_result name_aliases(Builder *b) {
    const XmlIds *ids = &b->source->document->ids;
    for (size_t i = 0; i < ids->capacity; i++) {
        const XmlId *id = &ids->slots[i];
        const char *path = id->id ? ARRAY_AT(b->source->paths, char *, id->node->index) : NULL;
        if (path && id->node->id && strcmp(id->id, id->node->id) != 0) {
            TRY(alias_prefix(b, id->node, path, id->id));
        }
    }
    return REY_OK;
}

// An area light among the scene's own objects is there for shapes to refer to.
static rey_result note_loose_light(Builder *b, const rey_xml_node *node) {
    int kind = node->tag == REY_XML_EMITTER ? rey_emitter_kind_find(node->type) : -1;
    bool loose = kind >= 0 && rey_emitter_kinds[kind].form == EMITTER_IS_SURFACE;
    for (size_t i = 0; i < b->scene->build.emitters.count && loose; i++) {
        const EmitterRecord *e = &ARRAY_AT(b->scene->build.emitters, EmitterRecord, i);
        loose = e->kind != kind || e->slot[0] != node->built;
    }
    return loose ? rey_scene_add_note(b->scene, "warning: %s:%d: this '%s' light belongs to no shape and lights nothing: expected "
                                      "within a <shape>, or a <ref> to it there", node->at.file, node->at.line, node->type)
                 : REY_OK;
}

static rey_result build_scene(Builder *b) {
    rey_xml_node *root = rey_xml_root(b->source->document);
    int counts[REY_XML_TAG_COUNT] = {0};
    if (root->tag != REY_XML_SCENE) {
        return rey_xml_fail(b->ctx, root->at, REY_ERROR_SCENE, "the root element is <%s>, expected <scene>",
                            rey_xml_tag_name(root->tag));
    }
    for (int i = 0; i < root->child_count; i++) {
        Snapshot s = build_snapshot(b);
        rey_xml_child *child = &root->children[i];
        int before[REY_XML_TAG_COUNT];
        rey_result result;
        memcpy(before, counts, sizeof before);
        for (bool again = true; again;) {
            memcpy(counts, before, sizeof before);
            result = build_child(b, child, counts);
            result = build_take_out(b, &s, child->node, result, &again);
        }
        TRY(build_forgive(b, &s, child, "", result, NULL));
    }
    for (int i = 0; i < root->child_count; i++) {
        TRY(note_loose_light(b, root->children[i].node));
    }
    TRY(replace_integrator(b, root));
    const char *note, *ignored;
    for (int i = 0; (ignored = rey_xml_ignored(b->source->document, i)); i++) {
        TRY(build_remember(b, ignored, ""));
    }
    for (int i = 0; (note = rey_xml_note(b->source->document, i)); i++) {
        TRY(rey_scene_add_note(b->scene, "%s", note));
    }
    TRY(build_check_unused(b, root));
    TRY(name_aliases(b));
    TRY(build_attribute_tables(b));
    find_drops(b);
    TRY(build_media_use(b));
    if (b->scene->integrator) {
        rey_scene_use(b->scene, 0);
    }
    name_further_terms(b);
    b->scene->view.emitter_cdf = rey_scene_append(b->scene, &b->scene->build.tables, sizeof(float),
                                                  (int64_t)b->scene->build.emitters.count);
    TRY(b->scene->view.emitter_cdf < 0 ? REY_ERROR_MEMORY : REY_OK);
    TRY(rey_scene_freeze(b->scene));
    TRY(name_rims(b));
    return build_note_ranges(b);
}

static void source_free(void *document) {
    SceneSource *source = document;
    rey_xml_free(source->ctx, source->document);
    rey_array_free(source->ctx, &source->textures);
    rey_array_free(source->ctx, &source->shapes);
    rey_array_free(source->ctx, &source->attributes);
    for (size_t i = 0; i < source->paths.count; i++) {
        rey_free(source->ctx, ARRAY_AT(source->paths, char *, i));
    }
    rey_array_free(source->ctx, &source->paths);
    for (size_t i = 0; i < source->ignored.count; i++) {
        rey_free(source->ctx, ARRAY_AT(source->ignored, char *, i));
    }
    rey_array_free(source->ctx, &source->ignored);
    rey_free(source->ctx, source);
}

rey_result rey_mitsuba_load(rey_context *ctx, const char *path, const rey_define *defines, int define_count, int flags,
                            rey_scene **out) {
    Builder b = {.ctx = ctx, .collection = -1, .lenient = (flags & LOAD_LENIENT) != 0};
    const int xml_flags = (flags ? REY_XML_SPARE : 0) | (b.lenient ? REY_XML_LENIENT : 0);
    *out = NULL;
    TRY(rey_scene_new(ctx, &b.scene));
    b.source = rey_alloc(ctx, sizeof *b.source);
    rey_result result = b.source ? REY_OK : REY_ERROR_MEMORY;
    if (result == REY_OK) {
        b.source->ctx = ctx;
        b.scene->document = b.source;
        b.scene->document_free = source_free;
        result = rey_xml_read_with(ctx, path, defines, define_count, xml_flags, &b.source->document);
    }
    if (result == REY_OK) {
        size_t nodes = (size_t)rey_xml_node_count(b.source->document);
        bool room = rey_array_push(ctx, &b.source->paths, sizeof(char *), nodes) &&
                    rey_array_push(ctx, &b.names, sizeof(NodeNames), nodes);
        result = room ? REY_OK : REY_ERROR_MEMORY;
    }
    if (result == REY_OK) {
        result = load_ahead(ctx, b.source->document, &b.ahead);
    }
    if (result == REY_OK) {
        result = build_scene(&b);
    }
    load_ahead_free(ctx, b.ahead);
    rey_array_free(ctx, &b.attribute_uses);
    rey_array_free(ctx, &b.named);
    rey_array_free(ctx, &b.names);
    rey_array_free(ctx, &b.texture_params);
    rey_free(ctx, b.groups.slots);
    if (result != REY_OK) {
        rey_scene_destroy(b.scene);
        return result;
    }
    *out = b.scene;
    return REY_OK;
}

const Array *rey_mitsuba_ignored(const rey_scene *scene) {
    const SceneSource *source = scene->document;
    return &source->ignored;
}
