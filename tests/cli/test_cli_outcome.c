// test_cli_outcome.c: what a fit says of itself: which loss it ended with, and what it finds wrong before it starts.
#include "command.h"

#include <math.h>
#include <signal.h>
#include <time.h>

// A job in the test's folder for the scenes of the test jobs; lines follow it.
static void write_job(Fixture *f, const char *lines) {
    char text[2048];
    if (access("target.exr", R_OK) != 0) {
        expect(f, 0, "render " TEST_JOBS "/truth.xml -o target.exr --spp 16");
    }
    snprintf(text, sizeof text, "scene: " TEST_JOBS "/start.xml\nspp: 8\nreport_spp: 2\nimage_every: 0\n"
             "views: [{target: target.exr}]\nparameters: [{name: red.reflectance.value, learning_rate: 0.05}]\n%s", lines);
    write_words("job.yaml", text);
}

// Losses of metrics.jsonl: their least, the mean of the last ten, and how many there are.
static int read_losses(const char *path, double *least, double *mean) {
    static char text[OUTPUT_BYTES];
    double losses[64], sum = 0;
    int count = 0;
    read_text(path, text);
    *least = INFINITY;
    for (const char *at = text; (at = strstr(at, "\"loss\":")) && count < 64; count++) {
        at += strlen("\"loss\":");
        losses[count] = strtod(at, NULL);
        *least = fmin(*least, losses[count]);
    }
    int window = count < 10 ? count : 10;
    for (int i = count - window; i < count; i++) {
        sum += losses[i] / window;
    }
    *mean = sum;
    return count;
}

static void expect_loss(Fixture *f, const char *arguments, const char *words, bool best) {
    double least, mean;
    char line[256];
    JsonNode *node = run_json(f, 0, arguments);
    assert_true(read_losses("out/metrics.jsonl", &least, &mean) > 0);
    assert_string_equal(json_text(node, "loss_is", ""), words);
    assert_float_equal(json_value(node, "loss", NAN), best ? least : mean, 1e-6 * fabs(mean));
    assert_true(least < mean);
    snprintf(line, sizeof line, "Loss %.4g, %s.", json_value(node, "loss", NAN), words);
    static char page[1 << 22];
    FILE *file = fopen("out/report.html", "rb");
    assert_non_null(file);
    page[fread(page, 1, sizeof page - 1, file)] = 0;
    fclose(file);
    assert_non_null(strstr(page, line));
    json_free(node);
    snprintf(line, sizeof line, "(%s)\n", words);
    expect(f, 0, "fit job.yaml -o out --resume");
    assert_non_null(strstr(f->out, line));
}

// With Adam it is a mean over iterations; L-BFGS, which uses the same samples always, shows that of the point that it took.
static void losses_are_explained(void **state) {
    Fixture *f = *state;
    write_job(f, "iterations: 12\n");
    expect_loss(f, "fit job.yaml -o out --json --overwrite", "mean of the last 10 iterations", false);
    write_job(f, "iterations: 6\n");
    expect_loss(f, "fit job.yaml -o out --json --overwrite", "mean of the last 6 iterations", false);
    write_job(f, "iterations: 8\noptimizer: {type: lbfgs, learning_rate: 0.2}\n");
    expect_loss(f, "fit job.yaml -o out --json --overwrite", "of the best point, which was taken", true);
    write_job(f, "iterations: 1\n");
    expect(f, 0, "fit job.yaml -o out --overwrite");
    assert_non_null(strstr(f->out, "(of the last iteration)"));
}

// The truth is opened when all is done: what is wrong with it is told then, and the report of what was found is there. That it is
// missing is told before.
static void truths_are_opened_last(void **state) {
    Fixture *f = *state;
    write_job(f, "iterations: 2\ntruth: {scene: wide.xml}\n");
    assert_int_equal(system("sed 's/value=\"32\"/value=\"40\"/' " TEST_JOBS "/start.xml >wide.xml"), 0);
    expect_words(f, 1, "fit job.yaml -o wide", "job.yaml:8: wide.xml: sensor 0 delivers 40 x 24, the scene's 32 x 24");
    assert_int_equal(access("wide/report.html", R_OK), 0);
    write_job(f, "iterations: 2\ntruth: {scene: nowhere.xml}\n");
    expect_words(f, 1, "fit job.yaml -o late", "job.yaml:8: nowhere.xml: cannot open");
    assert_int_not_equal(access("late", F_OK), 0);
    write_words("broken.xml", "<scene version='3.0.0'><shape type='spehre'/></scene>");
    expect_words(f, 1, "fit job.yaml -o broken --set truth.scene=broken.xml", "broken.xml:1:24: there is no shape 'spehre'");
    assert_int_equal(access("broken/report.html", R_OK), 0);
}

