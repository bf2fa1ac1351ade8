// Small fits of what moves that the literature began with, from plainly wrong starts: a triangle and a blocker of which only the
// shadow is seen [li2018], the place of a light, the pose of an object and its vertices [loubet2019], and how far a branching
// tree is turned, by its shadow [zhang2020]. A fit is given the picture and the start alone.
#include "fit_folder.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>
#include <math.h>

#define HEAD(size, fov, view)                                                                                          \
    "<scene version=\"3.0.0\"><default name=\"mesh\" value=\"start.obj\"/><integrator type=\"path\"><integer name=\"max_depth\" "  \
    "value=\"2\"/></integrator><sensor type=\"perspective\"><float name=\"fov\" value=\"" fov "\"/><transform "        \
    "name=\"to_world\"><lookat " view "/></transform><film type=\"hdrfilm\"><integer name=\"width\" value=\"" size     \
    "\"/><integer name=\"height\" value=\"" size "\"/><rfilter type=\"box\"/></film></sensor>"
#define MESH(id)                                                                                                       \
    "<shape type=\"obj\"" id "><string name=\"filename\" value=\"$mesh\"/><boolean name=\"face_normals\" value=\"true\"/>"         \
    "<bsdf type=\"twosided\"><bsdf type=\"diffuse\"/></bsdf></shape>"
#define PLACED(pose)                                                                                                   \
    "<shape type=\"shapegroup\" id=\"things\">" MESH("") "</shape><shape type=\"instance\" id=\"thing\"><ref id=\"things\"/>"      \
    "<transform name=\"to_world\">" pose "</transform></shape>"
#define PLANE(pose)                                                                                                    \
    "<shape type=\"rectangle\"><transform name=\"to_world\">" pose "</transform><bsdf type=\"diffuse\"/></shape>"
#define LAMP(pose, radiance)                                                                                           \
    "<shape type=\"rectangle\"><transform name=\"to_world\">" pose "</transform><emitter type=\"area\"><rgb name=\"radiance\" "    \
    "value=\"" radiance "\"/></emitter></shape>"
#define BULB(place, intensity)                                                                                         \
    "<emitter type=\"point\" id=\"bulb\"><point name=\"position\" " place "/><rgb name=\"intensity\" value=\"" intensity           \
    "\"/></emitter>"
#define SKY "<emitter type=\"constant\"><rgb name=\"radiance\" value=\"0.3\"/></emitter>"
#define BLOCK_VIEW                                                                                                                 \
    HEAD("48", "40", "origin=\"0.5, -5, 4\" target=\"0, 0, 0\" up=\"0, 0, 1\"")                                                    \
    "<default name=\"lx\" value=\"1\"/><default name=\"ly\" value=\"-1\"/><default name=\"lz\" value=\"4\"/><default name=\"px\" " \
    "value=\"0\"/><default name=\"py\" value=\"0\"/><default name=\"pz\" value=\"0\"/>" PLANE(                                     \
        "<scale value=\"3\"/><translate z=\"-1.2\"/>")

enum { MOST_SIZE = 64 };

// A fit: the scene; the true and the first values of its defaults, of which $mesh is the mesh; what is fitted.
typedef struct Classic {
    const char *scene, *truth, *start, *parameter;
    int size, iterations, spp;
    double learning_rate;
} Classic;

static int set_up(void **state) {
    *state = fixture_make();
    return *state ? 0 : 1;
}

// "a=b c=d" as definitions, whose text is in `copy`.
static int definitions_of(const char *text, rey_define *defines, char *copy) {
    int count = 0;
    strcpy(copy, text);
    for (char *word = strtok(copy, " "); word; word = strtok(NULL, " ")) {
        char *value = strchr(word, '=');
        *value = 0;
        defines[count++] = (rey_define){word, value + 1};
    }
    return count;
}

static void write_target(Fixture *f, const Classic *c) {
    static float image[MOST_SIZE * MOST_SIZE * 3];
    char path[128], copy[256];
    rey_define defines[8];
    rey_scene *scene;
    rey_render_def def = rey_default_render_def();
    def.spp = 1024;
    def.seed = 99;
    path_of(f, "scene.xml", path);
    assert_int_equal(rey_scene_load(f->ctx, path, defines, definitions_of(c->truth, defines, copy), &scene), REY_OK);
    assert_int_equal(rey_render(scene, &def, image, NULL), REY_OK);
    path_of(f, "target.exr", path);
    assert_int_equal(rey_exr_write(f->ctx, path, image, c->size, c->size, 3, NULL), REY_OK);
    rey_scene_destroy(scene);
}

