// scene.h: the flat scene. Records are plain 32-bit fields so that lanes can gather them; indices, no pointers.
#pragma once

#include "scene/names.h"

#include <math.h>

enum { MAX_SLOTS = 16, MAX_CONFIG = 4, MAX_CHILDREN = 2, MAX_EMITTER_SLOTS = 5 };

enum {
    TEXTURE_CONSTANT,
    TEXTURE_BITMAP,
    TEXTURE_CHECKERBOARD,
    TEXTURE_ATTRIBUTE,
    TEXTURE_BLACKBODY,
    TEXTURE_VOLUME, // the voxels of a grid
    TEXTURE_TABLE   // a list of `width` numbers that its user looks up itself
};
// What a black body derives from its temperature, in theta: colour, derivative, the temperature that these belong to; and
// the wavelengths that it emits.
enum { BLACKBODY_SLOPE = 3, BLACKBODY_BUILT = 6, BLACKBODY_RANGE = 7, BLACKBODY_NUMBERS = 9 };
// How the numbers of a bitmap are stored: floats in theta; or, until somebody changes them, in `texels` (texels.h).
enum { TEXELS_FLOAT, TEXELS_BYTE, TEXELS_SRGB, TEXELS_HALF };
enum { FILTER_NEAREST, FILTER_BILINEAR };
enum { WRAP_REPEAT, WRAP_MIRROR, WRAP_CLAMP };

typedef struct TextureNode {
    int32_t kind;
    int32_t theta;    // first value
    int32_t width, height, channels; // channels 1 or 3
    int32_t filter, wrap;
    int32_t to_uv;    // theta offset of a row-major 3 x 3 matrix, -1 = identity
    int32_t child[2]; // checkerboard: color0, color1; mesh_attribute: scale, -1; blackbody: temperature, -1
    int32_t attribute; // mesh_attribute: its first entry in `attributes`
    int32_t per_face;
    int32_t volume;    // volume: whose voxels these are
    int32_t storage, texels; // bitmap: TEXELS_, and its first number in `texels`, counted in its own numbers
} TextureNode;

typedef struct BsdfNode {
    int32_t kind;
    int32_t slot[MAX_SLOTS];     // textures, in the order of the kind's parameter list
    int32_t config[MAX_CONFIG];  // uniform switches, in the order of the kind's configuration list
    int32_t child[MAX_CHILDREN]; // nested functions, -1 = none
    int32_t table;               // first derived value in `tables`, -1 = none
    int32_t transmits;           // lets light through, itself or in a child
    int32_t spreads;             // scatters into more than single directions, itself or in a child
    int32_t glossy;              // scatters into lobes about single directions, itself or in a child
    int32_t aims;                // all of its light, and of its children's, is spread to its own side: directions can be mixed
    int32_t surface;             // asks for the parameterisation of the surface, itself or in a child
    int32_t turns;               // turns the shading normal, itself or in a child
    int32_t used;                // a shape has it, or one that holds it
} BsdfNode;

enum {
#define VOLUME(ENUM, prefix, name) VOLUME_##ENUM,
#include "scene/volumes.inl"
#undef VOLUME
    VOLUME_KIND_COUNT
};

// A field over the unit cube, which to_world places.
typedef struct VolumeNode {
    int32_t kind;
    int32_t theta, channels; // first value; 1, 3 or 6 numbers per voxel
    int32_t nx, ny, nz;      // voxels, x fastest
    int32_t filter, wrap;    // as of bitmaps
    int32_t table;           // rows of the inverse of to_world (12), -1 = the unit cube itself
    int32_t to_world;        // theta offset of 4 x 4, -1 = the unit cube itself
    int32_t texture;         // what its values are known as where derivatives are gathered
} VolumeNode;

enum { MAX_PHASE_SLOTS = 1, MAX_PHASE_CHILDREN = 2 };

