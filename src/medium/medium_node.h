// medium_node.h: volumes and media in the flat scene.
#pragma once

#include "scene/scene.h"

enum {
#define VOLUME(ENUM, prefix, name) VOLUME_##ENUM,
#include "medium/volumes.inl"
#undef VOLUME
    VOLUME_KIND_COUNT
};

// A field over the unit cube, which to_world places.
typedef struct VolumeNode {
    int32_t kind;
    int32_t theta, channels; // first value; 1 or 3 numbers per voxel
    int32_t nx, ny, nz;      // voxels, x fastest
    int32_t filter, wrap;    // as of bitmaps
    int32_t table;           // rows of the inverse of to_world (12), -1 = the unit cube itself
} VolumeNode;

// Supervoxels per axis at most, as measured: with 16 a walk through a peaked cloud of 128^3 voxels looks up 5 of them where a
// global majorant needs 76.
enum { MOST_SUPERVOXELS = 16 };

// Extinction is scale x sigma_t, of which the share `albedo` scatters.
typedef struct MediumNode {
    int32_t sigma_t, albedo, phase; // volumes; phase function
    int32_t scale;                  // theta offset
    bool bounded;                   // heterogeneous: nothing lies outside of the cube of sigma_t
    int32_t nx, ny, nz, table;      // supervoxels, and the largest extinction in each of them
} MediumNode;
