// xml.h: Mitsuba 3 XML read into a checked tree: values parsed, transforms composed, `$name` substituted, files
// included, references resolved. What a plugin's properties mean is the scene builder's business; it takes them with
// the getters below, which mark what they hand out as used, and then asks rey_xml_check_unused for the rest.
#pragma once

#include "io/spectrum.h"

// Object tags: X(symbol, tag in the file).
#define REY_XML_TAGS(X)                                                                                                \
    X(SCENE, "scene")                                                                                                  \
    X(BSDF, "bsdf")                                                                                                    \
    X(EMITTER, "emitter")                                                                                              \
    X(FILM, "film")                                                                                                    \
    X(INTEGRATOR, "integrator")                                                                                        \
    X(MEDIUM, "medium")                                                                                                \
    X(PHASE, "phase")                                                                                                  \
    X(RFILTER, "rfilter")                                                                                              \
    X(SAMPLER, "sampler")                                                                                              \
    X(SENSOR, "sensor")                                                                                                \
    X(SHAPE, "shape")                                                                                                  \
    X(TEXTURE, "texture")                                                                                              \
    X(VOLUME, "volume")                                                                                                \
    X(SPECTRUM, "spectrum")

typedef enum rey_xml_tag {
#define REY_XML_TAG_ENUM(symbol, name) REY_XML_##symbol,
    REY_XML_TAGS(REY_XML_TAG_ENUM)
#undef REY_XML_TAG_ENUM
        REY_XML_TAG_COUNT
} rey_xml_tag;
#define REY_XML_BIT(tag) (1u << (tag)) // sets of tags
// Whatever can stand for a texture: <texture> and <spectrum type=...>.
#define REY_XML_TEXTURES (REY_XML_BIT(REY_XML_TEXTURE) | REY_XML_BIT(REY_XML_SPECTRUM))

typedef enum rey_xml_kind {
    REY_XML_BOOLEAN_VALUE,
    REY_XML_INTEGER_VALUE,
    REY_XML_FLOAT_VALUE,
    REY_XML_STRING_VALUE,
    REY_XML_VECTOR_VALUE, // <vector> or <point>
    REY_XML_RGB_VALUE,
    REY_XML_SPECTRUM_VALUE,
    REY_XML_TRANSFORM_VALUE,
    REY_XML_KIND_COUNT
} rey_xml_kind;

typedef struct rey_xml_position {
    const char *file; // as opened; lives as long as the document
    int line, column; // from 1
} rey_xml_position;

typedef struct rey_xml_property {
    const char *name;
    rey_xml_position at;
    rey_xml_kind kind;
    bool used;    // set by the getters
    bool ignored; // left out by a lenient reader
    bool point;   // a vector that was written as <point>
    int order; // running number over properties and children of the node, in document order
    bool boolean;
    int64_t integer;
    double number;         // float; also set for an integer
    const char *string;    // string; for a spectrum from a file its name, else null
    double vector[3];      // vector, point, rgb
    double matrix[16];     // transform: 4x4, row-major, points are columns
    rey_spectrum spectrum; // as written
} rey_xml_property;

typedef struct rey_xml_child {
    struct rey_xml_node *node; // shared by all references to it
    const char *name;          // slot in the parent, null when unnamed
    rey_xml_position at;       // of the child or of the <ref>
    const char *ref;           // id that a <ref> names, null for a child that is declared here
    bool used;
    bool ignored; // left out by a lenient reader
    int order;
} rey_xml_child;

// Which properties and slots a builder has asked for: what an unknown one may have been meant to be.
enum { REY_XML_MOST_ASKED = 40 };
typedef struct rey_xml_asked {
    const char *names[REY_XML_MOST_ASKED];
    int count;
} rey_xml_asked;

