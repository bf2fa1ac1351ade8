// vertices.c: vertices as unknowns.
#include "fit/vertices.h"

#include <math.h>
#include <string.h>

rey_result rey_vertices_create(rey_context *ctx, int32_t vertex_count, const int32_t *welded, int32_t triangle_count,
                               const int32_t *indices, double smoothness, Regularisers weights, Vertices **out) {
    Vertices *v = *out = rey_alloc(ctx, sizeof *v);
    rey_result result = v ? rey_point_mesh_create(ctx, vertex_count, welded, triangle_count, indices, &v->mesh)
                          : REY_ERROR_MEMORY;
    if (!result) {
        size_t numbers = 3 * (size_t)v->mesh.point_count;
        v->weights = weights;
        v->points = rey_alloc_array(ctx, numbers, sizeof *v->points);
        v->scratch = rey_alloc_array(ctx, numbers, sizeof *v->scratch);
        v->sum = rey_alloc_array(ctx, numbers, sizeof *v->sum);
        v->degree = rey_alloc_array(ctx, (size_t)v->mesh.point_count, sizeof *v->degree);
        bool had = v->points && v->scratch && v->sum && v->degree;
        result = had ? rey_laplacian_create(ctx, &v->mesh, smoothness, &v->laplacian) : REY_ERROR_MEMORY;
    }
    for (int32_t k = 0; !result && k < v->mesh.edge_count; k++) {
        v->degree[v->mesh.edges[k].a]++;
        v->degree[v->mesh.edges[k].b]++;
    }
    return result;
}

void rey_vertices_free(rey_context *ctx, Vertices *v) {
    if (v) {
        rey_laplacian_free(ctx, v->laplacian);
        rey_point_mesh_free(ctx, &v->mesh);
        rey_free(ctx, v->points);
        rey_free(ctx, v->scratch);
        rey_free(ctx, v->sum);
        rey_free(ctx, v->degree);
        rey_free(ctx, v);
    }
}

static void gather_points(const PointMesh *mesh, const float *value, double *points) {
    for (int32_t i = 0; i < 3 * mesh->point_count; i++) {
        points[i] = (double)value[3 * mesh->vertex[i / 3] + i % 3];
    }
}

static void scatter_points(const PointMesh *mesh, const double *points, float *value) {
    for (int32_t i = 0; i < 3 * mesh->vertex_count; i++) {
        value[i] = (float)points[3 * mesh->point[i / 3] + i % 3];
    }
}

const double *rey_vertices_points(Vertices *v, const float *value) {
    gather_points(&v->mesh, value, v->points);
    return v->points;
}

static double edge_length(const PointEdge *e, const double *points, double d[3]) {
    for (int c = 0; c < 3; c++) {
        d[c] = points[3 * e->b + c] - points[3 * e->a + c];
    }
    return sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
}

void rey_vertices_begin(Vertices *v, float *start, double *variable) {
    const PointMesh *mesh = &v->mesh;
    double sum = 0, d[3];
    gather_points(mesh, start, v->points);
    scatter_points(mesh, v->points, start);
    for (int32_t k = 0; k < mesh->edge_count; k++) {
        sum += edge_length(&mesh->edges[k], v->points, d);
    }
    v->length = sum > 0 ? sum / mesh->edge_count : 1;
    rey_laplacian_multiply(v->laplacian, v->points, v->scratch);
    memset(variable, 0, 3 * (size_t)mesh->vertex_count * sizeof *variable);
    for (int32_t i = 0; i < 3 * mesh->point_count; i++) {
        variable[3 * mesh->vertex[i / 3] + i % 3] = v->scratch[i];
    }
}

void rey_vertices_follow(Vertices *v, const double *variable, float *value) {
    const PointMesh *mesh = &v->mesh;
    for (int32_t i = 0; i < 3 * mesh->point_count; i++) {
        v->scratch[i] = variable[3 * mesh->vertex[i / 3] + i % 3];
    }
    rey_laplacian_solve(v->laplacian, v->scratch, v->points);
    scatter_points(mesh, v->points, value);
}

void rey_vertices_gradient(Vertices *v, double *gradient) {
    const PointMesh *mesh = &v->mesh;
    memset(v->scratch, 0, 3 * (size_t)mesh->point_count * sizeof *v->scratch);
    for (int32_t i = 0; i < 3 * mesh->vertex_count; i++) {
        v->scratch[3 * mesh->point[i / 3] + i % 3] += gradient[i];
        gradient[i] = 0;
    }
    rey_laplacian_solve(v->laplacian, v->scratch, v->points); // M is symmetric
    for (int32_t i = 0; i < 3 * mesh->point_count; i++) {
        gradient[3 * mesh->vertex[i / 3] + i % 3] = v->points[i];
    }
}

/* ---- regularisers: value, and gradient g in the points ------------------------------------------------- */

