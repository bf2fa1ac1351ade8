// xml_parts.h: what the files of the XML reader share. Private to src/io/xml*.c.
#pragma once

#include "io/xml.h"

#include <expat.h>

// ---- document (xml.c) --------------------------------------------------------------------------------------------

typedef struct XmlBlock { // memory of the document, freed all at once
    struct XmlBlock *next;
    size_t used, size;
    _Alignas(16) unsigned char bytes[];
} XmlBlock;

typedef struct XmlId {
    const char *id; // null in an empty slot
    rey_xml_node *node;
    rey_xml_position at;
} XmlId;

typedef struct XmlIds { // hash table, open addressing
    XmlId *slots;
    size_t capacity, count; // capacity is a power of two, at most half full
} XmlIds;

struct rey_xml_document {
    XmlBlock *blocks;
    rey_xml_node *root;
    Array nodes;   // rey_xml_node *
    Array folders; // const char *, in the order of the <path> tags
    Array notes;   // const char *, literals: what a user should know about how it was read
    Array ignored; // const char *: what a lenient reader left out, and why
    Array spectra; // double *, data of spectra read from files
    XmlIds ids;
    const char *folder; // of the scene file
};

// Memory that lives as long as the document; null (and a recorded message) on failure.
void *rey_xml_keep(rey_context *ctx, rey_xml_document *document, size_t bytes);
char *rey_xml_keep_text(rey_context *ctx, rey_xml_document *document, const char *text, size_t length);

// ---- reader ------------------------------------------------------------------------------------------------------

enum {
    XML_LARGEST_FILE = 1 << 30,     // bytes, all files of a scene together
    XML_MOST_INCLUDES = 4096,       // files of a scene
    XML_MOST_NAMES = 4096,          // named properties and children of one object; <default>s of one scene
    XML_LONGEST_VALUE = 1 << 20,    // bytes of an attribute after substitution
    XML_MOST_SUBSTITUTED = 1 << 26, // bytes that substitution may produce in one scene
    XML_MOST_ATTRIBUTES = 8,
};

typedef struct XmlDefine {
    const char *name, *value;
    bool from_caller, used;
} XmlDefine;

typedef struct XmlFile { // one file being parsed; a chain from the innermost to the scene
    struct XmlReader *reader;
    struct XmlFile *parent;
    XML_Parser parser;
    const char *name, *folder;
    const char *text; // whole file
    size_t bytes;
    int version[3];
    size_t base; // frames that were open when it began
    int depth;
    int skipped; // elements open since one was left out
} XmlFile;

typedef struct XmlFrame { // one open element
    const struct XmlTag *tag;
    rey_xml_node *node;         // objects
    bool splice;                // root <scene> of an included file: its content goes to the object around
    Array properties;           // rey_xml_property
    Array children;             // rey_xml_child
    Array names;                // const char *: taken in this object
    rey_xml_property transform; // of an open <transform>
    int line;                   // of its tag
} XmlFrame;

typedef struct XmlReader {
    rey_context *ctx;
    rey_xml_document *document;
    rey_result result; // first failure; everything stops on it
    Array frames;      // XmlFrame
    Array defines;     // XmlDefine
    XmlFile *file;     // innermost
    int file_count;
    size_t bytes_read, substituted;
    int flags;          // REY_XML_SPARE, REY_XML_LENIENT
} XmlReader;

// ---- grammar (xml_grammar.c) and elements (xml_element.c) --------------------------------------------------------

typedef enum XmlClass {
    XML_OBJECT,    // becomes a node
    XML_VALUE,     // becomes a property
    XML_OPERATION, // within <transform>
    XML_SPECIAL    // ref, default, include, path, alias
} XmlClass;

typedef enum XmlSpecial { XML_REF, XML_DEFAULT, XML_INCLUDE, XML_PATH, XML_ALIAS } XmlSpecial;
typedef enum XmlOperation { XML_TRANSLATE, XML_SCALE, XML_ROTATE, XML_LOOKAT, XML_MATRIX } XmlOperation;

typedef struct XmlTag {
    const char *name;
    XmlClass class;
    int which;                 // rey_xml_tag, rey_xml_kind, XmlOperation or XmlSpecial
    int required;              // that many of the attributes must be given
    const char *attributes[6]; // null at the end
} XmlTag;

typedef struct XmlAttribute {
    const char *name, *value; // value after substitution
    rey_xml_position at;
} XmlAttribute;

typedef struct XmlAttributes {
    XmlAttribute items[XML_MOST_ATTRIBUTES];
    int count;
} XmlAttributes;

