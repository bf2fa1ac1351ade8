// test_cli_edges.c: what users do at the edges: strange outputs, broken options, signals, unequal pictures.
#include "command.h"

#include <math.h>
#include <sys/stat.h>

static void outputs_may_be_devices(void **state) {
    Fixture *f = *state;
    expect(f, 0, "render %s -o /dev/null --spp 1");
    expect(f, 0, "render %s -o a.exr --spp 1");
    assert_int_equal(system("test -c /dev/null"), 0);
    assert_int_equal(system("ln -s real.exr link.exr"), 0);
    expect(f, 0, "render %s -o link.exr --spp 1");
    assert_int_equal(system("test -L link.exr && cmp -s real.exr a.exr"), 0);
}

// A closed terminal is an interrupt: the fit saves and can be resumed.
static void hangups_stop_fits(void **state) {
    (void)state;
    char command[4096];
    snprintf(command, sizeof command, "'%s' render '%s/truth.xml' -o target.exr --spp 16 2>words.txt",
             REYNOLDS_COMMAND, TEST_JOBS);
    assert_int_equal(system(command), 0);
    snprintf(command, sizeof command,
             "'%s' fit '%s/job.yaml' --set views.0.target=$PWD/target.exr --set iterations=1000000 -o fit >out.txt "
             "2>words.txt & fit=$!; tries=0; while [ ! -s fit/metrics.jsonl ] && [ $tries -lt 600 ]; do sleep 0.1; "
             "tries=$((tries + 1)); done; kill -HUP $fit; wait $fit",
             REYNOLDS_COMMAND, TEST_JOBS);
    int status = system(command);
    assert_true(WIFEXITED(status));
    assert_int_equal(WEXITSTATUS(status), 130);
    assert_int_equal(access("fit/checkpoint.bin", R_OK), 0);
}

// -D and --spp of a fit are entries of its job.
static void fits_take_the_common_options(void **state) {
    (void)state;
    char command[4096];
    snprintf(command, sizeof command,
             "'%s' render '%s/truth.xml' -o target.exr --spp 16 2>words.txt && '%s' fit '%s/job.yaml' --set "
             "views.0.target=$PWD/target.exr --set iterations=2 -o short -D 'red=0.2, 0.3, 0.4' --spp 8 >out.txt 2>words.txt"
             " && grep -q 'red: .0.2, 0.3, 0.4.' short/job.resolved.yaml && grep -q 'spp: 8' short/job.resolved.yaml",
             REYNOLDS_COMMAND, TEST_JOBS, REYNOLDS_COMMAND, TEST_JOBS);
    assert_int_equal(system(command), 0);
}

// What a fit wrote loads by name into the scene that it began with, and another fit goes on from there.
static void saved_values_load_by_name(void **state) {
    (void)state;
    char command[4096];
    snprintf(command, sizeof command,
             "r='%s'; j='%s'; $r render $j/truth.xml -o target.exr --spp 16 2>words.txt && $r fit $j/job.yaml --set "
             "views.0.target=$PWD/target.exr --set iterations=3 -o \"it's\" --spp 8 >out.txt 2>words.txt && "
             "$r render it\\'s/recovered.xml -o a.npy --spp 2 2>words.txt && $r render $j/start.xml --load "
             "it\\'s/recovered.xml -o b.npy --spp 2 2>words.txt && cmp a.npy b.npy && $r render $j/start.xml -o b.npy "
             "--spp 2 2>words.txt && ! cmp -s a.npy b.npy && $r fit $j/job.yaml --load it\\'s/recovered.xml --set "
             "views.0.target=$PWD/target.exr --set iterations=0 -o fourth >out.txt 2>words.txt && $r render "
             "fourth/recovered.xml -o b.npy --spp 2 2>words.txt && cmp a.npy b.npy",
             REYNOLDS_COMMAND, TEST_JOBS);
    assert_int_equal(system(command), 0);
}

static void usage_errors_are_json_too(void **state) {
    Fixture *f = *state;
    static const char *const wrong[] = {"render --json", "rendr %s --json", "render %s -o a.exr --json --spp 0",
                                        "grad %s --param red.reflectance.value:ad=1 --json", "--jsn --json"};
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        JsonNode *node = run_json(f, 2, wrong[i]);
        assert_non_null(json_text(node, "error", NULL));
        json_free(node);
    }
}

