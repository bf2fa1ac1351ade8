// sum.c: sigma_t = sigma_s + sigma_a, voxel by voxel.
#include "medium/sum.h"

// A channel of a voxel; one number stands for all channels, and one value for all voxels.
static float value_at(const SceneView *view, const VolumeNode *v, int64_t voxel, int32_t channel) {
    int64_t first = v->kind == VOLUME_CONSTANT ? 0 : voxel * v->channels;
    return view->theta[v->theta + first + (v->channels == 1 ? 0 : channel)];
}

void rey_medium_sum(const SceneView *view, const MediumNode *medium) {
    if (medium->sigma_s < 0) {
        return;
    }
    const VolumeNode *sum = view->volumes + medium->sigma_t;
    const VolumeNode *sigma_s = view->volumes + medium->sigma_s, *sigma_a = view->volumes + medium->sigma_a;
    int64_t voxels = (int64_t)sum->nx * sum->ny * sum->nz;
    for (int64_t i = 0; i < voxels; i++) {
        for (int32_t c = 0; c < sum->channels; c++) {
            view->theta[sum->theta + i * sum->channels + c] = value_at(view, sigma_s, i, c) + value_at(view, sigma_a, i, c);
        }
    }
}
