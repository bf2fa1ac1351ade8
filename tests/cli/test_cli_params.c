// test_cli_params.c: which parameters there are: names, patterns, those that nothing uses, and reasons said once.
#include "command.h"
#include "io/image.h"

#include <math.h>

static int count_words(const char *text, const char *words) {
    int count = 0;
    while ((text = strstr(text, words)) != NULL) {
        text += strlen(words);
        count++;
    }
    return count;
}

static void write_file(const char *name, const char *text) {
    FILE *file = fopen(name, "w");
    assert_non_null(file);
    fputs(text, file);
    assert_int_equal(fclose(file), 0);
}

static const JsonNode *find_param(const JsonNode *node, const char *name) {
    for (const JsonNode *p = json_get(node, "parameters")->first; p; p = p->next) {
        if (!strcmp(json_text(p, "name", ""), name)) {
            return p;
        }
    }
    return NULL;
}

// What no shape has is said to be unused, in the table, in JSON and by grad.
static void unused_objects_are_told(void **state) {
    Fixture *f = *state;
    static const char *const scenes[] = {"params %s --json", "params %s -D ball=glass --json"};
    for (int glass = 0; glass < 2; glass++) {
        JsonNode *node = run_json(f, 0, scenes[glass]);
        for (const JsonNode *p = json_get(node, "parameters")->first; p; p = p->next) {
            const char *name = json_text(p, "name", "");
            bool off = !strncmp(name, glass ? "metal." : "glass.", 6) || !strncmp(name, "veil.", 5);
            if (json_value(p, "used", -1) != (off ? 0 : 1)) {
                fail_msg("%s: used is %g", name, json_value(p, "used", -1));
            }
        }
        json_free(node);
    }
    expect_said(f, 0, "params %s -D ball=glass --param metal.alpha.value", "unused: nothing in the scene refers to it");
    expect_said(f, 0, "grad %s -D ball=glass --param metal.alpha.value --spp 1", "nothing in the scene uses metal.alpha.value");
    expect(f, 0, "grad %s --param metal.alpha.value --spp 1");
    assert_string_equal(f->words, "");
}

// A reason stands once below the table, however many parameters it holds of.
static void reasons_are_said_once(void **state) {
    Fixture *f = *state;
    expect(f, 0, "params %s -D ball=veil --param \"*.to_world\" --param red.reflectance.value");
    int refused = count_words(f->out, "refused [1]");
    JsonNode *node = run_json(f, 0, "params %s -D ball=veil --param \"*.to_world\" --json");
    int expected = 0;
    for (const JsonNode *p = json_get(node, "parameters")->first; p; p = p->next) {
        expected += json_text(p, "refused", "")[0] != 0;
    }
    json_free(node);
    expect(f, 0, "params %s -D ball=veil --param \"*.to_world\"");
    assert_true(expected >= 2);
    assert_int_equal(refused, expected);
    assert_int_equal(count_words(f->out, "\n[1] "), 1);
    assert_int_equal(count_words(f->out, "'ball' is a smooth mirror or glass"), 1);
}

// Whether there are gradients is asked for many parameters at once, and the answers are those of each alone.
static void answers_are_those_of_one(void **state) {
    Fixture *f = *state;
    JsonNode *all = run_json(f, 0, "params %s -D ball=veil --json");
    int refused = 0, complete = 0;
    for (const JsonNode *p = json_get(all, "parameters")->first; p; p = p->next) {
        char arguments[512];
        const char *name = json_text(p, "name", "");
        snprintf(arguments, sizeof arguments, "params %%s -D ball=veil --param %s --json", name);
        JsonNode *alone = run_json(f, 0, arguments);
        assert_string_equal(json_text(p, "refused", ""), json_text(find_param(alone, name), "refused", ""));
        *(json_text(p, "refused", "")[0] ? &refused : &complete) += 1;
        json_free(alone);
    }
    assert_true(refused > 0 && complete > 0);
    json_free(all);
}

