// test_cli_words.c: what the command says where something is wrong or cannot be had.
#define _GNU_SOURCE // posix_openpt
#include "command.h"

#include <fcntl.h>

// A job in the test's folder for the scenes of the test jobs; lines follow it.
static void write_job(Fixture *f, const char *lines) {
    static char text[2048];
    snprintf(text, sizeof text, "folder: %s\nscene: start.xml\niterations: 0\nreport_spp: 2\n%s", TEST_JOBS, lines);
    write_words("job.yaml", text);
    if (access("target.exr", R_OK) != 0) {
        expect(f, 0, "render " TEST_JOBS "/truth.xml -o target.exr --spp 4");
    }
}

static JsonNode *fit_json(Fixture *f, int status, const char *sets) {
    char arguments[1024];
    snprintf(arguments, sizeof arguments, "fit job.yaml -o fit --overwrite --json --set views.0.target=$PWD/target.exr %s", sets);
    return run_json(f, status, arguments);
}

// `params` and `grad` agree about what is refused, in the same words.
static void refusals_are_the_same(void **state) {
    Fixture *f = *state;
    static const char *const scenes[] = {TEST_SCENE, TEST_SCENE " -D ball=veil"};
    int refused = 0;
    for (int s = 0; s < 2; s++) {
        char arguments[1024], text[512];
        snprintf(arguments, sizeof arguments, "params %s --json", scenes[s]);
        JsonNode *node = run_json(f, 0, arguments);
        for (const JsonNode *p = json_get(node, "parameters")->first; p; p = p->next) {
            snprintf(text, sizeof text, "%s", json_text(p, "refused", ""));
            snprintf(arguments, sizeof arguments, "grad %s --param %s --spp 1 -t 1", scenes[s], json_text(p, "name", ""));
            expect(f, text[0] ? 1 : 0, arguments);
            assert_non_null(strstr(f->words, text));
            refused += text[0] != 0;
        }
        json_free(node);
    }
    assert_true(refused > 0);
    expect_said(f, 0, "params %s -D ball=veil", "  refused [1]\n");
}

// A jump that paths may not meet is told apart from the terms that are needed, in words and in JSON.
static void what_may_be_needed_is_told(void **state) {
    Fixture *f = *state;
    write_words("bump.xml",
                "<scene version='3.0.0'><integrator type='path'/><sensor type='perspective'><film type='hdrfilm'><integer "
                "name='width' value='4'/><integer name='height' value='4'/></film></sensor><bsdf type='bumpmap' id='b'>"
                "<texture type='bitmap'><string name='filename' value='height.npy'/></texture><bsdf type='diffuse'/></bsdf>"
                "<shape type='rectangle'><ref id='b'/></shape><emitter type='constant'/></scene>");
    expect(f, 0, "render %s -o height.npy --spp 1");
    expect_said(f, 0, "params bump.xml", "interior,primary,indirect,terminator  complete");
    write_words("bumps.xml",
                "<scene version='3.0.0'><integrator type='path'/><sensor type='perspective'><film type='hdrfilm'><integer "
                "name='width' value='4'/><integer name='height' value='4'/></film></sensor><bsdf type='normalmap' id='b'><rgb "
                "name='normalmap' value='0.6,0.5,1'/><bsdf type='bumpmap'><texture type='bitmap'><string name='filename' "
                "value='height.npy'/></texture><bsdf type='diffuse'/></bsdf></bsdf>"
                "<shape type='rectangle'><ref id='b'/></shape><emitter type='constant'/></scene>");
    expect_said(f, 0, "params bumps.xml", "interior,primary,indirect  complete, unless paths meet the jump of 'terminator'");
    JsonNode *node = run_json(f, 0, "params bumps.xml --json");
    bool found = false;
    for (const JsonNode *p = json_get(node, "parameters")->first; p; p = p->next) {
        if (json_get(p, "terms_if_met")->first) {
            found = true;
            assert_string_equal(json_get(p, "terms_if_met")->first->text, "terminator");
        }
        for (const JsonNode *term = json_get(p, "terms")->first; term; term = term->next) {
            assert_string_not_equal(term->text, "terminator");
        }
    }
    assert_true(found);
    json_free(node);
}

