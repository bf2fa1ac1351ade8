// mesh.h: triangle meshes in memory, and their readers and writers (OBJ, PLY, Mitsuba serialized).
//
// Readers check everything that they take from a file: values are finite, indices in range, and a file that claims
// more elements than its bytes could hold fails before any allocation. Failures are REY_ERROR_IO (cannot read),
// REY_ERROR_FORMAT (malformed: the message starts with "FILE:LINE:" for text and "FILE: byte OFFSET:" for binary
// files), REY_ERROR_UNSUPPORTED or REY_ERROR_MEMORY, and leave *out empty (all zero).
#pragma once

#include "shape/normals.h"

enum { MESH_MOST_ITEMS = INT32_MAX }; // vertices or triangles of one mesh

typedef struct rey_mesh_attribute {
    char name[64]; // "vertex_NAME" or "face_NAME"
    bool per_face;
    int channels; // 1 or 3
    float *data;  // (face_count or vertex_count) x channels
} rey_mesh_attribute;

typedef struct rey_mesh {
    int64_t vertex_count, face_count;
    float *positions;         // vertex_count x 3
    float *normals;           // vertex_count x 3 as stored (any length), or null
    float *uvs;               // vertex_count x 2, or null
    uint32_t *faces;          // face_count x 3 render vertex indices, in stored winding
    uint32_t *position_index; // vertex_count: the first vertex with the same position (-0 equals 0), so that vertices
                              // split by a seam in uv or normals are still one point of the surface
    rey_mesh_attribute *attributes;
    int attribute_count;
    bool had_face_normals; // a serialized file asked for flat shading
} rey_mesh;

// Frees all arrays and empties the mesh. An empty (zeroed) mesh is valid.
void rey_mesh_free(rey_context *ctx, rey_mesh *mesh);

// ---- readers: the _memory forms read size bytes; name is the path that messages give -------------------------------

// OBJ: v, vt, vn and f; everything else is ignored. Polygons are split into fans from their first corner; indices may
// be negative (relative) or point forward. Vertices are the distinct (v, vt, vn) triples in order of first use. Corners
// without vt get uv (0,0) where others have one, corners without vn the smooth normal. flip_tex_coords: v' = 1 - v.
rey_result rey_mesh_read_obj(rey_context *ctx, const char *path, bool flip_tex_coords, rey_mesh *out);
rey_result rey_mesh_read_obj_memory(rey_context *ctx, const char *name, const void *bytes, size_t size,
                                    bool flip_tex_coords, rey_mesh *out);

// PLY, text or binary in either byte order: x y z, nx ny nz, (u v | s t | texture_u texture_v); polygons are split into
// fans. r g b or red green blue become the attribute color (alpha is dropped); contiguous PREFIX_x PREFIX_y PREFIX_z
// (or r g b, 0 1 2, 1 2 3, or the first of these alone) the attribute PREFIX; groups of other sizes are skipped.
// Integers are not scaled. Vertices stay as stored.
rey_result rey_mesh_read_ply(rey_context *ctx, const char *path, bool flip_tex_coords, rey_mesh *out);
rey_result rey_mesh_read_ply_memory(rey_context *ctx, const char *name, const void *bytes, size_t size,
                                    bool flip_tex_coords, rey_mesh *out);

// Mitsuba's serialized format, versions 3 and 4. Vertex colours become the attribute vertex_color.
rey_result rey_mesh_read_serialized(rey_context *ctx, const char *path, int shape_index, rey_mesh *out);
rey_result rey_mesh_read_serialized_memory(rey_context *ctx, const char *name, const void *bytes, size_t size,
                                           int shape_index, rey_mesh *out);

// ---- writer --------------------------------------------------------------------------------------------------------

// Binary little endian PLY with everything but position_index (recomputed on reading) and had_face_normals; reading it
// back gives the same bits. The file appears complete or not at all. Attribute names need their vertex_ or face_
// prefix.
rey_result rey_mesh_write_ply(rey_context *ctx, const char *path, const rey_mesh *mesh);

// ---- normals -------------------------------------------------------------------------------------------------------

// Replaces the normals by smooth ones: the unit sum of the unit normals of the faces at a position, each weighted by
// its angle there [thurmer1998]. Degenerate faces add nothing; a vertex where the sum is zero gets (0,0,1).
rey_result rey_mesh_compute_normals(rey_context *ctx, rey_mesh *mesh);

// The parts of that computation, for code that keeps its own positions or needs the intermediate sums.
// sums[3 position_index[v] ..] = sum over faces of angle times normal; sums holds vertex_count x 3 and is overwritten.
// The order of summation is that of the faces, so results are the same for any number of threads.
void rey_mesh_normal_sums(const rey_mesh *mesh, const float *positions, double *sums);
// normals[3 v ..] = unit(sums[3 position_index[v] ..]), or (0,0,1) where the sum is zero.
void rey_mesh_normals_from_sums(const rey_mesh *mesh, const double *sums, float *normals);

// ---- for readers and other makers of meshes ------------------------------------------------------------------------

// Adds a zeroed attribute for the current vertex_count or face_count; null (and a recorded message) on failure.
float *rey_mesh_add_attribute(rey_context *ctx, rey_mesh *mesh, const char *name, bool per_face, int channels);

// Fills position_index from the positions. Call again after welding changes; moving vertices does not change it.
rey_result rey_mesh_weld(rey_context *ctx, rey_mesh *mesh);