// The one unknown of a fit: what was found.
static FitResult run(Fixture *f, const Classic *c) {
    char job[1024], path[128], folder[128], copy[256];
    rey_define defines[8];
    assert_int_equal(write_text(f, "scene.xml", c->scene), REY_OK);
    write_target(f, c);
    int count = definitions_of(c->start, defines, copy);
    int at = snprintf(job, sizeof job, "scene: scene.xml\ndefines: {");
    for (int i = 0; i < count; i++) {
        at += snprintf(job + at, sizeof job - (size_t)at, "%s%s: %s", i ? ", " : "", defines[i].name, defines[i].value);
    }
    snprintf(job + at, sizeof job - (size_t)at,
             "}\nviews: [{target: target.exr}]\niterations: %d\nspp: %d\nloss: l2\nreport_spp: 0\noptimizer: {type: adam, "
             "learning_rate: %g, beta1: 0.9, beta2: 0.98, average: 5, schedule: {type: cosine, end: 0.05}}\nparameters: [{%s}]\n",
             c->iterations, c->spp, c->learning_rate, c->parameter);
    assert_int_equal(write_text(f, "job.yaml", job), REY_OK);
    path_of(f, "job.yaml", path);
    path_of(f, "out", folder);
    FitDef def = {.job_path = path, .output = folder};
    FitResult result;
    if (rey_fit(f->ctx, &def, &result)) {
        fail_msg("%s", rey_error(f->ctx));
    }
    assert_int_equal(result.rows.count, 1);
    return result;
}

static void write_mesh(Fixture *f, const char *name, const double (*p)[3], int points, const int (*t)[3], int triangles) {
    char path[128];
    path_of(f, name, path);
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    for (int i = 0; i < points; i++) {
        fprintf(file, "v %.9g %.9g %.9g\n", p[i][0], p[i][1], p[i][2]);
    }
    for (int i = 0; i < triangles; i++) {
        fprintf(file, "f %d %d %d\n", t[i][0] + 1, t[i][1] + 1, t[i][2] + 1);
    }
    assert_int_equal(fclose(file), 0);
}

// Largest distance of a found number from `truth`, over the largest distance of the start from it.
static double left_over(const FitRow *row, const double *truth) {
    double found = 0, start = 0;
    for (int64_t i = 0; i < row->count; i++) {
        found = fmax(found, fabs((double)row->found[i] - truth[i]));
        start = fmax(start, fabs((double)row->start[i] - truth[i]));
    }
    print_message("%s: off by %.4f, %.2f %% of where it began\n", row->name, found, 100 * found / start);
    assert_true(start > 0);
    return found / start;
}

static void test_triangle(void **state) {
    static const double start[3][3] = {{-2, 1.5, 0.3}, {0.9, 1.2, -0.3}, {-0.4, -1.4, 0.2}};
    static const double truth[3][3] = {{-1.7, 1, 0}, {1, 1, 0}, {-0.5, -1, 0}};
    static const int triangle[1][3] = {{0, 1, 2}};
    write_mesh(*state, "start.obj", start, 3, triangle, 1);
    write_mesh(*state, "truth.obj", truth, 3, triangle, 1);
    const Classic c = {HEAD("48", "45", "origin=\"0, 0, -5\" target=\"0, 0, 0\" up=\"0, 1, 0\"") MESH(" id=\"thing\"")
                           BULB("x=\"0.5\" y=\"1\" z=\"-4\"", "30") "</scene>",
                       "mesh=truth.obj", "mesh=start.obj", "name: thing.positions", 48, 200, 8, 0.05};
    FitResult result = run(*state, &c);
    assert_true(left_over(&ARRAY_AT(result.rows, FitRow, 0), truth[0]) < 0.03);
    rey_fit_result_free(&result);
}

