/* reynolds.h: the whole public C API of Reynolds, physics-based differentiable rendering.
 *
 * Compiles alone as C99, C11 and C++17. Every function that can fail returns a rey_result; the message
 * (file, line, value, allowed range) stays in the context until its next call. Null where something must be given is
 * REY_ERROR_ARGUMENT, and 0, -1 or null from functions that return a value. The library never prints, aborts or exits. A
 * context may be used by one thread at a time; different contexts are independent.
 *
 * Images are float32, linear sRGB, row major from the top left: image[(y * width + x) * 3 + channel]. */
#ifndef REYNOLDS_H
#define REYNOLDS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define REY_VERSION_MAJOR 0
#define REY_VERSION_MINOR 1
#define REY_VERSION_PATCH 0
#define REY_VERSION "0.1.0"

#if defined(__GNUC__)
#define REY_API __attribute__((visibility("default")))
#else
#define REY_API
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* Result codes: name and text. */
#define REY_RESULTS(R)                                                                   \
    R(REY_OK, "success")                                                                 \
    R(REY_ERROR_ARGUMENT, "invalid argument")                                            \
    R(REY_ERROR_MEMORY, "out of memory")                                                 \
    R(REY_ERROR_IO, "cannot read or write a file")                                       \
    R(REY_ERROR_FORMAT, "malformed file")                                                \
    R(REY_ERROR_SCENE, "invalid scene description")                                      \
    R(REY_ERROR_UNSUPPORTED, "not supported")                                            \
    R(REY_ERROR_PARAM, "unknown or invalid parameter")                                   \
    R(REY_ERROR_INCOMPLETE, "the gradient would be incomplete")                          \
    R(REY_ERROR_CANCELLED, "cancelled")

typedef enum rey_result {
#define REY_RESULT_ENUM(name, text) name,
    REY_RESULTS(REY_RESULT_ENUM)
#undef REY_RESULT_ENUM
    REY_RESULT_COUNT
} rey_result;

typedef struct rey_context rey_context;
typedef struct rey_scene rey_scene;

/* ---- context ------------------------------------------------------------------------------------------- */

typedef struct rey_context_def {
    size_t size;     /* sizeof(rey_context_def), set by rey_default_context_def */
    int threads;     /* worker threads, 0 (default) = as many as the affinity mask and cgroup quota allow; more than
                        4 for each of those (16 at least) cost memory and help nobody, so that fewer run */
    int lanes;       /* SIMD width of the kernels: 1, 8, 16; 0 (default) = the widest this machine runs */
    void *(*alloc)(void *user, size_t bytes, size_t alignment); /* default: the C library's; several threads may call
                                                                   it at once, unless `threads` is 1 */
    void (*release)(void *user, void *memory);                  /* frees what alloc returned */
    void *user;                                                 /* passed to alloc and release */
} rey_context_def;

REY_API rey_context_def rey_default_context_def(void);

/* Creates a context. def may be null for the defaults. The caller owns *out and destroys it after its scenes. */
REY_API rey_result rey_context_create(const rey_context_def *def, rey_context **out);
/* What is wrong with a def, in words; "" when nothing is. */
REY_API const char *rey_context_problem(const rey_context_def *def);
REY_API void rey_context_destroy(rey_context *ctx);

/* The message of the latest call when it failed, "" when it did not. Never null; valid until the next call. */
REY_API const char *rey_error(const rey_context *ctx);
REY_API const char *rey_result_text(rey_result result);
REY_API const char *rey_version(void);
REY_API int rey_threads(const rey_context *ctx); /* worker threads in use */
REY_API int rey_lanes(const rey_context *ctx);   /* SIMD width in use */

/* ---- scene --------------------------------------------------------------------------------------------- */

typedef struct rey_define { /* one $name substitution, like -D name=value on the command line */
    const char *name;
    const char *value;
} rey_define;

/* Loads a Mitsuba 3 XML scene. The caller owns *out; it must be destroyed before the context. */
REY_API rey_result rey_scene_load(rey_context *ctx, const char *path, const rey_define *defines,
                                  int define_count, rey_scene **out);
/* The same for what can be loaded: objects and properties that cannot be read are left out instead of failing. */
REY_API rey_result rey_scene_load_lenient(rey_context *ctx, const char *path, const rey_define *defines,
                                          int define_count, rey_scene **out);
REY_API int rey_scene_ignored_count(const rey_scene *scene); /* how many things were left out */
/* What was left out and why, "FILE:LINE:COLUMN: text"; null when there is no such entry. Lives as long as the scene. */
REY_API const char *rey_scene_ignored(const rey_scene *scene, int i);
REY_API void rey_scene_destroy(rey_scene *scene);

/* Writes the scene back with its current parameter values: path is the XML file, data files (.exr, .ply, .obj) go
 * beside it into a folder named after the file without its extension, plus "_data". */
REY_API rey_result rey_scene_save(const rey_scene *scene, const char *path);

