// grad.c: `reynolds grad`: the derivative image along a direction, or the gradient of sum A * image.
//
// Both modes report value = d/dtheta of the sum over pixels and channels of A * image along the joint direction
// (forward mode: A = 1/(3 W H), the mean), and its standard error from independently scrambled sample sets: the
// standard deviation of the sets' values divided by the square root of their number.
#include "cli.h"
#include "npy.h"

#include "base/context.h"
#include "io/file.h"
#include "io/image.h"
#include "render/facing.h"
#include "render/term_request.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { SETS = 16, PATH_BYTES = 4096, SHOWN_VALUES = 16 }; // gradients up to this size are printed in full with --json

// What is told of one parameter's gradient.
typedef struct Summary {
    double sum, standard_error, rms; // of the sum
    double values[SHOWN_VALUES];
    double set_sums[SETS]; // of each sample set
} Summary;

typedef struct Grad {
    Session session;
    Direction direction;
    rey_stats stats;
    double value, standard_error;
    Summary *summaries; // reverse: one per parameter of the direction
    double set_values[SETS]; // reverse: along the direction
    TermRequest request;
    double shares[SETS][TERM_COUNT]; // of each set's value
    int needed, used; // term bits
    float png_scale;  // of the signed picture, 0 when none was written
} Grad;

// Mean of the sets and its standard error; their values lie `stride` numbers apart.
static void summarize(const double *values, int stride, double *mean, double *standard_error) {
    double sum = 0, squares = 0;
    for (int i = 0; i < SETS; i++) {
        sum += values[i * stride];
    }
    *mean = sum / SETS;
    for (int i = 0; i < SETS; i++) {
        squares += (values[i * stride] - *mean) * (values[i * stride] - *mean);
    }
    *standard_error = sqrt(squares / (SETS - 1) / SETS);
}

// Terms that are needed. A jump that is only looked out for, and that no path met, is not.
static int terms_needed(const Grad *g) {
    return rey_terms_stated(g->session.scene, g->session.sensor, g->needed) | (g->needed & g->stats.missing_terms);
}

// Terms that are missing; of mirrors that the camera sees the term does not know.
static int terms_left_out(const Grad *g) {
    return terms_needed(g) & (~g->used | (g->stats.missing_terms & REY_TERM_SPECULAR));
}

// The terms' shares of the value, and their standard errors.
static void write_terms(Json *json, const Grad *g) {
    static const char *const keys[] = {"terms", "terms_standard_error"};
    int computed = g->used | (g->session.options->terms ? 0 : REY_TERM_INTERIOR);
    computed = rey_terms_stated(g->session.scene, g->session.sensor, computed);
    for (int k = 0; k < 2; k++) {
        json_object(json, keys[k]);
        for (int i = 0; i < TERM_COUNT; i++) {
            double numbers[2];
            summarize(&g->shares[0][i], TERM_COUNT, &numbers[0], &numbers[1]);
            if (computed & TERMS_ESTIMATED & 1 << i) {
                json_number(json, rey_term_name(1 << i), numbers[k]);
            }
        }
        json_object_end(json);
    }
}

static void write_gradients(Json *json, const Grad *g) {
    json_array(json, "gradients");
    for (int k = 0; k < g->direction.count; k++) {
        const Summary *s = &g->summaries[k];
        rey_param_info info = {.count = 0};
        rey_param_get_info(g->session.scene, g->direction.params[k], &info);
        json_object(json, NULL);
        json_string(json, "name", g->direction.names[k]);
        json_array(json, "shape");
        for (int i = 0; i < info.dims; i++) {
            json_integer(json, NULL, info.shape[i]);
        }
        json_array_end(json);
        json_number(json, "sum", s->sum);
        json_number(json, "standard_error", s->standard_error);
        json_number(json, "rms", s->rms);
        if (info.count <= SHOWN_VALUES) {
            json_array(json, "values");
            for (int64_t i = 0; i < info.count; i++) {
                json_number(json, NULL, s->values[i]);
            }
            json_array_end(json);
        }
        json_object_end(json);
    }
    json_array_end(json);
}

