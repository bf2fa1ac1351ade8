// lenient.h: reading what can be read of a scene: where a part fails, everything that it began is taken back, the part
// is left out, and the scene remembers what and why.
#pragma once

#include "io/build.h"

// How far the scene had grown.
typedef struct Snapshot {
#define ARRAY(type, name, comment) size_t name;
#include "scene/arrays.inl"
#undef ARRAY
    size_t params, aliases, source_textures, source_shapes, source_attributes, attribute_uses, named;
    int32_t collection, collections;
} Snapshot;

Snapshot build_snapshot(const Builder *b);
// The result of building a child: when it failed and the reader is lenient, takes back what was built since the
// snapshot, marks the child as left out and returns REY_OK; else returns the result. *left_out may be null.
rey_result build_forgive(Builder *b, const Snapshot *s, rey_xml_child *child, const char *instead, rey_result result,
                         bool *left_out);
// The result of building a node: where it failed, the reader is lenient, and one of its properties, or a part that it does without,
// is to blame, takes that out of it, takes back what was built since the snapshot, and returns REY_OK with *again = true.
rey_result build_take_out(Builder *b, const Snapshot *s, rey_xml_node *node, rey_result result, bool *again);
// The result of a look at what was built: where it failed and the reader is lenient, lists why, and what is done instead, and
// returns REY_OK.
rey_result build_overlook(Builder *b, const char *instead, rey_result result);
// Lists what was left out, and what is done instead.
rey_result build_remember(Builder *b, const char *text, const char *instead);
// An error that names what nobody took; a lenient reader leaves all of that out.
rey_result build_check_unused(Builder *b, rey_xml_node *node);