// Values of one parameter from a file must have its shape.
static void loaded_values_have_shapes(void **state) {
    Fixture *f = *state;
    expect(f, 0, "render %s -o picture.npy --spp 1");
    expect_words(f, 1, "render %s -o a.exr --spp 1 --load red.reflectance.value=picture.npy",
                 "picture.npy: 'red.reflectance.value' has the shape 24x32x3, expected 3 as in the scene");
    expect_words(f, 2, "render %s -o a.exr --spp 1 --load re.reflectance.value=picture.npy",
                 "no parameter 're.reflectance.value', did you mean 'red.reflectance.value'?");
    expect_words(f, 1, "params %s --load nowhere.xml", "nowhere.xml");
    expect_words(f, 2, "fit job.yaml --load a=b.npy", "a fit takes one saved scene");
}

static void words_help(void **state) {
    Fixture *f = *state;
    expect_words(f, 2, "grad %s --param red.reflectance.value:add", "'add' needs a value, such as add=1");
    expect_words(f, 2, "grad %s --param red.reflectance.value:file=", "'file' needs a value, such as file=TANGENT.npy");
    expect_words(f, 2, "grad %s --param red.reflectance.value --mode reverse --adjoint inf", "not a finite number");
    expect_words(f, 2, "grad %s --param red.reflectance.value --mode reverse --adjoint 1 -o d.exr", "folder");
    expect_words(f, 1, "render %s -o a.exr -D ball=", "attribute 'id' of <ref> is empty");
    expect_words(f, 2, "render %s -o a.exr --sensor 3", "--sensor: the scene has 1 sensor, counted from 0, got 3: 0 is 'camera'");
    expect_words(f, 2, "render %s -o a.exr --sensor cam", "--sensor: the scene has no sensor 'cam': 0 is 'camera'");
    expect_words(f, 2, "render %s -o a.exr --sensor ball", "--sensor: the scene has no sensor 'ball'");
    expect(f, 0, "render %s -o a.exr --sensor camera --spp 1");
    write_words("endless.xml", "<scene version='3.0.0'><bsdf type='plastic'><float name='int_ior' value='inf'/></bsdf></scene>");
    expect_words(f, 1, "info endless.xml", "bad value 'inf': numbers are finite, expected a number up to 3.4e38");
    write_words("mesh.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    write_words("mesh.xml", "<scene version='3.0.0'><integrator type='path'/><sensor type='perspective'/><shape type='obj' "
                            "id='m'><string name='filename' value='mesh.obj'/></shape></scene>");
    expect_words(f, 2, "grad mesh.xml --param m.to_world:rotate=0,1,0", "their vertices move: m.positions:rotate=0,1,0");
    expect_words(f, 0, "grad %s --param ball.to_world --spp 1", "ball.to_world moves all entries of the matrix; :translate=");
    expect(f, 0, "grad %s --param ball.to_world:add=1 --spp 1");
    assert_null(strstr(f->words, "entries"));
    expect(f, 0, "doctor");
    assert_true(strstr(f->out, "compiler   gcc ") || strstr(f->out, "lang"));
}

// What is no file is called what it is, and nobody waits for a pipe that no one writes to.
static void files_are_files(void **state) {
    Fixture *f = *state;
    static const char *const others[][2] = {{"folder", "'folder' is a folder, expected a file"},
                                            {"/dev/null", "'/dev/null' is a device, expected a file"},
                                            {"pipe", "'pipe' is a pipe or socket, expected a file"}};
    assert_int_equal(system("mkfifo pipe && mkdir folder && ln -s pipe link"), 0);
    expect_words(f, 1, "render pipe -o a.exr", "pipe: cannot read: is a pipe");
    expect_words(f, 1, "info link", "link: cannot read: is a pipe");
    expect_words(f, 1, "compare pipe pipe", "is a pipe");
    expect_words(f, 1, "fit pipe", "is a pipe");
    for (int i = 0; i < 3; i++) {
        char scene[512];
        snprintf(scene, sizeof scene,
                 "<scene version='3.0.0'><shape type='ply'><string name='filename' value='%s'/></shape></scene>", others[i][0]);
        write_words("mesh.xml", scene);
        expect_words(f, 1, "info mesh.xml", others[i][1]);
    }
    char command[4096]; // a shell's pipe has a writer
    snprintf(command, sizeof command, "cat '%s' | '%s' info /dev/stdin >out.txt 2>words.txt", TEST_SCENE, REYNOLDS_COMMAND);
    assert_int_equal(system(command), 0);
}