static void write_json(FILE *file, const Grad *g, const char *gradient_folder) {
    const Options *o = g->session.options;
    Json json = json_begin(file);
    json_object(&json, NULL);
    cli_json_stats(&json, &g->session, &g->stats);
    json_string(&json, "mode", o->reverse ? "reverse" : "forward");
    json_number(&json, "value", g->value);
    json_number(&json, "standard_error", g->standard_error);
    write_terms(&json, g);
    json_bool(&json, "complete", terms_left_out(g) == 0);
    cli_json_terms(&json, "needed_terms", terms_needed(g));
    cli_json_terms(&json, "left_out", terms_left_out(g));
    json_array(&json, "parameters");
    for (int i = 0; i < g->direction.count; i++) {
        json_string(&json, NULL, g->direction.names[i]);
    }
    json_array_end(&json);
    if (o->reverse) {
        write_gradients(&json, g);
    }
    json_integer(&json, "width", g->session.width);
    json_integer(&json, "height", g->session.height);
    json_string(&json, "output", gradient_folder ? gradient_folder : o->output);
    if (g->png_scale > 0) {
        json_number(&json, "png_scale", (double)g->png_scale);
    }
    json_object_end(&json);
    json_end(&json);
}

// OUT_variance.ext beside OUT.ext.
static void variance_path(const char *output, char path[PATH_BYTES]) {
    const char *dot = strrchr(output, '.');
    snprintf(path, PATH_BYTES, "%.*s_variance%s", (int)(dot - output), output, dot);
}

// The sample sets one by one: their mean, and what each pixel's mean varies by, from the scatter of the sets.
static rey_result forward_with_variance(Grad *g, float *image, float *variance, double *sets) {
    Session *s = &g->session;
    size_t count = (size_t)s->width * (size_t)s->height * 3;
    double *sums = rey_alloc_array(s->ctx, count, 2 * sizeof *sums);
    rey_result result = sums ? REY_OK : REY_ERROR_MEMORY;
    rey_scene_info info;
    rey_scene_get_info(s->scene, &info);
    int spp = s->def.spp ? s->def.spp : info.sample_count;
    s->def.sets = 1;
    s->def.spp = (spp + SETS - 1) / SETS;
    s->progress.parts = SETS;
    g->request.primary_spp = (g->request.primary_spp + SETS - 1) / SETS;
    g->request.indirect_spp = (g->request.indirect_spp + SETS - 1) / SETS;
    for (uint32_t k = 0; k < SETS && !result; k++) {
        rey_stats stats = {0};
        s->def.set = k;
        g->request.values = g->shares + k;
        result = rey_jvp_terms(s->scene, &s->def, g->request, cli_direction_selection(&g->direction),
                               g->direction.tangent, image, &sets[k], &stats);
        cli_add_stats(&g->stats, &stats);
        s->progress.part++;
        for (size_t i = 0; i < count && !result; i++) {
            double d = (double)image[i] - sums[2 * i];
            sums[2 * i] += d / (k + 1);
            sums[2 * i + 1] += d * ((double)image[i] - sums[2 * i]);
        }
    }
    for (size_t i = 0; i < count && !result; i++) {
        image[i] = (float)sums[2 * i];
        variance[i] = (float)(sums[2 * i + 1] / (SETS - 1) / SETS);
    }
    rey_free(s->ctx, sums);
    return result;
}

static rey_result write_forward(Grad *g, const float *image, const float *variance) {
    Session *s = &g->session;
    const char *output = s->options->output;
    char path[PATH_BYTES];
    bool png = cli_image_format(output) == IMAGE_PNG;
    rey_result result = cli_write_image(s->ctx, output, image, s->width, s->height, true, png ? &g->png_scale : NULL);
    if (!result && variance) {
        variance_path(output, path);
        result = cli_write_image(s->ctx, path, variance, s->width, s->height, false, NULL);
    }
    return result;
}

