// table.h: the phase functions as data, for the reader, the documentation and the tests; and what they derive.
#pragma once

#include "scene/scene.h"

typedef enum PhaseParamType { PHASE_PARAM_NUMBER, PHASE_PARAM_TABLE, PHASE_PARAM_MATRIX, PHASE_PARAM_WEIGHTS } PhaseParamType;

typedef struct PhaseParam {
    PhaseParamType type;
    const char *name;
    float value, low, high; // default, allowed range
    const char *text;
} PhaseParam;

enum { ANY_NUMBER = -1 };

typedef struct PhaseKind {
    const char *name;
    const PhaseParam *params;
    int param_count, children; // children: how many functions it is made of, or ANY_NUMBER
    const char *reference;
} PhaseKind;

extern const PhaseKind rey_phase_kinds[];
extern const int rey_phase_kind_count;
int rey_phase_kind_find(const char *name); // -1 when unknown

// Numbers in `tables` that a function derives, 0 for most; and bringing them up to date.
int32_t rey_phase_table_size(const TextureNode *textures, const PhaseNode *node);
void rey_phase_update(const SceneView *view, const PhaseNode *node);
