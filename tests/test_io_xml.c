// test_io_xml.c: the XML reader: what good documents become, where bad ones are wrong, and that nothing leaks.
#define _GNU_SOURCE // mkdtemp
#include "base/context.h"
#include "io/xml.h"
#include "io/xml_parts.h"

#include <dirent.h>
#include <locale.h>
#include <math.h>
#include <setjmp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <cmocka.h>

#define DATA TEST_DATA_DIR "/xml/"

static rey_context *make_context(void) {
    rey_context *ctx = NULL;
    assert_int_equal(rey_context_create(NULL, &ctx), REY_OK);
    return ctx;
}

static int setup(void **state) {
    *state = make_context();
    return 0;
}

static int teardown(void **state) {
    rey_context_destroy(*state);
    return 0;
}

static rey_xml_document *read_text(rey_context *ctx, const char *text) {
    rey_xml_document *document = NULL;
    rey_result result = rey_xml_read_memory(ctx, DATA "text.xml", text, strlen(text), NULL, 0, &document);
    if (result) {
        fail_msg("%s", rey_error(ctx));
    }
    return document;
}

static rey_xml_document *read_file(rey_context *ctx, const char *name, const rey_define *defines, int count) {
    rey_xml_document *document = NULL;
    if (rey_xml_read(ctx, name, defines, count, &document)) {
        fail_msg("%s", rey_error(ctx));
    }
    return document;
}

// ---- good documents ----------------------------------------------------------------------------------------------

static const char *no_names(void *user, int i) {
    UNUSED(user);
    UNUSED(i);
    return NULL;
}

static void test_values(void **state) {
    rey_context *ctx = *state;
    rey_xml_document *document = read_text(
        ctx, "<scene version='3.0.0'>\n"
             " <bsdf type='diffuse' id='a'>\n"
             "  <boolean name='b' value='TRUE'/><integer name='i' value=' -12 '/><float name='f' value='1.5e-3'/>\n"
             "  <string name='s' value='ggx'/><vector name='v' x='1' z='3'/><point name='p' value='2'/>\n"
             "  <point name='q' value='1, 2,3'/><rgb name='c' value='.1 .2,.3'/><rgb name='g' value='0.5'/>\n"
             "  <spectrum name='flat' value='0.25'/><spectrum name='w' value='400:1, 500:2 600:3'/>\n"
             "  <transform name='t'><translate x='1'/></transform>\n"
             " </bsdf>\n"
             "</scene>");
    rey_xml_node *root = rey_xml_root(document);
    assert_int_equal(root->tag, REY_XML_SCENE);
    assert_int_equal(root->child_count, 1);
    rey_xml_node *node = rey_xml_child_of(root, REY_XML_BIT(REY_XML_BSDF), 0)->node;
    assert_string_equal(node->type, "diffuse");
    assert_ptr_equal(node, rey_xml_find_id(document, "a"));
    assert_int_equal(node->at.line, 2);
    assert_int_equal(node->at.column, 2);
    assert_int_equal(rey_xml_find(node, "f")->at.line, 3);
    assert_int_equal(rey_xml_find(node, "w")->order, 10);

    bool b;
    int64_t i;
    double f, v[3], m[16], m2[6];
    const char *s;
    int choice;
    const double zero[3] = {0};
    assert_int_equal(rey_xml_check_unused(ctx, node, no_names, NULL), REY_ERROR_SCENE);
    assert_int_equal(rey_xml_get_bool(ctx, node, "b", false, &b), REY_OK);
    assert_true(b);
    assert_int_equal(rey_xml_get_int(ctx, node, "i", -20, 20, 0, &i), REY_OK);
    assert_int_equal(i, -12);
    assert_int_equal(rey_xml_get_int(ctx, node, "i", 0, 20, 0, &i), REY_ERROR_SCENE);
    assert_int_equal(rey_xml_get_float(ctx, node, "i", 0, &f), REY_OK);
    assert_true(f == -12);
    assert_int_equal(rey_xml_get_float(ctx, node, "f", 0, &f), REY_OK);
    assert_true(f == 1.5e-3);
    assert_int_equal(rey_xml_get_int(ctx, node, "f", -1, 1, 0, &i), REY_ERROR_SCENE);
    assert_int_equal(rey_xml_get_float(ctx, node, "absent", 7, &f), REY_OK);
    assert_true(f == 7);
    assert_int_equal(rey_xml_get_string(ctx, node, "s", "", &s), REY_OK);
    assert_string_equal(s, "ggx");
    assert_int_equal(rey_xml_get_choice(ctx, node, "s", (const char *const[]){"beckmann", "ggx"}, 2, 0, &choice),
                     REY_OK);
    assert_int_equal(choice, 1);
    assert_int_equal(rey_xml_get_choice(ctx, node, "s", (const char *const[]){"a", "b"}, 2, 0, &choice),
                     REY_ERROR_SCENE);
    assert_non_null(strstr(rey_error(ctx), "'a', 'b'"));
    assert_int_equal(rey_xml_get_vec3(ctx, node, "v", zero, v), REY_OK);
    assert_true(v[0] == 1 && v[1] == 0 && v[2] == 3);
    assert_int_equal(rey_xml_get_vec3(ctx, node, "p", zero, v), REY_OK);
    assert_true(v[0] == 2 && v[1] == 2 && v[2] == 2);
    assert_int_equal(rey_xml_get_vec3(ctx, node, "q", zero, v), REY_OK);
    assert_true(v[0] == 1 && v[1] == 2 && v[2] == 3);
    assert_int_equal(rey_xml_get_colour(ctx, node, "c", REY_COLOUR_REFLECTANCE, zero, v), REY_OK);
    assert_true(v[0] == .1 && v[1] == .2 && v[2] == .3);
    assert_int_equal(rey_xml_get_colour(ctx, node, "g", REY_COLOUR_EMISSION, zero, v), REY_OK);
    assert_true(v[2] == .5);
    assert_int_equal(rey_xml_get_colour(ctx, node, "flat", REY_COLOUR_EMISSION, zero, v), REY_OK);
    assert_true(fabs(v[0] - 0.25 * 1.204794) < 1e-6);
    rey_xml_property *w = rey_xml_find(node, "w");
    assert_int_equal(w->spectrum.count, 3);
    assert_true(w->spectrum.wavelengths[1] == 500 && w->spectrum.values[2] == 3);
    assert_int_equal(rey_xml_get_colour(ctx, node, "w", REY_COLOUR_EMISSION, zero, v), REY_OK);
    assert_int_equal(rey_xml_get_transform(ctx, node, "t", m), REY_OK);
    assert_true(m[3] == 1 && m[0] == 1 && m[15] == 1);
    assert_int_equal(rey_xml_get_transform2(ctx, node, "t", m2), REY_OK);
    assert_true(m2[0] == 1 && m2[1] == 0 && m2[2] == 1 && m2[4] == 1);
    assert_int_equal(rey_xml_check_unused(ctx, node, no_names, NULL), REY_OK);
    assert_int_equal(rey_xml_require(ctx, node, "s"), REY_OK);
    assert_int_equal(rey_xml_require(ctx, node, "filename"), REY_ERROR_SCENE);
    rey_xml_free(ctx, document);
}

