// start.c: where unknowns start: what the job says, or what the scene has.
#include "fit/start.h"

#include "fit/rigid.h"
#include "io/grid.h"
#include "io/image.h"
#include "scene/names.h"
#include "shape/affine.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static rey_result fail(Job *job, const JobParameter *p, const char *name, const char *why) {
    return rey_job_fail_at(job, rey_job_place_of(p->node, "start", "parameterisation"), REY_ERROR_PARAM, "parameter '%s': %s", name,
                           why);
}

static rey_result read_start_file(Job *job, const Unknown *unknown, const char *path, rey_image *image, float *start) {
    const int32_t size[3] = {unknown->grid.nx, unknown->grid.ny, unknown->grid.nz};
    return size[0] ? rey_grid_read_as(job->ctx, path, size, unknown->grid.channels, start)
                   : rey_image_read(job->ctx, path, image);
}

static rey_result start_from_file(Job *job, const JobParameter *p, const Unknown *unknown, float *start) {
    const char *path = rey_job_path(job, p->start_file);
    rey_image image = {0};
    rey_result result = path ? read_start_file(job, unknown, path, &image, start) : REY_ERROR_MEMORY;
    if (result && result != REY_ERROR_MEMORY) {
        result = rey_job_fail_at(job, rey_job_place_of(p->node, "start", NULL), result, "parameter '%s': %s", unknown->name,
                                 rey_error(job->ctx));
    }
    if (!result && !unknown->grid.nx) {
        if (image.srgb) {
            rey_image_decode_srgb(&image);
        }
        int64_t count = (int64_t)image.width * image.height * image.channels;
        bool picture = unknown->dims >= 2; // a picture transposed would have as many numbers
        if (count != unknown->count ||
            (picture && (unknown->shape[0] != image.height || unknown->shape[1] != image.width))) {
            char why[1024];
            char shape[80] = "1";
            for (int i = 0, used = 0; i < unknown->dims; i++) {
                used += snprintf(shape + used, sizeof shape - (size_t)used, i ? " x %lld" : "%lld",
                                 (long long)unknown->shape[i]);
            }
            snprintf(why, sizeof why, "%s holds %d x %d x %d numbers, expected %s", p->start_file, image.height,
                     image.width, image.channels, shape);
            result = fail(job, p, unknown->name, why);
        } else {
            memcpy(start, image.data, (size_t)count * sizeof *start);
        }
        for (int64_t i = 0; i < count && !result; i++) {
            if (!isfinite(start[i])) {
                result = fail(job, p, unknown->name, "the start file holds a value that is not finite");
            }
        }
    }
    rey_image_free(job->ctx, &image);
    return result;
}

rey_result rey_start_set(Job *job, const rey_scene *scene, const JobParameter *p, const Unknown *unknown, float *start) {
    if (p && p->start_file) {
        return start_from_file(job, p, unknown, start);
    }
    if ((!p || p->start_count == 0) && unknown->param < 0) {
        start[0] = (float)job->views[unknown->view].exposure;
        return REY_OK;
    }
    if (!p || p->start_count == 0) {
        memcpy(start, rey_param_values(scene, unknown->param), (size_t)unknown->count * sizeof *start);
        return REY_OK;
    }
    int64_t last = unknown->grid.nx ? unknown->grid.channels : unknown->dims ? unknown->shape[unknown->dims - 1] : 1;
    if (p->start_count != 1 && p->start_count != unknown->count && p->start_count != last) {
        return rey_job_fail_at(job, rey_job_place_of(p->node, "start", "name"), REY_ERROR_PARAM,
                               "parameter '%s': start holds %d numbers, expected %s%lld", unknown->name, p->start_count,
                               unknown->count > 1 ? "1 or " : "", (long long)unknown->count);
    }
    for (int64_t i = 0; i < unknown->count; i++) { // shorter lists repeat: a colour for every texel
        start[i] = (float)p->start[i % p->start_count];
    }
    return REY_OK;
}

// key: what the start does not go with, before the other one of bounds and parameterisation, which decides, too.
static rey_result fail_start(Job *job, const JobParameter *p, const Unknown *unknown, int64_t i, float start, const char *key,
                             const char *expected) {
    const char *other = strcmp(key, "bounds") ? "bounds" : "parameterisation";
    JobPlace at = rey_job_blame(rey_job_place_of(p->node, "start", key), rey_job_place_of(p->node, other, NULL));
    return rey_job_fail_at(job, at, REY_ERROR_PARAM, "parameter '%s': entry %lld starts at %g, %s", unknown->name, (long long)i,
                           (double)start, expected);
}

// Of poses without an inverse and meshes without an area nothing is seen, and no step leads away from there.
static rey_result check_shape(Job *job, const JobParameter *p, const Unknown *unknown, const float *start) {
    double inverse[12];
    if (rey_name_is_pose(unknown->name) && unknown->count == RIGID_VALUES && !rey_affine_inverse(start, inverse)) {
        return fail(job, p, unknown->name, "its start cannot be inverted, expected a pose");
    }
    if (unknown->vertices) {
        const double *points = rey_vertices_points(unknown->vertices, start);
        return rey_point_mesh_area(&unknown->vertices->mesh, points) > 0
                   ? REY_OK
                   : fail(job, p, unknown->name, "its start is a mesh without area: all of its triangles are lines or points");
    }
    return REY_OK;
}

rey_result rey_start_check(Job *job, const JobParameter *p, const Unknown *unknown, const float *start, bool kept) {
    bool logarithm = !kept && p->parameterisation == PARAMETERISATION_LOG;
    bool logit = !kept && p->parameterisation == PARAMETERISATION_LOGIT;
    char expected[256];
    for (int64_t i = 0; i < unknown->count; i++) {
        float x = start[i], low = (float)unknown->low, high = (float)unknown->high;
        if (logarithm && !(x > 0)) {
            return fail_start(job, p, unknown, i, x, "parameterisation", "expected a number above 0: 'parameterisation: log' never "
                              "leaves or reaches 0; give a start, or 'parameterisation: softplus'");
        }
        if (x < low || x > high) {
            snprintf(expected, sizeof expected, "outside of its bounds %g to %g", unknown->low, unknown->high);
            return fail_start(job, p, unknown, i, x, "bounds", expected);
        }
        if (logit && !(x > low && x < high)) {
            snprintf(expected, sizeof expected, "expected a number between %g and %g: 'parameterisation: logit' never leaves or "
                                                "reaches its bounds; give a start, or wider bounds", unknown->low, unknown->high);
            return fail_start(job, p, unknown, i, x, "parameterisation", expected);
        }
    }
    return check_shape(job, p, unknown, start);
}
