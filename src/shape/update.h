// update.h: what shapes derive from their parameters.
#pragma once

#include "scene/scene.h"
#include "shape/affine.h"

// Brings a shape's derived data up to date: vertices of rectangles and cubes, tables of spheres and disks, area and
// cumulative triangle areas of mesh emitters.
rey_result rey_shape_update(rey_scene *scene, int32_t shape);
// Vertex normals of a mesh that were computed when it was loaded follow its vertices: writes those that its vertices have now.
rey_result rey_shape_normals(const rey_scene *scene, const ShapeRecord *shape, float *normals);
rey_result rey_instance_update(rey_scene *scene, int32_t instance);

// Unit meshes of shapes that follow to_world: 4 or 24 vertices of position (3), normal (3), uv (2).
enum { RECTANGLE_VERTICES = 4, RECTANGLE_TRIANGLES = 2, CUBE_VERTICES = 24, CUBE_TRIANGLES = 12 };
void rey_rectangle_mesh(float vertices[RECTANGLE_VERTICES][8], int32_t triangles[RECTANGLE_TRIANGLES][3]);
void rey_cube_mesh(float vertices[CUBE_VERTICES][8], int32_t triangles[CUBE_TRIANGLES][3]);