// Every column of the table, up to the blank line, begins where its title does.
static void tables_are_aligned(void **state) {
    Fixture *f = *state;
    expect(f, 0, "params %s");
    const char *value = strstr(f->out, " value"), *terms = strstr(f->out, " terms");
    assert_true(value && terms);
    long at[2] = {value - f->out, terms - f->out};
    for (const char *line = strchr(f->out, '\n'); line && line[1] > '\n'; line = strchr(line + 1, '\n')) {
        for (int k = 0; k < 2; k++) {
            assert_true((long)strcspn(line + 1, "\n") > at[k]);
            assert_true(line[1 + at[k]] == ' ' && line[2 + at[k]] != ' ');
        }
    }
}

static void write_pfm(const char *path, int width, float value) {
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    fprintf(file, "PF\n%d 1\n-1\n", width);
    for (int i = 0; i < 3 * width; i++) {
        float x = i == 0 ? value : 1;
        fwrite(&x, sizeof x, 1, file);
    }
    fclose(file);
}

static void unequal_pictures(void **state) {
    Fixture *f = *state;
    write_pfm("one.pfm", 2, 1);
    write_pfm("nan.pfm", 2, __builtin_nanf(""));
    write_pfm("wide.pfm", 3, 1);
    expect_words(f, 1, "compare one.pfm wide.pfm", "the sizes differ: one.pfm is 2 x 1, wide.pfm is 3 x 1");
    expect_words(f, 1, "compare nan.pfm one.pfm", "1 of 6 numbers of nan.pfm and 0 of one.pfm are not finite");
    JsonNode *node = run_json(f, 1, "compare one.pfm nan.pfm --json");
    assert_true(json_value(node, "mse", -1) == 0 && json_value(node, "mean_a", -1) == 1);
    assert_true(json_value(node, "nonfinite_a", -1) == 0 && json_value(node, "nonfinite_b", -1) == 1);
    json_free(node);
}

// A picture does not replace what the scene reads, under whatever name.
static void inputs_are_not_written(void **state) {
    Fixture *f = *state;
    write_words("lit.xml", "<scene version='3.0.0'><integrator type='path'/><sensor type='perspective'><film type='hdrfilm'>"
                           "<integer name='width' value='8'/><integer name='height' value='8'/></film></sensor>"
                           "<emitter type='envmap' id='sky'><string name='filename' value='sky.exr'/></emitter></scene>");
    expect(f, 0, "render %s -o sky.exr --spp 1");
    assert_int_equal(system("cp sky.exr before.exr && ln -s sky.exr alias.exr"), 0);
    expect_words(f, 2, "render lit.xml -o sky.exr --spp 1", "sky.exr is both read and written; name another file");
    expect_words(f, 2, "render lit.xml -o alias.exr --spp 1", "alias.exr is both read and written");
    expect_words(f, 2, "grad lit.xml --param sky.scale -o sky.exr --spp 16", "sky.exr is both read and written");
    expect_words(f, 2, "render lit.xml --load sky.data=before.exr -o before.exr --spp 1", "before.exr is both read");
    assert_int_equal(system("cmp -s sky.exr before.exr"), 0);
    // Tangents are read as well.
    expect(f, 0, "grad lit.xml --param sky.scale --mode reverse --adjoint 1 -o slopes --spp 16");
    expect(f, 0, "grad lit.xml --param sky.data --mode reverse --adjoint 1 -o slopes --spp 16");
    expect(f, 0, "grad lit.xml --param sky.data:file=slopes/sky.data.npy --spp 16");
    expect_words(f, 1, "grad lit.xml --param sky.data:file=slopes/sky.scale.npy --spp 16", "the parameter has");
    // Same numbers, other shape: a picture on its side.
    FILE *aside = fopen("aside.npy", "wb");
    const char header[] = "{'descr': '<f4', 'fortran_order': False, 'shape': (3, 1), }\n";
    const float numbers[3] = {1, 2, 3};
    assert_non_null(aside);
    fprintf(aside, "\x93NUMPY\x01%c%c%c%s", 0, (int)strlen(header), 0, header);
    fwrite(numbers, sizeof numbers, 1, aside);
    fclose(aside);
    expect_words(f, 1, "grad %s --param red.reflectance.value:file=aside.npy --spp 16", "has the shape 3x1, expected 3");
    expect_words(f, 2, "grad lit.xml --param sky.scale --mode reverse --adjoint 3e38 --spp 16", "is not finite");
    expect_words(f, 2, "grad lit.xml --param sky.scale:file=slopes/sky.scale.npy -o slopes/sky.scale.npy --spp 16",
                 "slopes/sky.scale.npy is both read and written");
    expect_words(f, 2, "grad lit.xml --param sky.scale:file=slopes/sky.scale.npy --mode reverse --adjoint 1 -o slopes --spp 16",
                 "slopes/sky.scale.npy is both read and written");
    expect(f, 0, "render lit.xml -o other.exr --spp 1");
    // What is included is read, too.
    write_words("part.xml", "<scene version='3.0.0'><bsdf type='diffuse' id='grey'/></scene>");
    write_words("whole.xml", "<scene version='3.0.0'><include filename='part.xml'/></scene>");
    expect_words(f, 2, "convert whole.xml part.xml", "part.xml is both read and written");
}

