// table.h: the scattering functions as data, for the reader, the writer, the documentation and the tests; and what they
// derive from their parameters.
#pragma once

#include "scene/kind.h"

enum { REFLECTS, TRANSMITS };

typedef struct BsdfKind {
    const char *name;
    const ParamDesc *params;
    int param_count;
    const ConfigDesc *configs;
    int config_count;
    int fewest_children, most_children;
    const char *child; // name of the children in parameter paths; numbered when there can be several
    bool adapter;
    bool transmits; // by itself, not through its children
    const char *reference;
} BsdfKind;

extern const BsdfKind rey_bsdf_kinds[];
extern const int rey_bsdf_kind_count;
int rey_bsdf_kind_find(const char *name); // -1 when unknown

// Whether paths go on from it in a direction that follows from where they came: by themselves, not through children.
bool rey_bsdf_bends(int kind);
// Whether light from other than single directions is scattered: by the function itself, not by its children.
bool rey_bsdf_spreads(int kind);
// Whether it scatters into lobes about single directions, which may be narrow: by itself, not through children.
bool rey_bsdf_glossy(int kind);
// Whether smooth surfaces of a kind turn paths into other directions by themselves.
bool rey_bsdf_mirrors(int kind);
// Whether smooth surfaces of a kind refract.
bool rey_bsdf_refracts(int kind);
// Kinds that let a part of the light pass undeviated.
bool rey_bsdf_opens(int kind);
// Kinds of which more or less light passes undeviated than paths do.
bool rey_bsdf_tints(int kind);
// Whether light passes it undeviated and undimmed.
bool rey_bsdf_passes(int kind);
// Whether nothing but the surface has a part in the density of directions.
bool rey_bsdf_samples_alike(int kind);
// Whether a function itself refracts into directions that end abruptly (rim.h).
bool rey_bsdf_ends(const SceneView *view, const BsdfNode *node);
// Whether a kind turns the shading normal of the function inside it.
bool rey_bsdf_turns(int kind);
// Whether it drops light abruptly at the plane of the normal that it turns: without use_shadowing_function.
bool rey_bsdf_cuts(const BsdfNode *node);

// Whether a function itself depends on the direction of the surface's tangents.
bool rey_bsdf_oriented(const SceneView *view, const BsdfNode *node);
// Whether a kind takes the slope of the texture in a slot.
bool rey_bsdf_takes_slope(int kind, int slot);

// Numbers in `tables` that a function of this kind derives, 0 for most.
int32_t rey_bsdf_table_size(int kind);
rey_result rey_bsdf_update(rey_scene *scene, int32_t bsdf);
