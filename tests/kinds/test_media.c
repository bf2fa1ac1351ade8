// Volumes and tracking: lookups that are known, adjoints against differences in double, bounds of supervoxels, transmittance
// and free flights against integrals along the ray, and widths.
#include "cases.h"
#include "media_kernels.h"
#include "medium/majorant_build.h"

enum { RAYS = 4000, LOOKUPS = 37 };

static const MediaKernels *const exact = &media_kernels_double;

static double at(const MediaCase *c, const double p[3], int channel) {
    MediaLookup q = {.p = {p[0], p[1], p[2]}};
    exact->eval(c, 1, &q);
    return q.value[channel];
}

static void update(MediaCase *c) {
    float theta[MEDIA_THETA], tables[MEDIA_TABLES] = {0};
    for (int i = 0; i < MEDIA_THETA; i++) {
        theta[i] = (float)c->theta[i];
    }
    SceneView view = {.theta = theta, .tables = tables, .textures = &c->flakes, .volumes = &c->grid};
    assert_true(rey_medium_table_size(&c->sigma_t, &c->medium) <= MEDIA_PLACE);
    rey_medium_update(&view, &c->sigma_t, &c->medium, 1);
    for (int i = 0; i < MEDIA_PLACE; i++) {
        c->tables[i] = (double)tables[i];
    }
}

// The first number is the scale; the voxels follow.
static MediaCase case_of(int nx, int ny, int nz, int channels) {
    MediaCase c = {.theta_count = 1 + nx * ny * nz * channels, .theta = {1}};
    bool constant = nx * ny * nz == 1;
    c.sigma_t = (VolumeNode){.kind = constant ? VOLUME_CONSTANT : VOLUME_GRID, .theta = 1, .channels = channels, .nx = nx,
                             .ny = ny, .nz = nz, .filter = FILTER_BILINEAR, .wrap = WRAP_CLAMP, .table = -1};
    c.medium = (MediumNode){.bounded = true, .sigma_s = -1, .sigma_a = -1, .flakes = -1};
    assert_true(c.theta_count <= MEDIA_THETA);
    return c;
}

// Clouds: half of the voxels are empty, some are dense.
static MediaCase cloud(Random *r, int channels) {
    static const int sizes[][3] = {{7, 5, 6}, {1, 1, 1}, {3, 9, 4}, {2, 2, 2}, {1, 8, 1}};
    const int *n = sizes[below(r, COUNT_OF(sizes))];
    MediaCase c = case_of(n[0], n[1], n[2], channels);
    for (int i = 1; i < c.theta_count; i++) {
        double u = uniform(r);
        c.theta[i] = u < 0.5 ? 0 : u < 0.9 ? 2 * uniform(r) : 20 * uniform(r);
    }
    c.theta[0] = between(r, 0.5, 1.5);
    c.sigma_t.filter = uniform(r) < 0.3 ? FILTER_NEAREST : FILTER_BILINEAR;
    c.sigma_t.wrap = below(r, 3);
    update(&c);
    return c;
}

// Turns a case's grid within the space of its rays: its middle stays, and one of its axes is `thin` times as long.
static void turn(MediaCase *c, Random *r, double thin) {
    const double a = between(r, 0.2, 1.3), b = between(r, -1, 1), size = between(r, 0.6, 1);
    const double about_z[9] = {cos(a), -sin(a), 0, sin(a), cos(a), 0, 0, 0, 1};
    const double about_x[9] = {1, 0, 0, 0, cos(b), -sin(b), 0, sin(b), cos(b)};
    const double scale[3] = {size * thin, size, 0.8 * size};
    double *m = c->theta + MEDIA_POSE, *inverse = c->tables + MEDIA_PLACE;
    c->sigma_t.to_world = MEDIA_POSE;
    c->sigma_t.table = MEDIA_PLACE;
    for (int i = 0; i < 3; i++) {
        double moved[2] = {0, 0};
        for (int j = 0; j < 3; j++) {
            double turned = 0;
            for (int k = 0; k < 3; k++) {
                turned += about_z[3 * i + k] * about_x[3 * k + j];
            }
            m[4 * i + j] = turned * scale[j];
            inverse[4 * j + i] = turned / scale[j];
            moved[0] += 0.5 * m[4 * i + j];
        }
        m[4 * i + 3] = 0.5 - moved[0];
    }
    for (int j = 0; j < 3; j++) {
        inverse[4 * j + 3] = 0.5;
        for (int i = 0; i < 3; i++) {
            inverse[4 * j + 3] -= 0.5 * inverse[4 * j + i];
        }
    }
}

