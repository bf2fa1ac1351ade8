// blame.h: names of objects for messages that say why something cannot be had.
#pragma once

#include "scene/scene.h"

enum { OBJECT_NAME = 200 };

// How an object is called in names of parameters: its id, or the path through its owner. Objects without parameters are
// "number 3".
void rey_name_shape(const rey_scene *scene, int32_t shape, char name[OBJECT_NAME]);
void rey_name_instance(const rey_scene *scene, int32_t instance, char name[OBJECT_NAME]);
void rey_name_bsdf(const rey_scene *scene, int32_t bsdf, char name[OBJECT_NAME]);
void rey_name_texture(const rey_scene *scene, int32_t texture, char name[OBJECT_NAME]);
void rey_name_emitter(const rey_scene *scene, int32_t emitter, char name[OBJECT_NAME]);

// Why edges that are seen in mirrors and through glass are not found (rey_chains_known): "because of ...".
void rey_name_obstacle(const rey_scene *scene, const SensorRecord *sensor, char text[OBJECT_NAME]);
// Whether a scattering function, or one inside of it, is of such a kind (bsdf/table.h); -1: it has none.
bool rey_bsdf_holds(const SceneView *view, int32_t bsdf, bool (*is)(int kind));
// Whether a texture, or one inside it, is of a sort.
bool rey_texture_holds(const SceneView *view, int32_t texture, bool (*is)(const SceneView *view, const TextureNode *t));
// Whether a texture, -1 = none, is a parameter, or reads one.
bool rey_texture_reads(const SceneView *view, int32_t texture, const Param *p);
bool rey_is_volume(const SceneView *view, const TextureNode *t);
// Whether surfaces use some function of a sort.
bool rey_bsdfs_used(const SceneView *view, bool (*are)(int kind));
// The first shape whose scattering function bends paths; false when there is none.
bool rey_name_bender(const rey_scene *scene, char name[OBJECT_NAME]);
