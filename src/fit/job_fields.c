// job_fields.c: values and maps of a job file, and what is wrong with them.
#include "fit/job_fields.h"

#include "io/number.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

rey_result rey_job_fail(Job *job, const YamlNode *node, const char *format, ...) {
    char message[1024];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(message, sizeof message, format, arguments);
    va_end(arguments);
    return rey_job_fail_at(job, rey_job_place(node), REY_ERROR_FORMAT, "%s", message);
}

JobPlace rey_job_place(const YamlNode *node) {
    return node ? (JobPlace){node->line, node->set} : (JobPlace){0};
}

bool rey_job_is_real(const YamlNode *node, double *value) {
    const char *end;
    return node->kind == YAML_SCALAR && node->text && rey_parse_real(node->text, &end, value) && !*end;
}

const YamlNode *rey_job_blamed(const YamlNode *node) {
    for (const YamlNode *entry = node->child; entry; entry = entry->next) {
        if (entry->set) {
            return entry;
        }
    }
    return node;
}

JobPlace rey_job_blame(JobPlace first, JobPlace second) {
    return (second.set && !first.set) || (!first.set && !first.line) ? second : first;
}

JobPlace rey_job_place_of(const YamlNode *entry, const char *key, const char *other) {
    const char *const keys[] = {key, other};
    JobPlace at = {0};
    for (int i = 0; i < COUNT_OF(keys); i++) {
        const YamlNode *value = keys[i] ? rey_yaml_find(entry, keys[i]) : NULL;
        at = rey_job_blame(at, rey_job_place(value ? rey_job_blamed(value) : NULL));
    }
    return rey_job_blame(at, at.line ? at : rey_job_place(entry));
}

// What stands where something else was expected.
static const char *found(const YamlNode *node, char text[128]) {
    bool empty = !node->child && !(node->text && node->text[0]);
    if (node->kind == YAML_SCALAR && !empty) {
        snprintf(text, 128, "'%.100s'", node->text);
    } else {
        snprintf(text, 128, "%s", node->kind == YAML_LIST ? (empty ? "an empty list" : "a list") : empty ? "nothing" : "a map");
    }
    return text;
}

rey_result rey_job_fail_kind(Job *job, const YamlNode *node, const char *what, const char *expected) {
    char text[128];
    return rey_job_fail(job, rey_job_blamed(node), "%s: %s, expected %s", what, found(node, text), expected);
}

rey_result rey_job_read_real(Job *job, const YamlNode *node, const char *what, double low, double high, double *out) {
    double value;
    if (!rey_job_is_real(node, &value)) {
        return rey_job_fail_kind(job, node, what, "a number");
    }
    if (value < low || value > high) {
        return rey_job_fail(job, node, "%s = %.10g, expected %.10g to %.10g", what, value, low, high);
    }
    *out = value;
    return REY_OK;
}

static const char *word_at(void *user, int i) {
    const char *const *names = user;
    return names[i];
}

static void list_words(const char *(*next)(void *user, int i), void *user, char *text, size_t size) {
    text[0] = 0;
    for (int i = 0; next(user, i); i++) {
        size_t used = strlen(text);
        snprintf(text + used, size - used, "%s%s", i ? ", " : "", next(user, i));
    }
}

static rey_result read_choice(Job *job, const YamlNode *node, const char *what, const char *const *names, int *out) {
    const char *text = node->kind == YAML_SCALAR && node->text ? node->text : "";
    for (int i = 0; names[i]; i++) {
        if (!strcmp(text, names[i])) {
            *out = i;
            return REY_OK;
        }
    }
    char all[256], expected[320];
    list_words(word_at, (void *)(uintptr_t)names, all, sizeof all);
    const char *nearest = rey_nearest_word(text, word_at, (void *)(uintptr_t)names);
    snprintf(expected, sizeof expected, "one of %s", all);
    return nearest ? rey_job_fail(job, node, "%s: unknown value '%s', did you mean '%s'?", what, text, nearest)
           : text[0] ? rey_job_fail(job, node, "%s: unknown value '%s', expected %s", what, text, expected)
                     : rey_job_fail_kind(job, node, what, expected);
}

rey_result rey_job_read_text(Job *job, const YamlNode *node, const char **out) {
    if (node->kind != YAML_SCALAR || !node->text || !node->text[0]) {
        return rey_job_fail_kind(job, node, node->key ? node->key : "entry", "a text");
    }
    *out = node->text;
    return REY_OK;
}