// A point of the world in the space of a case's grid.
static void to_local(const MediaCase *c, const double p[3], double q[3]) {
    for (int k = 0; k < 3; k++) {
        const double *row = c->tables + MEDIA_PLACE + 4 * k;
        q[k] = c->sigma_t.table < 0 ? p[k] : row[0] * p[0] + row[1] * p[1] + row[2] * p[2] + row[3];
    }
}

// Whether a point of the world lies in the box along its axes around the corners of the grid's cube.
static bool in_box(const MediaCase *c, const double p[3]) {
    bool inside = true;
    for (int k = 0; k < 3; k++) {
        double low = INFINITY, high = -INFINITY;
        for (int i = 0; i < 8; i++) {
            const double *row = c->theta + MEDIA_POSE + 4 * k, q[3] = {i & 1, i >> 1 & 1, i >> 2};
            double x = c->sigma_t.table < 0 ? q[k] : row[0] * q[0] + row[1] * q[1] + row[2] * q[2] + row[3];
            low = fmin(low, x);
            high = fmax(high, x);
        }
        inside = inside && p[k] >= low && p[k] <= high;
    }
    return inside;
}

// Makes a case's medium one of flakes, whose matrices are alike everywhere or lie on a grid.
static void add_flakes(MediaCase *c, Random *r) {
    const bool grid = uniform(r) < 0.7;
    const int n[3] = {grid ? 2 : 1, grid ? 3 : 1, grid ? 2 : 1}, count = n[0] * n[1] * n[2];
    c->flakes = (TextureNode){.kind = grid ? TEXTURE_VOLUME : TEXTURE_TABLE, .theta = c->theta_count, .width = 6};
    c->grid = (VolumeNode){.kind = VOLUME_GRID, .theta = c->theta_count, .channels = 6, .nx = n[0], .ny = n[1], .nz = n[2],
                           .filter = FILTER_BILINEAR, .wrap = WRAP_CLAMP, .table = -1};
    c->medium.flakes = 0;
    assert_true(c->theta_count + 6 * count <= MEDIA_THETA);
    for (int i = 0; i < count; i++, c->theta_count += 6) {
        static const int row[6] = {0, 1, 2, 0, 0, 1}, column[6] = {0, 1, 2, 1, 2, 2};
        double b[3][3]; // S = b b'
        for (int k = 0; k < 9; k++) {
            b[k / 3][k % 3] = between(r, -1, 1) + (k % 4 == 0 ? 0.5 : 0);
        }
        for (int k = 0; k < 6; k++) {
            const double *x = b[row[k]], *y = b[column[k]];
            c->theta[c->theta_count + k] = x[0] * y[0] + x[1] * y[1] + x[2] * y[2];
        }
    }
}

static MediaCase flaky_cloud(Random *r, int channels) {
    MediaCase c = cloud(r, channels);
    add_flakes(&c, r);
    update(&c);
    return c;
}

static double area(const MediaCase *c, const double p[3], const double w[3]) {
    double ignored[MEDIA_THETA];
    MediaFlakes q = {.p = {p[0], p[1], p[2]}, .w = {w[0], w[1], w[2]}};
    exact->flakes(c, 1, &q, ignored, NULL);
    return q.area;
}

static void any_direction(Random *r, double w[3]) {
    double length = 0;
    for (int k = 0; k < 3; k++) {
        w[k] = between(r, -1, 1);
        length += w[k] * w[k];
    }
    for (int k = 0; k < 3; k++) {
        w[k] /= sqrt(length);
    }
}

// Numbers of the conformance folder's facts.
static void test_lookups(void **state) {
    (void)state;
    MediaCase c = case_of(3, 3, 3, 1);
    for (int i = 1; i < c.theta_count; i++) {
        c.theta[i] = 1;
    }
    c.theta[1] = 0;
    c.theta[1 + 13] = 0.5;
    assert_true(fabs(at(&c, (double[]){0, 0, 0}, 0)) < 1e-12);
    assert_true(fabs(at(&c, (double[]){1 / 3.0, 1 / 3.0, 1 / 3.0}, 0) - 0.8125) < 1e-12);
    c.sigma_t.filter = FILTER_NEAREST;
    assert_true(fabs(at(&c, (double[]){1 / 6.0, 1 / 6.0, 1 / 6.0}, 0)) < 1e-12);
    c = case_of(5, 8, 3, 1);
    for (int i = 0; i < 120; i++) {
        int y = i / 5 % 8, z = i / 40;
        c.theta[1 + i] = z == 0 ? 0.32 : y == 7 ? 0.55 : i == 46 ? 0.5 : i == 0 ? 0 : 1;
    }
    assert_true(fabs(at(&c, (double[]){0.2, 1, 0.7}, 0) - 0.55) < 1e-12);
    assert_true(fabs(at(&c, (double[]){0.5, 0.5, 0}, 0) - 0.32) < 1e-12);
}