/* Gives the scene's parameters the values that they have in another scene file, matched by name; mostly one that
 * rey_scene_save wrote after this scene was changed, which then renders the same bits. It is read without defines.
 * Parameters that the file lacks keep their values. One that the scene lacks, or that has another shape in the file, is
 * REY_ERROR_PARAM; a file that does not load fails as rey_scene_load does. Both leave the scene as it was. No other
 * thread may use the scene's context meanwhile. */
REY_API rey_result rey_scene_load_values(rey_scene *scene, const char *path);

REY_API int rey_scene_sensor_count(const rey_scene *scene);
/* Size in pixels of the picture that a sensor delivers (the crop window's size). */
REY_API rey_result rey_scene_film_size(const rey_scene *scene, int sensor, int *width, int *height);

typedef struct rey_scene_info {
    int64_t shapes, triangles, vertices, bsdfs, emitters, textures, sensors, instances;
    int64_t parameters;      /* named parameters */
    int64_t parameter_floats; /* numbers in all of them together */
    int64_t bytes;           /* memory held by the scene, without the ray-tracing structure [bytes] */
    double bounds[6];        /* world bounding box: min x y z, max x y z */
    int sample_count;        /* samples per pixel that the first sensor's sampler asks for */
    int max_depth, rr_depth; /* of the integrator; max_depth -1 = unlimited */
    const char *integrator;  /* name of the integrator that runs */
} rey_scene_info;
REY_API void rey_scene_get_info(const rey_scene *scene, rey_scene_info *info);

/* What a user should know about how the scene was read: plugins that another one stands for, and the like. */
REY_API int rey_scene_note_count(const rey_scene *scene);
/* One note, "FILE:LINE: text", some behind "warning: " or "derivatives: "; null when there is none. Lives as long as the scene. */
REY_API const char *rey_scene_note(const rey_scene *scene, int note);

/* ---- parameters ---------------------------------------------------------------------------------------- */

/* Terms of a derivative. A gradient is the sum of the terms that its parameter needs. */
enum {
    REY_TERM_INTERIOR = 1,    /* everything that does not move a discontinuity */
    REY_TERM_PRIMARY = 2,     /* silhouettes, and shading normals that turn away, seen by the camera */
    REY_TERM_INDIRECT = 4,    /* the same seen from other path vertices */
    REY_TERM_SPECULAR = 8,    /* edges seen in smooth mirrors and through glass */
    REY_TERM_MEDIUM = 16,     /* participating media */
    REY_TERM_TERMINATOR = 32, /* jumps where the normal of a normal or bump map turns away from the viewer */
    REY_TERM_ALL = 63
};
/* Name of one term ("interior"), null when bit is not one of the above. */
REY_API const char *rey_term_name(int bit);

typedef struct rey_param_info {
    const char *name;        /* stable dotted path, such as red.reflectance.value */
    const char *unit;        /* "" when dimensionless */
    const char *description; /* one line */
    int64_t count;           /* numbers in the parameter */
    int dims;                /* number of entries of shape, 0 to 3 */
    int64_t shape[3];        /* for example height, width, 3 */
    float low, high;         /* allowed range, -INFINITY and INFINITY where open */
    int terms;               /* bits of the terms that its derivative may need; 0 = not differentiable. Where TERMINATOR
                                is not known (docs/cli.md) it is needed only if paths meet the jump, which the
                                derivative then reports */
    const char *why;         /* why the terms beyond interior are needed, or why it is not differentiable; "" else */
} rey_param_info;

REY_API int rey_param_count(const rey_scene *scene);
REY_API rey_result rey_param_get_info(const rey_scene *scene, int param, rey_param_info *info);
/* Index of a parameter by name or alias, -1 when there is none. rey_param_nearest suggests the closest name. */
REY_API int rey_param_find(const rey_scene *scene, const char *name);
REY_API const char *rey_param_nearest(const rey_scene *scene, const char *name);
/* The parameter's values: a view that stays valid and in place while the scene lives. */
REY_API const float *rey_param_values(const rey_scene *scene, int param);
/* Writes count values (must be the parameter's count). Checks finiteness and range before anything is changed. */
REY_API rey_result rey_param_set(rey_scene *scene, int param, const float *values, int64_t count);

/* ---- rendering ----------------------------------------------------------------------------------------- */

enum { REY_SAMPLER_DEFAULT, REY_SAMPLER_INDEPENDENT, REY_SAMPLER_SOBOL };
/* Derivatives with respect to the extinction of media. PROBE: also where nothing collides, by a path from a uniform point.
 * SCORE: the score function, the sum over the path of d log f, which lives on the path's own collisions: cheaper, refused
 * where an extinction is 0, and of large variance where it is nearly so. */
enum { REY_ESTIMATOR_PROBE, REY_ESTIMATOR_SCORE };

