// direction.c: directions in parameter space from texts such as bunny.positions:rotate=0,1,0@0,0.5,0.
//
// A direction is the tangent d theta_i / d theta of a curve through the current values:
//   positions  p(theta) = T(theta) p, normals n(theta) = R(theta) n, and transforms M(theta) = T(theta) M (world)
//   or M(theta) = M T(theta) (local). With T(theta) = I + theta L + O(theta^2) the tangents are L p, L n, L M and M L.
#include "cli.h"

#include "npy.h"

#include "base/context.h"
#include "scene/absent.h"
#include "scene/names.h"
#include "scene/scene.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { MAX_LIST = 64 };

typedef enum OpId { OP_ADD, OP_TRANSLATE, OP_LOCAL_TRANSLATE, OP_ROTATE, OP_SCALE, OP_FILE, OP_COUNT } OpId;
static const char *const op_names[OP_COUNT] = {"add", "translate", "local_translate", "rotate", "scale", "file"};

typedef struct Op {
    OpId id;
    double values[MAX_LIST];
    int value_count;
    double centre[3];
    const char *file;
} Op;

// What the numbers of a parameter are, as far as moving them is concerned.
typedef enum Geometry { GEOMETRY_NONE, GEOMETRY_POINTS, GEOMETRY_VECTORS, GEOMETRY_TRANSFORM } Geometry;

static bool ends_with(const char *name, const char *ending) {
    size_t n = strlen(name), m = strlen(ending);
    return n >= m && !strcmp(name + n - m, ending);
}

static bool is_strand(const rey_param_info *info) { return ends_with(info->name, "control_points"); }

static Geometry geometry_of(const rey_param_info *info) {
    if (is_strand(info)) { // four points of one are no transform
        return GEOMETRY_POINTS;
    }
    if (info->dims == 2 && info->shape[0] == 4 && info->shape[1] == 4) {
        return GEOMETRY_TRANSFORM;
    }
    if (info->dims < 1 || info->dims > 2 || info->shape[info->dims - 1] != 3) {
        return GEOMETRY_NONE;
    }
    if (ends_with(info->name, "positions") || ends_with(info->name, "position")) {
        return GEOMETRY_POINTS;
    }
    return ends_with(info->name, "normals") || ends_with(info->name, "direction") ? GEOMETRY_VECTORS : GEOMETRY_NONE;
}

// Up to the first colon that an operation's name and "=" follow, or the first colon.
size_t cli_direction_name_length(const char *spec) {
    for (const char *colon = strchr(spec, ':'); colon; colon = strchr(colon + 1, ':')) {
        for (int i = 0; i < OP_COUNT; i++) {
            size_t n = strlen(op_names[i]);
            if (!strncmp(colon + 1, op_names[i], n) && colon[1 + n] == '=') {
                return (size_t)(colon - spec);
            }
        }
    }
    return strcspn(spec, ":");
}

static const char *op_name_at(void *user, int i) {
    UNUSED(user);
    return i < OP_COUNT ? op_names[i] : NULL;
}

static rey_result unknown_op(rey_context *ctx, const char *spec, const char *op) {
    char word[64];
    snprintf(word, sizeof word, "%.*s", (int)strcspn(op, "="), op);
    const char *nearest = rey_nearest_word(word, op_name_at, NULL);
    if (nearest && !strcmp(nearest, word)) {
        return rey_fail(ctx, REY_ERROR_ARGUMENT, "%s: '%s' needs a value, such as %s=%s", spec, word, word,
                        !strcmp(word, "add") || !strcmp(word, "scale") ? "1"
                        : !strcmp(word, "file")                        ? "TANGENT.npy"
                                                                       : "1,0,0");
    }
    return rey_fail(ctx, REY_ERROR_ARGUMENT,
                    "%s: unknown operation '%s', %s%s (one of add, translate, local_translate, rotate, scale, file)",
                    spec, word, nearest ? "did you mean " : "expected OP=VALUE", nearest ? nearest : "");
}

// Reads "list" or "list@cx,cy,cz".
static bool parse_values(const char *text, Op *op) {
    const char *at = strchr(text, '@');
    char list[1024];
    size_t length = at ? (size_t)(at - text) : strlen(text);
    if (length >= sizeof list) {
        return false;
    }
    memcpy(list, text, length);
    list[length] = 0;
    op->value_count = cli_parse_list(list, MAX_LIST, op->values);
    return op->value_count > 0 && (!at || cli_parse_list(at + 1, 3, op->centre) == 3);
}

const char *cli_direction_file(const char *spec) {
    const char *op = spec + cli_direction_name_length(spec);
    return strncmp(op, ":file=", 6) == 0 ? op + 6 : NULL;
}