static rey_result forward(Grad *g) {
    Session *s = &g->session;
    double sets[SETS];
    size_t pixels = (size_t)s->width * (size_t)s->height;
    float *image = rey_alloc_array(s->ctx, pixels, 3 * sizeof *image), *variance = NULL;
    rey_result result = image ? REY_OK : REY_ERROR_MEMORY;
    if (!result && s->options->variance) {
        char path[PATH_BYTES];
        variance_path(s->options->output, path);
        variance = rey_alloc_array(s->ctx, pixels, 3 * sizeof *variance);
        result = variance ? rey_file_check_output(s->ctx, path) : REY_ERROR_MEMORY;
    }
    if (!result) {
        result = variance ? forward_with_variance(g, image, variance, sets)
                          : rey_jvp_terms(s->scene, &s->def, g->request, cli_direction_selection(&g->direction),
                                          g->direction.tangent, image, sets, &g->stats);
        cli_progress_end(&s->progress);
    }
    if (!result) {
        summarize(sets, 1, &g->value, &g->standard_error);
        result = s->options->output ? write_forward(g, image, variance) : REY_OK;
    }
    rey_free(s->ctx, image);
    rey_free(s->ctx, variance);
    return result;
}

static rey_result read_adjoint(Session *s, float **adjoint) {
    const char *text = s->options->adjoint;
    size_t count = (size_t)s->width * (size_t)s->height * 3;
    double number;
    if (cli_parse_number(text, &number)) {
        *adjoint = rey_alloc_array(s->ctx, count, sizeof **adjoint);
        for (size_t i = 0; i < count && *adjoint; i++) {
            (*adjoint)[i] = (float)number;
        }
        return *adjoint ? REY_OK : REY_ERROR_MEMORY;
    }
    int width, height;
    rey_result result = cli_read_image(s->ctx, text, &width, &height, adjoint, NULL);
    if (!result && (width != s->width || height != s->height)) {
        return rey_fail(s->ctx, REY_ERROR_ARGUMENT, "%s: the adjoint is %d x %d pixels, the picture %d x %d", text,
                        width, height, s->width, s->height);
    }
    return result;
}

static double dot(const double *gradient, const float *tangent, int64_t count) {
    double sum = 0;
    for (int64_t i = 0; i < count; i++) {
        sum += gradient[i] * (double)tangent[i];
    }
    return sum;
}

// FOLDER/NAME.npy of the k-th parameter.
static void gradient_path(const Grad *g, int k, char path[PATH_BYTES]) {
    const char *folder = g->session.options->output;
    snprintf(path, PATH_BYTES, "%s/%s.npy", folder, g->direction.names[k]);
    for (char *c = path + strlen(folder) + 1; *c; c++) {
        *c = *c == '/' ? '_' : *c; // names are not paths
    }
}

static rey_result check_gradient_paths(const Grad *g) {
    char path[PATH_BYTES];
    rey_result result = REY_OK;
    for (int k = 0; k < g->direction.count && g->session.options->output && !result; k++) {
        gradient_path(g, k, path);
        result = cli_refuse_input(&g->session, path);
        result = result ? result : rey_file_check_output(g->session.ctx, path);
    }
    return result;
}

static rey_result write_summary(const Grad *g) {
    const char *folder = g->session.options->output;
    char path[PATH_BYTES], *text = NULL;
    size_t size = 0;
    snprintf(path, sizeof path, "%s/gradient.json", folder);
    FILE *file = open_memstream(&text, &size);
    if (!file) {
        return rey_fail_memory(g->session.ctx, 0);
    }
    write_json(file, g, folder);
    bool bad = ferror(file) != 0;
    rey_result result = fclose(file) || bad ? rey_fail_memory(g->session.ctx, size)
                                            : rey_file_write(g->session.ctx, path, text, size);
    free(text);
    return result;
}