static void test_adjoint(void **state) {
    (void)state;
    Random r = {21};
    for (int k = 0; k < 40; k++) {
        MediaCase c = cloud(&r, k % 2 ? 3 : 1);
        MediaLookup q = {.p = {between(&r, -0.2, 1.2), between(&r, -0.2, 1.2), between(&r, -0.2, 1.2)}};
        double gradient[MEDIA_THETA] = {0}, tangent[MEDIA_THETA], along = 0;
        for (int i = 0; i < 3; i++) {
            q.df[i] = between(&r, -1, 1);
        }
        exact->adj(&c, 1, &q, gradient, NULL);
        for (int i = 1; i < c.theta_count; i++) {
            double f[2] = {0, 0}, x = c.theta[i];
            for (int side = 0; side < 2; side++) {
                c.theta[i] = x + (side ? -0.5 : 0.5);
                for (int channel = 0; channel < 3; channel++) {
                    f[side] += q.df[channel] * at(&c, q.p, channel);
                }
            }
            c.theta[i] = x;
            assert_true(fabs(f[0] - f[1] - gradient[i]) < 1e-9);
            tangent[i] = between(&r, -1, 1);
            along += tangent[i] * gradient[i];
        }
        for (int axis = 0; axis < 3 && c.sigma_t.filter == FILTER_BILINEAR; axis++) {
            double f[2] = {0, 0};
            for (int side = 0; side < 2; side++) {
                double p[3] = {q.p[0], q.p[1], q.p[2]};
                p[axis] += side ? -1e-6 : 1e-6;
                for (int channel = 0; channel < 3; channel++) {
                    f[side] += q.df[channel] * at(&c, p, channel);
                }
            }
            assert_true(fabs((f[0] - f[1]) / 2e-6 - q.dp[axis]) < 1e-5 * (1 + fabs(q.dp[axis])));
        }
        tangent[0] = 0;
        exact->adj(&c, 1, &q, NULL, tangent);
        assert_true(fabs(q.forward - along) < 1e-9 * (1 + fabs(along)));
    }
}

static void test_bounds(void **state) {
    (void)state;
    Random r = {22};
    double tightest = INFINITY;
    for (int k = 0; k < 4000; k++) {
        MediaCase c = cloud(&r, 3);
        double p[3] = {uniform(&r), uniform(&r), uniform(&r)};
        const MediumNode *m = &c.medium;
        int cell = ((int)(p[2] * m->nz) * m->ny + (int)(p[1] * m->ny)) * m->nx + (int)(p[0] * m->nx);
        double bound = c.tables[m->table + cell];
        for (int channel = 0; channel < 3; channel++) {
            double sigma = c.theta[0] * at(&c, p, channel);
            assert_true(sigma <= bound);
            tightest = sigma > 0 ? fmin(tightest, bound / sigma) : tightest;
        }
    }
    assert_true(tightest < 1.01); // no looser than it must be, where a voxel is met
    for (int k = 0; k < 4000; k++) {
        MediaCase c = flaky_cloud(&r, 1);
        double p[3] = {uniform(&r), uniform(&r), uniform(&r)}, w[3];
        const MediumNode *m = &c.medium;
        int cell = ((int)(p[2] * m->nz) * m->ny + (int)(p[1] * m->ny)) * m->nx + (int)(p[0] * m->nx);
        any_direction(&r, w);
        assert_true(c.theta[0] * at(&c, p, 0) * area(&c, p, w) <= c.tables[m->table + cell]);
    }
}