// A truth that gets the start's defines is the start.
static void truths_that_are_the_start_are_told(void **state) {
    Fixture *f = *state;
    static const char words[] = "all values of the truth equal the start";
    write_job(f, "iterations: 1\ndefines: {red: 0.5}\ntruth: {scene: " TEST_JOBS "/start.xml}\n");
    expect_words(f, 0, "fit job.yaml -o same", "all values of the truth equal the start: it got the job's 'defines'; does it need "
                                               "'truth.defines' of its own?");
    expect(f, 0, "fit job.yaml -o same --overwrite --set truth.defines.red=0.7");
    assert_null(strstr(f->words, words));
    expect(f, 0, "fit job.yaml -o same --overwrite --set parameters.1=lamp.emitter.radiance.value --set parameters.1.start=4");
    assert_null(strstr(f->words, words)); // of one it does not
    // an error of what is 0 is no percentage
    JsonNode *node = run_json(f, 0, "fit job.yaml -o same --overwrite --set 'truth.defines.red=0.5, 0, 0.5' --json");
    const JsonNode *row = json_get(node, "parameters")->first;
    assert_string_equal(json_text(row, "measure", ""), "largest_absolute");
    assert_true(json_value(row, "error", 0) > 0.4);
    json_free(node);
    expect(f, 0, "fit job.yaml -o same --overwrite --set 'truth.defines.red=0.5, 0, 0.5'");
    assert_non_null(strstr(f->out, " (absolute)\n"));
    assert_null(strstr(f->out, "%\n"));
}

// What would be found out in the first iteration is told before it.
static void mistakes_are_told_at_the_start(void **state) {
    Fixture *f = *state;
    write_job(f, "iterations: 2\n");
    expect_words(f, 2, "fit job.yaml -o no --set 'parameters=[views.7.exposure]'", "the job has no view 7, expected 0");
    expect_words(f, 2, "fit job.yaml -o no --set 'parameters=[views.1.exposure]' --set 'views.1={sensor: 0, target: target.exr, "
                       "held_out: true}'", "view 1 is held out: nothing that is fitted tells its exposure");
}

// What `grad` refuses, a fit refuses in the same words.
static void refusals_are_those_of_grad(void **state) {
    Fixture *f = *state;
    static char words[OUTPUT_BYTES];
    expect(f, 0, "render %s -D ball=veil -o target.exr --spp 4");
    expect(f, 1, "grad %s -D ball=veil --param floor.to_world:translate=1,0,0");
    snprintf(words, sizeof words, "%s", f->words + strlen("reynolds: "));
    words[strcspn(words, "\n")] = 0;
    assert_non_null(strstr(words, "needs the term 'specular', which does not cover this yet"));
    write_words("veil.yaml", "scene: " TEST_SCENE "\ndefines: {ball: veil}\nviews: [{target: target.exr}]\niterations: 1\n"
                              "spp: 2\nreport_spp: 0\nparameters:\n  - red.reflectance.value\n  - floor.to_world\n");
    expect_words(f, 1, "fit veil.yaml -o veil", words);
    assert_non_null(strstr(f->words, "veil.yaml:9: parameter 'floor.to_world': "));
    assert_non_null(strstr(f->words, "(in a job, 'terms: interior')"));
    expect_words(f, 0, "fit veil.yaml -o veil --set terms=interior",
                 "incomplete on request: 'terms: interior' leaves out primary,indirect,specular, which the gradient of "
                 "floor.to_world needs\n");
}

