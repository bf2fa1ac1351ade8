// job_flat.c: the resolved job as text: flat lines for comparison, nested YAML for people.
#include "fit/job.h"
#include "fit/text.h"

#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// Quotes a text as YAML does with double quotes, whose escapes contain JSON's.
static void line_text(Text *t, const char *key, const char *value) {
    rey_text_add(t, "%s: ", key);
    rey_text_json(t, value);
    rey_text_add(t, "\n");
}

static void line_real(Text *t, const char *key, double value) {
    rey_text_add(t, "%s: ", key);
    rey_text_number(t, value);
    rey_text_add(t, "\n");
}

static void line_bound(Text *t, const char *key, double value) {
    if (isinf(value)) {
        rey_text_add(t, "%s: %s\n", key, value < 0 ? "-.inf" : ".inf");
    } else {
        line_real(t, key, value);
    }
}

static void line_integer(Text *t, const char *key, int64_t value) {
    rey_text_add(t, "%s: %lld\n", key, (long long)value);
}

static void flat_parameter(Text *t, const Job *job, int i) {
    const JobParameter *p = &job->parameters[i];
    char key[64];
#define KEY(name) (snprintf(key, sizeof key, "parameters.%d." name, i), key)
    line_text(t, KEY("name"), p->name);
    if (p->learning_rate > 0) {
        line_real(t, KEY("learning_rate"), p->learning_rate);
    }
    if (!isnan(p->bounds[0])) {
        line_bound(t, KEY("bounds.0"), p->bounds[0]);
        line_bound(t, KEY("bounds.1"), p->bounds[1]);
    }
    line_text(t, KEY("parameterisation"), rey_parameterisation_name((int)p->parameterisation));
    if (job->optimizer.kind == OPTIMIZER_ADAM) {
        line_text(t, KEY("moment"), rey_moment_name((int)p->moment));
    }
    if (p->parameterisation == PARAMETERISATION_LAPLACIAN) {
        line_real(t, KEY("smoothness"), p->smoothness);
        line_real(t, KEY("regularisers.laplacian"), p->regularisers.laplacian);
        line_real(t, KEY("regularisers.edge_length"), p->regularisers.edge_length);
        line_real(t, KEY("regularisers.normals"), p->regularisers.normals);
    }
    if (p->grid_regularisers.total_variation > 0) {
        line_real(t, KEY("regularisers.total_variation"), p->grid_regularisers.total_variation);
    }
    if (p->grid_regularisers.sparsity > 0) {
        line_real(t, KEY("regularisers.sparsity"), p->grid_regularisers.sparsity);
    }
    if (p->carve) {
        line_text(t, KEY("carve"), "true");
    }
    if (p->known_g) {
        line_text(t, KEY("g"), "known");
    }
    if (p->start_file) {
        line_text(t, KEY("start"), p->start_file);
    } else if (p->start_count == 1) {
        line_real(t, KEY("start"), p->start[0]);
    }
    for (int k = 0; k < p->start_count && p->start_count > 1; k++) {
        snprintf(key, sizeof key, "parameters.%d.start.%d", i, k);
        line_real(t, key, p->start[k]);
    }
#undef KEY
}

static void flat_optimizer(Text *t, const JobOptimizer *o) {
    line_text(t, "optimizer.type", rey_optimizer_name((int)o->kind));
    line_real(t, "optimizer.learning_rate", o->learning_rate);
    if (o->kind == OPTIMIZER_ADAM) {
        line_real(t, "optimizer.beta1", o->beta1);
        line_real(t, "optimizer.beta2", o->beta2);
        line_real(t, "optimizer.epsilon", o->epsilon);
    } else if (o->kind == OPTIMIZER_LBFGS) {
        line_integer(t, "optimizer.memory", o->memory);
    } else {
        line_real(t, "optimizer.momentum", o->momentum);
    }
    line_real(t, "optimizer.average", o->average);
    const JobSchedule *s = &o->schedule;
    line_text(t, "optimizer.schedule.type", rey_schedule_name((int)s->kind));
    if (s->kind == SCHEDULE_COSINE || s->kind == SCHEDULE_EXPONENTIAL) {
        line_real(t, "optimizer.schedule.end", s->end);
        line_integer(t, "optimizer.schedule.length", s->length);
    } else if (s->kind == SCHEDULE_STEP) {
        line_real(t, "optimizer.schedule.factor", s->factor);
        line_integer(t, "optimizer.schedule.every", s->every);
    }
}

