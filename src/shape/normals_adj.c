// normals_adj.c: smooth vertex normals that follow their vertices: n = unit(S), S = sum over faces of angle times normal.
#include "shape/normals.h"

#include <math.h>
#include <string.h>

static double dot(const double a[3], const double b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void cross(const double a[3], const double b[3], double c[3]) {
    for (int k = 0; k < 3; k++) {
        c[k] = a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3];
    }
}

// A face: unit normal, twice its area, and the edge opposite each corner, counter-clockwise.
typedef struct Face {
    double normal[3], angle[3], twice_area, edge[3][3];
} Face;

static bool face_of(const MeshView *mesh, int64_t f, Face *face) {
    const float *p[3];
    for (int k = 0; k < 3; k++) {
        p[k] = mesh->positions + 3 * (size_t)mesh->faces[3 * f + k];
    }
    for (int k = 0; k < 3; k++) {
        for (int i = 0; i < 3; i++) {
            face->edge[k][i] = (double)p[(k + 2) % 3][i] - (double)p[(k + 1) % 3][i];
        }
    }
    double n[3];
    cross(face->edge[0], face->edge[1], n);
    face->twice_area = sqrt(dot(n, n));
    return rey_face_normal(p[0], p[1], p[2], face->normal, face->angle);
}

// d angle[k] / d p[j]: the angle between the two edges at corner k opens when their ends move across them.
// The unit vectors across an edge within the face point along edge x normal.
static void angle_slopes(const Face *face, int k, double slope[3][3]) {
    const double *ahead = face->edge[(k + 2) % 3], *behind = face->edge[(k + 1) % 3]; // p[k+1] - p[k], p[k] - p[k+2]
    double a[3], b[3];
    cross(ahead, face->normal, a);
    cross(behind, face->normal, b);
    for (int i = 0; i < 3; i++) {
        slope[(k + 1) % 3][i] = a[i] / dot(ahead, ahead);
        slope[(k + 2) % 3][i] = b[i] / dot(behind, behind);
        slope[k][i] = -slope[(k + 1) % 3][i] - slope[(k + 2) % 3][i];
    }
}

// Adjoint of what a face adds to the sums at its corners: dsum[k] . (angle[k] normal).
static void face_adj(const Face *face, const double *dsum[3], double dp[3][3]) {
    double dnormal[3] = {0, 0, 0};
    memset(dp, 0, 9 * sizeof(double));
    for (int k = 0; k < 3; k++) {
        double slope[3][3], dangle = dot(dsum[k], face->normal);
        angle_slopes(face, k, slope);
        for (int i = 0; i < 9; i++) {
            dp[i / 3][i % 3] += dangle * slope[i / 3][i % 3];
        }
        for (int i = 0; i < 3; i++) {
            dnormal[i] += face->angle[k] * dsum[k][i];
        }
    }
    // normal = unit(N), dN / dp[k] = edge[k] x .: the adjoint of p[k] is dN x edge[k]
    double along = dot(dnormal, face->normal);
    for (int i = 0; i < 3; i++) {
        dnormal[i] = (dnormal[i] - along * face->normal[i]) / face->twice_area;
    }
    for (int k = 0; k < 3; k++) {
        double d[3];
        cross(dnormal, face->edge[k], d);
        for (int i = 0; i < 3; i++) {
            dp[k][i] += d[i];
        }
    }
}

// The adjoint of unit(sum), and equally its motion: the matrix is symmetric.
static void unit_change(const double *sum, const double *d, double *out) {
    double length = sqrt(dot(sum, sum));
    for (int k = 0; k < 3; k++) {
        out[k] = length > 0 ? (d[k] - sum[k] * dot(sum, d) / (length * length)) / length : 0;
    }
}

static bool any(const double *d) { return d[0] != 0 || d[1] != 0 || d[2] != 0; }