// A shadow tells no heights: what counts is where light from the lamp's middle takes the corners on the floor.
static void test_shadow_blocker(void **state) {
    static const double start[4][3] = {{-0.2, 3.5, -0.8}, {-0.8, 3, 0.3}, {0.4, 2.8, -0.8}, {0.3, 3.2, 1}};
    static const double truth[4][3] = {{-0.5, 3, -0.5}, {-0.5, 3, 0.5}, {0.5, 3, -0.5}, {0.5, 3, 0.5}};
    static const int triangles[2][3] = {{0, 1, 2}, {1, 3, 2}};
    const double lamp = 5;
    write_mesh(*state, "start.obj", start, 4, triangles, 2);
    write_mesh(*state, "truth.obj", truth, 4, triangles, 2);
    const Classic c = {HEAD("48", "45", "origin=\"0, 2, -5\" target=\"0, 0, 0\" up=\"0, 1, 0\"") MESH(" id=\"thing\"")
                           PLANE("<scale value=\"3\"/><rotate x=\"1\" angle=\"-90\"/>")
                           LAMP("<scale value=\"0.1\"/><rotate x=\"1\" angle=\"90\"/><translate y=\"5\"/>", "1000") "</scene>",
                       "mesh=truth.obj", "mesh=start.obj", "name: thing.positions", 48, 200, 8, 0.02};
    FitResult result = run(*state, &c);
    const float *found = ARRAY_AT(result.rows, FitRow, 0).found;
    for (int i = 0; i < 4; i++) {
        for (int k = 0; k < 3; k += 2) {
            double there = truth[i][k] * lamp / (lamp - truth[i][1]);
            double here = (double)found[3 * i + k] * lamp / (lamp - (double)found[3 * i + 1]);
            print_message("corner %d: %.3f for %.3f\n", i, here, there);
            assert_true(fabs(here - there) < 0.03);
        }
    }
    rey_fit_result_free(&result);
}

static const double block[8][3] = {{-0.5, -0.5, -0.5}, {0.5, -0.5, -0.5}, {-0.5, 0.5, -0.5}, {0.5, 0.5, -0.5},
                                   {-0.5, -0.5, 0.5},  {0.5, -0.5, 0.5},  {-0.5, 0.5, 0.5},  {0.5, 0.5, 0.5}};
static const int block_faces[12][3] = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                                       {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};

static void test_light(void **state) {
    static const double place[3] = {1, -1, 4};
    write_mesh(*state, "start.obj", block, 8, block_faces, 12);
    const Classic c = {BLOCK_VIEW MESH("") BULB("x=\"$lx\" y=\"$ly\" z=\"$lz\"", "40") "</scene>", "", "lx=3 ly=1 lz=6",
                       "name: bulb.position", 48, 100, 8, 0.1};
    FitResult result = run(*state, &c);
    assert_true(left_over(&ARRAY_AT(result.rows, FitRow, 0), place) < 0.05);
    rey_fit_result_free(&result);
}

static void test_pose(void **state) {
    // Turned by 20 degrees about z.
    static const double pose[16] = {0.9396926, -0.3420201, 0, 0, 0.3420201, 0.9396926, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
    write_mesh(*state, "start.obj", block, 8, block_faces, 12);
    const Classic c = {BLOCK_VIEW PLACED("<rotate z=\"1\" angle=\"20\"/><translate x=\"$px\" y=\"$py\" z=\"$pz\"/>") SKY
                           BULB("x=\"1\" y=\"-1\" z=\"4\"", "40") "</scene>",
                       "", "px=0.1 py=0.3 pz=0.1", "name: thing.to_world, parameterisation: rigid", 48, 100, 8, 0.03};
    FitResult result = run(*state, &c);
    assert_true(left_over(&ARRAY_AT(result.rows, FitRow, 0), pose) < 0.05);
    rey_fit_result_free(&result);
}

static void test_vertices(void **state) {
    double moved[8][3];
    for (int i = 0; i < 24; i++) {
        moved[i / 3][i % 3] = block[i / 3][i % 3] + 0.3;
    }
    write_mesh(*state, "start.obj", moved, 8, block_faces, 12);
    write_mesh(*state, "truth.obj", block, 8, block_faces, 12);
    const Classic c = {BLOCK_VIEW MESH(" id=\"thing\"") SKY BULB("x=\"1\" y=\"-1\" z=\"4\"", "40") "</scene>", "mesh=truth.obj",
                       "mesh=start.obj", "name: thing.positions, parameterisation: laplacian", 48, 150, 16, 0.05};
    FitResult result = run(*state, &c);
    const FitRow *row = &ARRAY_AT(result.rows, FitRow, 0);
    double truth[24];
    assert_int_equal(row->count, 24);
    for (int i = 0; i < 24; i++) { // vertices are numbered as they are read
        truth[i] = (double)row->start[i] - 0.3;
    }
    assert_true(left_over(row, truth) < 0.05);
    rey_fit_result_free(&result);
}

// ---- a branching tree --------------------------------------------------------------------------------------------

enum { LEVELS = 6, FORK = 3, SIDES = 7, MOST_BRANCHES = 364 };

typedef struct Tree {
    double points[2 * SIDES * MOST_BRANCHES][3];
    int faces[2 * SIDES * MOST_BRANCHES][3];
    int point_count, face_count;
    uint32_t random;
} Tree;

static double random_of(Tree *t) {
    t->random = t->random * 1664525u + 1013904223u;
    return (t->random >> 8) / 16777216.0;
}

static void unit(double v[3]) {
    double length = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    for (int k = 0; k < 3; k++) {
        v[k] /= length;
    }
}

static void cross(const double a[3], const double b[3], double c[3]) {
    for (int k = 0; k < 3; k++) {
        c[k] = a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3];
    }
}