typedef struct PhaseNode {
    int32_t kind;                      // medium/kinds.inl
    int32_t slot[MAX_PHASE_SLOTS];     // textures, in the order of the kind's parameter list; tables: as many as width says
    int32_t child[MAX_PHASE_CHILDREN]; // nested functions, -1 = none; of a list: one, and the node with the rest of the list
    int32_t table;                     // first derived value in `tables`, -1 = none
} PhaseNode;

// Extinction is scale x sigma_t, in media of flakes times their projected area; the share `albedo` of it scatters. Of media that
// are written with sigma_s and sigma_a, sigma_t is the sum of these, which medium/sum.h derives; they have no albedo (-1).
typedef struct MediumNode {
    int32_t sigma_t, albedo;        // volumes
    int32_t sigma_s, sigma_a;       // volumes: what scatters and what absorbs, -1 = sigma_t and albedo say that
    int32_t emission;               // volume: radiance that is added per unit of length, whatever sigma_t and scale are; -1 = none
    int32_t phase;
    int32_t flakes;                 // texture of their matrix (medium/flakes.h), -1 = there are none
    int32_t scale, scale_texture;   // theta offset, and the texture of that number
    int32_t bounded;                // heterogeneous: nothing lies outside of the box around the cube of sigma_t
    int32_t nx, ny, nz, table;      // supervoxels, the largest extinction in each of them, and that in all of them
} MediumNode;

enum { SHAPE_HAS_NORMALS = 1, SHAPE_HAS_UVS = 2, SHAPE_FLIP_NORMALS = 4, SHAPE_INSTANCED = 16, SHAPE_SMOOTH_GRADIENT = 32 };
// Host only: the vertex normals were computed from the positions and follow them.
enum { SHAPE_SMOOTH_NORMALS = 8 };
// Host only: no ray meets it; it only says where a sensor looks.
enum { SHAPE_UNSEEN = 64 };

typedef struct ShapeRecord {
    int32_t kind, flags, group, bsdf, emitter; // kind: shape/kinds.inl
    int32_t interior, exterior;              // media, -1 = vacuum
    int32_t triangle, triangle_count;        // in `triangles`, counted in triangles
    int32_t vertex_count, welded;            // welded: first entry in `welded`
    int32_t positions, normals, uvs;         // theta offsets, -1 = none
    int32_t to_world;                        // theta offset of a row-major 4 x 4 matrix, -1 = vertices are in the world
    int32_t table;                           // what the kind derives from to_world
    int32_t mirrored;                        // spheres: to_world turned the inside out as it was read, which it may not do later
    int32_t segment, segment_count;          // curves: in `segments`; positions holds 4 numbers per control point
    int32_t area_cdf;                        // tables offset: triangle_count cumulative areas (mesh emitters), -1 = none
    float area;                              // surface area [scene units^2]
    int32_t collection;                      // shapegroup that it belongs to, -1 = stands in the scene itself
} ShapeRecord;

typedef struct InstanceRecord {
    int32_t group;    // number of the shapegroup
    int32_t to_world; // theta offset of 4 x 4
    int32_t table;    // rows of to_world (12), rows of its inverse (12)
} InstanceRecord;

typedef struct EmitterRecord {
    int32_t kind, shape;   // kind: emitter/kinds.inl; shape: of lights that are one, else -1
    int32_t slot[MAX_EMITTER_SLOTS]; // in the order of the kind's parameter list: textures, or theta offsets of places
    int32_t table;         // what the kind derives from its parameters, -1 = nothing
    int32_t attributes;    // its texture reads mesh attributes or a volume: where, emitter_texcoord says
    int32_t family;        // lights of one family are handled in one call, with their numbers gathered; -1 = alone
    float weight;          // sampling weight, normalised: the probability of being chosen
} EmitterRecord;

enum { FILM_BOX, FILM_TENT, FILM_GAUSSIAN, FILM_MITCHELL, FILM_CATMULLROM, FILM_LANCZOS };
enum { MOST_FILTER_RADIUS = 256 }; // pixels