static void flat_views(Text *t, const Job *job) {
    char key[64];
    for (int i = 0; i < job->view_count; i++) {
        const JobView *v = &job->views[i];
        snprintf(key, sizeof key, "views.%d.sensor", i);
        if (v->sensor_id) {
            line_text(t, key, v->sensor_id);
        } else {
            line_integer(t, key, v->sensor);
        }
        snprintf(key, sizeof key, "views.%d.target", i);
        line_text(t, key, v->target);
        snprintf(key, sizeof key, "views.%d.weight", i);
        line_real(t, key, v->weight);
        snprintf(key, sizeof key, "views.%d.exposure", i);
        line_real(t, key, v->exposure);
        if (v->mask) {
            snprintf(key, sizeof key, "views.%d.mask", i);
            line_text(t, key, v->mask);
        }
        if (v->silhouette) {
            snprintf(key, sizeof key, "views.%d.silhouette", i);
            line_text(t, key, v->silhouette);
        }
        if (v->held_out) {
            snprintf(key, sizeof key, "views.%d.held_out", i);
            line_text(t, key, "true");
        }
    }
    line_integer(t, "views_per_iteration", job->views_per_iteration ? job->views_per_iteration : job->fitted_count);
}

void rey_job_terms_text(int terms, char *text, size_t size) {
    text[0] = 0;
    for (int bit = 1; bit <= terms; bit <<= 1) {
        size_t used = strlen(text);
        if (terms & bit) {
            snprintf(text + used, size - used, "%s%s", used ? "," : "", rey_term_name(bit));
        }
    }
}

static void flat_terms(Text *t, int terms) {
    char names[128];
    rey_job_terms_text(terms, names, sizeof names);
    line_text(t, "terms", names);
}

static void flat_defines(Text *t, const char *prefix, const JobDefines *defines) {
    char key[512];
    for (int i = 0; i < defines->count; i++) {
        snprintf(key, sizeof key, "%s.%s", prefix, defines->list[i].name);
        line_text(t, key, defines->list[i].value);
    }
}

// What decides the numbers that the optimisation goes through.
static void flat_decisive(Text *t, const Job *job) {
    char key[512];
    line_text(t, "scene", job->scene);
    if (job->load) {
        line_text(t, "load", job->load);
    }
    flat_defines(t, "defines", &job->defines);
    line_integer(t, "seed", job->seed);
    for (int i = 0; i < job->spp_count; i++) {
        snprintf(key, sizeof key, "spp.%d.from", i);
        line_integer(t, key, job->spp[i].from);
        snprintf(key, sizeof key, "spp.%d.spp", i);
        line_integer(t, key, job->spp[i].spp);
    }
    line_integer(t, "gradient_spp", job->gradient_spp);
    if (job->reuse_within > 0) {
        line_real(t, "reuse.within", job->reuse_within);
        line_real(t, "reuse.effective", job->reuse_effective);
    }
    for (int i = 0; i < job->level_count; i++) {
        snprintf(key, sizeof key, "levels.%d.from", i);
        line_integer(t, key, job->levels[i].from);
        snprintf(key, sizeof key, "levels.%d.reduce", i);
        line_integer(t, key, job->levels[i].reduce);
        if (job->levels[i].edge_length > 0) {
            snprintf(key, sizeof key, "levels.%d.edge_length", i);
            line_real(t, key, job->levels[i].edge_length);
        }
        if (job->levels[i].resolution > 0) {
            snprintf(key, sizeof key, "levels.%d.resolution", i);
            line_integer(t, key, job->levels[i].resolution);
        }
    }
    flat_views(t, job);
    line_text(t, "loss.type", rey_loss_name((int)job->loss));
    if (job->loss == LOSS_RELATIVE_L2 || job->loss == LOSS_LOG_L2) {
        line_real(t, "loss.epsilon", job->loss_epsilon);
    }
    if (job->terms) {
        flat_terms(t, job->terms);
    }
    flat_optimizer(t, &job->optimizer);
    for (int i = 0; i < job->parameter_count; i++) {
        flat_parameter(t, job, i);
    }
    if (job->stop_window) {
        line_integer(t, "stop.window", job->stop_window);
        line_real(t, "stop.tolerance", job->stop_tolerance);
    }
}