// What a restricted gradient lacks is named, and why more cannot be had where that is so.
static void restricted_gradients_say_what_they_lack(void **state) {
    Fixture *f = *state;
    expect_words(f, 0, "grad %s --param floor.to_world:translate=1,0,0 --spp 16 --terms interior,primary",
                 "incomplete on request: --terms interior,primary leaves out indirect\n");
    assert_null(strstr(f->words, "without --terms"));
    expect_words(f, 0, "grad %s -D ball=veil --param floor.to_world:translate=1,0,0 --spp 16 --terms interior",
                 "without --terms it is refused: the gradient of floor.to_world needs the term 'specular'");
    JsonNode *node = run_json(f, 0, "grad %s --param floor.to_world:translate=1,0,0 --spp 16 --terms interior,indirect --json");
    assert_string_equal(json_get(node, "left_out")->first->text, "primary");
    assert_null(json_get(node, "left_out")->first->next);
    json_free(node);
}

// So does a check of one, whose differences lack nothing.
static void restricted_checks_say_what_they_lack(void **state) {
    Fixture *f = *state;
    expect(f, 0, "check %s --param red.reflectance.value --spp 16 --terms interior");
    assert_null(strstr(f->out, "leaves out"));
    JsonNode *node = run_json(f, run(f, "check %s --param camera.x_fov --spp 16 --terms interior --json"),
                              "check %s --param camera.x_fov --spp 16 --terms interior --json");
    const JsonNode *left = json_get(json_get(node, "directions")->first, "left_out");
    assert_string_equal(left->first->text, "primary");
    assert_string_equal(left->first->next->text, "indirect");
    json_free(node);
    run(f, "check %s --param camera.x_fov --spp 16 --terms interior");
    assert_non_null(strstr(f->out, "--terms leaves out primary,indirect of what 1 of 1 need, which the differences have\n"));
}

// How often a text holds a word.
static int occurrences(const char *text, const char *word) {
    int count = 0;
    for (; (text = strstr(text, word)); text += strlen(word)) {
        count++;
    }
    return count;
}

// On a terminal that shows rows as they are ready, a table of the same rows would be one too many.
static void rows_of_check_stand_once(void **state) {
    Fixture *f = *state;
    static char text[OUTPUT_BYTES];
    const char *check = "check %s --spp 16 --param red.reflectance.value --param white.reflectance.value";
    expect(f, 0, check);
    assert_int_equal(occurrences(f->out, "red.reflectance.value") + occurrences(f->words, "red.reflectance.value"), 2);
    if (system("script -qc true /dev/null >nothing 2>&1") != 0) {
        return; // no terminal can be had
    }
    char command[2048], filled[1024];
    snprintf(filled, sizeof filled, check, TEST_SCENE);
    snprintf(command, sizeof command, "script -qec \"'%s' %s\" /dev/null >pty.txt </dev/null", REYNOLDS_COMMAND, filled);
    assert_int_equal(system(command), 0);
    read_text("pty.txt", text);
    assert_int_equal(occurrences(text, "derivative"), 1);
    assert_int_equal(occurrences(text, "white.reflectance.value"), 1 + occurrences(text, "open"));
    assert_int_equal(occurrences(text, "passed: "), 1);
}

