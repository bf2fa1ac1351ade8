// scene_save.c: scenes written back as Mitsuba XML.
#include "scene/scene.h"

rey_result rey_scene_save(const rey_scene *scene, const char *path) {
    return rey_fail(scene->ctx, REY_ERROR_UNSUPPORTED, "%s: scenes cannot be written yet", path);
}
