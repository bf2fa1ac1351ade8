// test_cli_convert.c: `reynolds convert`, as a user runs it.
#include "command.h"

static void converted_scenes_render_the_same_bits(void **state) {
    Fixture *f = *state;
    JsonNode *node = run_json(f, 0, "convert %s copy.xml --json");
    assert_string_equal(json_text(node, "output", ""), "copy.xml");
    json_free(node);
    expect(f, 0, "render %s --spp 2 -o a.npy");
    expect(f, 0, "render copy.xml --spp 2 -o b.npy");
    assert_int_equal(system("cmp -s a.npy b.npy"), 0);
    assert_int_not_equal(system("cmp -s a.npy copy.xml"), 0);
}

static void failures_of_convert(void **state) {
    Fixture *f = *state;
    expect(f, 2, "convert %s");
    assert_non_null(strstr(f->words, "OUT.xml is missing"));
    expect(f, 1, "convert missing.xml copy.xml");
    expect(f, 2, "convert %s copy.obj");
    assert_non_null(strstr(f->words, "'copy.obj' ends in none of .xml"));
    assert_int_not_equal(access("copy.obj", F_OK), 0);
    expect(f, 2, "convert %s -");
    expect(f, 0, "convert %s plain.xml");
    assert_non_null(strstr(f->words, "wrote plain.xml"));
    expect(f, 2, "convert plain.xml ./plain.xml");
    expect(f, 1, "convert %s no/such/folder.xml");
    assert_non_null(strstr(f->words, "no/such/folder.xml"));
}

// What lies in OUT_data without an OUT.xml is somebody else's; with one, it is what an earlier conversion wrote.
static void files_of_others_are_kept(void **state) {
    Fixture *f = *state;
    expect(f, 0, "render %s --spp 1 -o tex.png");
    write_words("painted.xml", "<scene version='3.0.0'><shape type='sphere'><bsdf type='diffuse'><texture type='bitmap' "
                               "name='reflectance'><string name='filename' value='tex.png'/></texture></bsdf></shape></scene>");
    assert_int_equal(system("mkdir k_data"), 0);
    write_words("k_data/tex.png", "mine");
    write_words("k_data/notes.txt", "mine, too");
    expect_said(f, 1, "convert painted.xml k.xml", "k_data/tex.png is there");
    assert_int_equal(system("grep -q mine k_data/tex.png && [ ! -e k.xml ]"), 0);
    assert_int_equal(system("mv k_data/tex.png mine.png"), 0);
    expect(f, 0, "convert painted.xml k.xml");
    assert_int_equal(system("cmp -s tex.png k_data/tex.png"), 0);
    write_words("k_data/tex.png", "old");
    expect(f, 0, "convert painted.xml k.xml");
    assert_int_equal(system("cmp -s tex.png k_data/tex.png && grep -q mine k_data/notes.txt"), 0);
}