static void apply(const double m[16], double x, double y, double z, double out[3]) {
    for (int i = 0; i < 3; i++) {
        out[i] = m[i * 4] * x + m[i * 4 + 1] * y + m[i * 4 + 2] * z + m[i * 4 + 3];
    }
}

static void assert_point(const double p[3], double x, double y, double z) {
    if (fabs(p[0] - x) > 1e-12 || fabs(p[1] - y) > 1e-12 || fabs(p[2] - z) > 1e-12) {
        fail_msg("%.15g %.15g %.15g, expected %g %g %g", p[0], p[1], p[2], x, y, z);
    }
}

static void transform_of(rey_context *ctx, const char *operations, double out[16]) {
    char text[1024];
    snprintf(text, sizeof text, "<shape version='3.0.0' type='cube'><transform name='to_world'>%s</transform></shape>",
             operations);
    rey_xml_document *document = read_text(ctx, text);
    assert_int_equal(rey_xml_get_transform(ctx, rey_xml_root(document), "to_world", out), REY_OK);
    rey_xml_free(ctx, document);
}

static void test_transforms(void **state) {
    rey_context *ctx = *state;
    double m[16], p[3];
    transform_of(ctx, "<scale value='2'/><translate x='1' y='2' z='3'/>", m); // first scale, then translate
    apply(m, 1, 1, 1, p);
    assert_point(p, 3, 4, 5);
    transform_of(ctx, "<translate value='1 2 3'/><scale y='-1'/>", m);
    apply(m, 0, 0, 0, p);
    assert_point(p, 1, -2, 3);
    transform_of(ctx, "<rotate z='2' angle='90'/>", m);
    apply(m, 1, 0, 5, p);
    assert_point(p, 0, 1, 5);
    transform_of(ctx, "<rotate value='1,1,1' angle='120'/>", m); // x -> y -> z -> x
    apply(m, 1, 0, 0, p);
    assert_point(p, 0, 1, 0);
    // The camera looks along its +z, and its +x is on the left of the picture: looking along -z, that is world -x.
    transform_of(ctx, "<lookat origin='0,0,4' target='0,0,0' up='0,1,0'/>", m);
    apply(m, 0, 0, 1, p);
    assert_point(p, 0, 0, 3);
    apply(m, 1, 0, 0, p);
    assert_point(p, -1, 0, 4);
    apply(m, 0, 1, 0, p);
    assert_point(p, 0, 1, 4);
    transform_of(ctx, "<lookat origin='1,2,3' target='1,9,3'/>", m); // any perpendicular will do
    apply(m, 0, 0, 2, p);
    assert_point(p, 1, 4, 3);
    assert_true(fabs(m[0] * m[1] + m[4] * m[5] + m[8] * m[9]) < 1e-12);
    transform_of(ctx, "<matrix value='1 2 3 4 5 6 7 8 9 10 11 12 0 0 0 1'/>", m);
    assert_true(m[1] == 2 && m[3] == 4 && m[4] == 5 && m[11] == 12);
    transform_of(ctx, "<matrix value='1 2 3 4 5 6 7 8 9'/>", m);
    assert_true(m[1] == 2 && m[3] == 0 && m[4] == 4 && m[10] == 9 && m[15] == 1);
}

