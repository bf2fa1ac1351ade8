// load.h: the files that a scene is made of, as the builder wants them. What is asked of a file is found out first, so
// that the reading itself can be left to a thread.
#pragma once

#include "io/image.h"
#include "io/mesh.h"
#include "io/pack.h"
#include "io/xml.h"

typedef enum FileKind { FILE_NONE, FILE_MESH, FILE_BITMAP, FILE_ENVMAP } FileKind;

typedef struct FileRequest {
    FileKind kind;
    char *path;
    rey_xml_position at;                       // where the scene names it
    rey_result (*read)(rey_context *ctx, const char *path, const struct FileRequest *request, rey_mesh *mesh);
    bool flip_tex_coords, flat_normals;        // meshes
    int shape_index;
    double to_world[16];
    bool raw, floats;                          // pictures: values are not to be decoded; not to be packed
} FileRequest;

typedef struct LoadedFile {
    rey_mesh mesh;       // in the world
    bool smooth_normals; // that were computed here
    rey_image image;     // linear, finite; without data where they are
    PackedImage packed;
} LoadedFile;

// What a node reads: FILE_NONE for nodes that read none of these.
FileKind load_kind(const rey_xml_node *node);
// What is asked of the node's file. The caller frees *out with load_request_free, also after a failure.
rey_result load_request(rey_context *ctx, const rey_xml_document *document, rey_xml_node *node, FileRequest *out);
void load_request_free(rey_context *ctx, FileRequest *request);
// Reads it; safe in any thread. The caller frees *out with load_free, also after a failure.
rey_result load_read(rey_context *ctx, const FileRequest *request, LoadedFile *out);
void load_free(rey_context *ctx, LoadedFile *file);

// ---- reading ahead -----------------------------------------------------------------------------------------------

typedef struct LoadAhead LoadAhead;

// Reads the files of all nodes by as many threads as the context has. What cannot be read is remembered as such, and
// is no failure here. *out is null where there is nothing to gain; accepts null where it is taken.
rey_result load_ahead(rey_context *ctx, const rey_xml_document *document, LoadAhead **out);
void load_ahead_free(rey_context *ctx, LoadAhead *ahead);
// The node's file: what was read ahead, or else read now. Failures are the same in both cases.
rey_result load_take(rey_context *ctx, const rey_xml_document *document, LoadAhead *ahead, rey_xml_node *node,
                     LoadedFile *out);