static rey_result parse_op(rey_context *ctx, const char *spec, const char *text, Op *op) {
    *op = (Op){.id = OP_COUNT};
    for (int i = 0; i < OP_COUNT; i++) {
        size_t n = strlen(op_names[i]);
        if (!strncmp(text, op_names[i], n) && text[n] == '=') {
            op->id = (OpId)i;
            text += n + 1;
            break;
        }
    }
    if (op->id == OP_COUNT || !*text) {
        return unknown_op(ctx, spec, spec + cli_direction_name_length(spec) + 1);
    }
    if (op->id == OP_FILE) {
        op->file = text;
        return REY_OK;
    }
    bool centred = op->id == OP_ROTATE || op->id == OP_SCALE;
    if (!parse_values(text, op) || (!centred && strchr(text, '@'))) {
        return rey_fail(ctx, REY_ERROR_ARGUMENT, "%s: '%s' is not a list of numbers%s", spec, text,
                        centred ? " with an optional @cx,cy,cz" : "");
    }
    bool vector = op->id != OP_ADD && op->id != OP_SCALE;
    if ((vector && op->value_count != 3) || (op->id == OP_SCALE && op->value_count != 1)) {
        return rey_fail(ctx, REY_ERROR_ARGUMENT, "%s: %s takes %s, got %d", spec, op_names[op->id],
                        vector ? "three numbers x,y,z" : "one number", op->value_count);
    }
    return REY_OK;
}

// The generator L of T(theta), a 4 x 4 matrix.
static bool generator(const Op *op, double L[4][4]) {
    memset(L, 0, 16 * sizeof(double));
    const double *v = op->values, *c = op->centre;
    if (op->id == OP_TRANSLATE || op->id == OP_LOCAL_TRANSLATE) {
        for (int i = 0; i < 3; i++) {
            L[i][3] = v[i];
        }
        return true;
    }
    if (op->id == OP_SCALE) { // c + (1 + theta S)(p - c)
        for (int i = 0; i < 3; i++) {
            L[i][i] = v[0];
            L[i][3] = -v[0] * c[i];
        }
        return true;
    }
    double length = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    if (length == 0) {
        return false;
    }
    double k =
        3.14159265358979323846 / 180 / length; // d/dtheta of Rodrigues' formula at 0 is the cross product by the axis
    double a[3] = {k * v[0], k * v[1], k * v[2]};
    double cross[3][3] = {{0, -a[2], a[1]}, {a[2], 0, -a[0]}, {-a[1], a[0], 0}};
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            L[i][j] = cross[i][j];
            L[i][3] -= cross[i][j] * c[j];
        }
    }
    return true;
}

static void add_transform_tangent(const double L[4][4], const float *M, bool local, float *tangent) {
    for (int i = 0; i < 4; i++) {
        for (int j = 0; j < 4; j++) {
            double sum = 0;
            for (int k = 0; k < 4; k++) {
                sum += local ? (double)M[4 * i + k] * L[k][j] : L[i][k] * (double)M[4 * k + j];
            }
            tangent[4 * i + j] += (float)sum;
        }
    }
}

static rey_result add_motion(rey_context *ctx, const char *spec, const Op *op, const rey_param_info *info,
                             const float *values, float *tangent) {
    Geometry geometry = geometry_of(info);
    bool local = op->id == OP_LOCAL_TRANSLATE;
    if (geometry == GEOMETRY_NONE) {
        return rey_fail(ctx, REY_ERROR_ARGUMENT,
                        "%s: %s moves positions (N x 3), control_points (N x 4) or transforms (4 x 4), and %s is none of these; "
                        "file=TANGENT.npy gives any direction", spec, op_names[op->id], info->name);
    }
    if (local && geometry != GEOMETRY_TRANSFORM) {
        return rey_fail(ctx, REY_ERROR_ARGUMENT, "%s: local_translate needs a transform (to_world)", spec);
    }
    double L[4][4];
    if (!generator(op, L)) {
        return rey_fail(ctx, REY_ERROR_ARGUMENT, "%s: the axis of a rotation cannot be zero", spec);
    }
    if (geometry == GEOMETRY_TRANSFORM) {
        add_transform_tangent((const double(*)[4])L, values, local, tangent);
        return REY_OK;
    }
    if (geometry == GEOMETRY_VECTORS && op->id != OP_ROTATE) {
        return rey_fail(ctx, REY_ERROR_ARGUMENT, "%s: %s does not turn directions; only rotate does", spec,
                        op_names[op->id]);
    }
    double w = geometry == GEOMETRY_POINTS ? 1 : 0;
    const int64_t numbers = is_strand(info) ? 4 : 3; // the fourth is a radius, which grows with the rest
    for (int64_t n = 0; n + numbers <= info->count; n += numbers) {
        for (int i = 0; i < 3; i++) {
            tangent[n + i] += (float)(L[i][0] * (double)values[n] + L[i][1] * (double)values[n + 1] +
                                      L[i][2] * (double)values[n + 2] + L[i][3] * w);
        }
        if (numbers == 4 && op->id == OP_SCALE) {
            tangent[n + 3] += (float)(op->values[0] * (double)values[n + 3]);
        }
    }
    return REY_OK;
}