// Names are the job's own, poses are poses, and what was not computed is not told.
static void fits_show_what_the_job_says(void **state) {
    Fixture *f = *state;
    write_job(f, "views: [{target: none.exr}]\n"
                 "parameters: [red.reflectance, {name: ball.to_world, parameterisation: rigid}]\ntruth: {scene: truth.xml}\n");
    JsonNode *node = fit_json(f, 0, "");
    assert_string_equal(json_text(json_get(node, "parameters")->first, "name", ""), "red.reflectance");
    assert_true(json_get(node, "loss")->kind == JSON_NULL);
    assert_true(json_value(json_get(node, "parameters")->first->next, "angle", 1) == 0);
    json_free(node);
    expect_said(f, 0, "fit job.yaml -o fit --overwrite --set views.0.target=$PWD/target.exr", "no loss");
    assert_non_null(strstr(f->out, "0 0 0.6, turned 0 0 0 deg, scale 0.6"));
    char page[OUTPUT_BYTES];
    read_text("fit/report.html", page);
    assert_null(strstr(page, ">-0<"));
    static const char *const absent[] = {"Meshes:", "each entry weighted", "Dashed", "The way:"};
    assert_non_null(strstr(page, "Poses:")); // footnotes of what there is
    for (size_t i = 0; i < sizeof absent / sizeof absent[0]; i++) {
        assert_null(strstr(page, absent[i]));
    }
}

// What an override makes wrong is told as such, although it shows where the scene is known, and the status is that of usage.
static void overrides_are_told(void **state) {
    Fixture *f = *state;
    static const char *const cases[][2] = {
        {"parameters.0.name=red", "parameter 'red': the scene has none of this name; there is 'red.reflectance.value'"},
        {"parameters.0.name=none.*", "parameter 'none.*': matches no parameter of the scene"},
        {"parameters.0.bounds.0=7", "bounds: 7 is not below 1"},
        {"parameters.0.bounds=[5,6]", "the bounds 5 to 6 lie outside of the parameter's range, expected some of 0 to 1"},
        {"parameters.0={name: red.reflectance, parameterisation: rigid}", "parameterisations rigid and similarity are for poses"},
        {"parameters.0.carve=true", "carve is for grids of voxels"},
        {"parameters.0.regularisers.sparsity=1", "total_variation and sparsity are for grids"},
        {"levels.0.reduce=7", "level 0 reduces by 7, but sensor 0 has "},
        {"defines={light: zzz}", "bad value 'zzz'"},
    };
    write_job(f, "levels: [{from: 0}]\nviews: [{target: none.exr}]\nparameters: [{name: red.reflectance, bounds: [0, 1]}]\n");
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        char command[256], words[256];
        snprintf(command, sizeof command, "fit job.yaml -o fit --set views.0.target=$PWD/target.exr --set '%s'", cases[i][0]);
        expect_said(f, 2, command, cases[i][1]);
        snprintf(words, sizeof words, "--set %s: ", cases[i][0]);
        expect_said(f, 2, command, words);
    }
    expect_said(f, 1, "fit job.yaml -o fit --set scene=$PWD/job.yaml", "/job.yaml:1:1: not well-formed XML");
    assert_non_null(strstr(f->words, "--set scene="));
    expect_said(f, 1, "fit job.yaml --set folder=/none", "--set folder=/none: /none/start.xml: cannot open the scene");
    expect_said(f, 1, "fit job.yaml --set views.0.target=$PWD/target.exr --set output=/proc/none", "--set output=/proc/none: ");
}