typedef struct rey_xml_node {
    rey_xml_tag tag;
    const char *type; // plugin name; "scene" for a scene
    const char *id;   // null when none was given
    const char *name; // slot that it was declared for, null when none
    rey_xml_position at;
    rey_xml_property *properties; // document order
    int property_count;
    rey_xml_child *children; // document order
    int child_count;
    rey_xml_asked *asked; // kept by the getters
    int index;  // position in the document's list of nodes
    int built;  // free for the builder: -1 at first. Nodes are shared: build each once.
    int height; // longest chain of children below, references included; at most REY_XML_DEEPEST
} rey_xml_node;

typedef struct rey_xml_document rey_xml_document;

enum {
    REY_XML_DEEPEST = 128,      // elements in each other, and objects in each other through references
    REY_XML_INCLUDE_DEPTH = 64, // files in each other
};

// Reads a scene file (or a fragment whose root is a single object). defines are `$name` values that go before the
// file's own <default>; one that is never used is an error. The caller owns *out and frees it with rey_xml_free.
// Errors: REY_ERROR_IO (no such file), REY_ERROR_FORMAT (not well-formed XML), REY_ERROR_SCENE (anything else wrong
// with the content), REY_ERROR_MEMORY.
rey_result rey_xml_read(rey_context *ctx, const char *path, const rey_define *defines, int define_count,
                        rey_xml_document **out);
// The same, with flags.
enum {
    REY_XML_SPARE = 1,   // defines that the scene never uses are no error
    REY_XML_LENIENT = 2, // nor are elements that cannot be read: they are left out and listed, see rey_xml_ignored
};
rey_result rey_xml_read_with(rey_context *ctx, const char *path, const rey_define *defines, int define_count, int flags,
                             rey_xml_document **out);
// The same from memory; path names the text in messages, and its folder is where files are looked up.
rey_result rey_xml_read_memory(rey_context *ctx, const char *path, const char *text, size_t bytes,
                               const rey_define *defines, int define_count, rey_xml_document **out);
void rey_xml_free(rey_context *ctx, rey_xml_document *document); // accepts null

rey_xml_node *rey_xml_root(const rey_xml_document *document);
int rey_xml_node_count(const rey_xml_document *document);
rey_xml_node *rey_xml_node_at(const rey_xml_document *document, int index);      // order of declaration
rey_xml_node *rey_xml_find_id(const rey_xml_document *document, const char *id); // ids and aliases; null if unknown
const char *rey_xml_note(const rey_xml_document *document, int index); // what a user should know; null at the end
const char *rey_xml_ignored(const rey_xml_document *document, int index); // what was left out; null at the end
const char *rey_xml_tag_name(rey_xml_tag tag);
const char *rey_xml_kind_name(rey_xml_kind kind);

// Records "FILE:LINE:COLUMN: message" and returns the code.
rey_result rey_xml_fail(rey_context *ctx, rey_xml_position at, rey_result code, const char *format, ...)
    PRINTF_LIKE(4, 5);
// Puts the place that named a file before what was wrong with the file; passes every result on.
rey_result rey_xml_named_file(rey_context *ctx, rey_xml_position at, rey_result result);
// Records "FILE:LINE:COLUMN: message" where the property or child `name` of the node stands; the node itself where it has
// none, or name is null. Returns REY_ERROR_SCENE.
rey_result rey_xml_fail_value(rey_context *ctx, const rey_xml_node *node, const char *name, const char *format, ...)
    PRINTF_LIKE(4, 5);
// ", expected A, B or C" of the candidates; nothing where one is near the word, which rey_xml_fail_word suggests.
void rey_xml_list_words(const char *word, const char *(*next)(void *user, int i), void *user, char *text, size_t size);
// Records "FILE:LINE:COLUMN: message, did you mean 'x'?" with the nearest of the candidates (see rey_nearest_word).
rey_result rey_xml_fail_word(rey_context *ctx, rey_xml_position at, const char *word,
                             const char *(*next)(void *user, int i), void *user, const char *format, ...)
    PRINTF_LIKE(6, 7);

