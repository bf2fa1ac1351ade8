// phase_node.h: a phase function in the flat scene.
#pragma once

#include "scene/scene.h"

enum { MAX_PHASE_SLOTS = 1, MAX_PHASE_CHILDREN = 2 };

typedef struct PhaseNode {
    int32_t kind;
    int32_t slot[MAX_PHASE_SLOTS];     // textures, in the order of the kind's parameter list; tables: as many as width says
    int32_t child[MAX_PHASE_CHILDREN]; // nested functions, -1 = none
    int32_t table;                     // first derived value in `tables`, -1 = none
} PhaseNode;