// A scene that is not done yet is shown as far as it goes.
static void infos_say_what_is_missing(void **state) {
    Fixture *f = *state;
    write_words("empty.xml", "<scene version='3.0.0'></scene>");
    write_words("ball.xml", "<scene version='3.0.0'><integrator type='direct'/><shape type='sphere'/></scene>");
    expect(f, 0, "info empty.xml");
    static const char *const lacks[] = {"missing: no integrator", "missing: no sensor", "missing: no shape", "missing: no emitter"};
    for (size_t i = 0; i < sizeof lacks / sizeof *lacks; i++) {
        assert_non_null(strstr(f->out, lacks[i]));
    }
    static const char *const absent[] = {"bounds", "max_depth", "samples per pixel"};
    for (size_t i = 0; i < sizeof absent / sizeof *absent; i++) {
        assert_null(strstr(f->out, absent[i]));
    }
    expect(f, 0, "info ball.xml");
    assert_non_null(strstr(f->out, "direct, max_depth 2"));
    assert_int_equal(occurrences(f->out, "missing: "), 2);
    JsonNode *node = run_json(f, 0, "info empty.xml --json");
    assert_int_equal(json_get(node, "integrator")->kind, JSON_NULL);
    assert_int_equal(json_get(node, "sample_count")->kind, JSON_NULL);
    assert_string_equal(json_get(node, "missing")->first->text, "integrator");
    json_free(node);
    expect(f, 0, "info %s");
    assert_null(strstr(f->out, "missing"));
    write_words("dark.xml", "<scene version='3.0.0'><integrator type='direct'/><sensor type='perspective'/>"
                            "<shape type='sphere'/></scene>");
    expect_words(f, 0, "render dark.xml -o a.exr --spp 1", "the picture is black: the scene has no emitter");
    expect_words(f, 1, "render empty.xml -o a.exr", "empty.xml: the scene has no integrator, expected one such as");
    expect_words(f, 1, "render ball.xml -o a.exr", "ball.xml: the scene has no sensor to render with");
    FILE *file = fopen("wrong.npy", "wb"); // 2, where 1 is the most
    assert_non_null(file);
    fwrite("\x93NUMPY\1\0\x46\0", 1, 10, file);
    fprintf(file, "%-69s\n", "{'descr': '<f4', 'fortran_order': False, 'shape': (3,), }");
    fwrite((float[3]){0.5f, 2, 0.5f}, sizeof(float), 3, file);
    fclose(file);
    expect_words(f, 1, "render %s -o a.exr --load red.reflectance.value=wrong.npy",
                 "wrong.npy: red.reflectance.value[1] = 2, expected a number in [0, 1]");
}

// A batch system that ends a job gets the status of an interruption, and no picture is left half written.
static void terminations_are_interruptions(void **state) {
    (void)state;
    static const char *const calls[] = {"render '" TEST_SCENE "' -o slow.exr --spp 1000000",
                                        "grad '" TEST_SCENE "' --param red.reflectance.value -o slow.exr --spp 1000000",
                                        "grad '" TEST_SCENE "' --param red.reflectance.value --mode reverse --adjoint 1 "
                                        "-o slow.exr.d --spp 1000000",
                                        "check '" TEST_SCENE "' --param red.reflectance.value --spp 1000000"};
    for (size_t i = 0; i < sizeof calls / sizeof *calls; i++) {
        char command[1024];
        snprintf(command, sizeof command, "timeout --preserve-status -s TERM 1 '%s' %s >out.txt 2>words.txt", REYNOLDS_COMMAND,
                 calls[i]);
        int status = system(command);
        assert_true(WIFEXITED(status));
        assert_int_equal(WEXITSTATUS(status), 130);
        assert_int_equal(system("grep -q 'reynolds: interrupted' words.txt && [ ! -e slow.exr ] && [ ! -e slow.exr.d ]"), 0);
    }
}

// A fit says that it goes on for a moment, saves, and can be resumed. It is interrupted in its first iterations, however long a
// slow machine takes to come there.
static void interrupted_fits_are_saved(void **state) {
    Fixture *f = *state;
    write_job(f, "iterations: 100000\n");
    pid_t child = fork();
    assert_int_not_equal(child, -1);
    if (!child) {
        if (freopen("out.txt", "w", stdout) && freopen("words.txt", "w", stderr)) {
            execl(REYNOLDS_COMMAND, "reynolds", "fit", "job.yaml", "-o", "cut", (char *)NULL);
        }
        _exit(1);
    }
    int status;
    while (system("[ -s cut/metrics.jsonl ]") != 0) { // the first iteration is done
        assert_int_equal(waitpid(child, &status, WNOHANG), 0);
        nanosleep(&(struct timespec){.tv_nsec = 20000000}, NULL);
    }
    kill(child, SIGINT);
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_true(WIFEXITED(status));
    assert_int_equal(WEXITSTATUS(status), 130);
    assert_int_equal(system("grep -q 'then saving' words.txt && [ -s cut/checkpoint.bin ]"), 0);
}