// Writes each parameter's gradient with the parameter's shape, and FOLDER/gradient.json.
static rey_result write_gradient(const Grad *g, const double *gradient) {
    rey_context *ctx = g->session.ctx;
    char path[PATH_BYTES];
    for (int k = 0; k < g->direction.count; k++) {
        rey_param_info info;
        rey_result result = rey_param_get_info(g->session.scene, g->direction.params[k], &info);
        float *values = result ? NULL : rey_alloc_array(ctx, (size_t)info.count, sizeof *values);
        if (!values) {
            return result ? result : REY_ERROR_MEMORY;
        }
        for (int64_t i = 0; i < info.count; i++) {
            values[i] = (float)gradient[g->direction.offsets[k] + i];
        }
        gradient_path(g, k, path);
        result = rey_npy_write(ctx, path, values, info.shape, info.dims);
        rey_free(ctx, values);
        if (result) {
            return result;
        }
    }
    return write_summary(g);
}

// What is kept of a sample set's gradient, which is as large as the selection.
static void book_set(void *user, int set, const double *gradient) {
    Grad *g = user;
    const Direction *d = &g->direction;
    g->set_values[set] = dot(gradient, d->tangent, d->offsets[d->count]);
    for (int k = 0; k < d->count; k++) {
        for (int64_t i = d->offsets[k]; i < d->offsets[k + 1]; i++) {
            g->summaries[k].set_sums[set] += gradient[i];
        }
    }
}

// Each parameter's gradient in a few numbers.
static void summarize_gradients(Grad *g, const double *gradient) {
    const Direction *d = &g->direction;
    for (int k = 0; k < d->count; k++) {
        Summary *s = &g->summaries[k];
        int64_t count = d->offsets[k + 1] - d->offsets[k];
        double squares = 0;
        for (int64_t i = 0; i < count; i++) {
            double x = gradient[d->offsets[k] + i];
            squares += x * x / (double)count;
            if (i < SHOWN_VALUES) {
                s->values[i] = x;
            }
        }
        summarize(s->set_sums, 1, &s->sum, &s->standard_error);
        s->rms = sqrt(squares);
    }
}

static rey_result reverse(Grad *g) {
    Session *s = &g->session;
    int64_t size = g->direction.offsets[g->direction.count];
    float *adjoint = NULL;
    double *gradient = rey_alloc_array(s->ctx, (size_t)size, sizeof *gradient);
    g->summaries = rey_alloc_array(s->ctx, (size_t)g->direction.count, sizeof *g->summaries);
    g->request.set_done = book_set;
    g->request.user = g;
    rey_result result = gradient && g->summaries ? check_gradient_paths(g) : REY_ERROR_MEMORY;
    if (!result) {
        result = read_adjoint(s, &adjoint);
    }
    if (!result) {
        result = rey_vjp_terms(s->scene, &s->def, g->request, cli_direction_selection(&g->direction), adjoint, gradient,
                               NULL, &g->stats);
        cli_progress_end(&s->progress);
    }
    if (!result) {
        summarize(g->set_values, 1, &g->value, &g->standard_error);
        summarize_gradients(g, gradient);
    }
    if (!result && s->options->output) {
        result = write_gradient(g, gradient);
    }
    rey_free(s->ctx, adjoint);
    rey_free(s->ctx, gradient);
    return result;
}

static rey_result differentiate(Grad *g) {
    Session *s = &g->session;
    s->def.sets = SETS;
    g->request = (TermRequest){.primary_spp = s->options->primary_spp, .indirect_spp = s->options->indirect_spp,
                               .values = g->shares, .direction = g->direction.tangent};
    g->needed = cli_direction_terms(s->scene, &g->direction);
    g->used = s->options->terms ? s->options->terms : g->needed;
    rey_result result = s->options->reverse ? reverse(g) : forward(g);
    bool finite = isfinite(g->value) && isfinite(g->standard_error);
    return result || finite ? result : rey_fail(s->ctx, REY_ERROR_ARGUMENT, "the derivative is not finite: the direction or the "
                                                "adjoint is too large, expected numbers of which sums are below 1e38");
}

