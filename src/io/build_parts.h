// build_parts.h: meshes with several scattering functions, and what they share with other shapes.
#pragma once

#include "io/build.h"
#include "io/mesh.h"

bool build_has_parts(const rey_xml_node *node);
rey_result build_parts(Builder *b, rey_xml_node *node, const char *path, ShapeRecord shape);

// The mesh of a shape in the world; *smooth: its normals were computed (build_shape.c).
rey_result build_load_mesh(Builder *b, rey_xml_node *node, rey_mesh *mesh, bool *smooth);
rey_result build_copy_mesh(Builder *b, const rey_mesh *mesh, int32_t id, const char *path, ShapeRecord *shape);
// The scattering function (null = the default one) and the light of a shape, and its shading group.
rey_result build_surface(Builder *b, rey_xml_node *node, rey_xml_child *bsdf, int32_t id, const char *path,
                         ShapeRecord *shape);
