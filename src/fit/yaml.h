// yaml.h: a YAML document as a tree that remembers its lines, and dotted overrides of it.
#pragma once

#include "base/context.h"

typedef enum YamlKind { YAML_SCALAR, YAML_LIST, YAML_MAP } YamlKind;

typedef struct YamlNode YamlNode;
struct YamlNode {
    YamlKind kind;
    int line;        // from 1; 0 = set by an override
    const char *set; // that override, where line = 0; the caller's text
    char *key;       // inside a map, else null
    char *text;      // scalars
    YamlNode *child; // first entry of a list or map
    YamlNode *next;  // next sibling
};

// Reads one document; an empty one is an empty map. Anchors, aliases, double keys and depths beyond 32 are refused.
// `name` is for messages. The caller frees *out with rey_yaml_free.
rey_result rey_yaml_read(rey_context *ctx, const char *name, const unsigned char *bytes, size_t size, YamlNode **out);
void rey_yaml_free(rey_context *ctx, YamlNode *node);

// Applies "a.b.0.c=VALUE": keys of maps and indices of lists, joined by dots; VALUE is YAML. Maps on the way are made,
// and an index one past a list's end appends to it. The assignment must live as long as the tree.
rey_result rey_yaml_override(rey_context *ctx, YamlNode *root, const char *assignment);

YamlNode *rey_yaml_find(const YamlNode *map, const char *key); // null when there is none
int rey_yaml_count(const YamlNode *node);                      // entries of a list or map
