// build.h: from the checked XML tree to the flat scene: what the parts of the builder share.
#pragma once

#include "bsdf/table.h"
#include "io/xml.h"
#include "scene/scene.h"

// Where a texture's values came from, so that the scene can be written back: a property of `node`, or the texture
// object `node` itself when property is null.
typedef struct TextureSource {
    rey_xml_node *node;
    const char *property;
    int32_t texture;
} TextureSource;

// Which shape a <shape> became.
typedef struct ShapeSource {
    rey_xml_node *node;
    int32_t shape;
} ShapeSource;

// Values that a mesh brings for one of its attributes.
typedef struct MeshAttribute {
    char name[64]; // "vertex_NAME" or "face_NAME"
    int32_t shape, theta, channels, param;
    bool per_face;
} MeshAttribute;

// A texture that reads an attribute by name.
typedef struct AttributeUse {
    char name[64];
    int32_t texture;
    rey_xml_node *node;
} AttributeUse;

// The source document; it lives as long as the scene, which is written back from it.
typedef struct SceneSource {
    rey_context *ctx;
    rey_xml_document *document;
    Array textures, shapes; // of TextureSource, ShapeSource
    Array attributes;       // of MeshAttribute
    Array ignored;          // of char *: what a lenient reader left out, and why
    Array paths;            // of char *, per node of the document: its first parameter path, null = none
} SceneSource;

// Parameters and aliases that came into being while an object was built: no others have a name that begins with its path.
typedef struct NodeNames {
    size_t first_param, first_alias, params, aliases; // params, aliases: one past the last; 0 = open yet
} NodeNames;

// Parameters of one texture: its values and its to_uv.
enum { TEXTURE_MOST_PARAMS = 2 };
typedef struct TextureParams {
    int32_t param[TEXTURE_MOST_PARAMS]; // number + 1, 0 = none
} TextureParams;

// Hash table of the shading groups: number + 1, 0 = empty.
typedef struct GroupTable {
    int32_t *slots;
    size_t capacity, used; // capacity is a power of two
} GroupTable;

typedef struct Builder {
    rey_context *ctx;
    rey_scene *scene;
    SceneSource *source;
    struct LoadAhead *ahead; // files that were read already, null = none
    Array attribute_uses; // of AttributeUse
    Array names;          // of NodeNames, per node
    Array texture_params; // of TextureParams, per texture
    Array named;          // of rey_xml_node *: objects whose path has been noted, in that order
    bool lenient;         // what cannot be read is left out
    bool small;           // a surface was said to be too small for its place
    int32_t collection;   // shapegroup that shapes go to, -1 = the scene itself
    int32_t shape_flags;  // of all shapes that are built now
    int32_t beside;       // number + 1 of the volume in whose place those that are built now must stand, 0 = anywhere
    GroupTable groups;
} Builder;

#define TRY(expression)                                                                                                \
    do {                                                                                                               \
        rey_result try_result_ = (expression);                                                                         \
        if (try_result_ != REY_OK) {                                                                                   \
            return try_result_;                                                                                        \
        }                                                                                                              \
    } while (0)

enum { MAX_PATH_NAME = 512 };

// "a.b" into out.
void build_join(char out[MAX_PATH_NAME], const char *a, const char *b);

// Remembers an object's parameter path, which starts the names of its parameters.
rey_result build_name(Builder *b, rey_xml_node *node, const char *path);

// First visit of an object: remembers its path and returns true. Later visits: names the object's parameters under
// the new path as well and returns false. Objects with an id are known under it, too.
rey_result build_visit(Builder *b, rey_xml_node *node, const char *path, bool *first);
rey_result build_finish(Builder *b, rey_xml_node *node, const char *path);

// Refuses a plugin: by name and reason where it is one of the format's, else with the nearest known name.
rey_result build_unknown(Builder *b, const rey_xml_node *node, const char *(*known)(void *user, int i), void *user);

// What a texture-valued slot expects.
typedef struct TextureUse {
    rey_colour_use colour;
    bool real;             // a number is wanted: a plain float stays one number
    float low, high;
    const char *unit, *text;
    int terms;             // that the derivative needs beyond `interior`
    const char *why;
} TextureUse;

// The texture of slot `name` of a node: a child, a value, or the default (grey, when count is 1). path: of the slot.
rey_result build_slot(Builder *b, rey_xml_node *node, const char *name, TextureUse use, const double *value, int count,
                      const char *path, int32_t *out);
// A texture object.
rey_result build_texture(Builder *b, rey_xml_node *node, TextureUse use, const char *path, int32_t *out);
bool build_is_volume(const Builder *b, int32_t texture); // itself or in a child
// A constant with its parameter `path`.value (alias `path`). node and property say where it came from, may be null.
rey_result build_constant(Builder *b, rey_xml_node *node, const char *property, TextureUse use, const double *values,
                          int count, const char *path, int32_t *out);
