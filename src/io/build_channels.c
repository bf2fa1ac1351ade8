// build_channels.c: the channels that `aov` and `moment` add to a picture, by the names and in the order of the format.
#include "io/build.h"

#include <stdio.h>
#include <string.h>

enum { MOST_POWER = 4 }; // second moments of second moments

static bool is(const rey_xml_node *node, const char *type) { return strcmp(node->type, type) == 0; }

static bool holds_others(const rey_xml_node *node) { return is(node, "aov") || is(node, "moment"); }

static rey_result add_channel(Builder *b, const rey_xml_node *node, const char *prefix, const char *name, char letter,
                              Channel channel) {
    enum { LONGEST = 256 }; // of OpenEXR
    char text[LONGEST];
    if (snprintf(text, sizeof text, "%s%s.%c", prefix, name, letter) >= LONGEST) {
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_UNSUPPORTED, "the name of channel '%.40s...' is too long", text);
    }
    for (size_t i = 0; i < b->scene->channels.count; i++) {
        if (strcmp(ARRAY_AT(b->scene->channels, Channel, i).name, text) == 0) {
            return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE, "two channels have the name '%s'", text);
        }
    }
    if (b->scene->channels.count == MOST_CHANNELS) {
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_UNSUPPORTED, "the integrators make more than %d channels", MOST_CHANNELS);
    }
    Channel *added = rey_array_push(b->ctx, &b->scene->channels, sizeof *added, 1);
    if (!added) {
        return REY_ERROR_MEMORY;
    }
    *added = channel;
    added->name = rey_strdup(b->ctx, text);
    return added->name ? REY_OK : REY_ERROR_MEMORY;
}

static const char *const components[] = {
#define AOV(ENUM, name, components) components,
#include "scene/aovs.inl"
#undef AOV
};

// The place of a quantity among those of an integrator, which it joins where it is new.
static rey_result find_quantity(Builder *b, const rey_xml_node *node, Integrator *integrator, int32_t kind, int32_t *place) {
    *place = 0;
    for (int32_t i = 0; i < integrator->aov_count; i++) {
        if (integrator->aovs[i] == kind) {
            return REY_OK;
        }
        *place += aov_components(integrator->aovs[i]);
    }
    if (integrator->aov_count == MOST_AOVS || *place + aov_components(kind) > MOST_AOV_CHANNELS) {
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_UNSUPPORTED, "more than %d quantities or %d channels", MOST_AOVS,
                            MOST_AOV_CHANNELS);
    }
    integrator->aovs[integrator->aov_count++] = kind;
    return REY_OK;
}

static const char *aov_word(void *user, int i) {
    static const char *const names[] = {
#define AOV(ENUM, name, components) name,
#include "scene/aovs.inl"
#undef AOV
    };
    UNUSED(user);
    return i < COUNT_OF(names) ? names[i] : NULL;
}

static const char quantities[] =
#define AOV(ENUM, name, components) ", " name
#include "scene/aovs.inl"
#undef AOV
    ;

// What the channels of one element have in common. All that `moment` holds is named twice: the second time, samples are squared.
typedef struct Place {
    const char *prefix;
    int32_t power, first; // first: of the scene's integrators, those inside of the element
} Place;

// "NAME:QUANTITY, NAME:QUANTITY, ..."
static rey_result name_quantities(Builder *b, rey_xml_node *node, Place at) {
    const char *list;
    TRY(rey_xml_get_string(b->ctx, node, "aovs", "", &list));
    if (!*list) {
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE, "'aov' lacks 'aovs', a list of NAME:QUANTITY");
    }
    while (*list) {
        char item[160], *colon;
        size_t length = strcspn(list, ",");
        if (length >= sizeof item) {
            return rey_xml_fail_value(b->ctx, node, "aovs", "'%.40s...' in 'aovs' is too long", list);
        }
        memcpy(item, list, length);
        list += length + (list[length] == ',');
        while (length > 0 && item[length - 1] == ' ') {
            length--;
        }
        item[length] = '\0';
        const char *name = item + strspn(item, " ");
        colon = strchr(item, ':');
        if (!colon || colon == name) {
            return rey_xml_fail_value(b->ctx, node, "aovs", "'%s' in 'aovs', expected NAME:QUANTITY", item);
        }
        *colon = '\0';
        int kind = -1;
        for (int i = 0; aov_word(NULL, i); i++) {
            kind = strcmp(colon + 1, aov_word(NULL, i)) == 0 ? i : kind;
        }
        if (kind < 0) {
            return rey_xml_fail_word(b->ctx, rey_xml_place(node, "aovs"), colon + 1, aov_word, NULL,
                                     "there is no quantity '%s', expected one of %s", colon + 1, quantities + 2);
        }
        Channel channel = {.source = CHANNEL_AOV, .integrator = at.first, .power = at.power};
        TRY(find_quantity(b, node, &ARRAY_AT(b->scene->integrators, Integrator, at.first), kind, &channel.component));
        for (int32_t c = 0; c < aov_components(kind); c++, channel.component++) {
            TRY(add_channel(b, node, at.prefix, name, components[kind][c], channel));
        }
    }
    return REY_OK;
}

