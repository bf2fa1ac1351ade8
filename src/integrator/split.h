// split.h: how the samples of `direct` divide when it draws more of lights than of scattering functions, or fewer.
#pragma once

#include "math/functions.h"
#include "scene/scene.h"

// The weight of either kind is its density times its share of the samples [veach1995 section 3.3].
typedef struct Split {
    Float light_pdf, scatter_pdf;     // factors on the densities in MIS weights
    Float light_weight, scatter_weight; // one over the share of the samples that draw one
    Mask light, scatter;
    UInt light_sample, scatter_sample; // numbers of the samples among those of their kind
} Split;

KFN Split split_of(const SceneView *scene, UInt sample) {
    int32_t n = scene->split, both = scene->light_samples + scene->scatter_samples;
    Split s;
    UInt turn = sample / (uint32_t)n;
    Int number = (Int)(sample - turn * (uint32_t)n);
    s.light = mi_lt(number, i_set(scene->light_samples));
    s.scatter = mi_lt(number, i_set(scene->scatter_samples));
    s.light_pdf = f_set((real)scene->light_samples / (real)both);
    s.scatter_pdf = f_set((real)scene->scatter_samples / (real)both);
    s.light_weight = (real)n * f_safe_rcp(f_set((real)scene->light_samples));
    s.scatter_weight = (real)n * f_safe_rcp(f_set((real)scene->scatter_samples));
    s.light_sample = turn * (uint32_t)scene->light_samples + (UInt)number;
    s.scatter_sample = turn * (uint32_t)scene->scatter_samples + (UInt)number;
    return s;
}
