// compare.c: `reynolds compare`: how two pictures differ; the second one is the reference.
#include "cli.h"

#include "base/context.h"

#include <math.h>
#include <stdio.h>

static const double relative_floor = 1e-2; // added to B^2 in the relative mean square error

typedef struct Difference {
    double mse, mae, relative_mse, psnr;
    double max_error;
    int x, y, channel; // where the largest error is
    double mean_a, mean_b;
    int64_t numbers;                    // that both pictures have
    int64_t nonfinite_a, nonfinite_b; // left out of everything above
} Difference;

static Difference compare(const float *a, const float *b, int width, int height) {
    Difference d = {.max_error = -1};
    int64_t count = (int64_t)width * height * 3;
    for (int64_t i = 0; i < count; i++) {
        d.nonfinite_a += !isfinite(a[i]);
        d.nonfinite_b += !isfinite(b[i]);
        d.numbers += isfinite(a[i]) && isfinite(b[i]);
    }
    double n = (double)d.numbers;
    for (int64_t i = 0; i < count; i++) {
        double p = (double)a[i], q = (double)b[i], e = fabs(p - q);
        if (!isfinite(p) || !isfinite(q)) {
            continue;
        }
        d.mse += e * e / n;
        d.mae += e / n;
        d.relative_mse += e * e / (q * q + relative_floor) / n;
        d.mean_a += p / n;
        d.mean_b += q / n;
        if (e > d.max_error) {
            d.max_error = e;
            d.channel = (int)(i % 3);
            d.x = (int)(i / 3 % width);
            d.y = (int)(i / 3 / width);
        }
    }
    d.psnr = -10 * log10(d.mse);
    return d;
}

static void print_text(const Difference *d, int width, int height) {
    printf("size          %d x %d\nmse           %.9g\nmae           %.9g\nrelative_mse  %.9g\npsnr          %.2f dB\n",
           width, height, d->mse, d->mae, d->relative_mse, d->psnr);
    printf("max_error     %.9g at %d,%d %c\nmean          %.9g against %.9g\n", d->max_error, d->x, d->y,
           "RGB"[d->channel], d -> mean_a, d -> mean_b);
    if (d->nonfinite_a || d->nonfinite_b) {
        printf("nonfinite     %lld in A, %lld in B, left out above\n", (long long)d->nonfinite_a,
               (long long)d->nonfinite_b);
    }
}

static void print_json(const Difference *d, int width, int height) {
    Json json = json_begin(stdout);
    json_object(&json, NULL);
    json_integer(&json, "width", width);
    json_integer(&json, "height", height);
    json_number(&json, "mse", d->mse);
    json_number(&json, "mae", d->mae);
    json_number(&json, "relative_mse", d->relative_mse);
    json_number(&json, "psnr", d->psnr);
    json_number(&json, "max_error", d->max_error);
    json_array(&json, "max_error_at");
    json_integer(&json, NULL, d->x);
    json_integer(&json, NULL, d->y);
    json_integer(&json, NULL, d->channel);
    json_array_end(&json);
    json_number(&json, "mean_a", d->mean_a);
    json_number(&json, "mean_b", d->mean_b);
    json_integer(&json, "nonfinite", d->nonfinite_a + d->nonfinite_b);
    json_integer(&json, "nonfinite_a", d->nonfinite_a);
    json_integer(&json, "nonfinite_b", d->nonfinite_b);
    json_object_end(&json);
    json_end(&json);
}

// A file of 8 bits ends where its encoding does, which is a difference from one of floats that no rendering makes.
static void note_clipping(const Options *o, const float *image, int64_t count, int linear) {
    int64_t outside = 0;
    for (int64_t i = 0; i < count; i++) {
        outside += image[i] < 0 || image[i] > 1;
    }
    if (outside > 0) {
        cli_note("%lld of %lld numbers of %s lie outside of 0 to 1, to which %s is clipped", (long long)outside, (long long)count,
                 o->files[linear], o->files[1 - linear]);
    }
}

static int compare_files(const Options *o, rey_context *ctx, float *images[2]) {
    int width[2] = {0}, height[2] = {0};
    ImageFile kinds[2] = {{0}};
    for (int i = 0; i < 2; i++) {
        rey_result result = cli_read_image(ctx, o->files[i], &width[i], &height[i], &images[i], &kinds[i]);
        if (result) {
            return cli_report_failure(o, ctx, result);
        }
    }
    if (width[0] != width[1] || height[0] != height[1]) {
        return cli_fail(o, "the sizes differ: %s is %d x %d, %s is %d x %d", o->files[0], width[0], height[0],
                        o->files[1], width[1], height[1]);
    }
    Difference d = compare(images[0], images[1], width[0], height[0]);
    if (d.numbers == 0) {
        return cli_fail(o, "no pixel is finite in both %s and %s", o->files[0], o->files[1]);
    }
    (o->json ? print_json : print_text)(&d, width[0], height[0]);
    if (d.nonfinite_a || d.nonfinite_b) {
        cli_note("%lld of %lld numbers of %s and %lld of %s are not finite: the pictures differ there",
                 (long long)d.nonfinite_a, (long long)width[0] * height[0] * 3, o->files[0], (long long)d.nonfinite_b,
                 o->files[1]);
    }
    for (int i = 0; i < 2; i++) {
        if (kinds[i].translucent) {
            cli_note("the colours of %s are divided by its alpha, which is left out", o->files[i]);
        }
        if (kinds[1 - i].encoded && !kinds[i].encoded) {
            note_clipping(o, images[i], (int64_t)width[0] * height[0] * 3, i);
        }
    }
    int status = cli_finish_output();
    return status ? status : d.nonfinite_a || d.nonfinite_b ? EXIT_FAILED : EXIT_OK;
}

int cli_compare(int argc, char **argv) {
    Options options;
    Session session;
    int status;
    if (!cli_options_parse(COMMAND_COMPARE, argc, argv, &options, &status)) {
        return status;
    }
    status = cli_context_open(&options, &session);
    if (!status) {
        float *images[2] = {NULL, NULL};
        status = compare_files(&options, session.ctx, images);
        rey_free(session.ctx, images[0]);
        rey_free(session.ctx, images[1]);
        cli_session_close(&session);
    }
    cli_options_free(&options);
    return status;
}
