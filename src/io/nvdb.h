// nvdb.h: NanoVDB files of major version 32, plain, zipped or in Blosc chunks: the first grid as a dense one over the box of
// its active voxels. A file is a header, a record per grid, and a tree for each of them: root, upper nodes of 32^3 lower ones,
// these of 16^3 leaves, and these of 8^3 voxels [museth2021].
#pragma once

#include "base/context.h"

typedef struct rey_nvdb {
    int32_t nx, ny, nz, channels; // channels: 1 or 3
    bool placed;                  // the box is along the axes
    float box[6];                 // corners in the world
    uint32_t type;
    int64_t low[3];               // first voxel
    const unsigned char *grid;    // its bytes
    size_t size;
    unsigned char *own;           // what was uncompressed
} rey_nvdb;

bool rey_nvdb_known(const unsigned char *bytes, size_t size); // whether a file begins like one
// The bytes must outlive *out, which the caller frees. Failures: REY_ERROR_FORMAT ("FILE: ..."), REY_ERROR_UNSUPPORTED,
// REY_ERROR_MEMORY; *out is then empty.
rey_result rey_nvdb_open(rey_context *ctx, const char *name, const unsigned char *bytes, size_t size, rey_nvdb *out);
// All voxels of the box; channel fastest, then x, y, z. Each is finite.
rey_result rey_nvdb_read(rey_context *ctx, const char *name, const rey_nvdb *nvdb, float *values);
void rey_nvdb_free(rey_context *ctx, rey_nvdb *nvdb);
