// save_parts.h: what the files that write a scene back share. Private to src/io/save*.c.
#pragma once

#include "io/build.h"
#include "io/save.h"

#include <stdarg.h>

// What a parameter whose values changed since loading means for the file.
typedef enum EditKind {
    EDIT_CONSTANT, // a value: a property of a node, written or default, or the texture object itself
    EDIT_TO_UV,    // a texture's mapping
    EDIT_TEXELS,   // a picture: of a bitmap or of an environment; voxels of a grid
    EDIT_LIST,     // numbers in a string
    EDIT_GEOMETRY, // vertices, attributes, control points or distances of a shape
    EDIT_LEAF      // a number, a vector or a pose of the name that the parameter ends in
} EditKind;

typedef struct Edit {
    EditKind kind;
    int param;
    const rey_xml_node *node;
    const char *property; // EDIT_CONSTANT: null = the object; EDIT_LEAF: end of the parameter's name
    int32_t next;         // of the same node, -1 = none
} Edit;

// A file that goes into the data folder as it is.
typedef struct DataFile {
    char *source, *name; // path as found; name in the folder
    bool inside;         // it lies there already
} DataFile;

typedef struct Writer {
    rey_context *ctx;
    const rey_scene *scene;
    const SceneSource *source;
    Array text;
    const char *folder;      // of the data files, as opened
    const char *folder_name; // the same, as the XML names it
    Array files;             // DataFile
    Array edits;             // Edit
    SavedParts parts;        // in the place of the scene's own
    int32_t *first_edit;     // per node: entry of `edits`, -1 = none
    int32_t *texture_sources; // per texture: entry of the source's textures, -1 = none
    Names paths;             // of nodes, by number
    int number;              // running number of the files that are written anew
    bool folder_made, folder_new; // it is there; it was not before
    Array made;              // char *: files that were not there before, where keeps_files
    bool keeps_files;        // what lies in the folder is not to be replaced
    uint8_t *declared;       // per node: the file holds it where it was declared, or where it was first referred to
    bool failed;             // out of memory while writing text
} Writer;

// ---- text (save_text.c) ------------------------------------------------------------------------------------------

void rey_save_line(Writer *w, int depth, const char *format, ...) PRINTF_LIKE(3, 4);
// A line <TAG name="NAME" value="VALUE"/>, with VALUE escaped.
void rey_save_value(Writer *w, int depth, const char *tag, const char *name, const char *value);
void rey_save_matrix(Writer *w, int depth, const char *name, const float m[16]);
// A property as the document has it. Names of files are looked up in the list of data files.
void rey_save_property(Writer *w, int depth, const rey_xml_property *property);
// <TAG id="VALUE" OTHER="OTHER_VALUE"/>; the second attribute is left out when its value is null.
void rey_save_tag(Writer *w, int depth, const char *tag, const char *value, const char *other, const char *other_value);
// <TAG type="TYPE" id="ID" name="SLOT">, and its end.
void rey_save_open(Writer *w, int depth, const rey_xml_node *node, const char *type, const char *slot);

// ---- data files (save_files.c) -----------------------------------------------------------------------------------

// Lists the files that nodes name and no edit replaces, and gives each a name of its own in the folder, where there may be none
// of this name that is to be kept.
rey_result rey_save_list_files(Writer *w);
rey_result rey_save_copy_files(Writer *w);
const char *rey_save_data_name(const Writer *w, const rey_xml_node *node); // null when the node names none
// A path for a file that is written anew, "KIND_N.ENDING", and the line that names it.
rey_result rey_save_new_file(Writer *w, int depth, const char *kind, const char *ending, char path[4096]);
void rey_save_free_files(Writer *w, bool failed); // failed: removes those that were not there before, too

// ---- edits (save_edits.c) ----------------------------------------------------------------------------------------

// Finds the node of every changed parameter; one that no property can hold is an error.
rey_result rey_save_find_edits(Writer *w);
const Edit *rey_save_first_edit(const Writer *w, const rey_xml_node *node); // null when none
const Edit *rey_save_next_edit(const Writer *w, const Edit *edit);
bool rey_save_has_edit(const Writer *w, const rey_xml_node *node, EditKind kind);
// Does an edit of the node stand for this property?
bool rey_save_replaces(const Writer *w, const rey_xml_node *node, const char *property);
bool rey_save_is_curve_or_grid(const rey_xml_node *node);
// Writes what the node's edits made of it.
rey_result rey_save_write_edits(Writer *w, int depth, const rey_xml_node *node);
// The value of a constant texture, as <float> or <rgb>.
void rey_save_constant(Writer *w, int depth, const char *name, int32_t texture);