// A conversion that fails half way leaves none of its files, so that another can write them.
static void failures_leave_nothing(void **state) {
    Fixture *f = *state;
    write_words("two.xml", "<scene version='3.0.0'><shape type='obj'><string name='filename' value='one.obj'/></shape>"
                           "<shape type='obj'><string name='filename' value='other.obj'/></shape></scene>");
    write_words("one.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    assert_int_equal(system("(cat one.obj; yes '# long' | head -n 20000) > other.obj"), 0);
    assert_int_not_equal(system("(ulimit -f 64; exec '" REYNOLDS_COMMAND "' convert two.xml half.xml) > out.txt 2> words.txt"), 0);
    assert_int_equal(system("grep -q other.obj words.txt && [ ! -e half.xml ] && [ ! -e half_data ]"), 0);
    expect(f, 0, "convert two.xml half.xml");
    assert_int_equal(system("cmp -s one.obj half_data/one.obj"), 0);
}

static const char *const broken_scene =
    "<scene version='3.0.0'><integrator type='stokes'/><sensor type='perspective'><film type='hdrfilm'>"
    "<integer name='width' value='8'/><integer name='height' value='8'/></film><float name='zoom' value='2'/></sensor>"
    "<medium type='haze' id='fog'/><emitter type='sunsky'/><emitter type='constant'/>"
    "<shape type='sphere'><bsdf type='twosided'><bsdf type='hair' id='fur'/></bsdf>"
    "<ref name='interior' id='fog'/></shape>"
    "<shape type='cube'><bsdf type='diffuse' id='wood'><texture type='bitmap' name='reflectance'>"
    "<string name='filename' value='none.png'/></texture></bsdf></shape>"
    "<shape type='ellipsoids'><bsdf type='diffuse' id='kept'><rgb name='reflectance' value='0.1 0.2 0.3'/></bsdf></shape>"
    "<shape type='rectangle'><ref id='kept'/></shape><shape type='obj'><string name='filename' value='no.obj'/></shape>"
    "<gizmo type='odd'><bsdf type='diffuse' id='inner'/>words</gizmo>words"
    "<shape type='sphere'><float name='radius' value='abc'/><ref id='inner'/><bsdf type='conductor'>"
    "<spectrum name='eta' filename='no.spd'/></bsdf>"
    "<transform name='to_world'><skew value='1'/><translate z='3'/></transform></shape>"
    "</scene>";

static void lenient_reading_lists_what_it_leaves_out(void **state) {
    static const char *const words[] = {"stokes",   "zoom", "212: there is no medium 'haze'", "sunsky", "hair", "none.png",
                                        "ellipsoids",  "no.obj",
                                        "<gizmo>", "text 'words' between", "'abc'", "unknown id 'inner'", "no.spd", "<skew>"};
    static const char *const commands[] = {"params broken.xml --lenient --json", "info broken.xml --lenient --json",
                                           "render broken.xml --spp 2 -o a.npy --lenient --json",
                                           "convert broken.xml mended.xml --lenient --json"};
    Fixture *f = *state;
    FILE *file = fopen("broken.xml", "w");
    assert_non_null(file);
    fputs(broken_scene, file);
    fclose(file);
    for (size_t i = 0; i < sizeof commands / sizeof commands[0]; i++) {
        JsonNode *node = run_json(f, 0, commands[i]);
        int count = 0;
        for (const JsonNode *n = json_get(node, "ignored")->first; n; n = n->next) {
            count++;
        }
        assert_int_equal(count, sizeof words / sizeof words[0]);
        json_free(node);
        for (size_t k = 0; k < sizeof words / sizeof words[0]; k++) {
            if (!strstr(f->words, words[k])) {
                fail_msg("'%s' is not named in %s", words[k], f->words);
            }
        }
    }
    expect(f, 1, "info broken.xml");
    assert_non_null(strstr(f->words, "unknown tag <gizmo>"));
    expect(f, 0, "check broken.xml --lenient --param kept.reflectance.value --spp 16"); // which reads it twice
    expect(f, 0, "render mended.xml --spp 2 -o b.npy");
    assert_int_equal(system("cmp -s a.npy b.npy"), 0);
    expect(f, 0, "params mended.xml");
    assert_non_null(strstr(f->out, "0.1, 0.2, 0.3"));
}

// What cannot be read takes as little with it as it can, and what is written reads back to the same picture.
static void lenient_reading_keeps_the_rest(void **state) {
    static const struct {
        const char *line, *word, *kept; // a part of a scene; what is named; what `info` or `params` still has
    } cases[] = {
        {"<shape type='sphere' colour='red' id='ball'/>", "unknown attribute 'colour'", "ball.bsdf.reflectance"},
        {"<bsdf type='diffuse' id='same'/><shape type='sphere' id='ball'/><bsdf type='diffuse' id='same'/>", "duplicate id 'same'",
         "ball.bsdf.reflectance"},
        {"<bsdf type='mask' id='hole'><ref id='hole'/></bsdf><shape type='sphere' id='ball'/>", "contains itself",
         "ball.bsdf.reflectance"},
        {"<shape type='sphere' id='ball'><bsdf type='mask'><texture type='bitmap' name='opacity'><string name='filename' "
         "value='no.png'/></texture><bsdf type='roughconductor'/></bsdf></shape>", "no.png", "alpha"},
        {"<shape type='sphere' id='ball'><bsdf type='normalmap'><texture type='bitmap' name='normalmap'><string name='filename' "
         "value='no.png'/></texture><bsdf type='roughconductor'/></bsdf></shape>", "no 'normalmap' that can be read",
         "ball.bsdf.reflectance"},
        {"<shape type='sphere' id='ball'><emitter type='constant'/></shape>", "constant", "ball.bsdf.reflectance"},
        {"<shape type='sphere' id='ball'><float name='radius' value='-2'/></shape>", "radius", "ball.to_world"}};
    static const char *const sensors[][2] = {{"<float name='fov' value='190'/>", "fov is 190"},
                                             {"<string name='fov_axis' value='q'/>", "'fov_axis'"},
                                             {"<sampler type='odd'/>", "sampler 'odd'"},
                                             {"<sampler type='independent'><integer name='sample_count' value='-3'/></sampler>",
                                              "sample_count"}};
    Fixture *f = *state;
    char text[2048];
    for (size_t i = 0; i < sizeof cases / sizeof *cases + sizeof sensors / sizeof *sensors; i++) {
        bool sensor = i >= sizeof cases / sizeof *cases;
        const char *const *own = sensors[sensor ? i - sizeof cases / sizeof *cases : 0];
        snprintf(text, sizeof text, "<scene version='3.0.0'><integrator type='path'/><sensor type='perspective'>%s<film "
                 "type='hdrfilm'><integer name='width' value='8'/><integer name='height' value='8'/>%s</film></sensor>"
                 "<emitter type='constant'/>%s</scene>", sensor ? own[0] : "", sensor ? "<rfilter type='odd'/>" : "",
                 sensor ? "<shape type='sphere' id='ball'/>" : cases[i].line);
        write_words("less.xml", text);
        expect(f, 1, "info less.xml");
        expect_words(f, 0, "params less.xml --lenient", sensor ? own[1] : cases[i].word);
        assert_non_null(strstr(f->out, sensor ? "ball.bsdf.reflectance" : cases[i].kept));
        expect(f, 0, "render less.xml --lenient --spp 4 -o a.npy");
        expect(f, 0, "convert less.xml kept.xml --lenient");
        expect(f, 0, "render kept.xml --spp 4 -o b.npy");
        assert_int_equal(system("cmp -s a.npy b.npy"), 0);
    }
    // An attribute that no mesh has reads as 0, which no file says.
    write_words("less.xml", "<scene version='3.0.0'><sensor type='perspective'/><shape type='cube'><bsdf type='diffuse'><texture "
                            "type='mesh_attribute' name='reflectance'><string name='name' value='vertex_no'/></texture></bsdf>"
                            "</shape></scene>");
    expect_words(f, 1, "convert less.xml kept.xml --lenient", "cannot be read without --lenient");
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(converted_scenes_render_the_same_bits),
        cmocka_unit_test(failures_of_convert),
        cmocka_unit_test(files_of_others_are_kept),
        cmocka_unit_test(failures_leave_nothing),
        cmocka_unit_test(lenient_reading_lists_what_it_leaves_out),
        cmocka_unit_test(lenient_reading_keeps_the_rest),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