// Pictures that reach out of their slot's range are used as they are, and said.
static void pictures_out_of_range_are_told(void **state) {
    Fixture *f = *state;
    write_pfm("below.pfm", 2, -5);
    write_pfm("within.pfm", 2, 0.5f);
    write_words("picture.xml", "<scene version='3.0.0'><integrator type='path'/><sensor type='perspective' id='eye'><film "
                               "type='hdrfilm'><integer name='width' value='4'/><integer name='height' value='4'/></film></sensor>"
                               "<sensor type='perspective'><film type='hdrfilm'><integer name='width' value='2'/><integer "
                               "name='height' value='2'/></film></sensor><emitter type='constant'/><shape type='rectangle'><bsdf "
                               "type='diffuse' id='floor'><texture type='bitmap' name='reflectance'><string name='filename' "
                               "value='$file'/><boolean name='raw' value='true'/></texture></bsdf></shape></scene>");
    expect_words(f, 0, "render picture.xml -D file=below.pfm -o out.exr --spp 1",
                 "warning: 1 of the 6 numbers of shape_0.bsdf.reflectance.data lie outside of 0 to 1, and go from -5 to 1");
    expect(f, 0, "render picture.xml -D file=within.pfm -o out.exr --spp 1 --sensor sensor_1");
    assert_null(strstr(f->words, "warning"));
    expect_words(f, 2, "render picture.xml -D file=within.pfm -o out.exr --spp 1 --sensor sensor_0", "no sensor 'sensor_0'");
}

// All channels go into EXR and NPY files, the first picture into PNG; readers of R G B find that one, and so do derivatives.
static void several_integrators(void **state) {
    Fixture *f = *state;
    static const char head[] = "<scene version='3.0.0'>",
                      inside[] = "<integrator type='$first' name='a'/><integrator type='direct' name='b'/><string name='aovs' "
                                 "value='dd:depth'/></integrator>",
                      rest[] = "<sensor type='perspective'><film type='hdrfilm'><integer name='width' value='6'/><integer "
                               "name='height' value='4'/></film></sensor><emitter type='constant'/><shape type='sphere'><point "
                               "name='center' x='0' y='0' z='4'/><bsdf type='diffuse' id='grey'/></shape></scene>";
    char text[1024];
    snprintf(text, sizeof text, "%s<default name='first' value='path'/><integrator type='aov'>%s%s", head, inside, rest);
    write_words("several.xml", text);
    snprintf(text, sizeof text, "%s<integrator type='path'/>%s", head, rest);
    write_words("alone.xml", text);
    expect(f, 0, "render several.xml -o several.exr --spp 4");
    expect(f, 0, "render several.xml -o several.png --spp 4");
    expect(f, 0, "render several.xml -o several.npy --spp 4");
    expect(f, 0, "render alone.xml -o alone.exr --spp 4");
    JsonNode *node = run_json(f, 0, "compare several.exr alone.exr --json");
    assert_true(json_value(node, "mse", 1) == 0);
    json_free(node);
    expect_said(f, 0, "info several.xml", "6 x 4 pixels, R G B a.R a.G a.B a.A b.R b.G b.B b.A dd.T");
    node = run_json(f, 0, "info alone.xml --json");
    assert_string_equal(json_get(node, "channels")->first->text, "R");
    assert_string_equal(json_get(node, "film_channels")->first->first->next->text, "G");
    json_free(node);
    expect_words(f, 0, "grad several.xml --param grey.reflectance.value --spp 16",
                 "derivatives: several.xml:1: 'aov' holds 2 integrators: R G B and derivatives are those of the first, 'path'");
    expect_words(f, 1, "grad several.xml -D first=depth --param grey.reflectance.value --spp 16",
                 "'depth' has no derivatives, 'path' has: of several, put one such first");
    expect(f, 0, "render several.xml -o several.exr --spp 4");
    assert_null(strstr(f->words, "derivatives"));
}

