// load.c: meshes and pictures from their files.
#include "io/load.h"

#include "shape/affine.h"

#include <math.h>
#include <string.h>

// ---- what is asked -----------------------------------------------------------------------------------------------

static rey_result read_obj(rey_context *ctx, const char *path, const FileRequest *request, rey_mesh *mesh) {
    return rey_mesh_read_obj(ctx, path, request->flip_tex_coords, mesh);
}

static rey_result read_ply(rey_context *ctx, const char *path, const FileRequest *request, rey_mesh *mesh) {
    return rey_mesh_read_ply(ctx, path, request->flip_tex_coords, mesh);
}

static rey_result read_serialized(rey_context *ctx, const char *path, const FileRequest *request, rey_mesh *mesh) {
    return rey_mesh_read_serialized(ctx, path, request->shape_index, mesh);
}

static const struct {
    const char *plugin;
    rey_xml_tag tag;
    FileKind kind;
    rey_result (*read)(rey_context *ctx, const char *path, const FileRequest *request, rey_mesh *mesh);
} file_plugins[] = {{"obj", REY_XML_SHAPE, FILE_MESH, read_obj},
                    {"ply", REY_XML_SHAPE, FILE_MESH, read_ply},
                    {"serialized", REY_XML_SHAPE, FILE_MESH, read_serialized},
                    {"bitmap", REY_XML_TEXTURE, FILE_BITMAP, NULL},
                    {"envmap", REY_XML_EMITTER, FILE_ENVMAP, NULL}};

static int find_plugin(const rey_xml_node *node) {
    for (int i = 0; i < COUNT_OF(file_plugins); i++) {
        if (node->tag == file_plugins[i].tag && strcmp(node->type, file_plugins[i].plugin) == 0) {
            return i;
        }
    }
    return -1;
}

FileKind load_kind(const rey_xml_node *node) {
    int plugin = find_plugin(node);
    return plugin < 0 ? FILE_NONE : file_plugins[plugin].kind;
}

static rey_result mesh_request(rey_context *ctx, rey_xml_node *node, FileRequest *out) {
    int64_t index = 0;
    bool obj = out->read == read_obj;
    rey_result result = rey_xml_get_bool(ctx, node, "flip_tex_coords", obj, &out->flip_tex_coords);
    if (result == REY_OK) {
        result = rey_xml_get_bool(ctx, node, "face_normals", false, &out->flat_normals);
    }
    if (result == REY_OK) {
        result = rey_xml_get_transform(ctx, node, "to_world", out->to_world);
    }
    if (result == REY_OK && out->read == read_serialized) {
        result = rey_xml_get_int(ctx, node, "shape_index", 0, 1 << 20, 0, &index);
    }
    out->shape_index = (int)index;
    if (result == REY_OK && rey_matrix_determinant(out->to_world) == 0) {
        result = rey_xml_fail(ctx, node->at, REY_ERROR_SCENE, "the shape's to_world cannot be inverted");
    }
    return result;
}

// 'variant' is what the renderer computes with.
static rey_result bitmap_request(rey_context *ctx, rey_xml_node *node, FileRequest *out) {
    static const char *const formats[] = {"auto", "variant", "float16", "uint8"};
    int format = 0;
    rey_result result = rey_xml_get_bool(ctx, node, "raw", false, &out->raw);
    if (result == REY_OK) {
        result = rey_xml_get_choice(ctx, node, "format", formats, COUNT_OF(formats), 0, &format);
    }
    out->floats = format == 1;
    return result;
}

rey_result load_request(rey_context *ctx, const rey_xml_document *document, rey_xml_node *node, FileRequest *out) {
    int plugin = find_plugin(node);
    *out = (FileRequest){.kind = file_plugins[plugin].kind, .read = file_plugins[plugin].read, .at = node->at};
    rey_result result = out->kind == FILE_MESH     ? mesh_request(ctx, node, out)
                        : out->kind == FILE_BITMAP ? bitmap_request(ctx, node, out)
                                                   : REY_OK;
    if (result == REY_OK) {
        result = rey_xml_resolve_file(ctx, document, node, "filename", &out->path);
    }
    if (result == REY_OK) {
        out->at = rey_xml_find(node, "filename")->at;
    }
    return result;
}

void load_request_free(rey_context *ctx, FileRequest *request) {
    rey_free(ctx, request->path);
    request->path = NULL;
}

// ---- meshes ------------------------------------------------------------------------------------------------------

static void transform_normal(const double m[16], bool mirrored, float *n) {
    double v[3] = {n[0], n[1], n[2]}, r[3], length = 0;
    for (int k = 0; k < 3; k++) {
        int a = (k + 1) % 3, c = (k + 2) % 3;
        r[k] = 0;
        for (int j = 0; j < 3; j++) {
            int d = (j + 1) % 3, e = (j + 2) % 3;
            r[k] += (m[4 * a + d] * m[4 * c + e] - m[4 * a + e] * m[4 * c + d]) * v[j];
        }
        length += r[k] * r[k];
    }
    double scale = length > 0 ? (mirrored ? -1 : 1) / sqrt(length) : 0;
    for (int k = 0; k < 3; k++) {
        n[k] = (float)(r[k] * scale);
    }
}

