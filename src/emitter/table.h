// table.h: the kinds of light as data, for the reader, the writer and the tests.
#pragma once

#include "scene/scene.h"

// The forms of parameter rows (light.h).
typedef enum EmitterParamType {
    EMITTER_PARAM_SPECTRUM,
    EMITTER_PARAM_EMISSION,
    EMITTER_PARAM_COLOUR,
    EMITTER_PARAM_REAL,
    EMITTER_PARAM_FRACTION,
    EMITTER_PARAM_IMAGE,
    EMITTER_PARAM_FOV,
    EMITTER_PARAM_POSITION,
    EMITTER_PARAM_POSE,
    EMITTER_PARAM_AXIS,
    EMITTER_PARAM_SKY
} EmitterParamType;

typedef struct EmitterParam {
    EmitterParamType type;
    const char *name;
    float value, low, high; // default, allowed range
    const char *text, *unit;
} EmitterParam;

typedef enum EmitterForm { EMITTER_IS_SURFACE, EMITTER_IS_ENVIRONMENT, EMITTER_IS_DELTA } EmitterForm;

typedef struct EmitterKind {
    const char *name;
    EmitterForm form;
    const EmitterParam *params;
    int param_count;
    int64_t (*table_size)(const TextureNode *textures, const EmitterRecord *e);
    bool (*follow)(const SceneView *view, const EmitterRecord *e);
} EmitterKind;

extern const EmitterKind rey_emitter_kinds[];
extern const int rey_emitter_kind_count;
int rey_emitter_kind_find(const char *name); // -1 when unknown