// A refusal names the object that causes it.
static void refusals_name_objects(void **state) {
    Fixture *f = *state;
    static const char head[] =
        "<scene version='3.0.0'><integrator type='path'/><sensor type='perspective' id='camera'><film type='hdrfilm'><integer "
        "name='width' value='4'/><integer name='height' value='4'/></film></sensor><emitter type='constant'/>"
        "<shape type='cube' id='box'/>";
    static const char *const scenes[][2] = {
        {"<emitter type='spot' id='torch'><float name='cutoff_angle' value='20'/><float name='beam_width' value='19.99'/>"
         "</emitter>",
         "does not know the border of the light of spots whose beam_width is all but their cutoff_angle ('torch')"},
        {"<shape type='rectangle' id='pane'><bsdf type='dielectric'/></shape><shape type='rectangle' id='leaf'>"
         "<bsdf type='normalmap'><rgb name='normalmap' value='0.6, 0.5, 0.9'/><bsdf type='conductor'/></bsdf></shape>",
         "'pane' is a smooth mirror or glass, has a smooth coat or lets a part of the light pass, and the edges that are seen in "
         "or through it are not found because of the normals of 'leaf.bsdf'"},
    };
    for (size_t i = 0; i < sizeof scenes / sizeof scenes[0]; i++) {
        FILE *file = fopen("objects.xml", "w");
        assert_non_null(file);
        fprintf(file, "%s%s</scene>", head, scenes[i][0]);
        assert_int_equal(fclose(file), 0);
        expect_said(f, 1, "grad objects.xml --param box.to_world:translate=1,0,0 --spp 1", scenes[i][1]);
    }
}

// What other renderers list for a shape, and this one does not: the message says why.
static void absent_parameters_are_explained(void **state) {
    Fixture *f = *state;
    static const char *const cases[][2] = {
        {"box.normals", "rectangles and cubes have flat faces without vertex normals"},
        {"box.vertex_normals", "meshes of obj, ply or serialized have some"},
        {"box.texcoords", "those of rectangles and cubes are what they are"},
        {"ball.vertex_positions", "it has no vertices; its to_world moves it"},
        {"ball.normals", "its normals are those of its surface"},
        {"ball.texcoords", "its texture coordinates are those of its surface"},
        {"flat.normals", "the faces of this mesh are flat and have no vertex normals"},
        {"flat.texcoords", "this mesh has no texture coordinates"},
        {"flat.faces", "which vertices a triangle joins is no number that could change a little"},
    };
    static const char scene[] =
        "<scene version='3.0.0'><integrator type='path'/><sensor type='perspective' id='camera'><film type='hdrfilm'><integer "
        "name='width' value='4'/><integer name='height' value='4'/></film></sensor><emitter type='constant'/>"
        "<shape type='cube' id='box'/><shape type='sphere' id='ball'/><shape type='obj' id='flat'><string name='filename' "
        "value='%s'/><boolean name='face_normals' value='true'/></shape></scene>";
    write_file("flat.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    write_file("uv.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n");
    char text[1024], arguments[256], expected[256];
    snprintf(text, sizeof text, scene, "flat.obj");
    write_file("shapes.xml", text);
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        snprintf(arguments, sizeof arguments, "grad shapes.xml --param %s", cases[i][0]);
        snprintf(expected, sizeof expected, "unknown parameter '%s': ", cases[i][0]);
        expect_said(f, 2, arguments, expected);
        expect_said(f, 2, arguments, cases[i][1]);
    }
    expect_said(f, 2, "render shapes.xml -o a.exr --load box.normals=a.npy", "no parameter 'box.normals': rectangles and cubes");
    write_file("shapes.yaml", "scene: shapes.xml\nviews: [{target: a.exr}]\nparameters: [flat.to_world]\n");
    expect(f, 0, "render shapes.xml -o a.exr --spp 1");
    expect_said(f, 1, "fit shapes.yaml", "shapes.yaml:3: parameter 'flat.to_world': the scene has none of this name: meshes have "
                                         "no pose of their own; their positions move");
    // texture coordinates that are listed are refused by params, grad and check in the same words
    snprintf(text, sizeof text, scene, "uv.obj");
    write_file("shapes.xml", text);
    static const char refusal[] = "flat.texcoords is not differentiable: what the texture coordinates of vertices change is not "
                                  "computed; the to_uv of a texture, which moves all of it, has a derivative";
    expect_said(f, 1, "grad shapes.xml --param flat.texcoords", refusal);
    expect_said(f, 1, "grad shapes.xml --param flat.vertex_texcoords --terms interior", refusal);
    expect_said(f, 1, "check shapes.xml --param flat.texcoords", refusal);
    JsonNode *node = run_json(f, 0, "params shapes.xml --json");
    const JsonNode *texcoords = find_param(node, "flat.texcoords");
    assert_string_equal(json_text(texcoords, "refused", ""), refusal);
    assert_null(json_get(texcoords, "terms")->first);
    json_free(node);
}

