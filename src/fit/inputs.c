// inputs.c: hashes of what a fit began with. What the files mean is hashed, not their bytes: a photograph that was written again
// with the same pixels is the same.
#include "fit/inputs.h"

#include "fit/text.h"
#include "scene/texels.h"

#include <stdio.h>
#include <string.h>

enum { HASH_DIGITS = 16, MOST_NAMED = 3 };
static const char REST[] = "what is no parameter of the scene";

// FNV-1a over words of 8 bytes, with the upper half folded in, which a product alone would not carry downwards.
static uint64_t add_hash(uint64_t hash, const void *data, size_t size) {
    const unsigned char *bytes = data;
    for (size_t i = 0; i < size; i += sizeof hash) {
        uint64_t word = 0;
        memcpy(&word, bytes + i, size - i < sizeof word ? size - i : sizeof word);
        hash = (hash ^ word) * 0x100000001b3u;
        hash ^= hash >> 32;
    }
    return hash;
}

static uint64_t hash_of(const void *data, size_t size) {
    return add_hash(0xcbf29ce484222325u ^ size, data, size);
}

static void put_line(Text *t, uint64_t hash, const char *kind, const char *name) {
    char line[1024];
    snprintf(line, sizeof line, "%s%s", kind, name);
    for (char *c = line; *c; c++) {
        *c = *c == '\n' ? ' ' : *c;
    }
    rey_text_add(t, "%0*llx %s\n", HASH_DIGITS, (unsigned long long)hash, line);
}

static void put_views(Fit *fit, Text *t) {
    for (int v = 0; v < fit->job.view_count; v++) {
        const FitView *view = &fit->views[v];
        const JobView *job = &fit->job.views[v];
        size_t pixels = (size_t)view->full_width * (size_t)view->full_height;
        put_line(t, hash_of(view->full_target, pixels * 3 * sizeof(float)), "target ", job->target);
        if (view->full_mask) {
            put_line(t, hash_of(view->full_mask, pixels * sizeof(float)), "mask ", job->mask);
        }
        if (view->silhouette) {
            size_t sums = (size_t)(view->full_width + 1) * (size_t)(view->full_height + 1);
            put_line(t, hash_of(view->silhouette, sums * sizeof *view->silhouette), "silhouette ", job->silhouette);
        }
    }
}

// Values as they are stored: a packed texture stays packed.
static uint64_t hash_param(const SceneView *view, const Param *p) {
    uint64_t hash = hash_of(p->shape, sizeof p->shape);
    const TextureNode *t = p->texture >= 0 ? view->textures + p->texture : NULL;
    if (t && t->storage != TEXELS_FLOAT) {
        size_t bytes = (size_t)rey_texel_bytes(t->storage);
        return add_hash(hash, (const unsigned char *)view->texels + (size_t)t->texels * bytes, (size_t)p->count * bytes);
    }
    return add_hash(hash, view->theta + p->theta, (size_t)p->count * sizeof(float));
}

// Which objects there are and how they refer to each other, and all numbers, those of the parameters among them.
static uint64_t hash_rest(const SceneView *view) {
    const int32_t settings[] = {view->environment, view->max_depth, view->rr_depth, view->hide_emitters, view->solid,
                                view->drops, view->through, view->split, view->light_samples, view->scatter_samples,
                                view->colour_is_depth, view->collections};
    uint64_t hash = hash_of(settings, sizeof settings);
    const struct {
        const void *data;
        size_t bytes;
    } arrays[] = {
#define ARRAY(type, name, comment) {view->name, (size_t)view->name##_count * sizeof(type)},
#include "scene/arrays.inl"
#undef ARRAY
    };
    for (int i = 0; i < COUNT_OF(arrays); i++) {
        if (arrays[i].data != view->tables && arrays[i].data != view->levels) { // derived, and constant
            hash = add_hash(hash, arrays[i].data, arrays[i].bytes);
        }
    }
    return hash;
}

rey_result rey_fit_inputs(Fit *fit, const rey_scene *scene, char **out) {
    Text t = {.ctx = fit->ctx};
    put_views(fit, &t);
    for (size_t i = 0; i < scene->params.count; i++) {
        const Param *p = &ARRAY_AT(scene->params, Param, i);
        put_line(&t, hash_param(&scene->view, p), "parameter ", p->name);
    }
    put_line(&t, hash_rest(&scene->view), REST, "");
    rey_result result = rey_text_take(&t, out);
    rey_text_free(&t);
    return result;
}

/* ---- differences --------------------------------------------------------------------------------------- */

// The line of the same thing, null when there is none.
static const char *find_thing(const char *text, const char *line) {
    size_t length = strcspn(line, "\n");
    for (; *text; text += strcspn(text, "\n"), text += *text != 0) {
        if (strcspn(text, "\n") == length && !strncmp(text + HASH_DIGITS, line + HASH_DIGITS, length - HASH_DIGITS)) {
            return text;
        }
    }
    return NULL;
}

static const char *next_line(const char *line) {
    line += strcspn(line, "\n");
    return line + (*line != 0);
}

// Names what a line is about, as long as few are named.
static void name_thing(const char *line, const char *how, int *count, char *what, size_t size) {
    size_t used = strlen(what);
    int length = (int)strcspn(line, "\n") - HASH_DIGITS - 1;
    if ((*count)++ < MOST_NAMED) {
        snprintf(what + used, size - used, "%s%.*s %s", used ? ", " : "", length < 200 ? length : 200, line + HASH_DIGITS + 1, how);
    }
}

bool rey_fit_inputs_differ(const char *before, const char *now, char *what, size_t size) {
    int count = 0;
    const char *rest = NULL;
    what[0] = 0;
    for (const char *a = before, *b = now; *b; b = next_line(b)) { // mostly they go side by side
        const char *same = *a && !strncmp(a + HASH_DIGITS, b + HASH_DIGITS, strcspn(b, "\n") - HASH_DIGITS + 1)
                               ? a : find_thing(before, b);
        bool differs = !same || strncmp(same, b, HASH_DIGITS) != 0;
        if (differs && !strncmp(b + HASH_DIGITS + 1, REST, sizeof REST - 1)) {
            rest = b;
        } else if (differs) {
            name_thing(b, same ? "has changed" : "has come", &count, what, size);
        }
        a = same ? next_line(same) : a;
    }
    for (const char *a = before; *a && !count && rest; a = next_line(a)) {
        if (!find_thing(now, a)) {
            name_thing(a, "is gone", &count, what, size);
        }
    }
    if (!count && rest) {
        name_thing(rest, "has changed", &count, what, size);
    }
    if (count > MOST_NAMED) {
        size_t used = strlen(what);
        snprintf(what + used, size - used, ", and %d more", count - MOST_NAMED);
    }
    return count > 0;
}