const XmlAttribute *rey_xml_attribute_named(const XmlAttributes *attributes, const char *name); // null when absent

rey_result rey_xml_start_element(XmlFile *file, const char *name, const char **attributes);
rey_xml_position rey_xml_element_position(const XmlFile *file);
// Tag by name; an error with the nearest tag when there is none. has_type tells <spectrum type> from <spectrum value>.
rey_result rey_xml_find_tag(XmlFile *file, const char *name, bool has_type, const XmlTag **out);
// Substitutes in, and checks, the attributes of a tag. extra: one more name that is allowed, or null.
rey_result rey_xml_take_attributes(XmlFile *file, const XmlTag *tag, const char *extra, const char **given,
                                   XmlAttributes *out);
rey_result rey_xml_end_element(XmlFile *file);
XmlFrame *rey_xml_top_frame(XmlReader *reader);    // null when none
XmlFrame *rey_xml_object_frame(XmlReader *reader); // innermost object that takes properties; null when none
void rey_xml_free_frame(rey_context *ctx, XmlFrame *frame);
rey_result rey_xml_claim_name(XmlReader *reader, XmlFrame *frame, const char *name, rey_xml_position at);

// ---- the others --------------------------------------------------------------------------------------------------

// The result of reading a part: where it failed and the reader is lenient, lists why, and the part is left out (xml.c).
rey_result rey_xml_overlook(XmlReader *reader, rey_result result);
// Parses one file's text into the open frames (xml.c).
rey_result rey_xml_parse_text(XmlReader *reader, const char *name, const char *text, size_t bytes);
// Reads a file into rey_alloc'ed memory: the scene, whose place is nowhere, or else a regular file that one names (xml_file.c).
rey_result rey_xml_load(XmlReader *reader, rey_xml_position at, const char *path, bool scene, char **text,
                        size_t *bytes);
// path when absolute, else the first of the folders that has it; null in *out when none has (xml_file.c).
rey_result rey_xml_search(rey_context *ctx, const rey_xml_document *document, const char *first_folder,
                          const char *path, char **out);
// Error that a file was not found, with the folders searched (xml_file.c).
rey_result rey_xml_not_found(rey_context *ctx, const rey_xml_document *document, rey_xml_position at,
                             const char *first_folder, const char *path);
char *rey_xml_folder_of(rey_context *ctx, rey_xml_document *document, const char *path); // kept by the document
char *rey_xml_join(rey_context *ctx, const char *folder, const char *path);              // freed by the caller
bool rey_xml_is_folder(const char *path);

// $name (xml_define.c).
rey_result rey_xml_add_define(XmlReader *reader, const char *name, const char *value, bool from_caller,
                              rey_xml_position at);
rey_result rey_xml_substitute(XmlReader *reader, const char *text, rey_xml_position at, const char **out);
rey_result rey_xml_check_defines(XmlReader *reader, rey_xml_position at);

// Values and transforms (xml_value.c, xml_transform.c).
rey_result rey_xml_read_value(XmlReader *reader, const XmlTag *tag, const XmlAttributes *attributes,
                              rey_xml_property *property);
rey_result rey_xml_read_vector(XmlReader *reader, const XmlAttributes *attributes, double otherwise, double out[3]);
rey_result rey_xml_read_numbers(XmlReader *reader, const XmlAttribute *attribute, int most, double *out, int *count);
rey_result rey_xml_apply_operation(XmlReader *reader, const XmlTag *tag, const XmlAttributes *attributes,
                                   rey_xml_position at, double matrix[16]);
void rey_xml_identity(double matrix[16]);
void rey_xml_multiply_left(double matrix[16], const double left[16]); // matrix = left * matrix

// Ids and references (xml_refs.c).
rey_result rey_xml_add_id(XmlReader *reader, const char *id, rey_xml_node *node, rey_xml_position at);
rey_xml_node *rey_xml_lookup_id(const XmlIds *ids, const char *id);
rey_result rey_xml_resolve_references(XmlReader *reader);

// Files older than version 2 (xml_upgrade.c). The name is rewritten into memory of the document.
rey_result rey_xml_upgrade_name(XmlReader *reader, const char **name);
rey_result rey_xml_upgrade_object(XmlReader *reader, XmlFrame *frame);
// Plugins and properties of older versions that have other names now (xml_old_names.c).
rey_result rey_xml_renew_object(XmlReader *reader, XmlFrame *frame);

rey_result rey_xml_fail_position(rey_context *ctx, rey_xml_position at, rey_result code, const char *format,
                                 va_list arguments);
