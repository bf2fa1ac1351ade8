// mesh_normals.c: smooth vertex normals of a mesh in memory.
#include "io/mesh.h"

static MeshView view_of(const rey_mesh *mesh, const float *positions) {
    return (MeshView){positions, mesh->faces, mesh->position_index, mesh->vertex_count, mesh->face_count};
}

void rey_mesh_normal_sums(const rey_mesh *mesh, const float *positions, double *sums) {
    MeshView view = view_of(mesh, positions);
    rey_normal_sums(&view, sums);
}

void rey_mesh_normals_from_sums(const rey_mesh *mesh, const double *sums, float *normals) {
    MeshView view = view_of(mesh, mesh->positions);
    rey_normals_from_sums(&view, sums, normals);
}

rey_result rey_mesh_compute_normals(rey_context *ctx, rey_mesh *mesh) {
    double *sums = rey_alloc_array(ctx, (size_t)mesh->vertex_count, 3 * sizeof *sums);
    float *normals = rey_alloc_array(ctx, (size_t)mesh->vertex_count, 3 * sizeof *normals);
    if (!sums || !normals) {
        rey_free(ctx, sums);
        rey_free(ctx, normals);
        return REY_ERROR_MEMORY;
    }
    rey_mesh_normal_sums(mesh, mesh->positions, sums);
    rey_mesh_normals_from_sums(mesh, sums, normals);
    rey_free(ctx, sums);
    rey_free(ctx, mesh->normals);
    mesh->normals = normals;
    return REY_OK;
}
