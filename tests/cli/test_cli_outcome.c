// test_cli_outcome.c: what a fit says of itself: which loss it ended with, and what it finds wrong before it starts.
#include "command.h"

#include <math.h>

static void write_words(const char *path, const char *words) {
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    fputs(words, file);
    assert_int_equal(fclose(file), 0);
}

// A job in the test's folder for the scenes of the test jobs; lines follow it.
static void write_job(Fixture *f, const char *lines) {
    char text[2048];
    if (access("target.exr", R_OK) != 0) {
        expect(f, 0, "render " TEST_JOBS "/truth.xml -o target.exr --spp 16");
    }
    snprintf(text, sizeof text, "scene: " TEST_JOBS "/start.xml\nspp: 8\nreport_spp: 2\nimage_every: 0\nviews: [{target: target.exr}]\n"
             "parameters: [{name: red.reflectance.value, learning_rate: 0.05}]\n%s", lines);
    write_words("job.yaml", text);
}

// Losses of metrics.jsonl: their least, the mean of the last ten, and how many there are.
static int read_losses(const char *path, double *least, double *mean) {
    static char text[OUTPUT_BYTES];
    double losses[64], sum = 0;
    int count = 0;
    read_text(path, text);
    *least = INFINITY;
    for (const char *at = text; (at = strstr(at, "\"loss\":")) && count < 64; count++) {
        at += strlen("\"loss\":");
        losses[count] = strtod(at, NULL);
        *least = fmin(*least, losses[count]);
    }
    int window = count < 10 ? count : 10;
    for (int i = count - window; i < count; i++) {
        sum += losses[i] / window;
    }
    *mean = sum;
    return count;
}

static void expect_loss(Fixture *f, const char *arguments, const char *words, bool best) {
    double least, mean;
    char line[256];
    JsonNode *node = run_json(f, 0, arguments);
    assert_true(read_losses("out/metrics.jsonl", &least, &mean) > 0);
    assert_string_equal(json_text(node, "loss_is", ""), words);
    assert_float_equal(json_value(node, "loss", NAN), best ? least : mean, 1e-6 * fabs(mean));
    assert_true(least < mean);
    snprintf(line, sizeof line, "Loss %.4g, %s.", json_value(node, "loss", NAN), words);
    static char page[1 << 22];
    FILE *file = fopen("out/report.html", "rb");
    assert_non_null(file);
    page[fread(page, 1, sizeof page - 1, file)] = 0;
    fclose(file);
    assert_non_null(strstr(page, line));
    json_free(node);
    snprintf(line, sizeof line, "(%s)\n", words);
    expect(f, 0, "fit job.yaml -o out --resume");
    assert_non_null(strstr(f->out, line));
}

// With Adam it is a mean over iterations; L-BFGS, which uses the same samples always, shows that of the point that it took.
static void losses_are_explained(void **state) {
    Fixture *f = *state;
    write_job(f, "iterations: 12\n");
    expect_loss(f, "fit job.yaml -o out --json --overwrite", "mean of the last 10 iterations", false);
    write_job(f, "iterations: 6\n");
    expect_loss(f, "fit job.yaml -o out --json --overwrite", "mean of the last 6 iterations", false);
    write_job(f, "iterations: 8\noptimizer: {type: lbfgs, learning_rate: 0.2}\n");
    expect_loss(f, "fit job.yaml -o out --json --overwrite", "of the best point, which was taken", true);
    write_job(f, "iterations: 1\n");
    expect(f, 0, "fit job.yaml -o out --overwrite");
    assert_non_null(strstr(f->out, "(of the last iteration)"));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(losses_are_explained),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
