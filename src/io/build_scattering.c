// build_scattering.c: media that are written with what scatters and what absorbs. Both stay parameters; the extinction is the
// volume of their sum, which follows them (medium/sum.h), and the share that scatters is their ratio at each point: a grid of
// ratios would say something else between voxels.
#include "io/build.h"

#include <string.h>

enum { SIGMA_S, SIGMA_A, BOTH };
static const char *const names[BOTH] = {"sigma_s", "sigma_a"};

static const VolumeNode *volume_at(const Builder *b, int32_t id) {
    return &ARRAY_AT(b->scene->build.volumes, VolumeNode, id);
}

static rey_result check_words(Builder *b, const rey_xml_node *node) {
    for (int i = 0; i < BOTH; i++) {
        if (!rey_xml_has(node, names[i])) {
            return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE,
                                "'%s' is given without '%s': either both are, 0 where there is none, or 'sigma_t' and 'albedo'",
                                names[1 - i], names[i]);
        }
    }
    return REY_OK;
}

// One of the two. Unlike elsewhere, colours may exceed 1.
static rey_result build_part(Builder *b, rey_xml_node *node, int which, const char *path, int32_t *out) {
    static const char *const texts[BOTH] = {"scattering coefficient", "absorption coefficient"};
    TextureUse use = {REY_COLOUR_UNBOUNDED, true, 0, INFINITY, "1/scene unit", texts[which], 0, NULL};
    char full[MAX_PATH_NAME];
    build_join(full, path, names[which]);
    TRY(build_volume_slot(b, node, names[which], use, 0, full, out));
    int32_t channels = volume_at(b, *out)->channels;
    return channels == 1 || channels == 3 ? REY_OK
                                          : rey_xml_fail_value(b->ctx, node, names[which], "'%s' has %d channels, expected 1 or 3",
                                                               names[which], channels);
}

// Whether the sum of two volumes is a volume, too.
static rey_result check_pair(Builder *b, const rey_xml_node *node, const VolumeNode *s, const VolumeNode *a) {
    const bool grids = s->kind == VOLUME_GRID && a->kind == VOLUME_GRID;
    if (grids && (s->nx != a->nx || s->ny != a->ny || s->nz != a->nz)) {
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE,
                            "'sigma_s' and 'sigma_a' are grids of %d x %d x %d and %d x %d x %d voxels, whose sum is the "
                            "extinction: expected one resolution", s->nx, s->ny, s->nz, a->nx, a->ny, a->nz);
    }
    if (grids && (s->filter != a->filter || s->wrap != a->wrap)) {
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE,
                            "'sigma_s' and 'sigma_a' have different %ss, and their sum is the extinction: expected the same",
                            s->filter != a->filter ? "filter_type" : "wrap_mode");
    }
    if (s->to_world >= 0 && a->to_world >= 0 && s->to_world != a->to_world) {
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE,
                            "the volume of 'sigma_a' belongs to another object as well, and could move away from 'sigma_s': "
                            "expected one that is this medium's alone");
    }
    return REY_OK;
}

// The sum's values come with the first update.
static rey_result build_sum(Builder *b, MediumNode *medium) {
    rey_scene *scene = b->scene;
    const VolumeNode s = *volume_at(b, medium->sigma_s), a = *volume_at(b, medium->sigma_a);
    VolumeNode sum = s.kind == VOLUME_GRID || a.kind != VOLUME_GRID ? s : a;
    const VolumeNode *placed = s.to_world >= 0 ? &s : &a;
    float *theta;
    sum.channels = s.channels > a.channels ? s.channels : a.channels;
    sum.to_world = placed->to_world;
    sum.table = placed->table;
    int64_t count = (int64_t)sum.nx * sum.ny * sum.nz * sum.channels;
    TRY(build_add_texture(b, sum.kind == VOLUME_GRID ? TEXTURE_VOLUME : TEXTURE_CONSTANT, count, &sum.texture, &theta));
    medium->sigma_t = rey_scene_append(scene, &scene->build.volumes, sizeof sum, 1);
    TRY(medium->sigma_t < 0 ? REY_ERROR_MEMORY : REY_OK);
    TextureNode *t = &ARRAY_AT(scene->build.textures, TextureNode, sum.texture);
    t->channels = sum.channels;
    t->filter = sum.filter;
    t->volume = medium->sigma_t;
    sum.theta = t->theta;
    ARRAY_AT(scene->build.volumes, VolumeNode, medium->sigma_t) = sum;
    return REY_OK;
}

rey_result build_scattering(Builder *b, rey_xml_node *node, const char *path, MediumNode *medium) {
    if (rey_xml_has(node, "sigma_t") || rey_xml_has(node, "albedo")) {
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE,
                            "either 'sigma_t' and 'albedo' or 'sigma_s' and 'sigma_a' may be given, not both");
    }
    TRY(check_words(b, node));
    medium->albedo = -1;
    TRY(build_part(b, node, SIGMA_S, path, &medium->sigma_s));
    b->beside = volume_at(b, medium->sigma_s)->to_world >= 0 ? medium->sigma_s + 1 : 0;
    rey_result result = build_part(b, node, SIGMA_A, path, &medium->sigma_a);
    b->beside = 0;
    TRY(result);
    TRY(check_pair(b, node, volume_at(b, medium->sigma_s), volume_at(b, medium->sigma_a)));
    return build_sum(b, medium);
}
