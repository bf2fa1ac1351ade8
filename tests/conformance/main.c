// main.c: conformance [FOLDER] [--seeds N] [--scale N] [--only GLOB] [--quick] [-t N] [--lanes N]
//             [--sampler sobol|independent]
#include "conformance.h"

#include "base/context.h"
#include "cli.h"
#include "io/image.h"

#include <fnmatch.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

bool suite_selects(const Suite *suite, const char *name) {
    return !suite->only || fnmatch(suite->only, name, 0) == 0;
}

void suite_report(Suite *suite, const char *name, Verdict verdict, bool gated, const char *format, ...) {
    static const char *const words[] = {"pass", "FAIL", "skip"};
    static const char *const ungated_words[] = {"(pass)", "(fail)", "(skip)"};
    va_list arguments;
    va_start(arguments, format);
    printf("%-6s %-62s ", (gated ? words : ungated_words)[verdict], name);
    vprintf(format, arguments);
    putchar('\n');
    fflush(stdout);
    va_end(arguments);
    if (gated) {
        int *counts[] = {&suite->passed, &suite->failed, &suite->skipped};
        ++*counts[verdict];
    }
}

void suite_report_failure(Suite *suite, const char *name, rey_result result, bool gated) {
    bool missing = result == REY_ERROR_UNSUPPORTED || result == REY_ERROR_INCOMPLETE;
    suite_report(suite, name, missing ? VERDICT_SKIP : VERDICT_FAIL, gated, "%s", rey_error(suite->ctx));
}

rey_result suite_load(Suite *suite, const char *path, const char *integrator, int spp, rey_scene **scene) {
    char count[32];
    snprintf(count, sizeof count, "%d", spp);
    const rey_define defines[] = {{"integrator", integrator}, {"spp", count}};
    return rey_scene_load(suite->ctx, path, defines, COUNT_OF(defines), scene);
}

rey_result suite_read_image(Suite *suite, const char *path, int width, int height, float **rgb) {
    int w, h;
    rey_result result = cli_read_image(suite->ctx, path, &w, &h, rgb, NULL);
    if (!result && (w != width || h != height)) {
        rey_free(suite->ctx, *rgb);
        *rgb = NULL;
        return rey_fail(suite->ctx, REY_ERROR_FORMAT, "%s: %d x %d pixels, expected %d x %d", path, w, h, width,
                        height);
    }
    return result;
}

float *suite_image(Suite *suite, int width, int height) {
    return rey_alloc_array(suite->ctx, (size_t)width * (size_t)height, 3 * sizeof(float));
}

static int usage(void) {
    fprintf(stderr, "usage: conformance [FOLDER] [--seeds N] [--scale N] [--only GLOB] [--quick] [-t N] [--lanes N]"
                    " [--sampler sobol|independent]\n");
    return 2;
}

static bool parse(int argc, char **argv, Suite *suite, rey_context_def *def) {
    for (int i = 1; i < argc; i++) {
        const char *name = argv[i], *value = i + 1 < argc ? argv[i + 1] : "";
        int64_t number = 0;
        bool good = cli_parse_integer(value, 1, 1000000, &number);
        if (!strcmp(name, "--quick")) {
            suite->quick = true;
            continue;
        }
        if (name[0] != '-') {
            suite->folder = name;
            continue;
        }
        if (!strcmp(name, "--only")) {
            suite->only = value;
        } else if (!strcmp(name, "--sampler") && !strcmp(value, "sobol")) {
            suite->sampler = REY_SAMPLER_SOBOL;
        } else if (!strcmp(name, "--sampler") && !strcmp(value, "independent")) {
            suite->sampler = REY_SAMPLER_INDEPENDENT;
        } else if (!strcmp(name, "--seeds") && good) {
            suite->seeds = (int)number;
        } else if (!strcmp(name, "--scale") && good) {
            suite->scale = (int)number;
        } else if (!strcmp(name, "-t") && good) {
            def->threads = (int)number;
        } else if (!strcmp(name, "--lanes") && good) {
            def->lanes = (int)number;
        } else {
            return false;
        }
        i++;
    }
    return true;
}

int main(int argc, char **argv) {
    const char *environment = getenv("REYNOLDS_CONFORMANCE_DIR");
    Suite suite = {.seeds = 1, .scale = 1};
    static const char default_folder[] = PROJECT_DIR "/../shared/conformance";
    suite.folder = environment && environment[0] ? environment : default_folder;
    rey_context_def def = rey_default_context_def();
    if (!parse(argc, argv, &suite, &def)) {
        return usage();
    }
    char path[4096];
    snprintf(path, sizeof path, "%s/renders.json", suite.folder);
    if (access(path, R_OK)) {
        bool named = suite.folder != default_folder;
        printf("%s: there is no %s\n0 passed, %d failed, %d skipped\n", named ? "failed" : "skipped", path, named, !named);
        return named; // who names a folder wants it run
    }
    rey_result result = rey_context_create(&def, &suite.ctx);
    if (result) {
        fprintf(stderr, "conformance: %s\n", rey_result_text(result));
        return 1;
    }
    run_renders(&suite);
    run_derivatives(&suite);
    run_facts(&suite);
    run_converts(&suite);
    rey_context_destroy(suite.ctx);
    if (suite.only && suite.passed + suite.failed + suite.skipped == 0) {
        fprintf(stderr, "conformance: --only %s fits no case, expected a pattern such as '*/test_spot'\n", suite.only);
        return 2;
    }
    printf("%d passed, %d failed, %d skipped\n", suite.passed, suite.failed, suite.skipped);
    return suite.failed ? 1 : 0;
}