// Parameters have the further names of what they belong to.
static void aliases_name_parameters(void **state) {
    Fixture *f = *state;
    write_words("alias.xml", "<scene version='3.0.0'><integrator type='path'/><sensor type='perspective'><film type='hdrfilm'>"
                             "<integer name='width' value='2'/><integer name='height' value='2'/></film></sensor><bsdf "
                             "type='twosided' id='white'><bsdf type='diffuse'/></bsdf><alias id='white' as='blanc'/><shape "
                             "type='rectangle'><ref id='blanc'/></shape></scene>");
    expect(f, 0, "grad alias.xml --param white.brdf_0.reflectance.value --spp 16");
    expect(f, 0, "grad alias.xml --param blanc.brdf_0.reflectance.value --spp 16");
}

// What a pattern fits and cannot move is listed; what is asked for by name must be there.
static void patterns_pass_over_bounds(void **state) {
    Fixture *f = *state;
    write_words("bounds.xml", "<scene version='3.0.0'><integrator type='path'><integer name='max_depth' value='2'/></integrator>"
                              "<sensor type='perspective'><film type='hdrfilm'><integer name='width' value='8'/>"
                              "<integer name='height' value='8'/></film></sensor><emitter type='constant'/><shape type='sphere'>"
                              "<point name='center' x='0' y='0' z='4'/><bsdf type='diffuse' id='pure'><rgb name='reflectance' "
                              "value='0, 1, 0.5'/></bsdf></shape></scene>");
    expect_words(f, 1, "check bounds.xml --param pure.reflectance.value:add=1 --spp 16", "the bounds leave no room to move");
    JsonNode *node = run_json(f, 0, "check bounds.xml --param '*:add=1' --spp 16 --json");
    const JsonNode *first = json_get(node, "directions")->first;
    assert_true(first && first->next && strstr(f->out, "the bounds leave no room to move"));
    json_free(node);
    // By itself it finds a way inwards.
    node = run_json(f, 0, "check bounds.xml --param pure.reflectance.value --spp 64 --json");
    assert_string_equal(json_text(json_get(node, "directions")->first, "verdict", ""), "ok");
    assert_true(fabs(json_value(json_get(node, "directions")->first, "derivative", 0)) > 1e-3);
    assert_non_null(strstr(f->words, "on both of its bounds"));
    json_free(node);
}

// A report of somebody else in a folder without a fit stays.
static void fits_replace_no_foreign_files(void **state) {
    Fixture *f = *state;
    char arguments[2048], fit[2048];
    snprintf(arguments, sizeof arguments, "render '%s/truth.xml' -o target.exr --spp 16", TEST_JOBS);
    expect(f, 0, arguments);
    snprintf(fit, sizeof fit, "fit '%s/job.yaml' --set views.0.target=$PWD/target.exr --set iterations=1 -o mine", TEST_JOBS);
    assert_int_equal(mkdir("mine", 0777), 0);
    write_words("mine/report.html", "somebody's");
    write_words("mine/notes.txt", "somebody's");
    expect_words(f, 2, fit, "mine/report.html is there already, and no fit is in this folder that wrote it; --overwrite");
    assert_int_equal(system("grep -q somebody mine/report.html && test ! -e mine/job.resolved.yaml"), 0);
    snprintf(arguments, sizeof arguments, "%s --set report_spp=0", fit);
    expect(f, 0, arguments); // writes no report
    assert_int_equal(system("grep -q somebody mine/report.html && rm -r mine"), 0);
    assert_int_equal(mkdir("mine", 0777), 0);
    write_words("mine/report.html", "somebody's");
    snprintf(arguments, sizeof arguments, "%s --overwrite", fit);
    expect(f, 0, arguments);
    assert_int_equal(system("grep -q '<html' mine/report.html && rm -r mine && mkdir mine"), 0);
    write_words("mine/notes.txt", "somebody's");
    expect(f, 0, fit);
}