// delta_i = x_i - mean of neighbours: with q_i = 2 delta_i / (n l^2), g_i = q_i - sum over neighbours j of q_j / degree_j.
static double laplacian_energy(const Vertices *v, double weight, double *delta, double *g) {
    const PointMesh *mesh = &v->mesh;
    double sum = 0, scale = weight / (mesh->point_count * v->length * v->length);
    memset(delta, 0, 3 * (size_t)mesh->point_count * sizeof *delta);
    for (int32_t k = 0; k < mesh->edge_count; k++) {
        const PointEdge *e = &mesh->edges[k];
        for (int c = 0; c < 3; c++) {
            double difference = v->points[3 * e->a + c] - v->points[3 * e->b + c];
            delta[3 * e->a + c] += difference / v->degree[e->a];
            delta[3 * e->b + c] -= difference / v->degree[e->b];
        }
    }
    for (int32_t i = 0; i < 3 * mesh->point_count; i++) {
        sum += delta[i] * delta[i];
    }
    for (int32_t k = 0; k < mesh->edge_count; k++) {
        const PointEdge *e = &mesh->edges[k];
        for (int c = 0; c < 3; c++) {
            double q = 2 * scale * (delta[3 * e->a + c] / v->degree[e->a] - delta[3 * e->b + c] / v->degree[e->b]);
            g[3 * e->a + c] += q;
            g[3 * e->b + c] -= q;
        }
    }
    return scale * sum;
}

static double edge_energy(const Vertices *v, double weight, double *g) {
    double sum = 0, d[3], scale = weight / v->mesh.edge_count;
    for (int32_t k = 0; k < v->mesh.edge_count; k++) {
        const PointEdge *e = &v->mesh.edges[k];
        double length = edge_length(e, v->points, d), off = length / v->length - 1;
        sum += off * off;
        for (int c = 0; c < 3 && length > 0; c++) {
            double slope = scale * 2 * off * d[c] / (length * v->length);
            g[3 * e->b + c] += slope;
            g[3 * e->a + c] -= slope;
        }
    }
    return scale * sum;
}

typedef struct Normal {
    double n[3], size; // unit, and twice the area; size 0 = it has none
    double ab[3], ac[3];
} Normal;

static Normal normal_of(const Vertices *v, int32_t triangle) {
    const int32_t *corner = v->mesh.triangles + 3 * (int64_t)triangle;
    Normal r = {.size = 0};
    for (int c = 0; c < 3; c++) {
        r.ab[c] = v->points[3 * corner[1] + c] - v->points[3 * corner[0] + c];
        r.ac[c] = v->points[3 * corner[2] + c] - v->points[3 * corner[0] + c];
    }
    for (int c = 0; c < 3; c++) {
        int i = (c + 1) % 3, j = (c + 2) % 3;
        r.n[c] = r.ab[i] * r.ac[j] - r.ab[j] * r.ac[i];
        r.size += r.n[c] * r.n[c];
    }
    r.size = sqrt(r.size);
    for (int c = 0; c < 3 && r.size > 0; c++) {
        r.n[c] /= r.size;
    }
    return r;
}

// n = m / |m|, m = ab x ac: dm = (dn - n (n . dn)) / |m|, d(ab) = ac x dm, d(ac) = dm x ab.
static void normal_adj(const Vertices *v, int32_t triangle, const Normal *r, const double dn[3], double *g) {
    const int32_t *corner = v->mesh.triangles + 3 * (int64_t)triangle;
    double along = r->n[0] * dn[0] + r->n[1] * dn[1] + r->n[2] * dn[2], dm[3];
    for (int c = 0; c < 3; c++) {
        dm[c] = (dn[c] - r->n[c] * along) / r->size;
    }
    for (int c = 0; c < 3; c++) {
        int i = (c + 1) % 3, j = (c + 2) % 3;
        double dab = r->ac[i] * dm[j] - r->ac[j] * dm[i], dac = dm[i] * r->ab[j] - dm[j] * r->ab[i];
        g[3 * corner[1] + c] += dab;
        g[3 * corner[2] + c] += dac;
        g[3 * corner[0] + c] -= dab + dac;
    }
}

static double normal_energy(const Vertices *v, double weight, double *g) {
    double sum = 0, scale = weight / v->mesh.edge_count;
    for (int32_t k = 0; k < v->mesh.edge_count; k++) {
        const PointEdge *e = &v->mesh.edges[k];
        if (e->triangle[1] < 0) {
            continue;
        }
        Normal r[2] = {normal_of(v, e->triangle[0]), normal_of(v, e->triangle[1])};
        if (!(r[0].size > 0) || !(r[1].size > 0)) {
            continue;
        }
        double dn[2][3];
        for (int c = 0; c < 3; c++) {
            sum += (c == 0) - r[0].n[c] * r[1].n[c];
            dn[0][c] = -scale * r[1].n[c];
            dn[1][c] = -scale * r[0].n[c];
        }
        normal_adj(v, e->triangle[0], &r[0], dn[0], g);
        normal_adj(v, e->triangle[1], &r[1], dn[1], g);
    }
    return scale * sum;
}

double rey_vertices_regularise(Vertices *v, const float *value, double *gradient) {
    const PointMesh *mesh = &v->mesh;
    const Regularisers *w = &v->weights;
    double energy = 0;
    if (!(w->laplacian > 0) && !(w->edge_length > 0) && !(w->normals > 0)) {
        return 0;
    }
    gather_points(mesh, value, v->points);
    memset(v->sum, 0, 3 * (size_t)mesh->point_count * sizeof *v->sum);
    energy += w->laplacian > 0 ? laplacian_energy(v, w->laplacian, v->scratch, v->sum) : 0;
    energy += w->edge_length > 0 ? edge_energy(v, w->edge_length, v->sum) : 0;
    energy += w->normals > 0 ? normal_energy(v, w->normals, v->sum) : 0;
    for (int32_t i = 0; i < 3 * mesh->point_count; i++) {
        gradient[3 * mesh->vertex[i / 3] + i % 3] += v->sum[i];
    }
    return energy;
}