// Where the job is wrong its line is told; where the command line is, the setting, and the exit status is that of usage.
static void places_of_jobs_are_told(void **state) {
    Fixture *f = *state;
    write_job(f, "views:\n  - sensor: 0\n    target: none.exr\nparameters: [red.reflectance]\n");
    expect_said(f, 1, "fit job.yaml -o fit", "job.yaml:7: " TEST_JOBS "/none.exr: cannot open");
    expect_said(f, 1, "fit job.yaml -o fit --set views.0.target=no.exr", "--set views.0.target=no.exr: " TEST_JOBS "/no.exr");
    expect_said(f, 2, "fit job.yaml -o fit --set views.0.target=start.xml", "--set views.0.target=start.xml: " TEST_JOBS);
    expect_said(f, 1, "fit job.yaml -o fit --set scene=no.xml", "--set scene=no.xml: " TEST_JOBS "/no.xml: cannot open the scene");
    expect_said(f, 2, "fit job.yaml -o fit --spp 1", "--spp 1: spp = 1, expected 2 to 65536");
    expect_said(f, 2, "fit job.yaml -o fit --set lss=l1", "--set lss=l1: unknown key 'lss', did you mean 'loss'?");
    expect_said(f, 2, "fit job.yaml -o fit --set seed=[", "--set seed=[: ");
    expect_said(f, 2, "fit job.yaml -o fit --set views.5.target=a",
                "--set views.5.target=a: views is a list of 1, and '5' is no index");
    expect_said(f, 2, "fit job.yaml -o fit -D a=1 -D b=2 -D a=3", "-D: 'a' is defined twice");
    expect_said(f, 2, "fit job.yaml -o fit -D nothing=1", "the scene never uses '$nothing'");
    write_job(f, "defines: {nothing: 1}\nviews: [{target: none.exr}]\nparameters: [red.reflectance]\n");
    expect_said(f, 1, "fit job.yaml -o fit", "job.yaml:5: " TEST_JOBS "/start.xml:1:1: the parameter 'nothing' was given");
    write_job(f, "views: [{target: none.exr}]\nparameters:\n  - {name: red.reflectance, parameterisation: log, start: 0}\n");
    expect_said(f, 1, "fit job.yaml -o fit --set views.0.target=$PWD/target.exr",
                 "job.yaml:7: parameter 'red.reflectance': entry 0 starts at 0");
    write_job(f, "levels: [{from: 0, resolution: 4}]\nviews: [{target: none.exr}]\nparameters: [red.reflectance]\n");
    expect_said(f, 1, "fit job.yaml -o fit --set views.0.target=$PWD/target.exr", "job.yaml:5: levels have a 'resolution'");
    write_job(f, "load: none.xml\nviews: [{target: none.exr}]\nparameters: [red.reflectance]\n");
    expect_said(f, 1, "fit job.yaml -o fit", "job.yaml:5: " TEST_JOBS "/none.xml: cannot open the scene");
    write_job(f, "views: [{target: none.exr}]\nparameters: [red.reflectance]\n");
    JsonNode *node = fit_json(f, 2, "--set parameters.0=nothing");
    assert_string_equal(json_text(node, "kind", ""), "usage");
    json_free(node);
    expect_said(f, 1, "fit none.yaml", "none.yaml: cannot open");
    expect_said(f, 1, "render none.xml -o a.exr", "none.xml: cannot open the scene: No such file");
}

// Rows of a check are shown as they come, and once more in the table.
static void checks_show_their_rows(void **state) {
    Fixture *f = *state;
    expect(f, 0, "check %s --param red.reflectance.value --param metal.alpha.value --spp 16");
    const char *titles = strstr(f->words, "worst z");
    assert_non_null(titles);
    assert_non_null(strstr(titles, "red.reflectance.value"));
    assert_non_null(strstr(titles, "metal.alpha.value"));
    assert_non_null(strstr(f->out, "passed"));
    expect_said(f, 1, "check %s --param glass.eta.value", "needs the term 'specular'");
    expect(f, 0, "check %s --param red.reflectance.value --spp 16");
    assert_null(strstr(f->words, "worst z"));
    expect_said(f, 2, "render %s -o=a.exr", "-o=a.exr: a name follows without '='");
}

// Where a result goes is said once, and no picture is written onto a terminal.
static void outputs_are_plain(void **state) {
    Fixture *f = *state;
    expect_said(f, 2, "render %s -o x.exr -o y.exr", "-o is given twice, with 'x.exr' and 'y.exr'");
    expect_said(f, 2, "fit job.yaml -o fit -o fit", "-o is given twice");
    int terminal = posix_openpt(O_RDWR | O_NOCTTY);
    if (terminal < 0 || grantpt(terminal) || unlockpt(terminal)) {
        return; // a machine without terminals
    }
    char command[1024];
    snprintf(command, sizeof command, "'%s' render '%s' --spp 1 -o - >%s 2>words.txt", REYNOLDS_COMMAND, TEST_SCENE,
             ptsname(terminal));
    int status = system(command);
    close(terminal);
    assert_true(WIFEXITED(status) && WEXITSTATUS(status) == 2);
    assert_int_equal(system("grep -q 'standard output is a terminal' words.txt"), 0);
}

static void standard_input_has_a_name(void **state) {
    Fixture *f = *state;
    expect_said(f, 2, "render - -o x.exr", "'-': scenes are read from files; standard input is /dev/stdin");
    expect_said(f, 2, "fit -", "'-': jobs are read from files; standard input is /dev/stdin");
    expect_said(f, 2, "compare x.exr -", "'-': pictures are read from files; standard input is /dev/stdin");
    expect(f, 0, "params /dev/stdin <%s");
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(refusals_are_the_same),       cmocka_unit_test(what_may_be_needed_is_told),
        cmocka_unit_test(fits_show_what_the_job_says), cmocka_unit_test(places_of_jobs_are_told),
        cmocka_unit_test(overrides_are_told),          cmocka_unit_test(checks_show_their_rows),
        cmocka_unit_test(outputs_are_plain),           cmocka_unit_test(standard_input_has_a_name),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