static void test_references(void **state) {
    rey_context *ctx = *state;
    rey_xml_document *document =
        read_text(ctx, "<scene version='3.0.0'>\n"
                       " <shape type='sphere'><ref id='later'/><ref id='fog' name='interior'/></shape>\n"
                       " <medium type='homogeneous' id='fog'/><bsdf type='diffuse' id='later'/>\n"
                       " <alias id='later' as='other'/><shape type='cube'><ref id='other'/></shape></scene>");
    rey_xml_node *root = rey_xml_root(document);
    rey_xml_node *later = rey_xml_find_id(document, "later");
    assert_ptr_equal(root->children[0].node->children[0].node, later);
    assert_string_equal(root->children[0].node->children[0].ref, "later");
    assert_ptr_equal(root->children[3].node->children[0].node, later);
    assert_ptr_equal(rey_xml_child_named(root->children[0].node, "interior")->node, rey_xml_find_id(document, "fog"));
    assert_null(rey_xml_child_named(root->children[0].node, "exterior"));
    assert_null(rey_xml_child_of(root, REY_XML_BIT(REY_XML_SHAPE), 2));
    assert_int_equal(rey_xml_count_children(root, REY_XML_BIT(REY_XML_SHAPE)), 2);
    assert_int_equal(later->built, -1);
    assert_int_equal(root->height, 2);
    assert_int_equal(rey_xml_node_count(document), 5);
    assert_ptr_equal(rey_xml_node_at(document, 2), rey_xml_find_id(document, "fog"));
    rey_xml_free(ctx, document);
}

static void test_substitution(void **state) {
    rey_context *ctx = *state;
    rey_xml_document *document = NULL;
    static const char text[] = "<scene version='3.0.0'><default name='n' value='1'/><default name='nn' value='2'/>"
                               "<default name='n' value='9'/><default name='both' value='$n-$nn'/>"
                               "<film type='x$n'><string name='s' value='$both \\$5 a\\b$given'/></film></scene>";
    const rey_define defines[] = {{"given", "$raw"}};
    assert_int_equal(rey_xml_read_memory(ctx, "t.xml", text, strlen(text), defines, 1, &document), REY_OK);
    rey_xml_node *film = rey_xml_root(document)->children[0].node;
    assert_string_equal(film->type, "x1");
    assert_string_equal(rey_xml_find(film, "s")->string, "1-2 $5 a\\b$raw");
    rey_xml_free(ctx, document);
    const rey_define unused[] = {{"given", "1"}, {"nnn", "1"}};
    assert_int_equal(rey_xml_read_memory(ctx, "t.xml", text, strlen(text), unused, 2, &document), REY_ERROR_SCENE);
    assert_string_equal(rey_error(ctx), "t.xml:1:1: the parameter 'nnn' was given but the scene never uses '$nnn', "
                                        "did you mean 'nn'?");
    assert_null(document);
}

static void test_files(void **state) {
    rey_context *ctx = *state;
    const rey_define defines[] = {{"size", "32"}};
    rey_xml_document *document = read_file(ctx, DATA "scene.xml", defines, 1);
    rey_xml_node *root = rey_xml_root(document);
    assert_int_equal(root->child_count, 5); // integrator, sensor, included bsdf, shape, fragment
    assert_string_equal(root->children[2].node->id, "white");
    assert_non_null(strstr(root->children[2].node->at.file, "parts/materials.xml"));
    assert_int_equal(root->children[2].node->at.line, 3);
    int64_t width;
    rey_xml_node *film = root->children[1].node->children[0].node;
    assert_int_equal(rey_xml_get_int(ctx, film, "width", 1, 100, 0, &width), REY_OK);
    assert_int_equal(width, 32);
    rey_xml_node *shape = root->children[3].node;
    char *path = NULL;
    assert_int_equal(rey_xml_resolve_file(ctx, document, shape, "filename", &path), REY_OK);
    assert_non_null(strstr(path, "parts/triangle.obj"));
    rey_free(ctx, path);
    assert_int_equal(rey_xml_resolve_file(ctx, document, shape, "other", &path), REY_ERROR_IO);
    assert_non_null(strstr(rey_error(ctx), "file 'nowhere.obj' was not found, looked in '"));
    assert_null(path);
    assert_int_equal(rey_xml_resolve_file(ctx, document, root, "filename", &path), REY_ERROR_SCENE);
    double rgb[3];
    const double zero[3] = {0};
    rey_xml_node *emitter = shape->children[1].node;
    assert_int_equal(rey_xml_get_colour(ctx, emitter, "radiance", REY_COLOUR_EMISSION, zero, rgb), REY_OK);
    assert_true(fabs(rgb[0] - 20.710837) < 1e-4);
    rey_xml_free(ctx, document);
}

static void test_upgrade(void **state) {
    rey_context *ctx = *state;
    rey_xml_document *document = read_file(ctx, DATA "old.xml", NULL, 0);
    rey_xml_node *bsdf = rey_xml_root(document)->children[0].node;
    rey_xml_child *texture = rey_xml_child_named(bsdf, "reflectance");
    assert_non_null(texture);
    double m[6];
    assert_int_equal(rey_xml_get_transform2(ctx, texture->node, "to_uv", m), REY_OK);
    assert_true(m[0] == 2 && m[4] == 1 && m[2] == 0.25 && m[5] == 0);
    assert_null(rey_xml_find(texture->node, "uscale"));
    assert_non_null(rey_xml_find(texture->node, "filter_type"));
    rey_xml_node *sensor = rey_xml_root(document)->children[1].node;
    assert_non_null(rey_xml_find(sensor, "to_world"));
    assert_non_null(rey_xml_find(rey_xml_root(document)->children[2].node, "int_ior"));
    rey_xml_free(ctx, document);
}

static void test_locale(void **state) {
    rey_context *ctx = *state;
    if (!setlocale(LC_NUMERIC, "de_DE.UTF-8")) {
        skip();
    }
    rey_xml_document *document = read_text(ctx, "<film version='3.0.0' type='f'><float name='f' value='0.5'/></film>");
    assert_true(rey_xml_find(rey_xml_root(document), "f")->number == 0.5);
    rey_xml_free(ctx, document);
    setlocale(LC_NUMERIC, "C");
}

// ---- bad documents -----------------------------------------------------------------------------------------------