// Which terms a restricted gradient lacks, and why all of them together cannot be had, where that is so.
static void note_left_out(const Grad *g) {
    const Session *s = &g->session;
    char missing[128], asked[128];
    cli_terms_text(terms_left_out(g), missing, sizeof missing);
    cli_terms_text(g->used, asked, sizeof asked);
    cli_note("incomplete on request: --terms %s leaves out %s", asked, missing);
    rey_render_def whole = s->def;
    whole.terms = 0;
    if (rey_derivative_check(s->scene, &whole, cli_direction_selection(&g->direction)) == REY_ERROR_INCOMPLETE) {
        cli_note("without --terms it is refused: %s", rey_error(s->ctx));
    }
}

static void print_gradients(const Grad *g) {
    int width = (int)strlen("parameter"), shape_width = (int)strlen("shape");
    char shape[64];
    for (int pass = 0; pass < 2; pass++) { // first how wide the columns are
        if (pass) {
            printf("\n%-*s  %-*s  %13s %9s %13s\n", width, "parameter", shape_width, "shape", "sum", "+-", "rms");
        }
        for (int k = 0; k < g->direction.count; k++) {
            const Summary *s = &g->summaries[k];
            const char *name = g->direction.names[k];
            rey_param_info info = {.count = 1};
            rey_param_get_info(g->session.scene, g->direction.params[k], &info);
            cli_shape_text(&info, shape, sizeof shape);
            width = cli_text_width(name) > width ? cli_text_width(name) : width;
            shape_width = (int)strlen(shape) > shape_width ? (int)strlen(shape) : shape_width;
            if (pass) {
                printf("%-*s  %-*s  %13.6g %9.1e %13.6g\n", cli_pad(name, width), name, shape_width, shape, s->sum,
                       s->standard_error, s->rms);
            }
        }
    }
    if (!g->session.options->output) {
        cli_note("-o DIR writes the gradients' numbers, a file for each parameter");
    }
}

static void print_result(const Grad *g) {
    cli_warn_nonfinite(&g->stats);
    if (g->png_scale > 0) {
        cli_note("blue -%g, white 0, red %g", (double)g->png_scale, (double)g->png_scale);
    }
    if (terms_left_out(g)) {
        note_left_out(g);
    }
    if (g->session.options->json) {
        write_json(stdout, g, NULL);
    } else if (g->session.options->output && !strcmp(g->session.options->output, "-")) {
        cli_note("value %.9g, standard error %.3g", g->value, g->standard_error); // the picture has standard output
    } else {
        printf("value %.9g\nstandard_error %.3g\n", g->value, g->standard_error);
        if (g->session.options->reverse) {
            fflush(stdout);
            print_gradients(g);
        }
    }
}

int cli_grad(int argc, char **argv) {
    Options options;
    Grad g = {0};
    Specs specs = {0};
    int status;
    if (!cli_options_parse(COMMAND_GRAD, argc, argv, &options, &status)) {
        return status;
    }
    cli_catch_terminations();
    status = cli_session_open(&options, "grad", &g.session);
    if (!status) {
        status = cli_specs_open(&g.session, &specs);
        if (!status) {
            status = cli_session_direction(&g.session, (const char *const *)specs.texts, specs.count, &g.direction);
        }
        rey_result result = status ? REY_OK : differentiate(&g);
        if (result) {
            status = cli_report(&options, g.session.ctx, result);
        } else if (!status) {
            print_result(&g);
            status = cli_finish_output();
        }
        rey_free(g.session.ctx, g.summaries);
        cli_direction_free(g.session.ctx, &g.direction);
        cli_specs_free(&g.session, &specs);
        cli_session_close(&g.session);
    }
    cli_options_free(&options);
    return status;
}