// The area of known flakes, and its adjoints against differences.
static void test_flakes(void **state) {
    (void)state;
    Random r = {25};
    MediaCase flat = case_of(1, 1, 1, 1);
    add_flakes(&flat, &r);
    flat.flakes.kind = TEXTURE_TABLE;
    const double known[6] = {0.04, 0.25, 1, 0, 0, 0.1};
    memcpy(flat.theta + flat.flakes.theta, known, sizeof known);
    assert_true(fabs(area(&flat, (double[]){0, 0, 0}, (double[]){1, 0, 0}) - 0.2) < 1e-12);
    assert_true(fabs(area(&flat, (double[]){0, 0, 0}, (double[]){0, 0.6, 0.8}) - sqrt(0.09 + 0.64 + 0.096)) < 1e-12);
    for (int k = 0; k < 60; k++) {
        MediaCase c = flaky_cloud(&r, 1);
        MediaFlakes q = {.p = {between(&r, -0.2, 1.2), between(&r, -0.2, 1.2), between(&r, -0.2, 1.2)}, .d = between(&r, -1, 1)};
        double gradient[MEDIA_THETA] = {0}, tangent[MEDIA_THETA], along = 0;
        const double h = 1e-6;
        any_direction(&r, q.w);
        exact->flakes(&c, 1, &q, gradient, NULL);
        for (int i = 0; i < c.theta_count; i++) {
            double f[2], x = c.theta[i];
            for (int side = 0; side < 2; side++) {
                c.theta[i] = x + (side ? -h : h);
                f[side] = q.d * area(&c, q.p, q.w);
            }
            c.theta[i] = x;
            assert_true(fabs((f[0] - f[1]) / (2 * h) - gradient[i]) < 1e-6);
            tangent[i] = between(&r, -1, 1);
            along += tangent[i] * gradient[i];
        }
        for (int axis = 0; axis < 6; axis++) {
            double f[2], *x = axis < 3 ? q.p + axis : q.w + axis - 3, from = *x;
            for (int side = 0; side < 2; side++) {
                *x = from + (side ? -h : h);
                f[side] = q.d * area(&c, q.p, q.w);
            }
            *x = from;
            double expected = (f[0] - f[1]) / (2 * h), found = axis < 3 ? q.dp[axis] : q.dw[axis - 3];
            assert_true(fabs(expected - found) < 1e-5 * (1 + fabs(expected)));
        }
        exact->flakes(&c, 1, &q, NULL, tangent);
        assert_true(fabs(q.forward - along) < 1e-9 * (1 + fabs(along)));
    }
}

// Optical depth along a ray from its origin to t, by many small steps.
static double optical_depth(const MediaCase *c, const MediaRay *ray, double t, int channel) {
    enum { STEPS = 8000 };
    static MediaLookup q[STEPS];
    static double world[STEPS][3];
    double sum = 0;
    for (int i = 0; i < STEPS; i++) {
        for (int k = 0; k < 3; k++) {
            world[i][k] = ray->o[k] + (i + 0.5) / STEPS * t * ray->d[k];
        }
        to_local(c, world[i], q[i].p);
    }
    exact->eval(c, STEPS, q);
    for (int i = 0; i < STEPS; i++) {
        double shown = c->medium.flakes < 0 ? 1 : area(c, world[i], ray->d);
        sum += in_box(c, world[i]) || !c->medium.bounded ? q[i].value[channel] * shown : 0;
    }
    return c->theta[0] * sum * t / STEPS;
}

static MediaRay random_ray(Random *r) {
    MediaRay ray = {.tmax = between(r, 0.5, 3)};
    double length = 0;
    for (int k = 0; k < 3; k++) {
        ray.o[k] = between(r, -0.5, 1.5);
        ray.d[k] = between(r, 0, 1) - ray.o[k];
        length += ray.d[k] * ray.d[k];
    }
    bool along_axis = uniform(r) < 0.2; // parallel to walls between cells
    for (int k = 0; k < 3; k++) {
        ray.d[k] = along_axis ? k == 1 : ray.d[k] / sqrt(length);
    }
    return ray;
}

// Mean and its standard error.
typedef struct Mean {
    double n, sum, squares;
} Mean;

static void mean_add(Mean *m, double x) {
    m->n++;
    m->sum += x;
    m->squares += x * x;
}

static void mean_is(const Mean *m, double expected, const char *what) {
    double mean = m->sum / m->n, error = sqrt(fmax(0, m->squares / m->n - mean * mean) / m->n);
    if (!(fabs(mean - expected) <= 4.8 * error + 2e-3 * fabs(expected) + 5e-4)) {
        fail_msg("%s: %.6f +- %.6f, expected %.6f", what, mean, error, expected);
    }
}

