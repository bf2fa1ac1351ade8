// texels.h: textures whose numbers lie in 8 or 16 bits while nobody changes them. The numbers are exactly those of the floats
// that stand in their place as soon as somebody does: no bit of a picture depends on how a texture is stored.
#pragma once

#include "scene/scene.h"

// What `levels` holds: the numbers of bytes, and of bytes that are encoded as sRGB.
enum { LEVELS_BYTE = 0, LEVELS_SRGB = 256, LEVELS_COUNT = 512 };

// Bytes of one number.
int rey_texel_bytes(int32_t storage);
// Number i of a bitmap, however it is stored.
float rey_texel(const SceneView *view, const TextureNode *t, int64_t i);
// Gives packed textures, and the parameters that are their numbers, places behind the end of theta, which take memory when
// they are written to. *numbers: how many there are.
rey_result rey_texels_place(rey_scene *scene, int64_t *numbers);
// The numbers of a texture become floats in theta; nothing where they are. unpack: with their values, otherwise the caller
// writes them all.
void rey_texels_promote(rey_scene *scene, int32_t texture, bool unpack);