// A stream that is closed is no place for a file: no word goes into what a fit writes.
static void closed_streams_stay_closed(void **state) {
    Fixture *f = *state;
    char command[1024];
    write_job(f, "iterations: 1\n");
    snprintf(command, sizeof command, "rm -rf closed; '%s' fit job.yaml -o closed <&- >&- 2>&-", REYNOLDS_COMMAND);
    int status = system(command);
    assert_true(WIFEXITED(status) && WEXITSTATUS(status) == 1); // the table was not delivered
    assert_int_equal(access("closed/report.html", R_OK), 0);
    assert_int_equal(system("! grep -rq 'iteration 1/1\\|making the table' closed"), 0);
}

// Files of another kind, and what the user wrote.
static void mistakes_are_recognised(void **state) {
    Fixture *f = *state;
    write_job(f, "iterations: 1\n");
    write_words("tab.yaml", "scene: a.xml\nviews:\n\t- {target: a.exr}\n");
    expect_words(f, 1, "fit tab.yaml", "tab.yaml:3: a tab in the indentation, expected spaces");
    expect_words(f, 1, "fit %s", "this is XML, as scenes are; expected a job, whose key 'scene' names one");
    expect_words(f, 1, "render job.yaml -o a.exr", "a scene begins with <scene version=");
    expect_words(f, 2, "render '' -o a.exr", "the name of a file is empty");
    expect_words(f, 2, "fit job.yaml -o ''", "-o: the name is empty");
    expect_words(f, 2, "fit job.yaml -o -", "a fit writes a folder");
    expect_words(f, 1, "fit job.yaml -o nowhere --resume", "nowhere: there is no such folder, and so no fit to resume");
    assert_int_equal(system("mkdir -p no_fit"), 0);
    expect_words(f, 1, "fit job.yaml -o no_fit --resume", "no_fit: this folder holds no fit to resume");
    expect_words(f, 2, "fit job.yaml -D blue=1", "-D blue=1: ");
    expect_words(f, 2, "fit job.yaml --spp 1", "--spp 1: spp = 1, expected 2 to");
    expect_words(f, 1, "fit job.yaml --load no.xml", "--load no.xml: ");
    expect_words(f, 2, "fit job.yaml --set defines.blue=1", "--set defines.blue=1: ");
    expect_words(f, 2, "fit job.yaml --set parameters.0.start=nan", "start: nan, expected a finite number");
    expect_words(f, 2, "fit job.yaml --set parameters.0.start=[1,2]", "--set parameters.0.start=[1,2]: parameter 'red.reflec");
    expect_words(f, 2, "fit job.yaml --set parameters.0.start=target.exr", "--set parameters.0.start=target.exr: par");
    assert_int_equal(system("sed 's/learning_rate: 0.05/parameterisation: logit, bounds: [0, 1]/' job.yaml >logit.yaml"), 0);
    expect_words(f, 2, "fit logit.yaml --set parameters.0.bounds=[0.1,0.3]", "--set parameters.0.bounds=[0.1,0.3]: parameter "
                       "'red.reflectance.value': entry 0 starts at 0.5, outside of its bounds 0.1 to 0.3");
    expect_words(f, 2, "fit logit.yaml --set parameters.0.bounds=[0.5,0.9]", "--set parameters.0.bounds=[0.5,0.9]: parameter ");
    expect_words(f, 2, "render %s -o a.exr --load target.exr", "whose values are in 'target.exr'? expected NAME=target.exr");
    expect_words(f, 2, "render %s -o a.exr --load red.reflectance.value=", "expected FILE.xml or NAME=FILE");
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(losses_are_explained),
        cmocka_unit_test(truths_are_opened_last),
        cmocka_unit_test(truths_that_are_the_start_are_told),
        cmocka_unit_test(mistakes_are_told_at_the_start),
        cmocka_unit_test(refusals_are_those_of_grad),
        cmocka_unit_test(restricted_gradients_say_what_they_lack),
        cmocka_unit_test(restricted_checks_say_what_they_lack),
        cmocka_unit_test(rows_of_check_stand_once),
        cmocka_unit_test(infos_say_what_is_missing),
        cmocka_unit_test(terminations_are_interruptions),
        cmocka_unit_test(interrupted_fits_are_saved),
        cmocka_unit_test(closed_streams_stay_closed),
        cmocka_unit_test(mistakes_are_recognised),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
