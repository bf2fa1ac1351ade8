// specs.c: --param as a list of directions, with patterns such as grey.* written out.
#include "cli.h"

#include "base/context.h"
#include "scene/names.h"
#include "scene/scene.h"

#include <stdio.h>
#include <string.h>

// NAME and the operation of a spec.
static rey_result add_spec(rey_context *ctx, const char *name, const char *op, Array *specs) {
    size_t size = strlen(name) + strlen(op) + 1;
    char *text = rey_alloc(ctx, size), **slot = text ? rey_array_push(ctx, specs, sizeof *slot, 1) : NULL;
    if (!slot) {
        rey_free(ctx, text);
        return REY_ERROR_MEMORY;
    }
    snprintf(text, size, "%s%s", name, op);
    *slot = text;
    return REY_OK;
}

// Nothing fits a pattern; passed: names that it matches all the same, "" when there are none.
static rey_result nothing_fits(rey_context *ctx, const char *spec, const char *pattern, const char *passed) {
    if (!*passed) {
        return rey_fail(ctx, REY_ERROR_ARGUMENT, "--param: no parameter matches '%s'; 'reynolds params' lists them", pattern);
    }
    bool bare = !spec[cli_direction_name_length(spec)];
    return rey_fail(ctx, REY_ERROR_ARGUMENT, "--param: '%s' matches only %s, %s", pattern, passed,
                    bare ? "which move things or have no derivative: a pattern passes over those; name them one by one, or "
                           "give an operation such as :translate=1,0,0"
                         : "which this operation does not fit");
}

static rey_result expand(Session *s, const char *spec, bool listing, Array *specs) {
    char pattern[1024], passed[512] = "";
    size_t length = cli_direction_name_length(spec), before = specs->count;
    int left_out = 0;
    snprintf(pattern, sizeof pattern, "%.*s", (int)length, spec);
    const char **names = rey_params_matching(s->scene, pattern);
    rey_result result = names ? REY_OK : REY_ERROR_MEMORY;
    for (int i = 0; i < rey_param_count(s->scene) && !result; i++) {
        rey_param_info info;
        result = rey_param_get_info(s->scene, i, &info);
        if (result || !names[i]) {
            continue;
        }
        if (listing || cli_direction_fits(s->scene, i, spec)) {
            result = add_spec(s->ctx, names[i], spec + length, specs);
        } else {
            cli_list_add(passed, sizeof passed, &left_out, names[i]);
        }
    }
    rey_free(s->ctx, names);
    cli_list_end(passed, sizeof passed, left_out);
    return result || specs->count > before ? result : nothing_fits(s->ctx, spec, pattern, passed);
}

static rey_result expand_all(Session *s, Array *specs) {
    const Options *o = s->options;
    rey_result result = REY_OK;
    for (int i = 0; i < rey_param_count(s->scene) && o->all && !result; i++) {
        rey_param_info info;
        result = rey_param_get_info(s->scene, i, &info);
        result = result ? result : add_spec(s->ctx, info.name, "", specs);
    }
    for (int i = 0; i < o->param_count && !result; i++) {
        const char *spec = o->params[i];
        size_t length = cli_direction_name_length(spec);
        bool listing = o->command == COMMAND_PARAMS;
        if (listing && spec[length]) {
            return rey_fail(s->ctx, REY_ERROR_ARGUMENT, "--param: '%s' has an operation, expected a name or a pattern", spec);
        }
        bool pattern = memchr(spec, '*', length) != NULL;
        result = pattern ? expand(s, spec, listing, specs) : add_spec(s->ctx, spec, "", specs);
    }
    return result;
}

int cli_specs_open(Session *session, Specs *specs) {
    Array list = {0};
    rey_result result = expand_all(session, &list);
    *specs = (Specs){list.data, (int)list.count};
    if (result) {
        cli_specs_free(session, specs);
        return cli_report(session->options, session->ctx, result);
    }
    return EXIT_OK;
}

void cli_specs_free(Session *session, Specs *specs) {
    for (int i = 0; i < specs->count; i++) {
        rey_free(session->ctx, specs->texts[i]);
    }
    rey_free(session->ctx, specs->texts);
    *specs = (Specs){0};
}