// A prism from `from` along d, and FORK others from its end.
static void grow(Tree *t, const double from[3], const double d[3], double length, double radius, int level) {
    static const double aside[3] = {0.3, 0.2, 0.9};
    double x[3], y[3], end[3];
    cross(d, aside, x);
    unit(x);
    cross(d, x, y);
    int first = t->point_count;
    for (int i = 0; i < 2 * SIDES; i++) {
        double turn = 2 * 3.14159265358979 * (i % SIDES) / SIDES, r = i < SIDES ? radius : 0.7 * radius;
        for (int k = 0; k < 3; k++) {
            end[k] = from[k] + length * d[k];
            t->points[t->point_count][k] = (i < SIDES ? from[k] : end[k]) + r * (cos(turn) * x[k] + sin(turn) * y[k]);
        }
        t->point_count++;
    }
    for (int k = 0; k < SIDES; k++) {
        int a = first + k, b = first + (k + 1) % SIDES;
        memcpy(t->faces[t->face_count++], (int[3]){a, b, b + SIDES}, sizeof(int[3]));
        memcpy(t->faces[t->face_count++], (int[3]){a, b + SIDES, a + SIDES}, sizeof(int[3]));
    }
    for (int i = 0; i < FORK && level > 0; i++) {
        double next[3];
        for (int k = 0; k < 3; k++) {
            next[k] = d[k] + 0.9 * (2 * random_of(t) - 1);
        }
        unit(next);
        grow(t, end, next, 0.68 * length, 0.65 * radius, level - 1);
    }
}

// The camera sees its shadow alone.
static void test_tree(void **state) {
    static Tree tree;
    static const double root[3] = {0, 0, -0.3}, up[3] = {0, 0, 1};
    tree.random = 3;
    grow(&tree, root, up, 0.5, 0.06, LEVELS - 1);
    double start = 0.3;
    write_mesh(*state, "start.obj", (const double(*)[3])tree.points, tree.point_count, (const int(*)[3])tree.faces,
               tree.face_count);
    const Classic c = {HEAD("64", "40", "origin=\"0, -0.2, 5.5\" target=\"0, 0, 0\" up=\"0, 1, 0\"")
                           "<default name=\"turn\" value=\"0\"/>" PLANE("<scale value=\"1.8\"/>")
                           PLACED("<rotate z=\"1\" angle=\"$turn\"/><rotate x=\"1\" angle=\"70\"/><translate y=\"-6\" z=\"3.5\"/>")
                           LAMP("<scale value=\"0.15\"/><lookat origin=\"0, -12, 7\" target=\"0, 0, 0\" up=\"0, 0, 1\"/>", "2400")
                           "</scene>",
                       "turn=0", "turn=17.188734", "name: thing.to_world, parameterisation: rigid", 64, 120, 16, 0.03};
    FitResult result = run(*state, &c);
    const FitRow *row = &ARRAY_AT(result.rows, FitRow, 0);
    // The tree's own x axis, which is the world's when it is not turned.
    double began = atan2(hypot((double)row->start[4], (double)row->start[8]), (double)row->start[0]);
    double turned = atan2(hypot((double)row->found[4], (double)row->found[8]), (double)row->found[0]);
    print_message("a tree of %d triangles, turned by %.3f: %.4f is left\n", tree.face_count, began, turned);
    assert_true(tree.face_count >= 5000 && fabs(began - start) < 1e-4 && turned < 0.01);
    rey_fit_result_free(&result);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_triangle, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_shadow_blocker, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_light, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_pose, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_vertices, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_tree, set_up, tear_down),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
