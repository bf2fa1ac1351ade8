// conformance.h: the suite that judges the renderer by scenes and pictures made by others.
#pragma once

#include "json_read.h"
#include "reynolds/reynolds.h"

#include <stdbool.h>

typedef struct Suite {
    const char *folder; // holds renders.json and ad/
    const char *only;   // glob on case names, null = all
    int seeds;          // every case runs with seeds 0 to seeds - 1, and all of them must pass
    int scale;          // times the prescribed number of samples
    int sampler;        // REY_SAMPLER_*; default: what each scene names
    bool quick;         // only cases of at most a few million samples
    rey_context *ctx;
    int passed, failed, skipped;
} Suite;

// Cases above this number of samples are left out by --quick.
static const double quick_samples = 2.5e6;

typedef enum Verdict { VERDICT_PASS, VERDICT_FAIL, VERDICT_SKIP } Verdict;

bool suite_selects(const Suite *suite, const char *name);
// Prints the row of one case and counts it, unless it is not gated.
void suite_report(Suite *suite, const char *name, Verdict verdict, bool gated, const char *format, ...)
    __attribute__((format(printf, 5, 6)));
// Reports a library failure: skipped when a kind or a term does not exist yet, else failed.
void suite_report_failure(Suite *suite, const char *name, rey_result result, bool gated);

// Loads a scene with the definitions that the suite prescribes.
rey_result suite_load(Suite *suite, const char *path, const char *integrator, int spp, rey_scene **scene);
// Reads a picture of a known size; *rgb is freed with rey_free.
rey_result suite_read_image(Suite *suite, const char *path, int width, int height, float **rgb);
// Room for a picture, zeroed.
float *suite_image(Suite *suite, int width, int height);

void run_renders(Suite *suite);
void run_derivatives(Suite *suite);
void run_facts(Suite *suite);
void run_converts(Suite *suite);
