// job_fields.h: how a map of a job file is read by a table of its keys.
#pragma once

#include "fit/job.h"

typedef enum FieldType {
    FIELD_TEXT,    // const char *
    FIELD_REAL,    // double in [low, high]
    FIELD_INTEGER, // int in [low, high]
    FIELD_SEED,    // uint32_t
    FIELD_CHOICE,  // int, index into names
    FIELD_READER   // read(job, node, target)
} FieldType;

typedef struct Field {
    const char *key;
    FieldType type;
    size_t offset;
    double low, high;
    const char *const *names;
    rey_result (*read)(Job *job, const YamlNode *node, void *target);
    bool required;
} Field;

// A table of names, ended by null, and the function that reads it.
#define NAMES(function, ...)                                                                                           \
    static const char *const function##_list[] = {__VA_ARGS__, NULL};                                                  \
    const char *function(int kind) {                                                                                   \
        return function##_list[kind];                                                                                  \
    }

// Records a message that starts with the node's file and line.
rey_result rey_job_fail(Job *job, const YamlNode *node, const char *format, ...) PRINTF_LIKE(3, 4);
// Where a value is not what was expected, the override that made an entry of it is to blame: scene.x=1 of the text that scene is.
const YamlNode *rey_job_blamed(const YamlNode *node);
// An entry that is something else than what a message says is expected; the message says what it is.
rey_result rey_job_fail_kind(Job *job, const YamlNode *node, const char *what, const char *expected);
JobPlace rey_job_place(const YamlNode *node); // null: none
bool rey_job_is_real(const YamlNode *node, double *value);
// what: the key that a message calls it by.
rey_result rey_job_read_real(Job *job, const YamlNode *node, const char *what, double low, double high, double *out);
rey_result rey_job_read_text(Job *job, const YamlNode *node, const char **out);
rey_result rey_job_read_field(Job *job, const Field *field, const YamlNode *node, char *base);
// Reads a map by its table, which ends with a key of null.
rey_result rey_job_read_map(Job *job, const YamlNode *map, const char *what, const Field *fields, void *base);
// Memory for the entries of a list of at least one.
rey_result rey_job_open_list(Job *job, const YamlNode *node, size_t item_bytes, void **items, int *count);
// The entries of `parameters` (job_parameters.c); target: JobParameter **.
rey_result rey_job_read_parameters(Job *job, const YamlNode *node, void *target);
// Whether the keys of a whole job go together (job_check.c).
rey_result rey_job_check(Job *job);