typedef struct rey_render_def {
    size_t size;       /* sizeof(rey_render_def), set by rey_default_render_def */
    int sensor;        /* default 0 */
    int spp;           /* samples per pixel, 0 (default) = the scene's own count */
    uint32_t seed;     /* default 0 */
    uint32_t set;      /* which independently scrambled sample set; same seed, other set = independent noise */
    int sampler;       /* REY_SAMPLER_*; default: Sobol. A scene's `independent` asks for any unbiased sampler, and
                          scrambled Sobol points are that with less noise */
    int terms;         /* derivative terms to estimate, 0 (default) = all that the parameters need, else a refusal */
    int estimator;     /* derivatives: REY_ESTIMATOR_*; default: PROBE */
    int sets;          /* derivatives: spp is split over this many independent sets (default 16, at least 1) */
    bool (*progress)(void *user, double fraction); /* may be null; false cancels. Called from one thread at a time */
    void *user;
} rey_render_def;
REY_API rey_render_def rey_default_render_def(void);

typedef struct rey_stats {
    double seconds;      /* wall time of the call [s] */
    double trace_seconds; /* thread time inside the ray tracer, summed over threads [s] */
    double thread_seconds; /* thread time of the workers, summed [s] */
    int64_t paths, rays; /* camera paths, and rays of any kind */
    int64_t nonfinite;   /* samples dropped because they were not finite; 0 in a healthy renderer */
    int missing_terms;   /* derivatives: terms that the parameters may need and the paths showed to be needed, but that
                            were left out: REY_TERM_TERMINATOR, _SPECULAR */
} rey_stats;

/* Renders. image: height x width x 3 floats owned by the caller. stats may be null. */
REY_API rey_result rey_render(rey_scene *scene, const rey_render_def *def, float *image, rey_stats *stats);

/* Renders several sensors of a scene: images[i] is the picture of sensors[i] (as of rey_render), and def->sensor does not
 * matter. Each picture has the bits that rey_render gives it. stats: the sum over all; may be null. */
REY_API rey_result rey_render_sensors(rey_scene *scene, const rey_render_def *def, const int *sensors, int count,
                                      float *const *images, rey_stats *stats);

/* Channels of a picture: R, G, B, and behind them what the scene's integrator ('aov', 'moment') adds, named as in the
 * files of the format ("img.R", "dd.T", "nn.X", "m2_img.Y"). */
REY_API int rey_channel_count(const rey_scene *scene); /* at least 3 */
REY_API const char *rey_channel_name(const rey_scene *scene, int channel); /* null when there is no such channel */
/* Renders all channels. image: height x width x rey_channel_count floats owned by the caller. stats may be null. */
REY_API rey_result rey_render_channels(rey_scene *scene, const rey_render_def *def, float *image, rey_stats *stats);

/* The picture that a sensor's film asks for (pixel_format): R G B, Y, or X Y Z, then A where it has alpha (1 where a
 * path met a surface that does not merely let light pass, or shows an environment; colours are multiplied by it), then
 * what the integrator adds, as behind the third channel of rey_render_channels. */
REY_API int rey_film_channel_count(const rey_scene *scene, int sensor); /* 0 when there is no such sensor */
REY_API const char *rey_film_channel_name(const rey_scene *scene, int sensor, int channel); /* null when there is none */
/* component_format, of files: 16 or 32 bits of floating point, or unsigned integers of 32. 32 where the scene is silent. */
enum { REY_COMPONENT_FLOAT16, REY_COMPONENT_FLOAT32, REY_COMPONENT_UINT32 };
REY_API int rey_film_component(const rey_scene *scene, int sensor); /* REY_COMPONENT_*, -1 when there is no such sensor */
/* Renders def->sensor. image: height x width x rey_film_channel_count floats owned by the caller. stats may be null. */
REY_API rey_result rey_render_film(rey_scene *scene, const rey_render_def *def, float *image, rey_stats *stats);

/* A selection of parameters: vectors over it are the parameters' values one after the other. */
typedef struct rey_selection {
    const int *params; /* parameter indices, none twice */
    int count;
} rey_selection;
REY_API int64_t rey_selection_size(const rey_scene *scene, rey_selection selection);

/* Vector-Jacobian product (reverse mode): gradient[i] = d/dtheta_i sum over pixels and channels of adjoint * image.
 * adjoint: height x width x 3 floats. gradient: rey_selection_size doubles, assigned.
 * set_gradients: null, or def->sets times the selection's size doubles: the gradient of each sample set, whose mean
 * is gradient. REY_ERROR_INCOMPLETE when def->terms is 0 and a parameter needs a term that does not exist, or when none of
 * the terms that def->terms asks for is one of the parameters'; what else it leaves out is left out without a word. */
REY_API rey_result rey_vjp(rey_scene *scene, const rey_render_def *def, rey_selection selection,
                           const float *adjoint, double *gradient, double *set_gradients, rey_stats *stats);

/* Jacobian-vector product (forward mode): derivative[pixel] = sum_i d image[pixel] / d theta_i * tangent[i].
 * tangent: rey_selection_size floats. derivative: height x width x 3 floats, assigned.
 * set_values: null, or def->sets doubles: mean over pixels and channels of each set's derivative image. */
REY_API rey_result rey_jvp(rey_scene *scene, const rey_render_def *def, rey_selection selection,
                           const float *tangent, float *derivative, double *set_values, rey_stats *stats);

#ifdef __cplusplus
}
#endif
#endif