// Patterns stand for the parameters that move nothing, with an operation for those that it fits.
static void patterns_choose(void **state) {
    Fixture *f = *state;
    JsonNode *node = run_json(f, 0, "grad %s --param \"*.reflectance.value\" --spp 4 --json");
    assert_int_equal(count_words(f->out, "reflectance.value"), 3); // white, red, the lamp's
    double all = json_value(node, "value", 0);
    json_free(node);
    node = run_json(f, 0, "grad %s --spp 4 --json --param white.reflectance.value --param red.reflectance.value "
                          "--param lamp.bsdf.reflectance.value");
    assert_true(json_value(node, "value", 1) == all);
    json_free(node);
    node = run_json(f, 0, "grad %s --param \"ball.*:translate=1,0,0\" --spp 4 --json");
    assert_string_equal(json_get(node, "parameters")->first->text, "ball.to_world");
    assert_null(json_get(node, "parameters")->first->next);
    json_free(node);
    node = run_json(f, 0, "check %s --param \"red.*\" --param \"metal.alpha*\" --spp 16 --json");
    assert_string_equal(json_text(json_get(node, "directions")->first, "param", ""), "red.reflectance.value");
    assert_string_equal(json_text(json_get(node, "directions")->first->next, "param", ""), "metal.alpha.value");
    json_free(node);
    node = run_json(f, 0, "params %s --param \"ball.*\" --param red.reflectance --json");
    assert_non_null(find_param(node, "ball.to_world"));
    assert_non_null(find_param(node, "red.reflectance.value"));
    assert_null(find_param(node, "white.reflectance.value"));
    json_free(node);
    expect_said(f, 2, "grad %s --param \"grey.*\"", "no parameter matches 'grey.*'");
    expect_said(f, 2, "check %s --param \"grey.*\"", "no parameter matches 'grey.*'");
    expect_said(f, 2, "params %s --param \"grey.*\"", "no parameter matches 'grey.*'");
    expect_said(f, 2, "grad %s --param \"camera.to*\"", "'camera.to*' matches only camera.to_world, which move things");
    expect_said(f, 2, "grad %s --param \"red.*:translate=1,0,0\"", "which this operation does not fit");
    expect_said(f, 2, "params %s --param \"red.*:add=1\"", "expected a name or a pattern");
}

// What is suggested is what `params` lists, whatever alias the word is nearest to.
static void suggestions_are_listed(void **state) {
    Fixture *f = *state;
    expect_said(f, 2, "grad %s --param metal.alpa", "did you mean 'metal.alpha.value'?");
    expect_said(f, 2, "check %s --param metal.bsdf", "unknown parameter 'metal.bsdf'");
    expect_said(f, 2, "params %s --param metal.alpa", "did you mean 'metal.alpha.value'?");
}

// A term that a parameter's derivative does not have is no 0.
static void terms_that_do_not_exist_are_errors(void **state) {
    Fixture *f = *state;
    expect_said(f, 2, "grad %s --param red.reflectance.value --terms primary",
                 "--terms primary: the gradient of red.reflectance.value has no such term, expected some of interior");
    expect_said(f, 2, "check %s --param red.reflectance.value --terms indirect", "expected some of interior");
    expect_said(f, 2, "grad %s --param red.reflectance.value --terms terminator", "expected some of interior");
    expect(f, 0, "grad %s --param red.reflectance.value --terms interior,primary --spp 1");
    expect(f, 0, "grad %s --param ball.to_world:translate=1,0,0 --param red.reflectance.value --terms primary --spp 4");
    JsonNode *node = run_json(f, 0, "check %s --all --terms primary --spp 16 --json");
    const JsonNode *list = json_get(node, "directions");
    for (const JsonNode *row = list->first; row; row = row->next) {
        if (!strcmp(json_text(row, "param", ""), "red.reflectance.value")) {
            assert_string_equal(json_text(row, "verdict", ""), "refused");
        }
    }
    json_free(node);
}