rey_result rey_job_flat(const Job *job, char **out) {
    Text t = {.ctx = job->ctx};
    flat_decisive(&t, job);
    return rey_text_take(&t, out);
}

/* ---- nested -------------------------------------------------------------------------------------------- */

static bool is_index(const char *part, size_t length) {
    return length && strspn(part, "0123456789") >= length;
}

// Writes one flat line, given the line before it: the components that they share are not repeated. An entry of a list
// starts with "- " in the place of its own indentation.
static void nest_line(Text *t, const char *before, const char *line) {
    const char *part = line, *old = before;
    bool shared = true, after_dash = false;
    int indent = 0;
    const char *key_end = strstr(line, ": ");
    while (part < key_end) {
        const char *dot = memchr(part, '.', (size_t)(key_end - part));
        const char *end = dot && strncmp(line, "defines.", 8) ? dot : dot && part == line ? dot : key_end;
        size_t length = (size_t)(end - part);
        shared = shared && !strncmp(old, part, length) && (old[length] == '.');
        bool index = is_index(part, length), last = end == key_end;
        if (!shared) {
            if (!after_dash) {
                rey_text_add(t, "%*s", 2 * indent, "");
            }
            if (index) {
                rey_text_add(t, last ? "-" : "- ");
            } else {
                rey_text_add(t, last ? "%.*s:" : "%.*s:\n", (int)length, part);
            }
        }
        after_dash = !shared && index;
        old += shared ? length + 1 : 0;
        indent++;
        part = end + 1;
    }
    rey_text_add(t, "%.*s\n", (int)strcspn(key_end + 1, "\n"), key_end + 1);
}

rey_result rey_job_yaml(const Job *job, char **out) {
    Text flat = {.ctx = job->ctx}, nested = {.ctx = job->ctx};
    char absolute[PATH_MAX]; // the text lies in another folder than the job
    line_text(&flat, "folder", realpath(job->folder, absolute) ? absolute : job->folder);
    line_text(&flat, "output", job->output);
    line_integer(&flat, "iterations", job->iterations);
    line_integer(&flat, "checkpoint_every", job->checkpoint_every);
    line_real(&flat, "checkpoint_seconds", job->checkpoint_seconds);
    line_integer(&flat, "image_every", job->image_every);
    line_integer(&flat, "report_spp", job->report_spp);
    if (job->truth_scene) {
        line_text(&flat, "truth.scene", job->truth_scene);
        flat_defines(&flat, "truth.defines", &job->truth_defines);
    }
    flat_decisive(&flat, job);
    char *lines;
    rey_result result = rey_text_take(&flat, &lines);
    if (result) {
        return result;
    }
    const char *before = "";
    for (const char *line = lines; *line; line = strchr(line, '\n') + 1) {
        nest_line(&nested, before, line);
        before = line;
    }
    rey_free(job->ctx, lines);
    return rey_text_take(&nested, out);
}

static size_t key_length(const char *line) {
    const char *end = strstr(line, ": ");
    size_t length = strcspn(line, "\n");
    return end && (size_t)(end - line) < length ? (size_t)(end - line) : length;
}

// Has one of the lines the key of `line`?
static bool has_key(const char *text, const char *line) {
    size_t length = key_length(line);
    for (; *text; text += strcspn(text, "\n"), text += *text != 0) {
        if (key_length(text) == length && strncmp(text, line, length) == 0) {
            return true;
        }
    }
    return false;
}

bool rey_job_difference(const char *a, const char *b, char *key, size_t size) {
    while (*a && *b) {
        size_t na = strcspn(a, "\n"), nb = strcspn(b, "\n");
        if (na != nb || strncmp(a, b, na)) {
            break;
        }
        a += na + (a[na] != 0);
        b += nb + (b[nb] != 0);
    }
    if (!*a && !*b) {
        return false;
    }
    // A line that stands further down in the other text follows one that was put in there.
    const char *line = !*a || (*b && !has_key(a, b) && has_key(b, a)) ? b : a;
    snprintf(key, size, "%.*s", (int)key_length(line), line);
    return true;
}