// ---- properties --------------------------------------------------------------------------------------------------
// All getters: an absent property gives the default and REY_OK; a property of the wrong kind is REY_ERROR_SCENE; a
// property that is present is marked used. *out is written in every case but failure. Names live as long as the
// document, as literals do.

rey_xml_property *rey_xml_find(const rey_xml_node *node, const char *name); // null when absent; does not mark
bool rey_xml_has(const rey_xml_node *node, const char *name);               // a property or a named child
rey_result rey_xml_require(rey_context *ctx, const rey_xml_node *node, const char *name); // error when !rey_xml_has

rey_result rey_xml_get_bool(rey_context *ctx, const rey_xml_node *node, const char *name, bool otherwise, bool *out);
rey_result rey_xml_get_int(rey_context *ctx, const rey_xml_node *node, const char *name, int64_t low, int64_t high,
                           int64_t otherwise, int64_t *out); // outside low..high is an error
rey_result rey_xml_get_float(rey_context *ctx, const rey_xml_node *node, const char *name, double otherwise,
                             double *out); // accepts integers
rey_result rey_xml_get_string(rey_context *ctx, const rey_xml_node *node, const char *name, const char *otherwise,
                              const char **out); // lives as long as the document
// One of count words, any case: stores its index. Anything else is an error that lists the words.
rey_result rey_xml_get_choice(rey_context *ctx, const rey_xml_node *node, const char *name, const char *const *words,
                              int count, int otherwise, int *out);
rey_result rey_xml_get_vec3(rey_context *ctx, const rey_xml_node *node, const char *name, const double otherwise[3],
                            double out[3]);
rey_result rey_xml_get_transform(rey_context *ctx, const rey_xml_node *node, const char *name,
                                 double out[16]); // identity when absent
// As a transform of uv: rows x and y, columns x, y and translation of the 4x4; row-major 2x3.
rey_result rey_xml_get_transform2(rey_context *ctx, const rey_xml_node *node, const char *name, double out[6]);
// A colour in linear sRGB from <float>, <rgb> or <spectrum>, checked against the range of its use (reflectance [0, 1],
// emission >= 0). Use it when there is no child of that name (a texture would be one).
rey_result rey_xml_get_colour(rey_context *ctx, const rey_xml_node *node, const char *name, rey_colour_use use,
                              const double otherwise[3], double out[3]);
// An index of refraction: a number or a name.
rey_result rey_xml_get_ior(rey_context *ctx, const rey_xml_node *node, const char *name, const char *otherwise,
                           double *out);

// Where the property or child of this name stands, as of rey_xml_fail_value.
rey_xml_position rey_xml_place(const rey_xml_node *node, const char *name);

// ---- children ----------------------------------------------------------------------------------------------------

// The child in a slot, marked used; null when absent.
rey_xml_child *rey_xml_child_named(const rey_xml_node *node, const char *name);
// The index-th child (from 0, document order) whose tag is in the set `tags` of REY_XML_BITs, whatever its name;
// marked used; null when there are fewer.
rey_xml_child *rey_xml_child_of(const rey_xml_node *node, unsigned tags, int index);
int rey_xml_count_children(const rey_xml_node *node, unsigned tags); // marks nothing

// An error that names the first property or child that nobody took, with the nearest of the known names; known null =
// those that the getters were asked for.
rey_result rey_xml_check_unused(rey_context *ctx, const rey_xml_node *node, const char *(*known)(void *user, int i),
                                void *user);

// Marks that property or child as left out.
void rey_xml_ignore_unused(rey_xml_node *node);

// ---- files -------------------------------------------------------------------------------------------------------

// The path of the file that the string property `name` names: the search folders (latest <path> first), then the
// scene's folder. Marks the property used. A missing property or file is an error that lists the folders searched.
// The caller frees *out with rey_free.
rey_result rey_xml_resolve_file(rey_context *ctx, const rey_xml_document *document, const rey_xml_node *node,
                                const char *name, char **out);
