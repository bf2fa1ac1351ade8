// laplacian.h: the matrix M = I + lambda L of a mesh, L its combinatorial Laplacian (degree minus adjacency), factored by
// sparse Cholesky [nicolet2021 eq. 12]. Steps in u = M x move smooth parts of a surface as a whole: large triangles stay
// untangled where steps in x tear them.
#pragma once

#include "fit/point_mesh.h"

typedef struct Laplacian Laplacian;

// mesh must outlive it. Freed with rey_laplacian_free.
rey_result rey_laplacian_create(rey_context *ctx, const PointMesh *mesh, double lambda, Laplacian **out);
void rey_laplacian_free(rey_context *ctx, Laplacian *laplacian);
// u = M x; both hold three numbers per point.
void rey_laplacian_multiply(const Laplacian *laplacian, const double *x, double *u);
// x = M^-1 u, which may be the same array. NaN everywhere should the solver fail.
void rey_laplacian_solve(Laplacian *laplacian, const double *u, double *x);