// What the files of a film hold.
enum { PIXEL_RGB, PIXEL_RGBA, PIXEL_LUMINANCE, PIXEL_LUMINANCE_ALPHA, PIXEL_XYZ, PIXEL_XYZA, PIXEL_FORMATS };
enum { COMPONENT_FLOAT16, COMPONENT_FLOAT32, COMPONENT_UINT32 };

typedef struct SensorRecord {
    int32_t kind;
    int32_t to_world;         // theta offset of 4 x 4
    int32_t fov;              // theta offset: horizontal field of view [degrees], -1 = none
    int32_t principal;        // theta offset: principal point offset x, y [fraction of the film]
    int32_t width, height;    // full film [pixels]
    int32_t crop_x, crop_y, crop_width, crop_height;
    int32_t filter, sample_border, sampler, spp;
    int32_t pixel_format, component_format;
    float filter_radius, filter_a, filter_b; // gaussian: stddev; mitchell: B, C
    float near_clip, far_clip;
    int32_t medium;
    int32_t lens;             // theta offset: aperture radius, focus distance; -1 = none
    int32_t shape, aim;       // irradiancemeter: its shape; distant: SENSOR_AIM_, and the target shape
    float target[3];          // distant: target point
    int32_t batch, batch_count; // batch: its first sensor in `batch_sensors`, their number
} SensorRecord;

// Numbers of a sensor that derivatives know.
enum {
    CAMERA_POSE,
    CAMERA_FOV,
    CAMERA_PRINCIPAL_X,
    CAMERA_PRINCIPAL_Y,
    CAMERA_APERTURE,
    CAMERA_FOCUS,
    CAMERA_NUMBERS
};

// What a distant sensor sees.
enum { SENSOR_AIM_SCENE, SENSOR_AIM_POINT, SENSOR_AIM_SHAPE };

// Quantities of the first surface that a picture may hold beside colour.
enum {
#define AOV(ENUM, name, components) AOV_##ENUM,
#include "scene/aovs.inl"
#undef AOV
    AOV_COUNT
};
enum { MOST_AOVS = 32, MOST_AOV_CHANNELS = 48 };

static inline int32_t aov_components(int32_t kind) {
    static const uint8_t counts[] = {
#define AOV(ENUM, name, components) sizeof(components) - 1,
#include "scene/aovs.inl"
#undef AOV
    };
    return counts[kind];
}

typedef int32_t AovKinds[MOST_AOVS];

// What one integrator decides. Those inside of `aov` and `moment` render one after the other.
typedef struct Integrator {
    const char *name;
#define SETTING(type, name, comment) type name;
#include "scene/settings.inl"
#undef SETTING
} Integrator;

// Where the numbers of a picture's channel beyond the first three come from: linear sRGB, CIE XYZ, alpha, or the quantities
// of the first surface.
enum { CHANNEL_RGB, CHANNEL_XYZ, CHANNEL_ALPHA, CHANNEL_AOV };
enum { MOST_CHANNELS = 240 };

typedef struct Channel {
    char *name;
    int32_t source, component; // component: of quantities counted through all of the integrator's
    int32_t integrator;        // that it shows, among the scene's
    int32_t power;             // of the samples, whose mean it is: 1, and 2 for second moments
} Channel;

// What changed of a shape.
enum { SHAPE_DIRTY_POSE = 1, SHAPE_DIRTY_VERTICES = 2 };

// Lanes of one batch share a group: scattering function, emitter, shape kind and flags are uniform in kernels.
typedef struct Group {
    int32_t bsdf, emitter, shape_kind, shape_flags;
    int32_t interior, exterior;
} Group;

enum { MOST_OWN_SPHERES = 32, MOST_OPEN_TRIANGLES = 36, MOST_OPEN_CORNERS = 3 * MOST_OPEN_TRIANGLES, MOST_BEACONS = 8 };

