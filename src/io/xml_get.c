// xml_get.c: typed access to a node's properties and children, and the check that none was left over.
#include "io/xml_parts.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

static void note_asked(const rey_xml_node *node, const char *name) {
    rey_xml_asked *asked = node->asked;
    for (int i = 0; i < asked->count; i++) {
        if (strcmp(asked->names[i], name) == 0) {
            return;
        }
    }
    if (asked->count < REY_XML_MOST_ASKED) {
        asked->names[asked->count++] = name;
    }
}

static const char *asked_name(void *user, int i) {
    const rey_xml_asked *asked = user;
    return i < asked->count ? asked->names[i] : NULL;
}

rey_xml_property *rey_xml_find(const rey_xml_node *node, const char *name) {
    note_asked(node, name);
    for (int i = 0; i < node->property_count; i++) {
        if (strcmp(node->properties[i].name, name) == 0) {
            return &node->properties[i];
        }
    }
    return NULL;
}

static rey_xml_child *find_child(const rey_xml_node *node, const char *name) {
    for (int i = 0; i < node->child_count; i++) {
        if (node->children[i].name && strcmp(node->children[i].name, name) == 0) {
            return &node->children[i];
        }
    }
    return NULL;
}

rey_xml_position rey_xml_place(const rey_xml_node *node, const char *name) {
    for (int i = 0; i < node->property_count && name; i++) {
        if (strcmp(node->properties[i].name, name) == 0) {
            return node->properties[i].at;
        }
    }
    const rey_xml_child *child = name ? find_child(node, name) : NULL;
    return child ? child->at : node->at;
}

bool rey_xml_has(const rey_xml_node *node, const char *name) {
    return rey_xml_find(node, name) || find_child(node, name);
}

rey_result rey_xml_require(rey_context *ctx, const rey_xml_node *node, const char *name) {
    return rey_xml_has(node, name) ? REY_OK
                                   : rey_xml_fail(ctx, node->at, REY_ERROR_SCENE, "%s '%.100s' lacks '%s'",
                                                  rey_xml_tag_name(node->tag), node->type, name);
}

// The property, marked used; *out is null when it is absent. An object in its place, or another kind, is an error.
static rey_result take(rey_context *ctx, const rey_xml_node *node, const char *name, unsigned kinds,
                       const char *expected, rey_xml_property **out) {
    *out = rey_xml_find(node, name);
    const rey_xml_child *child = *out ? NULL : find_child(node, name);
    if (child) {
        return rey_xml_fail(ctx, child->at, REY_ERROR_SCENE, "'%s' of %s '%.100s' is an object (%s), expected %s", name,
                            rey_xml_tag_name(node->tag), node->type, rey_xml_tag_name(child->node->tag), expected);
    }
    if (*out && !(kinds >> (*out)->kind & 1)) {
        return rey_xml_fail(ctx, (*out)->at, REY_ERROR_SCENE, "'%s' of %s '%.100s' is of kind %s, expected %s", name,
                            rey_xml_tag_name(node->tag), node->type, rey_xml_kind_name((*out)->kind), expected);
    }
    if (*out) {
        (*out)->used = true;
    }
    return REY_OK;
}

enum {
    NUMBERS = 1 << REY_XML_INTEGER_VALUE | 1 << REY_XML_FLOAT_VALUE,
    COLOURS = NUMBERS | 1 << REY_XML_RGB_VALUE | 1 << REY_XML_SPECTRUM_VALUE,
};

rey_result rey_xml_get_bool(rey_context *ctx, const rey_xml_node *node, const char *name, bool otherwise, bool *out) {
    rey_xml_property *property;
    rey_result result = take(ctx, node, name, 1 << REY_XML_BOOLEAN_VALUE, "boolean", &property);
    *out = !result && property ? property->boolean : otherwise;
    return result;
}

rey_result rey_xml_get_int(rey_context *ctx, const rey_xml_node *node, const char *name, int64_t low, int64_t high,
                           int64_t otherwise, int64_t *out) {
    rey_xml_property *property;
    rey_result result = take(ctx, node, name, 1 << REY_XML_INTEGER_VALUE, "integer", &property);
    *out = !result && property ? property->integer : otherwise;
    if (!result && property && (*out < low || *out > high)) {
        result = rey_xml_fail(ctx, property->at, REY_ERROR_SCENE, "'%s' is %lld, expected %lld to %lld", name,
                              (long long)*out, (long long)low, (long long)high);
    }
    return result;
}