rey_result rey_job_read_field(Job *job, const Field *field, const YamlNode *node, char *base) {
    void *target = base + field->offset;
    const char *what = node->key ? node->key : field->key; // a value alone has the key that it is short for
    double value;
    rey_result result;
    switch (field->type) {
    case FIELD_TEXT:
        return rey_job_read_text(job, node, target);
    case FIELD_REAL:
        return rey_job_read_real(job, node, what, field->low, field->high, target);
    case FIELD_INTEGER:
    case FIELD_SEED:
        result = rey_job_read_real(job, node, what, field->low, field->high, &value);
        if (!result && value != floor(value)) {
            result = rey_job_fail(job, node, "%s = %.10g, expected a whole number", what, value);
        }
        if (!result && field->type == FIELD_SEED) {
            *(uint32_t *)target = (uint32_t)value;
        } else if (!result) {
            *(int *)target = (int)value;
        }
        return result;
    case FIELD_CHOICE:
        return read_choice(job, node, what, field->names, target);
    default:
        return field->read(job, node, target);
    }
}

static const char *key_at(void *user, int i) {
    const Field *fields = user;
    return fields[i].key;
}

// A key of the job that is one of an entry below it, null where it is none.
static const char *home_of(const Job *job, const YamlNode *node) {
    static const char *const below[][2] = {
        {"learning_rate", "optimizer.learning_rate"}, {"schedule", "optimizer.schedule"}, {"average", "optimizer.average"},
        {"beta1", "optimizer.beta1"}, {"beta2", "optimizer.beta2"}, {"momentum", "optimizer.momentum"},
        {"memory", "optimizer.memory"}, {"epsilon", "loss.epsilon or optimizer.epsilon"}, {"target", "views.0.target"},
        {"mask", "views.0.mask"}, {"sensor", "views.0.sensor"}, {"exposure", "views.0.exposure"},
        {"bounds", "parameters.0.bounds"}, {"start", "parameters.0.start"}, {"moment", "parameters.0.moment"},
        {"parameterisation", "parameters.0.parameterisation"}, {"tolerance", "stop.tolerance"}, {"window", "stop.window"},
        {"reduce", "levels.0.reduce"},
    };
    for (const YamlNode *own = job->tree->child; own; own = own->next) {
        for (int i = 0; i < COUNT_OF(below) && own == node; i++) {
            if (!strcmp(node->key, below[i][0])) {
                return below[i][1];
            }
        }
    }
    return NULL;
}

static rey_result unknown_key(Job *job, const YamlNode *node, const char *what, const Field *fields) {
    const char *home = home_of(job, node);
    if (home) {
        return rey_job_fail(job, node, "unknown key '%s', did you mean %s?", node->key, home);
    }
    const char *nearest = rey_nearest_word(node->key, key_at, (void *)(uintptr_t)fields);
    char all[512];
    list_words(key_at, (void *)(uintptr_t)fields, all, sizeof all);
    return nearest ? rey_job_fail(job, node, "unknown key '%s', did you mean '%s'?", node->key, nearest)
                   : rey_job_fail(job, node, "unknown key '%s' in %s, expected one of %s", node->key, what, all);
}

rey_result rey_job_read_map(Job *job, const YamlNode *map, const char *what, const Field *fields, void *base) {
    if (map->kind != YAML_MAP) {
        return rey_job_fail_kind(job, map, what, "'key: value' lines");
    }
    for (const YamlNode *node = map->child; node; node = node->next) {
        const Field *field = fields;
        while (field->key && strcmp(field->key, node->key)) {
            field++;
        }
        if (!field->key) {
            return unknown_key(job, node, what, fields);
        }
        rey_result result = rey_job_read_field(job, field, node, base);
        if (result) {
            return result;
        }
    }
    for (const Field *field = fields; field->key; field++) {
        if (field->required && !rey_yaml_find(map, field->key)) {
            return rey_job_fail(job, map, "%s: key '%s' is missing", what, field->key);
        }
    }
    return REY_OK;
}

rey_result rey_job_open_list(Job *job, const YamlNode *node, size_t item_bytes, void **items, int *count) {
    if (node->kind != YAML_LIST || !node->child) {
        return rey_job_fail_kind(job, node, node->key ? node->key : "entry", "a list of at least one entry");
    }
    *count = rey_yaml_count(node);
    *items = rey_job_alloc(job, (size_t)*count, item_bytes);
    return *items ? REY_OK : REY_ERROR_MEMORY;
}
