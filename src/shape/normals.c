// normals.c: smooth vertex normals. All in double: differences of floats are then nearly exact, and no product of finite
// floats overflows or vanishes.
#include "shape/normals.h"

#include <math.h>

static double dot(const double a[3], const double b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

bool rey_face_normal(const float a[3], const float b[3], const float c[3], double normal[3], double angles[3]) {
    double ab[3], bc[3], ca[3];
    for (int k = 0; k < 3; k++) {
        ab[k] = (double)b[k] - a[k];
        bc[k] = (double)c[k] - b[k];
        ca[k] = (double)a[k] - c[k];
        normal[k] = angles[k] = 0;
    }
    // ab x ac, of length twice the area
    double cross[3] = {ca[1] * ab[2] - ca[2] * ab[1], ca[2] * ab[0] - ca[0] * ab[2], ca[0] * ab[1] - ca[1] * ab[0]};
    double length = sqrt(dot(cross, cross));
    if (!(length > 0)) {
        return false;
    }
    for (int k = 0; k < 3; k++) {
        normal[k] = cross[k] / length;
    }
    // The cross product of any two edges has the same length: angle = atan2(|e x f|, e . f), accurate for all angles.
    angles[0] = atan2(length, -dot(ab, ca));
    angles[1] = atan2(length, -dot(bc, ab));
    angles[2] = atan2(length, -dot(ca, bc));
    return true;
}

void rey_normal_sums(const MeshView *mesh, double *sums) {
    for (int64_t i = 0; i < 3 * mesh->vertex_count; i++) {
        sums[i] = 0;
    }
    for (int64_t f = 0; f < mesh->face_count; f++) {
        const uint32_t *face = mesh->faces + 3 * f;
        const float *p = mesh->positions;
        double normal[3], angles[3];
        if (!rey_face_normal(p + 3 * (size_t)face[0], p + 3 * (size_t)face[1], p + 3 * (size_t)face[2], normal, angles)) {
            continue;
        }
        for (int i = 0; i < 9; i++) {
            sums[3 * (size_t)mesh->welded[face[i / 3]] + (size_t)(i % 3)] += angles[i / 3] * normal[i % 3];
        }
    }
}

void rey_normals_from_sums(const MeshView *mesh, const double *sums, float *normals) {
    for (int64_t i = 0; i < mesh->vertex_count; i++) {
        const double *sum = sums + 3 * (size_t)mesh->welded[i];
        double length = sqrt(dot(sum, sum));
        for (int k = 0; k < 3; k++) {
            normals[3 * i + k] = length > 0 ? (float)(sum[k] / length) : (float)(k == 2);
        }
    }
}