typedef struct BadCase {
    rey_result code;
    const char *text;    // body of a scene that starts on line 1
    const char *message; // start of the message, after the file's name
} BadCase;

#define S "<scene version='3.0.0'>\n"
static const BadCase bad_cases[] = {
    {REY_ERROR_FORMAT, "", ":1:1: not well-formed XML: no element found"},
    {REY_ERROR_FORMAT, S " <bsdf type='a'>\n</scene>", ":3:3: not well-formed XML: mismatched tag"},
    {REY_ERROR_FORMAT, S "</scene><scene/>", ":2:9: not well-formed XML: junk"},
    {REY_ERROR_SCENE, "<scene/>", ":1:1: <scene> lacks the attribute 'version'"},
    {REY_ERROR_SCENE, "<scene version='3'/>", ":1:8: bad version '3', expected three numbers"},
    {REY_ERROR_SCENE, "<scene version='4.0.0'/>", ":1:8: version 4.0.0 of the scene format is not known"},
    {REY_ERROR_SCENE, "<float name='a' value='1'/>", ":1:1: <float> cannot be the root"},
    {REY_ERROR_SCENE, S " <bsfd type='a'/></scene>", ":2:2: unknown tag <bsfd>"},
    {REY_ERROR_SCENE, S " <bsdf type='a'\n  ids='b'/></scene>",
     ":3:3: unknown attribute 'ids' of <bsdf>, did you mean 'id'?"},
    {REY_ERROR_SCENE, S " <bsdf/></scene>", ":2:2: <bsdf> lacks the attribute 'type'"},
    {REY_ERROR_SCENE, S " <bsdf type=''/></scene>", ":2:8: attribute 'type' of <bsdf> is empty"},
    {REY_ERROR_SCENE, S " <scene/></scene>", ":2:2: <scene> cannot stand within <scene>"},
    {REY_ERROR_SCENE, S " <translate x='1'/></scene>", ":2:2: <translate> cannot stand within <scene>"},
    {REY_ERROR_SCENE, S " <float name='a' value='1'><float name='b' value='1'/></float></scene>",
     ":2:28: <float> cannot stand within <float>, expected nothing"},
    {REY_ERROR_SCENE, S " <transform name='t'><float name='b' value='1'/></transform></scene>",
     ":2:22: <float> cannot stand within <transform>, expected translate"},
    {REY_ERROR_SCENE, S " hello</scene>", ":2:1: text 'hello' between the tags"},
    {REY_ERROR_SCENE, S " <float name='a' value='1'/>\n <integer name='a' value='1'/></scene>",
     ":3:2: 'a' is given twice in scene 'scene'"},
    {REY_ERROR_SCENE, S " <float name='a' value='1'/>\n <bsdf type='x' name='a'/></scene>", ":3:2: 'a' is given twice"},
    {REY_ERROR_SCENE, S " <float name='a' value='1x'/></scene>", ":2:18: bad value '1x', expected a number"},
    {REY_ERROR_SCENE, S " <float name='a' value=''/></scene>", ":2:18: bad value '', expected a number"},
    {REY_ERROR_SCENE, S " <float name='a' value='nan'/></scene>", ":2:18: bad value 'nan'"},
    {REY_ERROR_SCENE, S " <float name='a' value='1e999'/></scene>", ":2:18: bad value '1e999'"},
    {REY_ERROR_SCENE, S " <float name='a' value='0x10'/></scene>", ":2:18: bad value '0x10'"},
    {REY_ERROR_SCENE, S " <integer name='a' value='1.5'/></scene>", ":2:20: bad value '1.5', expected an integer"},
    {REY_ERROR_SCENE, S " <integer name='a' value='99999999999999999999'/></scene>", ":2:20: bad value '999"},
    {REY_ERROR_SCENE, S " <boolean name='a' value='yes'/></scene>", ":2:20: bad value 'yes', expected true or false"},
    {REY_ERROR_SCENE, S " <point name='a' value='1 2'/></scene>", ":2:18: bad value '1 2', expected one or three"},
    {REY_ERROR_SCENE, S " <point name='a' value='1 2 3 4'/></scene>", ":2:18: bad value '1 2 3 4'"},
    {REY_ERROR_SCENE, S " <point name='a' x='1 2'/></scene>", ":2:18: bad x '1 2', expected one number"},
    {REY_ERROR_SCENE, S " <point name='a' x='1' value='2'/></scene>", ":2:18: give either 'value' or x, y, z"},
    {REY_ERROR_SCENE, S " <rgb name='a' value='#ff0000'/></scene>", ":2:16: bad value '#ff0000'"},
    {REY_ERROR_SCENE, S " <spectrum name='a' value='1 2'/></scene>", ":2:21: bad value '1 2', expected one number"},
    {REY_ERROR_SCENE, S " <spectrum name='a' value='500:1, 400:2'/></scene>",
     ":2:21: wavelength 400 follows 500, expected ascending"},
    {REY_ERROR_SCENE, S " <spectrum name='a' value='500:1'/></scene>", ":2:21: bad value '500:1'"},
    {REY_ERROR_SCENE, S " <spectrum name='a' value='500:1,600:'/></scene>", ":2:21: bad value '500:1,600:'"},
    {REY_ERROR_SCENE, S " <spectrum name='a'/></scene>", ":2:2: <spectrum> needs either"},
    {REY_ERROR_IO, S " <spectrum name='a' filename='no.spd'/></scene>", ":2:2: file 'no.spd' was not found"},
    {REY_ERROR_SCENE, S " <transform name='t'>\n<rotate angle='3'/></transform></scene>",
     ":3:1: <rotate> needs an axis"},
    {REY_ERROR_SCENE, S " <transform name='t'>\n<rotate x='1'/></transform></scene>",
     ":3:1: <rotate> lacks the attribute 'angle'"},
    {REY_ERROR_SCENE, S " <transform name='t'>\n<rotate x='1' angle='a'/></transform></scene>", ":3:15: bad angle 'a'"},
    {REY_ERROR_SCENE, S " <transform name='t'>\n<matrix value='1 2 3'/></transform></scene>",
     ":3:9: 3 numbers in a matrix, expected 16 or 9"},
    {REY_ERROR_SCENE, S " <transform name='t'>\n<matrix value='1 0 0 0 0 1 0 0 0 0 1 0 0 0 1 1'/></transform></scene>",
     ":3:9: the matrix is not affine"},
    {REY_ERROR_SCENE, S " <transform name='t'>\n<lookat origin='0 0 0' target='0 0 0'/></transform></scene>",
     ":3:1: bad <lookat>: origin and target coincide"},
    {REY_ERROR_SCENE, S " <transform name='t'>\n<lookat origin='0 0 0' target='0 2 0' up='0 1 0'/></transform></scene>",
     ":3:1: bad <lookat>: 'up' is parallel"},
    {REY_ERROR_SCENE, S " <transform name='t'>\n<lookat origin='0 0' target='0 2 0'/></transform></scene>",
     ":3:9: bad origin '0 0', expected three numbers"},
    {REY_ERROR_SCENE, S " <transform name='t'><scale value='1e200'/>\n<scale value='1e200'/></transform></scene>",
     ":3:1: the transform overflows"},
    {REY_ERROR_SCENE, S " <bsdf type='a' id='white'/>\n <bsdf type='b'><ref id='whit'/></bsdf></scene>",
     ":3:17: unknown id 'whit' in <ref>, expected the id of an object of this scene, did you mean 'white'?"},
    {REY_ERROR_SCENE, S " <bsdf type='a' id='x'/>\n <bsdf type='a' id='x'/></scene>", ":3:17: duplicate id 'x', first"},
    {REY_ERROR_SCENE, S " <bsdf type='a' id='x'>\n <ref id='x'/></bsdf></scene>", ":3:2: reference cycle: 'x'"},
    {REY_ERROR_SCENE,
     S " <bsdf type='a' id='x'><ref id='y'/></bsdf>\n <bsdf type='a' id='y'><ref id='x'/></bsdf></scene>",
     ":3:24: reference cycle"},
    {REY_ERROR_SCENE, S " <alias id='x' as='y'/><bsdf type='a' id='x'/></scene>", ":2:9: unknown id 'x' in <alias>"},
    {REY_ERROR_SCENE, S " <bsdf type='a' id='x'/><alias id='x' as='x'/></scene>", ":2:39: duplicate id 'x'"},
    {REY_ERROR_SCENE, S " <default name='spp' value='1'/>\n <film type='$ssp'/></scene>",
     ":3:8: undefined parameter '$ssp', expected a <default> before this line or -D ssp=value (write \\$ for a dollar "
     "sign), did you mean 'spp'?"},
    {REY_ERROR_SCENE, S " <film type='a$'/></scene>", ":2:8: undefined parameter '$'"},
    {REY_ERROR_IO, S " <include filename='none.xml'/></scene>", ":2:11: file 'none.xml' was not found, looked in '"},
    {REY_ERROR_IO, S " <include filename='/none.xml'/></scene>", ":2:11: there is no file '/none.xml'"},
    {REY_ERROR_IO, S " <include filename='.'/></scene>", ":2:11: file '.' was not found"},
    {REY_ERROR_IO, S " <path value='none'/></scene>", ":2:8: '"},
    {REY_ERROR_SCENE, S " <film type='a'><path value='.'/></film></scene>", ":2:17: <path> must stand directly"},
    {REY_ERROR_SCENE,
     "<scene version='0.6.0'>\n <bsdf type='diffuse'><rgb name='reflectance' value='1'/>\n"
     "<rgb name='diffuseReflectance' value='1'/></bsdf></scene>",
     ":3:1: 'reflectance' is given twice in bsdf 'diffuse'"},
    {REY_ERROR_SCENE, "<!DOCTYPE s [<!ENTITY a 'b'>]>\n" S "</scene>", ":1:13: document type declarations"},
};

