// boundary.h: drivers of the boundary terms: which curves matter, how often each is sampled, and the passes over them.
#pragma once

#include "render/render_parts.h"

// Prepares the terms of a derivative after the selection is mapped, where they can be computed, and records why not; a
// rey_boundaries_free follows in any case.
rey_result rey_boundaries_begin(Render *r);
void rey_boundaries_free(Render *r);
// Whether a sensor is one that boundary terms know.
bool rey_boundary_sees(const SensorRecord *sensor);
// Whether a shape hides what is behind it, so that its outlines matter.
bool rey_boundary_hides(const SceneView *view, const ShapeRecord *shape);
// Whether paths go on from surfaces in directions that follow from how they came, and whether surfaces let light pass undeviated.
// In media, those of the kind null are passed by all (sightline.h, leg.h), and count for neither.
bool rey_boundary_chained(const SceneView *view);
bool rey_boundary_veiled(const SceneView *view);
// Whether what only vertex normals move is known for a sensor: silhouettes have no part in it.
bool rey_turning_known(const SceneView *view, const SensorRecord *sensor);
// Whether edges are known along chains of smooth mirrors and glass that begin at a vertex other than the camera.
bool rey_chains_known(const SceneView *view, const SensorRecord *sensor);
// Why not: null, or words and the object, -1 = none of that sort, that they are followed by.
typedef struct ChainObstacle {
    const char *what;
    int32_t shape, bsdf, texture;
} ChainObstacle;
ChainObstacle rey_chains_obstacle(const SceneView *view, const SensorRecord *sensor);
// The term that boundaries of a kind (BOUNDARY_) belong to.
int rey_boundary_term(int32_t kind);
// Runs the samples of one set. Reverse: adds to r->gradients. Forward: adds to the picture.
void rey_boundary_run(Render *r, BoundaryPlan *plan, uint32_t scramble, double *picture);
