// laplacian.c: I + lambda L through CHOLMOD. Simplicial and with a fixed ordering: the same bits on every machine, and no
// BLAS, whose threads would compete with the renderer's.
#include "fit/laplacian.h"

#include <suitesparse/cholmod.h>

#include <math.h>
#include <string.h>

struct Laplacian {
    const PointMesh *mesh;
    double lambda;
    cholmod_common common;
    cholmod_factor *factor;
    cholmod_dense *b, *x, *y, *e; // right side, solution, workspace
};

// Upper triangle, by columns: edges come in the order of their lower end, so that columns are filled with rising rows.
static void fill_columns(const PointMesh *mesh, double lambda, int32_t *next, cholmod_sparse *a) {
    int32_t *first = a->p, *rows = a->i, n = mesh->point_count;
    double *values = a->x;
    for (int32_t k = 0; k < mesh->edge_count; k++) {
        first[mesh->edges[k].b + 1]++;
    }
    for (int32_t j = 0; j < n; j++) {
        first[j + 1] += first[j] + 1; // and the diagonal, behind the others
        values[first[j + 1] - 1] = 1;
        rows[first[j + 1] - 1] = j;
    }
    memcpy(next, first, (size_t)n * sizeof *next);
    for (int32_t k = 0; k < mesh->edge_count; k++) {
        const PointEdge *e = &mesh->edges[k];
        int32_t at = next[e->b]++;
        rows[at] = e->a;
        values[at] = -lambda;
        values[first[e->a + 1] - 1] += lambda;
        values[first[e->b + 1] - 1] += lambda;
    }
}

static cholmod_sparse *matrix_of(rey_context *ctx, Laplacian *l) {
    size_t n = (size_t)l->mesh->point_count;
    cholmod_sparse *a = cholmod_allocate_sparse(n, n, n + (size_t)l->mesh->edge_count, 1, 1, 1, CHOLMOD_REAL, &l->common);
    int32_t *next = a ? rey_alloc_array(ctx, n, sizeof *next) : NULL;
    if (!next) {
        cholmod_free_sparse(&a, &l->common);
        return NULL;
    }
    memset(a->p, 0, (n + 1) * sizeof(int32_t));
    fill_columns(l->mesh, l->lambda, next, a);
    rey_free(ctx, next);
    return a;
}

rey_result rey_laplacian_create(rey_context *ctx, const PointMesh *mesh, double lambda, Laplacian **out) {
    Laplacian *l = *out = rey_alloc(ctx, sizeof *l);
    if (!l) {
        return REY_ERROR_MEMORY;
    }
    l->mesh = mesh;
    l->lambda = lambda;
    cholmod_start(&l->common);
    l->common.print = 0;
    l->common.supernodal = CHOLMOD_SIMPLICIAL;
    l->common.nmethods = 1;
    l->common.method[0].ordering = CHOLMOD_AMD;
    cholmod_sparse *a = matrix_of(ctx, l);
    l->factor = a ? cholmod_analyze(a, &l->common) : NULL;
    bool factored = l->factor && cholmod_factorize(a, l->factor, &l->common) && l->common.status == CHOLMOD_OK;
    cholmod_free_sparse(&a, &l->common);
    l->b = factored ? cholmod_zeros((size_t)mesh->point_count, 3, CHOLMOD_REAL, &l->common) : NULL;
    // One solution now: later ones find their memory, and cannot fail.
    if (!l->b || !cholmod_solve2(CHOLMOD_A, l->factor, l->b, NULL, &l->x, NULL, &l->y, &l->e, &l->common)) {
        return rey_fail(ctx, REY_ERROR_MEMORY, "the Laplacian of %d points could not be factored: CHOLMOD's status is %d",
                        (int)mesh->point_count, l->common.status);
    }
    return REY_OK;
}

void rey_laplacian_free(rey_context *ctx, Laplacian *l) {
    if (l) {
        cholmod_free_factor(&l->factor, &l->common);
        cholmod_free_dense(&l->b, &l->common);
        cholmod_free_dense(&l->x, &l->common);
        cholmod_free_dense(&l->y, &l->common);
        cholmod_free_dense(&l->e, &l->common);
        cholmod_finish(&l->common);
        rey_free(ctx, l);
    }
}

void rey_laplacian_multiply(const Laplacian *l, const double *x, double *u) {
    memcpy(u, x, 3 * (size_t)l->mesh->point_count * sizeof *u);
    for (int32_t k = 0; k < l->mesh->edge_count; k++) {
        const PointEdge *e = &l->mesh->edges[k];
        for (int c = 0; c < 3; c++) {
            double difference = l->lambda * (x[3 * e->a + c] - x[3 * e->b + c]);
            u[3 * e->a + c] += difference;
            u[3 * e->b + c] -= difference;
        }
    }
}

void rey_laplacian_solve(Laplacian *l, const double *u, double *x) {
    int32_t n = l->mesh->point_count;
    double *b = l->b->x;
    for (int32_t i = 0; i < 3 * n; i++) { // CHOLMOD's are by columns
        b[i % 3 * n + i / 3] = u[i];
    }
    bool solved = cholmod_solve2(CHOLMOD_A, l->factor, l->b, NULL, &l->x, NULL, &l->y, &l->e, &l->common);
    const double *found = l->x->x;
    for (int32_t i = 0; i < 3 * n; i++) {
        x[i] = solved ? found[i % 3 * n + i / 3] : (double)NAN;
    }
}