static void test_bad_documents(void **state) {
    rey_context *ctx = *state;
    for (int i = 0; i < COUNT_OF(bad_cases); i++) {
        const BadCase *c = &bad_cases[i];
        rey_xml_document *document = NULL;
        rey_result result = rey_xml_read_memory(ctx, DATA "bad.xml", c->text, strlen(c->text), NULL, 0, &document);
        char expected[512];
        snprintf(expected, sizeof expected, "%s%s", DATA "bad.xml", c->message);
        if (result != c->code || strncmp(rey_error(ctx), expected, strlen(expected)) != 0) {
            fail_msg("case %d: result %d, message\n%s\nexpected\n%s", i, result, rey_error(ctx), expected);
        }
        assert_null(document);
    }
}

static const char *known_names(void *user, int i) {
    static const char *const names[] = {"reflectance", "alpha", NULL};
    UNUSED(user);
    return names[i];
}

static void test_unused(void **state) {
    rey_context *ctx = *state;
    rey_xml_document *document =
        read_text(ctx, S " <bsdf type='diffuse'>\n  <texture type='bitmap'/>\n  <float name='refelctance' value='1'/>\n"
                         "  <ref id='t' name='alfa'/></bsdf><texture type='bitmap' id='t'/></scene>");
    rey_xml_node *bsdf = rey_xml_root(document)->children[0].node;
    assert_int_equal(rey_xml_check_unused(ctx, bsdf, known_names, NULL), REY_ERROR_SCENE);
    assert_string_equal(rey_error(ctx), DATA "text.xml:3:3: bsdf 'diffuse' has no use for the texture 'bitmap'");
    bsdf->children[0].used = true;
    assert_int_equal(rey_xml_check_unused(ctx, bsdf, known_names, NULL), REY_ERROR_SCENE);
    assert_string_equal(rey_error(ctx), DATA "text.xml:4:3: unknown property 'refelctance' of bsdf 'diffuse', did you "
                                             "mean 'reflectance'?");
    bsdf->properties[0].used = true;
    assert_int_equal(rey_xml_check_unused(ctx, bsdf, known_names, NULL), REY_ERROR_SCENE);
    assert_string_equal(rey_error(ctx), DATA "text.xml:5:3: bsdf 'diffuse' has no use for the texture 'bitmap' named "
                                             "'alfa', did you mean 'alpha'?");
    rey_xml_free(ctx, document);
}