// Differences of what moves are of fresh paths: there is no second comparison, and no word of one.
static void fresh_paths_are_compared_where_others_were(void **state) {
    Fixture *f = *state;
    const char *check = "check %s --param ball.to_world:translate=1,0,0 --spp 32";
    expect(f, 0, check);
    assert_null(strstr(f->out, "fresh z up to"));
    assert_null(strstr(f->out, "-0.00 "));
    assert_non_null(strstr(f->out, "      - "));
    JsonNode *node = run_json(f, 0, "check %s --param ball.to_world:translate=1,0,0 --spp 32 --json");
    assert_non_null(strstr(f->out, "\"fresh_z\": null"));
    json_free(node);
    expect(f, 0, "check %s --param white.reflectance.value --spp 32");
    assert_non_null(strstr(f->out, "fresh z up to 5"));
}

// A job over the box.
static void write_job(const char *path, const char *parameters) {
    char text[1024];
    snprintf(text, sizeof text, "scene: '%s'\nviews: [{target: target.exr, sensor: 0}]\nspp: 64\nloss: {type: l2}\niterations: 20\n"
             "optimizer: {learning_rate: 0.02}\nreport_spp: 2\nimage_every: 0\nparameters: %s\n", TEST_SCENE, parameters);
    write_words(path, text);
}

// The end says what was done, whether it was enough, and how long this run and all of them took.
static void ends_of_fits_are_told(void **state) {
    Fixture *f = *state;
    expect(f, 0, "render %s -o target.exr --spp 16");
    write_job("end.yaml", "[{name: white.reflectance.value, start: [0.1, 0.2, 0.3]}]");
    expect_words(f, 0, "fit end.yaml -o end",
                 "the loss was still falling when the iterations ended: --resume --set iterations=40 goes on");
    assert_null(strstr(f->out, "all runs"));
    assert_int_equal(system("grep -q 'loss was still falling' end/report.html"), 0);
    expect_words(f, 0, "fit end.yaml -o end --resume",
                 "nothing was left to do: 20 iterations were done already");
    assert_non_null(strstr(f->out, "in this run, "));
    expect_words(f, 0, "fit end.yaml -o end --resume --set iterations=6",
                 "nothing was left to do: 20 iterations were done already");
    JsonNode *node = run_json(f, 0, "fit end.yaml -o end --resume --set iterations=21 --json");
    assert_true(json_value(node, "iterations_before", -1) == 20 && json_value(node, "iterations", -1) == 21);
    assert_true(json_value(node, "seconds_before", -1) > 0);
    assert_true(json_value(node, "seconds", -1) > json_value(node, "seconds_before", -1));
    assert_null(strstr(f->words, "nothing was left"));
    json_free(node);
    write_job("flat.yaml", "[white.reflectance.value]"); // begins at the truth: nothing to fall to
    expect(f, 0, "fit flat.yaml -o flat");
    assert_null(strstr(f->words, "falling"));
    assert_int_not_equal(system("grep -q 'still falling' flat/report.html"), 0);
    // Steps that are too long end where losses no longer change, too, but have not converged.
    node = run_json(f, 0, "fit flat.yaml -o far --set \"optimizer={type: sgd, learning_rate: 1000}\" --set \"stop={window: 5}\" "
                          "--set iterations=100 --spp 8 --json");
    assert_true(json_value(node, "iterations", 0) == 100);
    assert_true(strstr(f->out, "\"converged\": false") && strstr(f->out, "\"rose\": true"));
    assert_non_null(strstr(f->words, "warning: the loss rose to more than twice"));
    json_free(node);
}

