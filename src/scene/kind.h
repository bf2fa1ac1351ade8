// kind.h: the machinery behind "a kind is one header and one table row".
//
// A kind's header lists its parameters once, as a macro of rows P(type, field, default, low, high, description):
//   SPEC   colour-valued texture          REAL   number-valued texture
//   and the special forms of ParamType; low and high say the allowed range
// and its uniform switches as rows C(type, field, default, choices, description). From the rows come the record below,
// fetch and scatter, XML attributes with defaults and ranges, parameter names, documentation and all tests.
#pragma once

#include "scene/scene.h"

// Which part of a function a direction belongs to. Values of delta lobes are coefficients of the delta, their
// densities discrete probabilities. Along LOBE_RIM a smooth value jumps (bsdf/rim.h).
enum { LOBE_SMOOTH, LOBE_REFLECT, LOBE_TRANSMIT, LOBE_NULL, LOBE_RIM };

typedef enum ParamType {
    PARAM_SPEC,      // colour texture
    PARAM_REAL,      // number texture
    PARAM_IOR,       // number: int_ior / ext_ior, or the ratio
    PARAM_SMOOTH_IOR, // the same; it turns directions of delta lobes, and with them the edges that are seen behind
    PARAM_SPECULAR,  // number texture: the reflectance at normal incidence over 0.08, or `eta`
    PARAM_RATE,      // number: steers sampling only, no parameter
    PARAM_METAL_ETA, // colour: eta, or from `material`
    PARAM_METAL_K,   // colour: k, or from `material`
    PARAM_ALPHA_U,   // number: alpha or alpha_u
    PARAM_ALPHA_V,   // number: alpha or alpha_v
    PARAM_NORMAL,    // colour texture that turns the shading normal
    PARAM_HEIGHT,    // slope of a number texture, which turns the shading normal; the only texture of its function
    PARAM_HEIGHT_SCALE // number, no texture: factor on the slope
} ParamType;

typedef struct ParamDesc {
    ParamType type;
    const char *name;
    float value;       // default
    float low, high;   // allowed range
    const char *text;  // description
    const char *option; // of an index: its default material; of others: "required" where there is no default
} ParamDesc;

typedef struct ConfigDesc {
    const char *name;
    int value;           // default
    const char *choices; // "false|true" or "beckmann|ggx": the value is the position; "given NAME": is NAME there, not 0?
    const char *text;
} ConfigDesc;