static void test_wrong_kinds(void **state) {
    rey_context *ctx = *state;
    rey_xml_document *document =
        read_text(ctx, S " <bsdf type='d'>\n  <string name='s' value='bk8'/><rgb name='c' value='1.5'/>\n"
                         "<texture type='bitmap' name='tex'/><float name='n' value='-1'/></bsdf></scene>");
    rey_xml_node *bsdf = rey_xml_root(document)->children[0].node;
    double v[3];
    bool b;
    const double zero[3] = {0};
    assert_int_equal(rey_xml_get_float(ctx, bsdf, "s", 0, v), REY_ERROR_SCENE);
    assert_string_equal(rey_error(ctx), DATA "text.xml:3:3: 's' of bsdf 'd' is of kind string, expected float");
    assert_int_equal(rey_xml_get_bool(ctx, bsdf, "tex", false, &b), REY_ERROR_SCENE);
    assert_string_equal(rey_error(ctx),
                        DATA "text.xml:4:1: 'tex' of bsdf 'd' is an object (texture), expected boolean");
    assert_int_equal(rey_xml_get_colour(ctx, bsdf, "c", REY_COLOUR_REFLECTANCE, zero, v), REY_ERROR_SCENE);
    assert_non_null(strstr(rey_error(ctx), "component 1.5, expected 0 to 1"));
    assert_int_equal(rey_xml_get_colour(ctx, bsdf, "c", REY_COLOUR_UNBOUNDED, zero, v), REY_OK);
    assert_int_equal(rey_xml_get_colour(ctx, bsdf, "n", REY_COLOUR_EMISSION, zero, v), REY_ERROR_SCENE);
    assert_int_equal(rey_xml_get_ior(ctx, bsdf, "s", "air", v), REY_ERROR_SCENE);
    assert_non_null(strstr(rey_error(ctx), "unknown material 'bk8' of 's', expected a number or a material's name, "
                                           "did you mean 'bk7'?"));
    assert_int_equal(rey_xml_get_ior(ctx, bsdf, "n", "air", v), REY_ERROR_SCENE);
    assert_int_equal(rey_xml_get_ior(ctx, bsdf, "none", "Air", v), REY_OK);
    assert_true(v[0] == 1.000277);
    rey_xml_free(ctx, document);
}

static void test_bad_files(void **state) {
    rey_context *ctx = *state;
    rey_xml_document *document = NULL;
    assert_int_equal(rey_xml_read(ctx, DATA "none.xml", NULL, 0, &document), REY_ERROR_IO);
    assert_int_equal(rey_xml_read(ctx, DATA, NULL, 0, &document), REY_ERROR_IO);
    assert_int_equal(rey_xml_read(ctx, DATA "cycle_a.xml", NULL, 0, &document), REY_ERROR_SCENE);
    assert_non_null(strstr(rey_error(ctx), "xml/cycle_b.xml:2:14: '"));
    assert_non_null(strstr(rey_error(ctx), "includes itself"));
    assert_int_equal(rey_xml_read(ctx, DATA "bad_spectrum.xml", NULL, 0, &document), REY_ERROR_FORMAT);
    assert_non_null(strstr(rey_error(ctx), "bad.spd:3: bad line '500 x'"));
    assert_int_equal(rey_xml_read(ctx, DATA "bad_include.xml", NULL, 0, &document), REY_ERROR_SCENE);
    assert_non_null(strstr(rey_error(ctx), "parts/no_version.xml:1:1: <scene> lacks the attribute 'version'"));
}

// ---- limits ------------------------------------------------------------------------------------------------------

static char *repeat(const char *head, const char *piece, int times, const char *middle, const char *tail) {
    size_t bytes = strlen(head) + strlen(middle) + (strlen(piece) + strlen(tail)) * (size_t)times + 64;
    char *text = malloc(bytes), *at = text;
    at += sprintf(at, "%s", head);
    for (int i = 0; i < times; i++) {
        at += sprintf(at, "%s", piece);
    }
    at += sprintf(at, "%s", middle);
    for (int i = 0; i < times; i++) {
        at += sprintf(at, "%s", tail);
    }
    return text;
}

static void expect_failure(rey_context *ctx, char *text, const char *message) {
    rey_xml_document *document = NULL;
    assert_int_equal(rey_xml_read_memory(ctx, "t.xml", text, strlen(text), NULL, 0, &document), REY_ERROR_SCENE);
    if (!strstr(rey_error(ctx), message)) {
        fail_msg("%s", rey_error(ctx));
    }
    free(text);
}