// A triangle of a surface that lets light pass: the number of its first corner; from each corner to the next, twice the number of
// the edge that leads there, and one more where that leads back; twice its area times its normal in the world.
typedef struct OpenTriangle {
    int32_t shape, prim, corner, way[3];
    float normal[3];
} OpenTriangle;

// What a kernel sees: the arrays, and uniform facts.
typedef struct SceneView {
#define ARRAY(type, name, comment) type *name;
#include "scene/arrays.inl"
#undef ARRAY
#define ARRAY(type, name, comment) int64_t name##_count;
#include "scene/arrays.inl"
#undef ARRAY
    int32_t environment;      // emitter index of the constant or envmap light, -1 = none
#define SETTING(type, name, comment) type name; // of the integrator at work
#include "scene/settings.inl"
#undef SETTING
    float bounds_centre[3], bounds_half[3], bounds_radius;
    void *embree;             // RTCScene
    // Spheres that stand in the scene by themselves and that kernels meet instead of Embree: all of them, or none.
    int32_t own_spheres[MOST_OWN_SPHERES], own_spheres_count;
    // Where shadow rays pass surfaces (through) and few of these stand in the scene: Embree knows them not (accel/triangles.h).
    bool open_apart;
    OpenTriangle open_triangles[MOST_OPEN_TRIANGLES];
    float open_corners[MOST_OPEN_CORNERS][3]; // in the world
    int32_t open_edges[MOST_OPEN_CORNERS][2];
    int32_t open_triangles_count, open_corners_count, open_edges_count;
    float open_low[3], open_high[3]; // what they lie in
    int32_t beacons_count;    // of the next: points of surfaces that part media, or within them
    float beacons[MOST_BEACONS][3];
    bool borders_touch;       // faces at which media end lie in other faces (shape/touches.h)
    int32_t collections;      // number of shapegroups
    bool uniform_emitters;    // every emitter is chosen with the same probability
    int32_t emitter_cdf;      // tables offset of cumulative emitter weights
} SceneView;

// Whether a medium is the same everywhere, as far as its own volumes go.
static inline bool medium_is_even(const SceneView *scene, int32_t id) {
    const MediumNode *medium = scene->media + id;
    const int32_t volumes[] = {medium->sigma_t, medium->albedo, medium->sigma_s, medium->sigma_a};
    bool even = medium->flakes < 0;
    for (int i = 0; i < COUNT_OF(volumes); i++) {
        even = even && (volumes[i] < 0 || scene->volumes[volumes[i]].kind == VOLUME_CONSTANT);
    }
    return even;
}

// A named parameter: a range of theta.
typedef struct Param {
    char *name;
    int32_t theta, count;
    int32_t dims, shape[3];
    float low, high;
    int32_t terms;
    const char *unit, *description, *why;
    int32_t texture;          // texture that these are the values of, -1 = none
    int32_t to_uv;            // texture that these are the to_uv of, -1 = none
    int32_t normals;          // shape that these are the vertex normals of, -1 = none
    int32_t attribute;        // entry of `attributes` that these are the values of, -1 = none
    int32_t geometry;         // shape whose geometry follows, -1 = none
    int32_t instance;         // instance whose pose this is, -1 = none
    int32_t camera;           // which of a sensor's numbers that is: CAMERA_, -1 = none
    int32_t emitter;          // emitter whose place this is, -1 = none
    int32_t place;            // which of its slots that is
    int32_t volume;           // volume whose pose this is, -1 = none
    bool moves_rims;          // it moves the ends of rough refraction (bsdf/rim.h) in light that no sampled direction meets
    uint32_t version;         // counts changes of the values
    uint32_t built;           // the version that derived data was built from
} Param;
#define PARAM_DEFAULTS                                                                                              \
    .texture = -1, .to_uv = -1, .normals = -1, .attribute = -1, .geometry = -1, .instance = -1, .camera = -1,       \
    .emitter = -1, .volume = -1, .low = -INFINITY, .high = INFINITY

