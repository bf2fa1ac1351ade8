// tracking.c: delta tracking through a cloud of 128^3 voxels that is empty in much of it and dense in little, on one thread: rays,
// lookups and supervoxels a second at every width, with bounds of supervoxels and with one bound for all.
//
// usage: tracking FOLDER
#include "base/platform.h"
#include "tracking.h"

#include <math.h>
#include <reynolds/reynolds.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

enum { SIDE = 128, RAYS = 1 << 16, REPEATS = 5, WIDTHS = 3 };

static const struct {
    int lanes;
    tracking_fn *track, *count;
} widths[WIDTHS] = {{1, track_w1, count_w1}, {8, track_w8, count_w8}, {16, track_w16, count_w16}};

static double seconds(void) {
    struct timespec now;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static double random_unit(uint32_t *state) {
    *state = *state * 1664525u + 1013904223u;
    return (double)(*state >> 8) / (1 << 24);
}

// Puffs of all sizes around a crooked axis; the smaller, the denser.
static float *make_cloud(double *mean, double *largest) {
    enum { PUFFS = 50 };
    float *voxels = calloc((size_t)SIDE * SIDE * SIDE, sizeof *voxels);
    uint32_t state = 12345;
    for (int p = 0; p < PUFFS && voxels; p++) {
        double radius = 6 + 12 * pow(random_unit(&state), 2), t = random_unit(&state), c[3];
        for (int k = 0; k < 3; k++) {
            c[k] = SIDE * (0.5 + (k == 0 ? t - 0.5 : 0.25 * sin(5 * t + 2 * k)) * 0.8 + 0.2 * (random_unit(&state) - 0.5));
        }
        for (int64_t i = 0; i < (int64_t)SIDE * SIDE * SIDE; i++) {
            double x = (double)(i % SIDE) - c[0], y = (double)(i / SIDE % SIDE) - c[1], z = (double)(i / SIDE / SIDE) - c[2];
            double r = (x * x + y * y + z * z) / (radius * radius);
            voxels[i] += r < 5 ? (float)(exp(-r) * 60 / (radius * radius)) : 0;
        }
    }
    double sum = 0, most = 0;
    for (int64_t i = 0; i < (int64_t)SIDE * SIDE * SIDE && voxels; i++) {
        sum += (double)voxels[i];
        most = fmax(most, (double)voxels[i]);
    }
    *mean = sum / ((double)SIDE * SIDE * SIDE);
    *largest = most;
    return voxels;
}

static bool write_scene(const char *folder, char path[1024], double *mean, double *largest) {
    char grid[1024];
    snprintf(grid, sizeof grid, "%s/tracking.vol", folder);
    snprintf(path, 1024, "%s/tracking.xml", folder);
    float *voxels = make_cloud(mean, largest);
    FILE *file = fopen(grid, "wb");
    const unsigned char head[4] = {'V', 'O', 'L', 3};
    const int32_t numbers[5] = {1, SIDE, SIDE, SIDE, 1};
    const float box[6] = {0, 0, 0, 1, 1, 1};
    bool good = voxels && file && fwrite(head, sizeof head, 1, file) == 1 && fwrite(numbers, sizeof numbers, 1, file) == 1 &&
                fwrite(box, sizeof box, 1, file) == 1 &&
                fwrite(voxels, sizeof *voxels, (size_t)SIDE * SIDE * SIDE, file) == (size_t)SIDE * SIDE * SIDE;
    good = (file && fclose(file) == 0) && good;
    free(voxels);
    file = good ? fopen(path, "w") : NULL;
    good = file && fprintf(file, "<scene version=\"3.0.0\"><integrator type=\"volpath\"/><sensor type=\"perspective\"/>"
                                 "<emitter type=\"constant\"/><shape type=\"cube\"><bsdf type=\"null\"/>"
                                 "<medium name=\"interior\" type=\"heterogeneous\"><float name=\"scale\" value=\"18\"/>"
                                 "<volume name=\"sigma_t\" type=\"gridvolume\"><string name=\"filename\" value=\"tracking.vol\"/>"
                                 "</volume></medium></shape></scene>\n") > 0;
    return file && fclose(file) == 0 && good;
}

static double share_of_empty(const SceneView *view, const MediumNode *m) {
    int32_t count = m->nx * m->ny * m->nz, empty = 0;
    for (int32_t i = 0; i < count; i++) {
        empty += view->tables[m->table + i] == 0;
    }
    return (double)empty / count;
}

static void measure(const SceneView *view, const MediumNode *medium, bool through, const char *bounds) {
    double best[WIDTHS];
    for (int repeat = 0; repeat < REPEATS; repeat++) {
        for (int k = 0; k < WIDTHS; k++) {
            TrackingCount unused = {0};
            double start = seconds();
            widths[k].track(view, medium, through, RAYS, &unused);
            double took = seconds() - start;
            best[k] = repeat == 0 || took < best[k] ? took : best[k];
        }
    }
    for (int k = 0; k < WIDTHS; k++) {
        TrackingCount count = {0};
        widths[k].count(view, medium, through, RAYS, &count);
        double n = (double)count.rays, rays = 1e-6 * n / best[k];
        double lookups = (double)count.lookups / n, cells = (double)count.cells / n;
        printf("%-10s %-11s %5d %8.2f %10.1f %8.1f %11.2f %9.2f %8.4f %8.2f\n", through ? "ratio" : "delta", bounds,
               widths[k].lanes, rays, rays * lookups, rays * cells, lookups, cells, count.passed / n, best[0] / best[k]);
    }
}

int main(int argc, char **argv) {
    char path[1024];
    double mean, largest;
    rey_context *ctx = NULL;
    rey_scene *scene = NULL;
    if (argc != 2 || !write_scene(argv[1], path, &mean, &largest)) {
        fprintf(stderr, "usage: tracking FOLDER, an existing one\n");
        return 2;
    }
    if (rey_context_create(NULL, &ctx) || rey_scene_load(ctx, path, NULL, 0, &scene)) {
        fprintf(stderr, "tracking: %s\n", ctx ? rey_error(ctx) : "no context");
        return 1;
    }
    const SceneView *view = &scene->view;
    const MediumNode *medium = view->media;
    MediumNode whole = *medium; // its bounds end with that of all of them
    whole.table += medium->nx * medium->ny * medium->nz;
    whole.nx = whole.ny = whole.nz = 1;
    printf("%d^3 voxels, %d^3 supervoxels, %.0f %% of them empty, largest over mean extinction %.0f\n", SIDE, medium->nx,
           100 * share_of_empty(view, medium), largest / mean);
    printf("%-10s %-11s %5s %8s %10s %8s %11s %9s %8s %8s\n", "tracking", "bounds", "lanes", "Mrays/s", "Mlookups/s", "Mcells/s",
           "lookups/ray", "cells/ray", "passed", "over w1");
    for (int through = 0; through < 2; through++) {
        measure(view, medium, through, "supervoxels");
        measure(view, &whole, through, "one");
    }
    rey_scene_destroy(scene);
    rey_context_destroy(ctx);
    return 0;
}