// The command line is wrong, not the scene: 2, and "usage" in JSON.
static void wrong_names_are_usage_errors(void **state) {
    Fixture *f = *state;
    static const char *const wrong[] = {"grad %s --param rad.reflectance.value --json",
                                        "check %s --param rad.reflectance.value --json",
                                        "params %s --param rad.reflectance.value --json",
                                        "grad %s --param \"rad.*\" --json",
                                        "grad %s --param ball.to_world:translate=1,2 --json",
                                        "grad %s --param ball.to_world:translate=1,2,x --json",
                                        "grad %s --param ball.to_world:rotate=0,0,0 --json",
                                        "grad %s --param red.reflectance.value:translate=1,0,0 --json",
                                        "grad %s --param red.reflectance.value:add=1,2 --json",
                                        "grad %s --param red.reflectance.value --terms primary --json",
                                        "grad %s --param red.reflectance.value -D bal=glass --json",
                                        "info %s -D bal=glass --json",
                                        "render %s -o a.exr -D ball=glass -D ball=metal --json",
                                        "render %s -o a.exr --load re.reflectance.value=a.npy --json",
                                        "render %s -o a.exr --sensor 3 --json",
                                        "convert %s copy.obj --json",
                                        "convert %s - --json"};
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        JsonNode *node = run_json(f, 2, wrong[i]);
        assert_string_equal(json_text(node, "kind", ""), "usage");
        assert_non_null(strstr(f->words, "--help"));
        json_free(node);
    }
    JsonNode *node = run_json(f, 1, "grad %s --param red.reflectance.value:file=none.npy --json");
    assert_string_not_equal(json_text(node, "kind", ""), "usage");
    json_free(node);
}

static const char further_names[] =
    "<scene version='3.0.0'><integrator type='path'/><sensor type='perspective'><film type='hdrfilm'><integer name='width' "
    "value='4'/><integer name='height' value='4'/></film></sensor><emitter type='constant'/>"
    "<shape type='sphere' id='first'><bsdf type='diffuse' id='blue'/></shape><shape type='sphere' id='second'>"
    "<bsdf type='diffuse' id='red'><rgb name='reflectance' value='0.1 0.2 0.3'/></bsdf></shape></scene>";

// A pattern fits what --param takes as a name: of an object inside of another one by its id, of one that another refers to by that
// one's. Each parameter counts once.
static void patterns_know_further_names(void **state) {
    Fixture *f = *state;
    write_file("further.xml", further_names);
    expect_said(f, 0, "params further.xml --param 'red.*'", "second.bsdf.reflectance.value");
    assert_null(strstr(f->out, "first"));
    JsonNode *one = run_json(f, 0, "grad further.xml --param red.reflectance.value --spp 16 --json");
    JsonNode *all = run_json(f, 0, "grad further.xml --param 're*.reflectance.*' --spp 16 --json");
    assert_true(json_value(one, "value", NAN) == json_value(all, "value", NAN));
    assert_string_equal(json_get(all, "parameters")->first->text, "red.reflectance.value");
    json_free(one);
    json_free(all);
    JsonNode *both = run_json(f, 0, "grad further.xml --param 'red.*' --param 'second.bsdf.*' --spp 16 --json");
    assert_null(json_get(both, "parameters")->first->next);
    json_free(both);
    JsonNode *ball = run_json(f, 0, "grad %s --param 'ball.*' --spp 4 --json");
    assert_string_equal(json_get(ball, "parameters")->first->text, "ball.bsdf.eta.value");
    json_free(ball);
    expect_said(f, 2, "params further.xml --param 'green.*'", "no parameter matches 'green.*'");
}

// Letters of several bytes take one place: the last column begins at the same one in every row.
static void columns_count_characters(void **state) {
    Fixture *f = *state;
    write_file("letters.xml", "<scene version='3.0.0'><bsdf type='diffuse' id='gold \u00fc \u91d1'/><bsdf type='diffuse' "
                              "id='iron'/></scene>");
    expect(f, 0, "params letters.xml");
    const char *line = f->out;
    int places[3] = {0};
    for (int row = 0; row < 3; row++, line = strchr(line, '\n') + 1) {
        const char *last = strstr(line, row ? "refused" : "gradient");
        assert_non_null(last);
        for (const char *c = line; c < last; c++) {
            places[row] += (*c & 0xC0) != 0x80;
        }
        assert_int_equal(places[row], places[0]);
    }
}