// One after the other of the integrators inside of `aov` or `moment`.
typedef struct Nested {
    rey_xml_node *node;
    char name[MAX_PATH_NAME]; // a number among those that have none
    int32_t first;            // of the scene's integrators, that or those of the node
    int count, unnamed;
} Nested;

static bool next_nested(rey_xml_node *node, Nested *n);

// Integrators of their own that an element holds, or is.
static int32_t count_integrators(rey_xml_node *node) {
    Nested n = {0};
    while (holds_others(node) && next_nested(node, &n)) {
    }
    return n.first > 0 ? n.first : 1;
}

static bool next_nested(rey_xml_node *node, Nested *n) {
    n->first += n->node ? count_integrators(n->node) : 0;
    rey_xml_child *child = rey_xml_child_of(node, REY_XML_BIT(REY_XML_INTEGRATOR), n->count++);
    if (child && child->name) {
        snprintf(n->name, sizeof n->name, "%s", child->name);
    } else if (child) {
        snprintf(n->name, sizeof n->name, "_arg_%d", n->unnamed++);
    }
    n->node = child ? child->node : NULL;
    return child != NULL;
}

static rey_result name_colours(Builder *b, const Nested *n, const char *prefix, int32_t source, int32_t power) {
    for (int32_t c = 0; c < 3; c++) {
        TRY(add_channel(b, n->node, prefix, n->name, source == CHANNEL_RGB ? "RGB"[c] : "XYZ"[c],
                        (Channel){.source = source, .component = c, .integrator = n->first, .power = power}));
    }
    return source == CHANNEL_RGB ? add_channel(b, n->node, prefix, n->name, 'A',
                                               (Channel){.source = CHANNEL_ALPHA, .integrator = n->first, .power = power})
                                 : REY_OK;
}

static rey_result name_channels(Builder *b, rey_xml_node *node, Place at);

// The channels that one of those inside brings besides its colour.
static rey_result name_further(Builder *b, const Nested *n, const char *prefix, int32_t power) {
    char longer[MAX_PATH_NAME];
    if (!holds_others(n->node)) {
        return REY_OK;
    }
    if (snprintf(longer, sizeof longer, "%s%s.", prefix, n->name) >= MAX_PATH_NAME) {
        return rey_xml_fail(b->ctx, n->node->at, REY_ERROR_UNSUPPORTED, "the name '%.40s...' is too long", longer);
    }
    return name_channels(b, n->node, (Place){longer, power, n->first});
}

static rey_result name_moments(Builder *b, rey_xml_node *node, Place at) {
    char squared[MAX_PATH_NAME];
    if (at.power == MOST_POWER) {
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_UNSUPPORTED, "'moment' inside 'moment' inside 'moment' is not supported");
    }
    if (snprintf(squared, sizeof squared, "%sm2_", at.prefix) >= MAX_PATH_NAME) {
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_UNSUPPORTED, "the name '%.40s...' is too long", squared);
    }
    for (int32_t k = 1; k <= 2; k++) {
        for (Nested n = {.first = at.first}; next_nested(node, &n);) {
            TRY(name_further(b, &n, k == 1 ? at.prefix : squared, k * at.power));
            TRY(name_colours(b, &n, k == 1 ? at.prefix : squared, CHANNEL_XYZ, k * at.power));
        }
    }
    return REY_OK;
}

static rey_result name_channels(Builder *b, rey_xml_node *node, Place at) {
    if (is(node, "moment")) {
        return name_moments(b, node, at);
    }
    for (Nested n = {.first = at.first}; next_nested(node, &n);) {
        TRY(name_colours(b, &n, at.prefix, CHANNEL_RGB, at.power));
    }
    for (Nested n = {.first = at.first}; next_nested(node, &n);) {
        TRY(name_further(b, &n, at.prefix, at.power));
    }
    return name_quantities(b, node, at);
}

rey_result build_channels(Builder *b, rey_xml_node *integrator) {
    return holds_others(integrator) ? name_channels(b, integrator, (Place){"", 1, 0}) : REY_OK;
}