static rey_result add_constant(rey_context *ctx, const char *spec, const Op *op, const rey_param_info *info, int channels,
                               float *tangent) {
    int64_t last = info->dims ? info->shape[info->dims - 1] : 1;
    last = channels > 1 && op->value_count != last ? channels : last; // a colour for every voxel
    if (op->value_count != 1 && op->value_count != last) {
        return rey_fail(ctx, REY_ERROR_ARGUMENT, "%s: add takes %s%lld number%s for %s, got %d", spec,
                        last > 1 ? "1 or " : "", (long long)last, PLURAL(last), info->name, op->value_count);
    }
    for (int64_t i = 0; i < info->count; i++) {
        tangent[i] += (float)op->values[op->value_count == 1 ? 0 : i % last];
    }
    return REY_OK;
}

static rey_result add_file(rey_context *ctx, const Op *op, const rey_param_info *info, int channels, float *tangent) {
    float *values = rey_alloc_array(ctx, (size_t)info->count, sizeof *values);
    if (!values) {
        return REY_ERROR_MEMORY;
    }
    rey_result result = cli_npy_read_tangent(ctx, op->file, info, channels, values);
    for (int64_t i = 0; i < info->count && !result; i++) {
        tangent[i] += values[i];
    }
    rey_free(ctx, values);
    return result;
}

// Index of the parameter that spec names. *name is a copy of the name, for the caller to free.
static rey_result find_param(rey_context *ctx, rey_scene *scene, const char *spec, int *param, char **name) {
    size_t length = cli_direction_name_length(spec);
    *name = rey_alloc(ctx, length + 1);
    if (!*name) {
        return REY_ERROR_MEMORY;
    }
    memcpy(*name, spec, length);
    *param = rey_param_find(scene, *name);
    if (*param >= 0) {
        return REY_OK;
    }
    if (ends_with(*name, ".to_world")) {
        char mesh[256];
        snprintf(mesh, sizeof mesh, "%.*s.positions", (int)(length - strlen(".to_world")), *name);
        if (rey_param_find(scene, mesh) >= 0) {
            return rey_fail(ctx, REY_ERROR_ARGUMENT, "unknown parameter '%s': meshes have none, their vertices move: %s:%s",
                            *name, mesh, spec[length] ? spec + length + 1 : "translate=1,0,0");
        }
    }
    char absent[ABSENT_BYTES];
    rey_param_absent(scene, *name, absent);
    return rey_fail(ctx, REY_ERROR_ARGUMENT, "unknown parameter '%s'%s", *name,
                    absent[0] ? absent : "; 'reynolds params' lists them");
}

// What a float cannot hold would be infinite, or be answered by 0.
static rey_result check_range(rey_context *ctx, const char *spec, const float *tangent, int64_t count) {
    for (int64_t i = 0; i < count; i++) {
        if (!isfinite(tangent[i])) {
            return rey_fail(ctx, REY_ERROR_ARGUMENT, "%s: number %lld of the direction is %g, expected numbers up to 3.4e38", spec,
                            (long long)i, (double)tangent[i]);
        }
    }
    return REY_OK;
}

static rey_result add_spec(rey_context *ctx, rey_scene *scene, const char *spec, int param, float *tangent) {
    rey_param_info info;
    rey_result result = rey_param_get_info(scene, param, &info);
    if (result) {
        return result;
    }
    Op op = {.id = OP_ADD, .values = {1}, .value_count = 1};
    const int channels = rey_scene_grid_channels(scene, param);
    size_t length = cli_direction_name_length(spec);
    if (spec[length]) {
        result = parse_op(ctx, spec, spec + length + 1, &op);
        if (result) {
            return result;
        }
    }
    switch (op.id) {
    case OP_ADD:
        result = add_constant(ctx, spec, &op, &info, channels, tangent);
        break;
    case OP_FILE:
        result = add_file(ctx, &op, &info, channels, tangent);
        break;
    default:
        result = add_motion(ctx, spec, &op, &info, rey_param_values(scene, param), tangent);
        break;
    }
    return result ? result : check_range(ctx, spec, tangent, info.count);
}