// Bounds hold all along rays through boxes in which the cube is turned, and its voxels go on or repeat.
static void test_bounds_on_the_way(void **state) {
    (void)state;
    Random r = {26};
    int tight = 0;
    for (int k = 0; k < 1500; k++) {
        MediaCase c = k % 2 ? cloud(&r, 1) : flaky_cloud(&r, 3);
        MediaRay ray = random_ray(&r);
        turn(&c, &r, k % 3 ? 1 : 0.01);
        media_kernels_w1.track(&c, 1, &ray);
        if (ray.sigma > ray.bound) {
            fail_msg("case %d: an extinction of %g where it is at most %g", k, ray.sigma, ray.bound);
        }
        tight += ray.sigma > 0.99 * ray.bound;
    }
    assert_true(tight > 100);
}

static void test_tracking(void **state) {
    (void)state;
    static MediaRay rays[RAYS];
    Random r = {23};
    for (int k = 0; k < 120; k++) {
        MediaCase c = k % 60 < 30 ? cloud(&r, k % 2 ? 3 : 1) : flaky_cloud(&r, k % 2 ? 3 : 1);
        c.medium.bounded = c.sigma_t.kind == VOLUME_GRID || uniform(&r) < 0.5;
        if (k >= 60) {
            turn(&c, &r, k % 3 ? 1 : 0.02); // the latter repeats so often that its walks take one bound for all
        }
        MediaRay ray = random_ray(&r);
        double half = 0.6 * ray.tmax;
        for (int i = 0; i < RAYS; i++) {
            rays[i] = ray;
            rays[i].sample = (uint32_t)i;
        }
        media_kernels_w1.track(&c, RAYS, rays);
        for (int channel = 0; channel < 3; channel++) {
            Mean passed = {0, 0, 0}, escaped = {0, 0, 0}, before = {0, 0, 0};
            double all = exp(-optical_depth(&c, &ray, ray.tmax, channel));
            for (int i = 0; i < RAYS; i++) {
                mean_add(&passed, rays[i].transmittance[channel]);
                mean_add(&escaped, rays[i].collided ? 0 : rays[i].weight[channel]);
                mean_add(&before, rays[i].collided && rays[i].t < half ? rays[i].weight[channel] : 0);
            }
            mean_is(&passed, all, "transmittance");
            mean_is(&escaped, all, "share of flights that pass");
            mean_is(&before, 1 - exp(-optical_depth(&c, &ray, half, channel)), "share of flights that end early");
        }
    }
}

static void test_widths(void **state) {
    (void)state;
    Random r = {24};
    static MediaRay rays[3][LOOKUPS];
    for (int k = 0; k < 40; k++) {
        MediaCase c = k < 20 ? cloud(&r, 3) : flaky_cloud(&r, 3);
        for (int i = 0; i < LOOKUPS; i++) {
            rays[0][i] = random_ray(&r);
            rays[0][i].sample = (uint32_t)i;
        }
        memcpy(rays[1], rays[0], sizeof rays[0]);
        memcpy(rays[2], rays[0], sizeof rays[0]);
        media_kernels_w1.track(&c, LOOKUPS, rays[0]);
        int other = 0;
        if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) {
            media_kernels_w8.track(&c, LOOKUPS, rays[1]);
        } else {
            memcpy(rays[1], rays[0], sizeof rays[0]);
        }
        if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl")) {
            media_kernels_w16.track(&c, LOOKUPS, rays[2]);
        } else {
            memcpy(rays[2], rays[0], sizeof rays[0]);
        }
        for (int w = 1; w < 3; w++) {
            for (int i = 0; i < LOOKUPS; i++) {
                bool same = rays[w][i].collided == rays[0][i].collided && fabs(rays[w][i].t - rays[0][i].t) < 1e-3;
                for (int channel = 0; channel < 3; channel++) {
                    same = same && fabs(rays[w][i].transmittance[channel] - rays[0][i].transmittance[channel]) < 1e-3;
                }
                other += !same;
            }
        }
        assert_true(other <= 2); // a choice may fall the other way where rounding decides
    }
}

// The name of a test as an argument runs that one only.
int main(int argc, char **argv) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_lookups),  cmocka_unit_test(test_adjoint),
                                       cmocka_unit_test(test_bounds),   cmocka_unit_test(test_bounds_on_the_way),
                                       cmocka_unit_test(test_flakes),   cmocka_unit_test(test_tracking),
                                       cmocka_unit_test(test_widths)};
    if (argc > 1) {
        cmocka_set_test_filter(argv[1]);
    }
    return cmocka_run_group_tests(tests, NULL, NULL);
}