typedef struct Alias {
    char *name;
    int32_t param;
} Alias;

struct rey_scene {
    rey_context *ctx;
    SceneView view;
    Array params, aliases;
    Names param_names, alias_names;
    Array integrators;        // of Integrator: the one whose picture R G B are and derivatives follow, then the others
    Array channels;           // of Channel: what a picture holds behind R G B
    Array notes;              // of char *: what a user should know about how the scene was read
    // Loading: each array grows by itself; rey_scene_freeze makes them fit, and the view points to them.
    struct {
#define ARRAY(type, name, comment) Array name;
#include "scene/arrays.inl"
#undef ARRAY
    } build;
    void *arena;
    size_t arena_bytes;
    struct Surface *embree_surfaces; // per shape: what the ray tracer's callbacks see (shape/pose.h)
    void *embree_device, **embree_groups; // RTCDevice; one RTCScene per shapegroup
    void (*accel_free)(rey_scene *scene); // set by accel, which owns view.embree and embree_device
    // Derived data to rebuild before the next kernel runs.
    uint8_t *dirty_instances, *dirty_shapes, *dirty_bsdfs, *dirty_emitters, *dirty_volumes, *dirty_media, *dirty_phases;
    bool dirty;
    float headroom;           // bounds of extinctions are so many times as large as they need be, for other ones that replay
    char *integrator;         // name of the first
    void *document;           // io's source document, owned; freed through document_free
    void (*document_free)(void *document);
};

// An empty scene; rey_scene_destroy frees it at any stage.
rey_result rey_scene_new(rey_context *ctx, rey_scene **out);
// Appends n zeroed entries to a build array; returns the index of the first, -1 on failure.
int32_t rey_scene_append(rey_scene *scene, Array *array, size_t item_bytes, int64_t n);
// The build arrays become what the view shows; theta never moves from here on. `arena` stands for empty arrays.
rey_result rey_scene_freeze(rey_scene *scene);
// The view takes over what an integrator of the scene decides.
void rey_scene_use(rey_scene *scene, int integrator);
// Forgets all integrators, and the channels that they brought.
void rey_scene_forget_integrators(rey_scene *scene);
// Records something that a user should know about how the scene was read; once, however often it is said.
rey_result rey_scene_add_note(rey_scene *scene, const char *format, ...) __attribute__((format(printf, 2, 3)));
// Terms of a list of names with commas between them; 0, and *wrong at its first word that names none.
int rey_terms_of(const char *text, const char **wrong);
// Whether nothing has to be known of silhouettes for a parameter, as one of materials, lights and media that stand still.
bool rey_param_stays(const rey_scene *scene, int param);
// Of each parameter the name that matches a pattern, its own or the first of its further ones; null where none does. To be freed;
// null: out of memory.
const char **rey_params_matching(const rey_scene *scene, const char *pattern);
// Registers a parameter; takes a copy of name. Returns its index, -1 on failure.
int rey_scene_add_param(rey_scene *scene, const char *name, Param param);
rey_result rey_scene_add_alias(rey_scene *scene, const char *name, int param);
// Numbers of each voxel of a parameter that is a grid over space, whose shape is Z x Y x (X channels); 0 of all others.
int rey_scene_grid_channels(const rey_scene *scene, int param);
// Forgets all parameters and aliases but the first so many.
void rey_scene_forget_params(rey_scene *scene, size_t params, size_t aliases);
// Writes a parameter's values after checking them, and counts its version up.
rey_result rey_scene_set(rey_scene *scene, int param, const float *values, int64_t count);
// Whether a medium's extinction is read from a texture: that of sigma_t itself, or one that it is the sum of.
bool rey_medium_reads(const SceneView *view, const MediumNode *medium, int32_t texture);
// Marks the derived data of every parameter whose version is not the one that it was built from.
void rey_scene_mark_changes(rey_scene *scene);