// Puts the parameter of one spec into the direction, unless it is there already; *slot is where it is.
static rey_result select_param(rey_context *ctx, rey_scene *scene, const char *spec, int *slot, Direction *d) {
    int param = -1;
    char *name;
    rey_result result = find_param(ctx, scene, spec, &param, &name);
    *slot = 0;
    while (*slot < d->count && d->params[*slot] != param) {
        ++*slot;
    }
    rey_param_info info;
    if (!result) {
        result = rey_param_get_info(scene, param, &info);
    }
    if (result || *slot < d->count) {
        rey_free(ctx, name);
        return result;
    }
    d->params[d->count] = param;
    d->names[d->count] = name;
    d->count++;
    d->offsets[d->count] = d->offsets[*slot] + info.count;
    return REY_OK;
}

rey_result cli_direction_build(rey_context *ctx, rey_scene *scene, const char *const *specs, int spec_count,
                               Direction *direction) {
    *direction = (Direction){0};
    int *slots = rey_alloc_array(ctx, (size_t)spec_count, sizeof *slots);
    direction->params = rey_alloc_array(ctx, (size_t)spec_count, sizeof *direction->params);
    direction->names = rey_alloc_array(ctx, (size_t)spec_count, sizeof *direction->names);
    direction->offsets = rey_alloc_array(ctx, (size_t)spec_count + 1, sizeof *direction->offsets);
    bool room = slots && direction->params && direction->names && direction->offsets;
    rey_result result = room ? REY_OK : REY_ERROR_MEMORY;
    for (int i = 0; i < spec_count && !result; i++) {
        result = select_param(ctx, scene, specs[i], &slots[i], direction);
    }
    if (!result) {
        size_t size = (size_t)direction->offsets[direction->count];
        direction->tangent = rey_alloc_array(ctx, size, sizeof *direction->tangent);
        result = direction->tangent ? REY_OK : REY_ERROR_MEMORY;
    }
    for (int i = 0; i < spec_count && !result; i++) {
        int slot = slots[i];
        result = add_spec(ctx, scene, specs[i], direction->params[slot], direction->tangent + direction->offsets[slot]);
    }
    rey_free(ctx, slots);
    if (result) {
        cli_direction_free(ctx, direction);
    }
    return result;
}

void cli_direction_free(rey_context *ctx, Direction *direction) {
    for (int i = 0; i < direction->count; i++) {
        rey_free(ctx, direction->names[i]);
    }
    rey_free(ctx, direction->names);
    rey_free(ctx, direction->params);
    rey_free(ctx, direction->offsets);
    rey_free(ctx, direction->tangent);
    *direction = (Direction){0};
}

rey_selection cli_direction_selection(const Direction *direction) {
    return (rey_selection){.params = direction->params, .count = direction->count};
}

bool cli_direction_fits(rey_scene *scene, int param, const char *spec) {
    rey_param_info info;
    rey_param_get_info(scene, param, &info);
    Geometry geometry = geometry_of(&info);
    const char *op = spec + cli_direction_name_length(spec);
    if (!*op || !info.terms) {
        return rey_param_stays(scene, param) && !rey_name_is_pose(info.name);
    }
    if (!strncmp(op, ":local_translate=", 17)) {
        return geometry == GEOMETRY_TRANSFORM;
    }
    if (!strncmp(op, ":translate=", 11) || !strncmp(op, ":scale=", 7)) {
        return geometry == GEOMETRY_TRANSFORM || geometry == GEOMETRY_POINTS;
    }
    return strncmp(op, ":rotate=", 8) || geometry != GEOMETRY_NONE;
}

bool cli_direction_bare_pose(const rey_scene *scene, const char *spec) {
    rey_param_info info;
    int param = spec[cli_direction_name_length(spec)] ? -1 : rey_param_find(scene, spec);
    return param >= 0 && rey_param_get_info(scene, param, &info) == REY_OK && geometry_of(&info) == GEOMETRY_TRANSFORM;
}

int cli_direction_terms(const rey_scene *scene, const Direction *direction) {
    int terms = 0;
    for (int i = 0; i < direction->count; i++) {
        rey_param_info info;
        if (rey_param_get_info(scene, direction->params[i], &info) == REY_OK) {
            terms |= info.terms;
        }
    }
    return terms;
}

rey_result cli_direction_check_terms(rey_context *ctx, const rey_scene *scene, const Direction *direction, int asked) {
    int terms = cli_direction_terms(scene, direction);
    if (!asked || !terms || (asked & terms)) {
        return REY_OK;
    }
    char wrong[128], right[128];
    cli_terms_text(asked, wrong, sizeof wrong);
    cli_terms_text(terms & TERMS_ESTIMATED, right, sizeof right);
    return rey_fail(ctx, REY_ERROR_ARGUMENT, "--terms %s: the gradient of %s%s has no such term, expected some of %s", wrong,
                    direction->names[0], direction->count > 1 ? " and the others" : "", right);
}