static void test_limits(void **state) {
    rey_context *ctx = *state;
    expect_failure(ctx, repeat(S, "<bsdf type='a'>", 100000, "</scene>", ""), "nested more than 128 deep");
    char *text = malloc(1 << 20), *at = text; // each object holds the next
    at += sprintf(at, S);
    for (int i = 0; i < 2000; i++) {
        at += sprintf(at, "<bsdf type='a' id='n%d'><ref id='n%d'/></bsdf>", i, i + 1);
    }
    sprintf(at, "<bsdf type='a' id='n2000'/></scene>");
    expect_failure(ctx, text, "nested more than 128 deep through references");
    text = malloc(1 << 20), at = text; // values that double: 2^60 bytes
    at += sprintf(at, S "<default name='a0' value='xx'/>");
    for (int i = 0; i < 60; i++) {
        at += sprintf(at, "<default name='a%d_' value='$a%d%s$a%d%s'/>", i + 1, i, i ? "_" : "", i, i ? "_" : "");
    }
    sprintf(at, "</scene>");
    expect_failure(ctx, text, "substitution makes this value too long");
    text = malloc(1 << 20), at = text;
    at += sprintf(at, S);
    for (int i = 0; i < 5000; i++) {
        at += sprintf(at, "<float name='f%d' value='1'/>", i);
    }
    sprintf(at, "</scene>");
    expect_failure(ctx, text, "more than 4096 named");
    // Shared objects are visited once each, however many paths lead to them: 2^100 here.
    text = malloc(1 << 20), at = text;
    at += sprintf(at, S);
    for (int i = 0; i < 100; i++) {
        at += sprintf(at, "<bsdf type='a' id='n%d'><ref id='n%d'/><ref id='n%d'/></bsdf>", i, i + 1, i + 1);
    }
    sprintf(at, "<bsdf type='a' id='n100'/></scene>");
    rey_xml_document *document = read_text(ctx, text);
    assert_int_equal(rey_xml_root(document)->height, 101);
    rey_xml_free(ctx, document);
    free(text);
}

// Writes files f0.xml, f1.xml, ... that each include the next `times` times, reads the first, and removes them again.
static void read_chain(rey_context *ctx, int files, int times, const char *message) {
    char folder[] = "/tmp/reynolds-test-XXXXXX", path[128];
    assert_non_null(mkdtemp(folder));
    for (int i = 0; i < files; i++) {
        snprintf(path, sizeof path, "%s/f%d.xml", folder, i);
        FILE *stream = fopen(path, "w");
        assert_non_null(stream);
        fprintf(stream, "<scene version='3.0.0'>");
        for (int k = 0; k < times && i + 1 < files; k++) {
            fprintf(stream, "<include filename='f%d.xml'/>", i + 1);
        }
        fprintf(stream, "</scene>");
        fclose(stream);
    }
    snprintf(path, sizeof path, "%s/f0.xml", folder);
    rey_xml_document *document = NULL;
    rey_result result = rey_xml_read(ctx, path, NULL, 0, &document);
    rey_xml_free(ctx, document);
    for (int i = 0; i < files; i++) {
        snprintf(path, sizeof path, "%s/f%d.xml", folder, i);
        remove(path);
    }
    remove(folder);
    assert_int_equal(result, message ? REY_ERROR_SCENE : REY_OK);
    assert_true(!message || strstr(rey_error(ctx), message));
}

static void test_include_limits(void **state) {
    read_chain(*state, 60, 1, NULL);
    read_chain(*state, 70, 1, "files are included more than 64 deep");
    read_chain(*state, 20, 2, "more than 4096 files are included");
}

// ---- truncation, failing memory ----------------------------------------------------------------------------------

static const char small_scene[] =
    "<?xml version='1.0' encoding='utf-8'?>\n<scene version='3.0.0'>\n <default name='w' value='8'/>\n"
    " <path value='parts'/>\n <include filename='materials.xml'/>\n <!-- comment -->\n"
    " <film type='hdrfilm'><integer name='width' value='$w'/></film>\n"
    " <shape type='obj'><ref id='white'/><transform name='to_world'><rotate x='1' angle='5'/></transform>\n"
    "  <emitter type='area'><spectrum name='radiance' filename='light.spd'/></emitter></shape>\n"
    " <alias id='white' as='w2'/><bsdf type='twosided'><ref id='w2' name='x'/></bsdf>\n</scene>";

static void test_truncated(void **state) {
    rey_context *ctx = *state;
    for (size_t bytes = 0; bytes <= strlen(small_scene); bytes++) {
        rey_xml_document *document = NULL;
        char *text = malloc(bytes + 1); // exact size, so that sanitizers see a read beyond it
        memcpy(text, small_scene, bytes);
        rey_result result = rey_xml_read_memory(ctx, DATA "text.xml", text, bytes, NULL, 0, &document);
        free(text);
        assert_int_equal(result == REY_OK, bytes == strlen(small_scene));
        assert_int_equal(document != NULL, bytes == strlen(small_scene));
        rey_xml_free(ctx, document);
    }
}

// What fuzzing found worth keeping: nothing of it may crash or leak; all failures have a position.
static void test_corpus(void **state) {
    rey_context *ctx = *state;
    DIR *listing = opendir(DATA "corpus");
    assert_non_null(listing);
    int count = 0;
    for (struct dirent *entry; (entry = readdir(listing));) {
        if (entry->d_name[0] == '.') {
            continue;
        }
        char path[4096];
        snprintf(path, sizeof path, "%s/%s", DATA "corpus", entry->d_name);
        rey_xml_document *document = NULL;
        rey_result result = rey_xml_read(ctx, path, NULL, 0, &document);
        assert_int_equal(result == REY_OK, document != NULL);
        assert_true(!result || strncmp(rey_error(ctx), path, strlen(path)) == 0);
        rey_xml_free(ctx, document);
        count++;
    }
    closedir(listing);
    assert_true(count > 50);
}