// Patterns pass over what moves, and a pose counts as what it is free to do.
static void poses_are_named(void **state) {
    Fixture *f = *state;
    expect(f, 0, "render %s -o target.exr --spp 16");
    write_job("poses.yaml", "['*.to_world']");
    expect_words(f, 1, "fit poses.yaml -o poses", "parameter '*.to_world': matches only ");
    assert_non_null(strstr(f->words, "which move things or have no derivative: a pattern passes over those; name them one by one"));
    write_job("poses.yaml", "['nothing.*']");
    expect_words(f, 1, "fit poses.yaml -o poses", "matches no parameter of the scene");
    write_job("poses.yaml", "[{name: ball.to_world, parameterisation: rigid}]");
    JsonNode *node = run_json(f, 0, "fit poses.yaml -o poses --set iterations=2 --json");
    assert_true(json_value(node, "numbers", -1) == 6);
    json_free(node);
    assert_int_equal(system("grep -q '>6 unknown numbers in 1 parameter,' poses/report.html"), 0);
    // In the report place and rotation stand below each other, and are charts of three colours; the scale stays.
    assert_int_equal(system("grep -q ',<br>turned ' poses/report.html && grep -q 'position <b class=\"key c0\"></b>x' "
                            "poses/report.html && grep -q 'rotation: axis times angle' poses/report.html && "
                            "! grep -q ', scale <b' poses/report.html"), 0);
    write_job("poses.yaml", "[{name: ball.to_world, parameterisation: similarity}]");
    expect(f, 0, "fit poses.yaml -o similar --set iterations=2");
    assert_int_equal(system("grep -q '>7 unknown numbers in 1 parameter,' similar/report.html && "
                            "grep -q ', scale <b' similar/report.html"), 0);
    // Curves of four numbers and more have a colour each.
    write_pfm("four.pfm", 2, 1);
    write_words("wide.xml", "<scene version='3.0.0'><integrator type='path'/><sensor type='perspective'><film type='hdrfilm'>"
                            "<integer name='width' value='32'/><integer name='height' value='24'/></film><transform "
                            "name='to_world'><lookat origin='0,0,3' target='0,0,0' up='0,1,0'/></transform></sensor>"
                            "<emitter type='constant'/><shape type='rectangle'><bsdf type='diffuse' id='b'><texture "
                            "type='bitmap' name='reflectance'><string name='filename' value='four.pfm'/></texture></bsdf></shape>"
                            "</scene>");
    expect(f, 0, "fit poses.yaml -o wide --set iterations=2 --set scene=wide.xml --set parameters.0=b.reflectance.data");
    assert_int_equal(system("test $(grep -o 'stroke:hsl([0-9]*,60%,[0-9]*%)' wide/report.html | sort -u | wc -l) -eq 6"), 0);
}

// What would compare rounding with rounding is no check.
static void steps_that_floats_lose_are_refused(void **state) {
    Fixture *f = *state;
    expect_words(f, 1, "check %s --param white.reflectance.value --spp 16 --step 1e-8",
                 "a step of 1e-08 is lost in the rounding of the parameter's values, expected 6e-06 or more");
    expect(f, 0, "check %s --param white.reflectance.value --spp 16 --step 1e-4");
    expect_words(f, 1, "check %s --param white.reflectance.value:add=0 --spp 16",
                 "white.reflectance.value:add=0: the direction is zero, expected one that moves the parameter");
}

// All texels of a bump together move nothing: forward and reverse differ by the rounding of what cancels.
static void cancelling_texels_are_no_error(void **state) {
    Fixture *f = *state;
    write_pfm("heights.pfm", 4, 0.3F);
    write_words("bump.xml",
                "<scene version='3.0.0'><default name='z' value='3'/><integrator type='path'/><sensor type='perspective'>"
                "<transform name='to_world'><lookat origin='0,-1,$z' target='0,0,0' up='0,1,0'/></transform><film type='hdrfilm'>"
                "<integer name='width' value='16'/><integer name='height' value='16'/></film></sensor><shape "
                "type='rectangle'><bsdf type='bumpmap' id='b'><texture type='bitmap'><string name='filename' value='heights.pfm'/>"
                "<boolean name='raw' value='true'/></texture><bsdf type='diffuse'/></bsdf></shape><emitter type='point'>"
                "<point name='position' x='1' y='0' z='2'/><rgb name='intensity' value='9'/></emitter></scene>");
    static const char *const views[] = {"check bump.xml --param b.nested_texture.data --terms interior --spp 32 --json",
                                        "check bump.xml -D z=12 --param b.nested_texture.data --terms interior --spp 32 --json"};
    for (int i = 0; i < 2; i++) { // in all blocks, and in the four of the middle, brighter than the mean
        JsonNode *node = run_json(f, 0, views[i]);
        const JsonNode *row = json_get(node, "directions")->first;
        assert_string_equal(json_text(row, "verdict", ""), "no effect");
        assert_true(json_value(row, "reverse_error", 1) < 1e-5);
        json_free(node);
    }
}