rey_result rey_xml_get_float(rey_context *ctx, const rey_xml_node *node, const char *name, double otherwise,
                             double *out) {
    rey_xml_property *property;
    rey_result result = take(ctx, node, name, NUMBERS, "float", &property);
    *out = !result && property ? property->number : otherwise;
    return result;
}

rey_result rey_xml_get_string(rey_context *ctx, const rey_xml_node *node, const char *name, const char *otherwise,
                              const char **out) {
    rey_xml_property *property;
    rey_result result = take(ctx, node, name, 1 << REY_XML_STRING_VALUE, "string", &property);
    *out = !result && property ? property->string : otherwise;
    return result;
}

typedef struct Words {
    const char *const *words;
    int count;
} Words;

static const char *next_word(void *user, int i) {
    const Words *list = user;
    return i < list->count ? list->words[i] : NULL;
}

rey_result rey_xml_get_choice(rey_context *ctx, const rey_xml_node *node, const char *name, const char *const *words,
                              int count, int otherwise, int *out) {
    rey_xml_property *property;
    rey_result result = take(ctx, node, name, 1 << REY_XML_STRING_VALUE, "string", &property);
    *out = otherwise;
    if (result || !property) {
        return result;
    }
    char list[512] = "";
    size_t used = 0;
    for (int i = 0; i < count; i++) {
        if (strcasecmp(words[i], property->string) == 0) {
            *out = i;
            return REY_OK;
        }
        int written = snprintf(list + used, sizeof list - used, "%s'%s'", i ? ", " : "", words[i]);
        used += written > 0 && (size_t)written < sizeof list - used ? (size_t)written : 0;
    }
    Words known = {words, count};
    return rey_xml_fail_word(ctx, property->at, property->string, next_word, &known,
                             "'%s' is '%.100s', expected one of %s", name, property->string, list);
}

rey_result rey_xml_get_vec3(rey_context *ctx, const rey_xml_node *node, const char *name, const double otherwise[3],
                            double out[3]) {
    rey_xml_property *property;
    rey_result result = take(ctx, node, name, 1 << REY_XML_VECTOR_VALUE, "point or vector", &property);
    memcpy(out, !result && property ? property->vector : otherwise, 3 * sizeof(double));
    return result;
}

rey_result rey_xml_get_transform(rey_context *ctx, const rey_xml_node *node, const char *name, double out[16]) {
    rey_xml_property *property;
    rey_result result = take(ctx, node, name, 1 << REY_XML_TRANSFORM_VALUE, "transform", &property);
    rey_xml_identity(out);
    if (!result && property) {
        memcpy(out, property->matrix, sizeof property->matrix);
    }
    return result;
}

rey_result rey_xml_get_transform2(rey_context *ctx, const rey_xml_node *node, const char *name, double out[6]) {
    double m[16];
    rey_result result = rey_xml_get_transform(ctx, node, name, m);
    static const int entries[] = {0, 1, 3, 4, 5, 7};
    for (int i = 0; i < 6; i++) {
        out[i] = m[entries[i]];
    }
    return result;
}

// ---- colours -----------------------------------------------------------------------------------------------------

rey_result rey_xml_get_colour(rey_context *ctx, const rey_xml_node *node, const char *name, rey_colour_use use,
                              const double otherwise[3], double out[3]) {
    rey_xml_property *property;
    rey_result result = take(ctx, node, name, COLOURS, "float, rgb or spectrum", &property);
    memcpy(out, otherwise, 3 * sizeof(double));
    if (result || !property) {
        return result;
    }
    if (property->kind == REY_XML_SPECTRUM_VALUE) {
        rey_spectrum_to_rgb(&property->spectrum, use, out);
    }
    for (int i = 0; i < 3; i++) {
        if (property->kind == REY_XML_RGB_VALUE) {
            out[i] = property->vector[i];
        } else if (property->kind != REY_XML_SPECTRUM_VALUE) {
            out[i] = property->number;
        }
        if (!(fabs(out[i]) <= (double)FLT_MAX)) {
            return rey_xml_fail(ctx, property->at, REY_ERROR_SCENE, "'%s' of %s '%.100s' is too large", name,
                                rey_xml_tag_name(node->tag), node->type);
        }
        bool low = use != REY_COLOUR_UNBOUNDED && out[i] < 0;
        if (low || (use == REY_COLOUR_REFLECTANCE && out[i] > 1)) {
            return rey_xml_fail(ctx, property->at, REY_ERROR_SCENE, "'%s' of %s '%.100s' has the component %g, %s",
                                name, rey_xml_tag_name(node->tag), node->type, out[i],
                                use == REY_COLOUR_REFLECTANCE ? "expected 0 to 1" : "expected at least 0");
        }
    }
    return REY_OK;
}

