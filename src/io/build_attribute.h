// build_attribute.h: attributes that meshes bring.
#pragma once

#include "io/build.h"
#include "io/mesh.h"

// Takes over one attribute of shape `id` with its parameter `path`.NAME; vertices and faces are the mesh's counts.
rey_result build_mesh_attribute(Builder *b, const rey_mesh_attribute *attribute, int32_t id, const char *path,
                                int64_t vertices, int64_t faces);