// Where rough refraction ends moves with the index, and recorded paths do not cross it: differences take fresh paths.
static void ends_of_refraction_are_checked_afresh(void **state) {
    Fixture *f = *state;
    write_words("pane.xml",
                "<scene version='3.0.0'><integrator type='path'/><sensor type='perspective'><transform name='to_world'><lookat "
                "origin='0,3,2' target='0,0,0' up='0,1,0'/></transform><film type='hdrfilm'><integer name='width' value='16'/>"
                "<integer name='height' value='16'/><rfilter type='box'/></film></sensor><shape type='rectangle' id='pane'><bsdf "
                "type='roughdielectric'><string name='distribution' value='ggx'/><float name='alpha' value='0.3'/></bsdf></shape>"
                "<emitter type='constant'/></scene>");
    JsonNode *node = run_json(f, 0, "check pane.xml --param pane.bsdf.eta.value --step 0.1 --spp 16384 --json");
    const JsonNode *row = json_get(node, "directions")->first;
    assert_string_equal(json_text(row, "verdict", ""), "ok");
    assert_false(json_value(row, "replayed", 1)); // the derivative's own paths are off by 1.6 %: WRONG
    json_free(node);
    node = run_json(f, 0, "check pane.xml --param pane.bsdf.specular_reflectance.value --spp 64 --json");
    assert_true(json_value(json_get(node, "directions")->first, "replayed", 0));
    json_free(node);
}

// A light so strong that its picture overflows: the samples are dropped, and that is said.
static void dropped_samples_are_told(void **state) {
    Fixture *f = *state;
    FILE *file = fopen("bright.xml", "w");
    assert_non_null(file);
    fprintf(file, "<scene version='3.0.0'><integrator type='path'/><sensor type='perspective'><transform name='to_world'>"
                  "<lookat origin='0,0,3' target='0,0,0' up='0,1,0'/></transform><film type='hdrfilm'><integer "
                  "name='width' value='4'/><integer name='height' value='4'/></film></sensor><shape type='rectangle'/>"
                  "<emitter type='point'><point name='position' x='0' y='0' z='0.01'/><rgb name='intensity' "
                  "value='3e38'/></emitter></scene>");
    assert_int_equal(fclose(file), 0);
    expect_words(f, 0, "render bright.xml -o bright.exr --spp 4", "not finite and left out");
    expect(f, 0, "render %s -o a.exr --spp 1");
    assert_null(strstr(f->words, "warning"));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(outputs_may_be_devices), cmocka_unit_test(ends_of_refraction_are_checked_afresh),
        cmocka_unit_test(hangups_stop_fits),
        cmocka_unit_test(fits_take_the_common_options),
        cmocka_unit_test(usage_errors_are_json_too),
        cmocka_unit_test(saved_values_load_by_name),
        cmocka_unit_test(loaded_values_have_shapes),
        cmocka_unit_test(words_help),
        cmocka_unit_test(files_are_files),
        cmocka_unit_test(tables_are_aligned),
        cmocka_unit_test(unequal_pictures),
        cmocka_unit_test(steps_that_floats_lose_are_refused), cmocka_unit_test(cancelling_texels_are_no_error),
        cmocka_unit_test(inputs_are_not_written), cmocka_unit_test(patterns_pass_over_bounds),
        cmocka_unit_test(aliases_name_parameters),
        cmocka_unit_test(pictures_out_of_range_are_told),
        cmocka_unit_test(several_integrators),
        cmocka_unit_test(fits_replace_no_foreign_files),
        cmocka_unit_test(fresh_paths_are_compared_where_others_were),
        cmocka_unit_test(ends_of_fits_are_told),
        cmocka_unit_test(poses_are_named),
        cmocka_unit_test(dropped_samples_are_told),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