// World vertices; normals by the cofactor matrix, which is the inverse transpose up to a positive factor once its sign
// follows the determinant's; a mirroring pose turns the winding over so that outside stays outside.
static void mesh_transform(rey_mesh *mesh, const double m[16]) {
    static const double identity[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
    bool mirrored = rey_matrix_determinant(m) < 0;
    if (memcmp(m, identity, sizeof identity) == 0) {
        return; // a saved scene reads back to the same bits
    }
    for (int64_t i = 0; i < mesh->vertex_count; i++) {
        float *p = mesh->positions + 3 * i;
        double x = p[0], y = p[1], z = p[2];
        for (int k = 0; k < 3; k++) {
            p[k] = (float)(m[4 * k] * x + m[4 * k + 1] * y + m[4 * k + 2] * z + m[4 * k + 3]);
        }
        if (mesh->normals) {
            transform_normal(m, mirrored, mesh->normals + 3 * i);
        }
    }
    for (int64_t i = 0; i < mesh->face_count && mirrored; i++) {
        uint32_t *f = mesh->faces + 3 * i, first = f[1];
        f[1] = f[2];
        f[2] = first;
    }
}

static rey_result read_mesh(rey_context *ctx, const FileRequest *request, LoadedFile *out) {
    rey_mesh *mesh = &out->mesh;
    rey_result result = request->read(ctx, request->path, request, mesh);
    if (result != REY_OK) {
        return result;
    }
    mesh_transform(mesh, request->to_world);
    if (request->flat_normals || mesh->had_face_normals) {
        rey_free(ctx, mesh->normals);
        mesh->normals = NULL;
    } else if (!mesh->normals) {
        out->smooth_normals = true;
        result = rey_mesh_compute_normals(ctx, mesh);
    }
    return result;
}

// ---- pictures ----------------------------------------------------------------------------------------------------

// At least 2 columns and 3 rows: the last ones are repeated.
static rey_result envmap_pad(rey_context *ctx, rey_image *image) {
    int width = image->width < 2 ? 2 : image->width, height = image->height < 3 ? 3 : image->height;
    if (width == image->width && height == image->height) {
        return REY_OK;
    }
    float *data = rey_alloc_array(ctx, (size_t)width * (size_t)height * 3, sizeof *data);
    if (!data) {
        return REY_ERROR_MEMORY;
    }
    for (int64_t i = 0; i < (int64_t)width * height; i++) {
        int64_t x = i % width < image->width ? i % width : image->width - 1;
        int64_t y = i / width < image->height ? i / width : image->height - 1;
        memcpy(data + 3 * i, image->data + 3 * (y * image->width + x), 3 * sizeof *data);
    }
    rey_free(ctx, image->data);
    image->data = data;
    image->width = width;
    image->height = height;
    return REY_OK;
}

static rey_result read_image(rey_context *ctx, const FileRequest *request, LoadedFile *out) {
    rey_image *image = &out->image;
    bool sky = request->kind == FILE_ENVMAP;
    rey_result result = rey_image_read(ctx, request->path, image);
    if (result == REY_OK && (sky || image->channels != 1)) {
        result = rey_image_to_rgb(ctx, request->path, image);
    }
    if (result == REY_OK && request->kind == FILE_BITMAP && !request->floats) {
        result = rey_image_pack(ctx, image, image->srgb && !request->raw, &out->packed);
    }
    if (result != REY_OK || out->packed.bytes) {
        return result;
    }
    if (image->srgb && !request->raw) {
        rey_image_decode_srgb(image);
    }
    for (int64_t i = 0; i < (int64_t)image->width * image->height * image->channels; i++) {
        if (!isfinite(image->data[i]) || (sky && image->data[i] < 0)) {
            return rey_fail(ctx, REY_ERROR_FORMAT, "%s: the picture has a value that is %snot finite at pixel %d, %d",
                            request->path, sky ? "negative or " : "", (int)(i / image->channels % image->width),
                            (int)(i / image->channels / image->width));
        }
    }
    return sky ? envmap_pad(ctx, image) : REY_OK;
}

rey_result load_read(rey_context *ctx, const FileRequest *request, LoadedFile *out) {
    *out = (LoadedFile){0};
    return rey_xml_named_file(ctx, request->at,
                              request->kind == FILE_MESH ? read_mesh(ctx, request, out)
                                                         : read_image(ctx, request, out));
}

void load_free(rey_context *ctx, LoadedFile *file) {
    rey_mesh_free(ctx, &file->mesh);
    rey_image_free(ctx, &file->image);
    rey_free(ctx, file->packed.bytes);
    file->packed = (PackedImage){0};
}