// A texture that reads a mesh's attribute; and, once all shapes and textures are known, who finds what where.
rey_result build_attribute_texture(Builder *b, rey_xml_node *node, int32_t texture);
rey_result build_attribute_tables(Builder *b);
// A spectrum as an object.
rey_result build_spectrum(Builder *b, rey_xml_node *node, TextureUse use, const char *path, int32_t *out);
// Numbers of a string property, between blanks and commas, as double; the caller frees the list.
rey_result build_number_list(Builder *b, rey_xml_node *node, const char *name, Array *list);
// Appends a texture node with identity mapping; *theta has room for count numbers. Where a texture came from.
rey_result build_add_texture(Builder *b, int32_t kind, int64_t count, int32_t *id, float **theta);
rey_result build_note_source(Builder *b, rey_xml_node *node, const char *property, int32_t texture);
// Registers a parameter of a texture (p.texture or p.to_uv); its number, -1 on failure. And those of a texture: the
// k-th, null when there are fewer.
int build_texture_param(Builder *b, const char *name, Param p);
Param *build_param_of(Builder *b, int32_t texture, int k);
// A constant number that is no parameter.
rey_result build_number(Builder *b, float value, int32_t *out);
// A pose: 16 numbers of theta with the parameter `path`.to_world. Returns its theta offset.
rey_result build_pose(Builder *b, const double matrix[16], const char *path, Param param, int32_t *out);

// Horizontal field of view [degrees] of a camera of that aspect, from fov or focal_length.
rey_result build_field_of_view(Builder *b, rey_xml_node *node, double aspect, double *out);
rey_result build_bsdf(Builder *b, rey_xml_node *node, const char *path, int32_t *out);
rey_result build_default_bsdf(Builder *b, rey_xml_node *node, double reflectance, const char *path, int32_t *out);
rey_result build_shape(Builder *b, rey_xml_node *node, const char *path);
rey_result build_group(Builder *b, ShapeRecord *shape); // finds its shading group
// A field over space: an object, or the value or texture in slot `name` of a node (see build_volume.c). *out: among `volumes`.
rey_result build_volume(Builder *b, rey_xml_node *node, TextureUse use, const char *path, int32_t *out);
rey_result build_volume_slot(Builder *b, rey_xml_node *node, const char *name, TextureUse use, double value,
                             const char *path, int32_t *out);
// What scatters and what absorbs in a medium, and the volume of their sum (build_scattering.c).
rey_result build_scattering(Builder *b, rey_xml_node *node, const char *path, MediumNode *medium);
rey_result build_phase(Builder *b, rey_xml_node *node, const char *path, int32_t *out);
rey_result build_isotropic_phase(Builder *b, int32_t *out);
rey_result build_medium(Builder *b, rey_xml_node *node, const char *path, int32_t *out);
// The medium in a slot of a node (name null: any medium, under the path); -1 where there is none.
rey_result build_medium_slot(Builder *b, rey_xml_node *node, const char *name, const char *path, int32_t *out);
// Whether paths go through media.
rey_result build_media_use(Builder *b);
// Notes of pictures with numbers out of their slots' ranges, which begin with "warning: "; of a scene that is frozen.
rey_result build_note_ranges(Builder *b);
rey_result build_sdfgrid(Builder *b, rey_xml_node *node, int32_t id, const char *path, ShapeRecord *shape);
bool build_is_curve(const char *plugin);
int build_curve_order(const char *plugin); // control points per segment
rey_result build_curve(Builder *b, rey_xml_node *node, int32_t id, const char *path, ShapeRecord *shape);
rey_result build_shapegroup(Builder *b, rey_xml_node *node, const char *path);
rey_result build_merge(Builder *b, rey_xml_node *node, const char *path);
rey_result build_instance(Builder *b, rey_xml_node *node, const char *path);
// shape: of an area light, else -1.
rey_result build_emitter(Builder *b, rey_xml_node *node, int32_t shape, const char *path, int32_t *out);
// shape: that the sensor belongs to, else -1.
rey_result build_sensor(Builder *b, rey_xml_node *node, int32_t shape, const char *path);
// node->built of a sensor that is part of a batch: this less its number in `batch_sensors`.
enum { SENSOR_OF_BATCH = -2 };
// A shape that no ray meets, for a sensor to look at.
rey_result build_target_shape(Builder *b, rey_xml_node *node, const char *path, int32_t *out);
// A pose that turns +z into the property `direction`.
rey_result build_direction(Builder *b, rey_xml_node *node, double matrix[16]);
rey_result build_film(Builder *b, rey_xml_node *node, SensorRecord *s); // node may be null
rey_result build_sampler(Builder *b, rey_xml_node *node, SensorRecord *s);
rey_result build_integrator(Builder *b, rey_xml_node *node);
rey_result build_default_integrator(Builder *b); // in the place of what could not be read
rey_result build_channels(Builder *b, rey_xml_node *integrator); // that it adds to pictures