rey_result rey_normals_adj(rey_context *ctx, const MeshView *mesh, const double *sums, const double *dnormals,
                           double *dpositions) {
    size_t n = 3 * (size_t)mesh->vertex_count;
    double *dsums = rey_alloc_array(ctx, n + 1, sizeof *dsums);
    if (!dsums) {
        return REY_ERROR_MEMORY;
    }
    memset(dsums, 0, n * sizeof *dsums);
    for (int64_t i = 0; i < mesh->vertex_count; i++) {
        double d[3], *at = dsums + 3 * (size_t)mesh->welded[i];
        if (!any(dnormals + 3 * i)) {
            continue;
        }
        unit_change(sums + 3 * (size_t)mesh->welded[i], dnormals + 3 * i, d);
        for (int k = 0; k < 3; k++) {
            at[k] += d[k];
        }
    }
    for (int64_t f = 0; f < mesh->face_count; f++) {
        Face face;
        const double *dsum[3];
        double dp[3][3];
        for (int k = 0; k < 3; k++) {
            dsum[k] = dsums + 3 * (size_t)mesh->welded[mesh->faces[3 * f + k]];
        }
        // Most samples see few of the faces.
        if (!(any(dsum[0]) || any(dsum[1]) || any(dsum[2])) || !face_of(mesh, f, &face)) {
            continue;
        }
        face_adj(&face, dsum, dp);
        for (int k = 0; k < 9; k++) {
            dpositions[3 * (size_t)mesh->faces[3 * f + k / 3] + (size_t)(k % 3)] += dp[k / 3][k % 3];
        }
    }
    rey_free(ctx, dsums);
    return REY_OK;
}

// The motion of what a face adds to the sum at corner k.
static void face_motion(const Face *face, const float *moves[3], double dsum[3][3]) {
    double dn[3] = {0, 0, 0};
    for (int k = 0; k < 3; k++) {
        double v[3] = {(double)moves[k][0], (double)moves[k][1], (double)moves[k][2]}, d[3];
        cross(face->edge[k], v, d);
        for (int i = 0; i < 3; i++) {
            dn[i] += d[i] / face->twice_area;
        }
    }
    double along = dot(dn, face->normal);
    for (int k = 0; k < 3; k++) {
        double slope[3][3], dangle = 0;
        angle_slopes(face, k, slope);
        for (int i = 0; i < 9; i++) {
            dangle += slope[i / 3][i % 3] * (double)moves[i / 3][i % 3];
        }
        for (int i = 0; i < 3; i++) {
            dsum[k][i] = dangle * face->normal[i] + face->angle[k] * (dn[i] - along * face->normal[i]);
        }
    }
}

rey_result rey_normals_tangent(rey_context *ctx, const MeshView *mesh, const float *positions, float *normals) {
    size_t n = 3 * (size_t)mesh->vertex_count;
    double *sums = rey_alloc_array(ctx, 2 * n + 1, sizeof *sums), *dsums = sums + n;
    if (!sums) {
        return REY_ERROR_MEMORY;
    }
    rey_normal_sums(mesh, sums);
    memset(dsums, 0, n * sizeof *dsums);
    for (int64_t f = 0; f < mesh->face_count; f++) {
        Face face;
        double dsum[3][3];
        const float *moves[3];
        if (!face_of(mesh, f, &face)) {
            continue;
        }
        for (int k = 0; k < 3; k++) {
            moves[k] = positions + 3 * (size_t)mesh->faces[3 * f + k];
        }
        face_motion(&face, moves, dsum);
        for (int k = 0; k < 9; k++) {
            dsums[3 * (size_t)mesh->welded[mesh->faces[3 * f + k / 3]] + (size_t)(k % 3)] += dsum[k / 3][k % 3];
        }
    }
    for (int64_t i = 0; i < mesh->vertex_count; i++) {
        double d[3];
        unit_change(sums + 3 * (size_t)mesh->welded[i], dsums + 3 * (size_t)mesh->welded[i], d);
        for (int k = 0; k < 3; k++) {
            normals[3 * i + k] = (float)d[k];
        }
    }
    rey_free(ctx, sums);
    return REY_OK;
}