typedef struct Counter {
    int until_failure, alive;
} Counter;

static void *counted_alloc(void *user, size_t bytes, size_t alignment) {
    Counter *counter = user;
    if (counter->until_failure-- == 0) {
        return NULL;
    }
    counter->alive++;
    return aligned_alloc(alignment, (bytes + alignment - 1) / alignment * alignment);
}

static void counted_release(void *user, void *memory) {
    ((Counter *)user)->alive--;
    free(memory);
}

static void test_failing_memory(void **state) {
    UNUSED(state);
    rey_result result = REY_ERROR_MEMORY;
    int n = 0;
    for (; result != REY_OK; n++) {
        assert_true(n < 10000);
        Counter counter = {.until_failure = 1000000};
        rey_context_def def = rey_default_context_def();
        def.alloc = counted_alloc;
        def.release = counted_release;
        def.user = &counter;
        rey_context *ctx = NULL;
        assert_int_equal(rey_context_create(&def, &ctx), REY_OK);
        rey_xml_document *document = NULL;
        const rey_define defines[] = {{"w", "9"}};
        counter.until_failure = n;
        result = rey_xml_read_memory(ctx, DATA "text.xml", small_scene, strlen(small_scene), defines, 1, &document);
        assert_true(result == REY_OK || result == REY_ERROR_MEMORY);
        rey_xml_free(ctx, document);
        assert_int_equal(counter.alive, 1);
        rey_context_destroy(ctx);
    }
    assert_true(n > 20);
}

// ---- scenes made by others ---------------------------------------------------------------------------------------

static int parsed_scenes;

// The text of a file names the parameters that it needs: pass those of spp and integrator that it uses.
static void parse_scene(rey_context *ctx, const char *path) {
    rey_xml_document *document = NULL;
    const rey_define given[] = {{"spp", "16"}, {"integrator", "path"}, {"max_depth", "3"}, {"res", "8"}};
    rey_define defines[COUNT_OF(given)];
    int count = 0;
    rey_result result = REY_ERROR_SCENE;
    for (int tries = 0; result && tries <= COUNT_OF(given); tries++) {
        result = rey_xml_read(ctx, path, defines, count, &document);
        for (int i = 0; result && i < COUNT_OF(given); i++) {
            char wanted[64];
            snprintf(wanted, sizeof wanted, "undefined parameter '$%s'", given[i].name);
            if (strstr(rey_error(ctx), wanted) && count < COUNT_OF(given)) {
                defines[count++] = given[i];
            }
        }
    }
    if (result) {
        fail_msg("%s", rey_error(ctx));
    }
    rey_xml_free(ctx, document);
    parsed_scenes++;
}

static void parse_folder(rey_context *ctx, const char *folder) {
    DIR *listing = opendir(folder);
    assert_non_null(listing);
    for (struct dirent *entry; (entry = readdir(listing));) {
        char path[4096];
        snprintf(path, sizeof path, "%s/%s", folder, entry->d_name);
        size_t length = strlen(path);
        struct stat info;
        bool hidden = entry->d_name[0] == '.';
        if (!hidden && stat(path, &info) == 0 && S_ISDIR(info.st_mode)) {
            parse_folder(ctx, path);
        } else if (!hidden && length > 4 && strcmp(path + length - 4, ".xml") == 0 && !strstr(path, "/fragments/") &&
                   !strstr(path, "/include/")) {
            parse_scene(ctx, path);
        }
    }
    closedir(listing);
}

static void test_conformance(void **state) {
    const char *folder = getenv("REYNOLDS_CONFORMANCE_DIR");
    folder = folder ? folder : PROJECT_DIR "/../shared/conformance";
    if (!rey_xml_is_folder(folder)) {
        print_message("skipped: no folder %s\n", folder);
        skip();
    }
    parsed_scenes = 0;
    parse_folder(*state, folder);
    print_message("%d scenes parsed\n", parsed_scenes);
    assert_true(parsed_scenes > 0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_values, setup, teardown),
        cmocka_unit_test_setup_teardown(test_transforms, setup, teardown),
        cmocka_unit_test_setup_teardown(test_references, setup, teardown),
        cmocka_unit_test_setup_teardown(test_substitution, setup, teardown),
        cmocka_unit_test_setup_teardown(test_files, setup, teardown),
        cmocka_unit_test_setup_teardown(test_upgrade, setup, teardown),
        cmocka_unit_test_setup_teardown(test_locale, setup, teardown),
        cmocka_unit_test_setup_teardown(test_bad_documents, setup, teardown),
        cmocka_unit_test_setup_teardown(test_unused, setup, teardown),
        cmocka_unit_test_setup_teardown(test_wrong_kinds, setup, teardown),
        cmocka_unit_test_setup_teardown(test_bad_files, setup, teardown),
        cmocka_unit_test_setup_teardown(test_limits, setup, teardown),
        cmocka_unit_test_setup_teardown(test_include_limits, setup, teardown),
        cmocka_unit_test_setup_teardown(test_truncated, setup, teardown),
        cmocka_unit_test_setup_teardown(test_corpus, setup, teardown),
        cmocka_unit_test(test_failing_memory),
        cmocka_unit_test_setup_teardown(test_conformance, setup, teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
