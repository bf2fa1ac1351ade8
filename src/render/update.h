// update.h: brings everything that derives from theta up to date.
#pragma once

#include "scene/scene.h"

rey_result rey_scene_update(rey_scene *scene);
