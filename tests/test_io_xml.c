// test_io_xml.c: the XML reader: what good documents become.
#include "io/xml_parts.h"
#include "io_xml.h"

#include <dirent.h>
#include <locale.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/stat.h>

// ---- good documents ----------------------------------------------------------------------------------------------

static const char *no_names(void *user, int i) {
    UNUSED(user);
    UNUSED(i);
    return NULL;
}

static const char values_text[] =
    "<scene version='3.0.0'>\n"
    " <bsdf type='diffuse' id='a'>\n"
    "  <boolean name='b' value='TRUE'/><integer name='i' value=' -12 '/><float name='f' value='1.5e-3'/>\n"
    "  <string name='s' value='ggx'/><vector name='v' x='1' z='3'/><point name='p' value='2'/>\n"
    "  <point name='q' value='1, 2,3'/><rgb name='c' value='.1 .2,.3'/><rgb name='g' value='0.5'/>\n"
    "  <spectrum name='flat' value='0.25'/><spectrum name='w' value='400:1, 500:2 600:3'/>\n"
    "  <transform name='t'><translate x='1'/></transform>\n"
    " </bsdf>\n"
    "</scene>";

static void test_positions(void **state) {
    rey_context *ctx = *state;
    rey_xml_document *document = read_text(ctx, values_text);
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
    rey_xml_free(ctx, document);
}

static void scalars_of(rey_context *ctx, rey_xml_node *node) {
    bool b;
    int64_t i;
    double f;
    const char *s;
    int choice;
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
}

static void vectors_of(rey_context *ctx, rey_xml_node *node) {
    double v[3], m[16], m2[6];
    const double zero[3] = {0};
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
}

static void test_values(void **state) {
    rey_context *ctx = *state;
    rey_xml_document *document = read_text(ctx, values_text);
    rey_xml_node *node = rey_xml_root(document)->children[0].node;
    assert_int_equal(rey_xml_check_unused(ctx, node, no_names, NULL), REY_ERROR_SCENE);
    scalars_of(ctx, node);
    assert_int_equal(rey_xml_check_unused(ctx, node, no_names, NULL), REY_ERROR_SCENE);
    vectors_of(ctx, node);
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
    assert_int_equal(rey_xml_read_memory(ctx, "t.xml", text, strlen(text), unused, 2, &document), REY_ERROR_ARGUMENT);
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

// Names of 0.5 to 2.x that no version of today has.
static void test_old_names(void **state) {
    rey_context *ctx = *state;
    rey_xml_document *document = read_text(
        ctx, "<scene version='0.5.0'>"
             "<film type='ldrfilm'><string name='fileFormat' value='png'/><float name='gamma' value='2.2'/>"
             "<boolean name='banner' value='false'/><boolean name='highQualityEdges' value='true'/>"
             "<string name='pixelFormat' value='luminanceAlpha'/></film>"
             "<film type='hdrfilm'><float name='gamma' value='2.2'/><boolean name='attachLog' value='true'/></film>"
             "<sampler type='halton'><integer name='scramble' value='3'/></sampler>"
             "<integrator type='volpath_simple'><boolean name='strictNormals' value='false'/></integrator>"
             "<integrator type='path'><boolean name='strictNormals' value='true'/></integrator>"
             "<texture type='bitmap'><float name='gamma' value='1'/><string name='filterType' value='EWA'/></texture>"
             "<texture type='vertexcolors'/>"
             "<bsdf type='diffuse'><srgb name='reflectance' value='#ff8000'/>"
             "<rgb name='other' intent='reflectance' value='0.5'/></bsdf></scene>");
    rey_xml_node *node[8];
    for (int i = 0; i < 8; i++) {
        node[i] = rey_xml_root(document)->children[i].node;
    }
    assert_string_equal(node[0]->type, "hdrfilm");
    assert_int_equal(node[0]->property_count, 2);
    assert_true(rey_xml_find(node[0], "sample_border")->boolean);
    assert_string_equal(rey_xml_find(node[0], "pixel_format")->string, "luminance_alpha");
    assert_int_equal(node[1]->property_count, 1); // gamma is no property of this film
    assert_string_equal(node[2]->type, "ldsampler");
    assert_int_equal(node[2]->property_count, 0);
    assert_string_equal(node[3]->type, "volpath");
    assert_int_equal(node[3]->property_count, 0);
    assert_non_null(rey_xml_find(node[4], "strict_normals")); // true would change the picture
    assert_true(rey_xml_find(node[5], "raw")->boolean);
    assert_string_equal(rey_xml_find(node[5], "filter_type")->string, "bilinear");
    assert_string_equal(node[6]->type, "mesh_attribute");
    assert_string_equal(rey_xml_find(node[6], "name")->string, "vertex_color");
    const double *srgb = rey_xml_find(node[7], "reflectance")->vector;
    assert_true(srgb[0] == 1 && fabs(srgb[1] - 0.21586050) < 1e-6 && srgb[2] == 0);
    int notes = 0;
    for (const char *note; (note = rey_xml_note(document, notes)); notes++) {
        assert_true(strstr(note, "ldrfilm") || strstr(note, "tone") || strstr(note, "halton") || strstr(note, "ewa"));
    }
    assert_int_equal(notes, 4);
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
        cmocka_unit_test_setup_teardown(test_positions, setup, teardown),
        cmocka_unit_test_setup_teardown(test_values, setup, teardown),
        cmocka_unit_test_setup_teardown(test_transforms, setup, teardown),
        cmocka_unit_test_setup_teardown(test_references, setup, teardown),
        cmocka_unit_test_setup_teardown(test_substitution, setup, teardown),
        cmocka_unit_test_setup_teardown(test_files, setup, teardown),
        cmocka_unit_test_setup_teardown(test_upgrade, setup, teardown),
        cmocka_unit_test_setup_teardown(test_old_names, setup, teardown),
        cmocka_unit_test_setup_teardown(test_locale, setup, teardown),
        cmocka_unit_test_setup_teardown(test_conformance, setup, teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