#define COLOURS "fog.interior_medium.albedo.data"

static double slope_of(Fixture *f, const char *scene, const char *direction) {
    char arguments[512];
    snprintf(arguments, sizeof arguments, "grad %s --param " COLOURS ":%s --spp 16 --json", scene, direction);
    JsonNode *node = run_json(f, 0, arguments);
    double value = json_value(node, "value", NAN);
    json_free(node);
    return value;
}

// Files of a grid of colours hold Z x Y x (3 X) numbers or Z x Y x X x 3, as tangents and as values; other shapes are refused.
static void grids_have_two_shapes(void **state) {
    Fixture *f = *state;
    enum { COUNT = 2 * 1 * 4 * 3 };
    static const int64_t shapes[][4] = {{2, 1, 12}, {2, 1, 4, 3}, {COUNT}, {2, 1, 3, 4}, {2, 4, 1, 3}, {2, 1, 4, 3}};
    static const int dims[] = {3, 4, 1, 4, 4, 4};
    static const char *const names[] = {"long.npy", "apart.npy", "row.npy", "turned.npy", "other.npy", "colours.npy"};
    rey_context *ctx = NULL;
    float tangent[COUNT], colours[COUNT];
    for (int i = 0; i < COUNT; i++) {
        tangent[i] = (float)(i % 5) - 1.5f;
        colours[i] = 0.3f + 0.02f * (float)i;
    }
    assert_int_equal(rey_context_create(NULL, &ctx), REY_OK);
    for (int k = 0; k < 6; k++) {
        assert_int_equal(rey_npy_write(ctx, names[k], k < 5 ? tangent : colours, shapes[k], dims[k]), REY_OK);
    }
    rey_context_destroy(ctx);
    write_file("fog.xml",
               "<scene version='3.0.0'><integrator type='volpath'/><sensor type='perspective'><transform name='to_world'>"
               "<lookat origin='0,0,4' target='0,0,0' up='0,1,0'/></transform><film type='hdrfilm'>"
               "<integer name='width' value='8'/><integer name='height' value='8'/></film></sensor><emitter type='constant'/>"
               "<shape type='cube' id='fog'><bsdf type='null'/><medium name='interior' type='homogeneous'>"
               "<volume name='albedo' type='gridvolume'><string name='filename' value='colours.npy'/>"
               "<transform name='to_world'><scale value='2'/><translate value='-1'/></transform></volume>"
               "</medium></shape></scene>");
    double expected = slope_of(f, "fog.xml", "file=long.npy");
    assert_true(fabs(expected) > 1e-4);
    assert_true(slope_of(f, "fog.xml", "file=apart.npy") == expected);
    assert_true(slope_of(f, "fog.xml", "file=row.npy") == expected);
    double all = slope_of(f, "fog.xml", "add=1"), red = slope_of(f, "fog.xml", "add=1,0,0");
    double rest = slope_of(f, "fog.xml", "add=0,1,1");
    assert_true(red > 0 && fabs(red + rest - all) < 1e-4 * all);
    static const char *const words[] = {"has the shape 2x1x3x4, expected 2x1x12 or 2x1x4x3 as in the scene",
                                        "has the shape 2x4x1x3, expected 2x1x12 or 2x1x4x3 as in the scene"};
    expect_said(f, 1, "grad fog.xml --param " COLOURS ":file=turned.npy", words[0]);
    expect_said(f, 1, "grad fog.xml --param " COLOURS ":file=other.npy", words[1]);
    expect(f, 0, "params fog.xml --load " COLOURS "=colours.npy");
    expect_said(f, 1, "params fog.xml --load " COLOURS "=turned.npy", words[0]);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(unused_objects_are_told),
        cmocka_unit_test(reasons_are_said_once),
        cmocka_unit_test(answers_are_those_of_one),
        cmocka_unit_test(refusals_name_objects),
        cmocka_unit_test(absent_parameters_are_explained),
        cmocka_unit_test(patterns_choose),
        cmocka_unit_test(patterns_know_further_names),
        cmocka_unit_test(columns_count_characters),
        cmocka_unit_test(suggestions_are_listed),
        cmocka_unit_test(terms_that_do_not_exist_are_errors),
        cmocka_unit_test(wrong_names_are_usage_errors),
        cmocka_unit_test(grids_have_two_shapes),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
