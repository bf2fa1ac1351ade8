// test_io_xml_bad.c: the XML reader: where bad documents are wrong, and that nothing leaks.
#define _GNU_SOURCE // mkdtemp
#include "io_xml.h"

#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/stat.h>

// ---- bad documents -----------------------------------------------------------------------------------------------

typedef struct BadCase {
    rey_result code;
    const char *text;    // body of a scene that starts on line 1
    const char *message; // start of the message, after the file's name
} BadCase;

#define S "<scene version='3.0.0'>\n"
static const BadCase bad_cases[] = {
    {REY_ERROR_FORMAT, "", ":1:1: not well-formed XML: no element found"},
    {REY_ERROR_FORMAT, S " <bsdf type='a'>\n</scene>",
     ":3:3: not well-formed XML: mismatched tag, expected </bsdf>, which line 2 opens"},
    {REY_ERROR_FORMAT, S "</scene><scene/>", ":2:9: not well-formed XML: junk"},
    {REY_ERROR_SCENE, "<scene/>", ":1:1: <scene> lacks the attribute 'version'"},
    {REY_ERROR_SCENE, "<scene version='3'/>", ":1:8: bad version '3', expected three numbers"},
    {REY_ERROR_SCENE, "<scene version='4.0.0'/>", ":1:8: version 4.0.0 of the scene format is not known"},
    {REY_ERROR_SCENE, "<float name='a' value='1'/>", ":1:1: <float> cannot be the root"},
    {REY_ERROR_SCENE, S " <bsfd type='a'/></scene>", ":2:2: unknown tag <bsfd>"},
    {REY_ERROR_SCENE, S " <bsdf type='a'\n  ids='b'/></scene>",
     ":3:3: unknown attribute 'ids' of <bsdf>, did you mean 'id'?"},
    {REY_ERROR_SCENE, S " <bsdf type='a' colour='b'/></scene>",
     ":2:17: unknown attribute 'colour' of <bsdf>, expected type, id or name; properties are elements within it"},
    {REY_ERROR_SCENE, S " <float name='a' val='1'/></scene>", ":2:18: unknown attribute 'val' of <float>, expected name or value"},
    {REY_ERROR_SCENE, "<scene verison='3.0.0'></scene>", ":1:8: unknown attribute 'verison' of <scene>, did you mean 'version'?"},
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
    {REY_ERROR_SCENE, S " <transform name='t'><scale value='1e30'/>\n<scale value='1e30'/></transform></scene>",
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
    {REY_ERROR_IO, S " <include filename='.'/></scene>", ":2:11: '.' is a folder, expected a file"},
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
    assert_string_equal(rey_error(ctx), DATA "text.xml:3:3: bsdf 'diffuse' has no use for the texture 'bitmap', whose "
                                             "'name' would say which property it is");
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
    assert_non_null(strstr(rey_error(ctx), "unknown material 'bk8' of 's', expected a number or a material's name such as 'bk7', "
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

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_bad_documents, setup, teardown),
        cmocka_unit_test_setup_teardown(test_unused, setup, teardown),
        cmocka_unit_test_setup_teardown(test_wrong_kinds, setup, teardown),
        cmocka_unit_test_setup_teardown(test_bad_files, setup, teardown),
        cmocka_unit_test_setup_teardown(test_limits, setup, teardown),
        cmocka_unit_test_setup_teardown(test_include_limits, setup, teardown),
        cmocka_unit_test_setup_teardown(test_truncated, setup, teardown),
        cmocka_unit_test_setup_teardown(test_corpus, setup, teardown),
        cmocka_unit_test(test_failing_memory),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