rey_result rey_xml_get_ior(rey_context *ctx, const rey_xml_node *node, const char *name, const char *otherwise,
                           double *out) {
    rey_xml_property *property;
    rey_result result = take(ctx, node, name, NUMBERS | 1 << REY_XML_STRING_VALUE, "float or string", &property);
    *out = 1;
    if (result) {
        return result;
    }
    if (property && property->kind != REY_XML_STRING_VALUE) {
        *out = property->number;
        return *out > 0 ? REY_OK
                        : rey_xml_fail(ctx, property->at, REY_ERROR_SCENE,
                                       "index of refraction '%s' is %g, expected more than 0", name, *out);
    }
    const char *word = property ? property->string : otherwise;
    if (!rey_named_ior(word, out)) {
        return rey_xml_fail_word(ctx, property ? property->at : node->at, word, rey_named_ior_name, NULL,
                                 "unknown material '%.100s' of '%s', expected a number or a material's name such as 'bk7'", word,
                                 name);
    }
    return REY_OK;
}

// ---- children ----------------------------------------------------------------------------------------------------

rey_xml_child *rey_xml_child_named(const rey_xml_node *node, const char *name) {
    note_asked(node, name);
    rey_xml_child *child = find_child(node, name);
    if (child) {
        child->used = true;
    }
    return child;
}

rey_xml_child *rey_xml_child_of(const rey_xml_node *node, unsigned tags, int index) {
    for (int i = 0; i < node->child_count; i++) {
        if ((tags >> node->children[i].node->tag & 1) && index-- == 0) {
            node->children[i].used = true;
            return &node->children[i];
        }
    }
    return NULL;
}

int rey_xml_count_children(const rey_xml_node *node, unsigned tags) {
    int count = 0;
    for (int i = 0; i < node->child_count; i++) {
        count += tags >> node->children[i].node->tag & 1;
    }
    return count;
}

static rey_result fail_property(rey_context *ctx, const rey_xml_node *node, const rey_xml_property *property,
                                const char *(*known)(void *user, int i), void *user) {
    char list[1024];
    rey_xml_list_words(property->name, known, user, list, sizeof list);
    return rey_xml_fail_word(ctx, property->at, property->name, known, user, "unknown property '%.100s' of %s '%.100s'%s",
                             property->name, rey_xml_tag_name(node->tag), node->type, list);
}

static rey_result fail_child(rey_context *ctx, const rey_xml_node *node, const rey_xml_child *child,
                             const char *(*known)(void *user, int i), void *user) {
    if (child->name) {
        return rey_xml_fail_word(ctx, child->at, child->name, known, user,
                                 "%s '%.100s' has no use for the %s '%.100s' named '%.100s'",
                                 rey_xml_tag_name(node->tag), node->type, rey_xml_tag_name(child->node->tag),
                                 child->node->type, child->name);
    }
    const char *hint = child->node->tag == REY_XML_TEXTURE ? ", whose 'name' would say which property it is" : "";
    return rey_xml_fail(ctx, child->at, REY_ERROR_SCENE, "%s '%.100s' has no use for the %s '%.100s'%s",
                        rey_xml_tag_name(node->tag), node->type, rey_xml_tag_name(child->node->tag), child->node->type, hint);
}

// The first property or child that nobody took; both null when there is none.
static void find_unused(const rey_xml_node *node, rey_xml_property **property, rey_xml_child **child) {
    *property = NULL;
    *child = NULL;
    for (int i = 0; i < node->property_count && !*property; i++) {
        *property = node->properties[i].used ? NULL : &node->properties[i];
    }
    for (int i = 0; i < node->child_count && !*child; i++) {
        *child = node->children[i].used ? NULL : &node->children[i];
    }
    if (*property && *child) {
        bool first = (*property)->order < (*child)->order;
        *property = first ? *property : NULL;
        *child = first ? NULL : *child;
    }
}

rey_result rey_xml_check_unused(rey_context *ctx, const rey_xml_node *node, const char *(*known)(void *user, int i),
                                void *user) {
    rey_xml_property *property;
    rey_xml_child *child;
    user = known ? user : node->asked;
    known = known ? known : asked_name;
    find_unused(node, &property, &child);
    if (property) {
        return fail_property(ctx, node, property, known, user);
    }
    return child ? fail_child(ctx, node, child, known, user) : REY_OK;
}

void rey_xml_ignore_unused(rey_xml_node *node) {
    rey_xml_property *property;
    rey_xml_child *child;
    find_unused(node, &property, &child);
    if (property) {
        property->used = property->ignored = true;
    } else if (child) {
        child->used = child->ignored = true;
    }
}
