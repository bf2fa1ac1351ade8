// test_cli_notes.c: what the command tells beside its numbers, in words and with --json.
#include "command.h"

#include <math.h>

// A ball that two cameras see, the second one with an id.
static void write_scene(void) {
    write_words("two.xml",
                "<scene version='3.0.0'><integrator type='path'><integer name='max_depth' value='2'/></integrator>\n"
                "<sensor type='perspective'><film type='hdrfilm'><integer name='width' value='8'/>\n"
                "<integer name='height' value='8'/></film>\n"
                "<transform name='to_world'><lookat origin='0,0,4' target='0,0,0' up='0,1,0'/></transform></sensor>\n"
                "<sensor type='perspective' id='side'><film type='hdrfilm'><integer name='width' value='8'/>\n"
                "<integer name='height' value='6'/></film>\n"
                "<transform name='to_world'><lookat origin='4,0,0' target='0,0,0' up='0,1,0'/></transform></sensor>\n"
                "<emitter type='constant'/><bsdf type='diffuse' id='idle'/>\n"
                "<shape type='sphere' id='ball'><bsdf type='diffuse' id='grey'/></shape></scene>\n");
}

static void expect_note(Fixture *f, const char *arguments, const char *words) {
    JsonNode *node = run_json(f, 0, arguments);
    const JsonNode *notes = json_get(node, "notes");
    assert_non_null(notes);
    if (!words) {
        assert_null(notes->first);
    } else if (!notes->first || !strstr(notes->first->text, words)) {
        fail_msg("reynolds %s: '%s', expected '%s'", arguments, notes->first ? notes->first->text : "no note", words);
    }
    json_free(node);
    assert_true(!words || strstr(f->words, words));
}

// A derivative is 0 with respect to the numbers of a camera that is not looked through: that is told.
static void other_cameras_are_told(void **state) {
    Fixture *f = *state;
    write_scene();
    static const char words[] = "the picture of sensor 0 does not depend on side.to_world, which belongs to another sensor: its";
    expect_note(f, "grad two.xml --param side.to_world:translate=1,0,0 --spp 16 --json", words);
    expect_note(f, "grad two.xml --param side.to_world:translate=1,0,0 --spp 16 --mode reverse --adjoint 1 --json", words);
    expect_note(f, "grad two.xml --param side.to_world:translate=1,0,0 --spp 16 --sensor side --json", NULL);
    expect_note(f, "check two.xml --param side.to_world:translate=1,0,0 --spp 16 --json", words);
    expect_note(f, "grad two.xml --param sensor_0.x_fov --sensor 1 --spp 16 --json",
                "the picture of sensor 1 ('side') does not depend on sensor_0.x_fov");
    expect_note(f, "grad two.xml --param idle.reflectance.value --spp 16 --json", "nothing in the scene uses idle.reflectance");
    expect(f, 0, "check two.xml --all --spp 16");
    assert_non_null(strstr(f->words, "does not depend on side.to_world, side.x_fov, side.principal_point_offset_x and 1 more, "
                                     "which belong to another sensor: their derivatives are 0"));
}

// Derivatives beside surfaces that are hardly larger than the step with which rays leave them are doubtful: that is told, once.
static void small_surfaces_are_told(void **state) {
    Fixture *f = *state;
    static const char *const balls[] = {"<point name='center' x='1000'/><float name='radius' value='%s'/>",
                                        "<transform name='to_world'><scale value='%s'/><translate z='-1000'/></transform>"};
    for (int i = 0; i < 4; i++) {
        char ball[160], text[1024];
        const char *radius = i % 2 ? "1.5" : "3";
        snprintf(ball, sizeof ball, balls[i / 2], radius);
        snprintf(text, sizeof text, "<scene version='3.0.0'><integrator type='path'/><sensor type='perspective' id='eye'>\n"
                 "<film type='hdrfilm'><integer name='width' value='8'/><integer name='height' value='8'/></film></sensor>\n"
                 "<emitter type='constant'/><shape type='%s' id='far'>%s</shape><shape type='%s'>%s</shape></scene>\n",
                 i < 2 ? "sphere" : "cube", ball, "sphere", "<point name='center' z='3'/>");
        write_words("far.xml", text);
        expect_note(f, "render far.xml --spp 1 -o far.npy --json", NULL);
        expect_note(f, "grad far.xml --param far.to_world:translate=0,1,0 --spp 1 --json",
                    i % 2 ? "3 wide, and rays begin 0.09" : NULL);
    }
}

// Where all that is asked for is refused, nothing has passed.
static void refusals_are_no_success(void **state) {
    Fixture *f = *state;
    write_words("twins.xml", "<scene version='3.0.0'><integrator type='path'/><sensor type='perspective' id='eye'>\n"
                             "<film type='hdrfilm'><integer name='width' value='8'/>\n"
                             "<integer name='height' value='8'/></film></sensor><emitter type='constant'/>\n"
                             "<shape type='sphere' id='one'/><shape type='sphere' id='two'/></scene>\n");
    expect(f, 1, "check twins.xml --param eye.x_fov --param one.to_world --spp 1");
    assert_non_null(strstr(f->out, "surfaces that lie in the same place, as 'one' and 'two' do"));
    assert_non_null(strstr(f->out, "nothing was checked: all directions are refused"));
    assert_null(strstr(f->out, "passed"));
    json_free(run_json(f, 1, "check twins.xml --param eye.x_fov --param one.to_world --spp 1 --json"));
    assert_non_null(strstr(f->out, "\"passed\": false"));
    json_free(run_json(f, 0, "check twins.xml --param '*.reflectance.value' --spp 1 --json"));
}

// So are unknowns of a fit on which no fitted view depends.
static void unknowns_out_of_sight_are_told(void **state) {
    Fixture *f = *state;
    write_scene();
    expect(f, 0, "render two.xml -o target.npy --spp 4");
    write_words("job.yaml", "scene: two.xml\nviews: [{target: target.npy}]\niterations: 1\nspp: 2\nreport_spp: 0\n"
                            "parameters: [grey.reflectance.value, side.x_fov]\n");
    expect_note(f, "fit job.yaml --json",
                "parameter 'side.x_fov': no view that is fitted has this sensor, so that its gradient is 0");
    expect_note(f, "fit job.yaml --overwrite --json --set parameters.1=idle.reflectance.value",
                "parameter 'idle.reflectance.value': no view that is fitted depends on it");
    assert_non_null(strstr(f->words, "parameter 'idle.reflectance.value': its gradient was 0 in every iteration"));
    assert_null(strstr(f->words, "parameter 'grey.reflectance.value': its gradient was 0"));
    expect_note(f, "fit job.yaml --overwrite --json --set parameters.1=sensor_0.x_fov", NULL);
    expect_note(f, "fit job.yaml --overwrite --json --set parameters.1=ball.to_world",
                "parameter 'ball.to_world': the 16 entries of this pose move freely, and shear it; 'parameterisation: rigid'");
    expect_note(f, "fit job.yaml --overwrite --json --set 'parameters.1={name: ball.to_world, parameterisation: rigid}'", NULL);
    // So are black targets under a loss that weighs them most.
    static const char *const losses[] = {"relative_l2", "l2"};
    write_words("dark.xml", "<scene version='3.0.0'><integrator type='path'/><sensor type='perspective'><film type='hdrfilm'>"
                            "<integer name='width' value='8'/><integer name='height' value='8'/></film></sensor></scene>");
    expect(f, 0, "render dark.xml -o dark.npy --spp 1");
    for (int i = 0; i < 2; i++) {
        char arguments[128];
        snprintf(arguments, sizeof arguments, "fit job.yaml --overwrite --json --set parameters.1=sensor_0.x_fov --set loss=%s "
                                              "--set views.0.target=dark.npy", losses[i]);
        expect_note(f, arguments, i ? NULL : "100 % of the targets' pixels are black, which 'relative_l2' weighs most");
    }
    // A truth that is missing is told before the work.
    expect_words(f, 1, "fit job.yaml -o before --set truth.scene=none.xml", "--set truth.scene=none.xml: none.xml: cannot open");
    assert_int_not_equal(access("before", F_OK), 0);
}

// A step that was asked for is not replaced without a word.
static void steps_are_told(void **state) {
    Fixture *f = *state;
    write_scene();
    expect_note(f, "check two.xml --param grey.reflectance.value --spp 16 --step 1e30 --json",
                "grey.reflectance.value: the step of 1e+30 is shortened to 0.4995, as far as the parameter's range allows");
    expect_note(f, "check two.xml --param grey.reflectance.value --spp 16 --step 0.1 --json", NULL);
    expect_words(f, 1, "check two.xml --param ball.to_world:translate=2,0,0 --spp 16 --step 1e30",
                 "a step of 1e+30 is too long, expected 5e+17 or less");
    expect_words(f, 1, "check two.xml --param grey.reflectance.value --spp 16 --step 1e-20", "is lost in the rounding");
    expect_words(f, 1, "check two.xml --param ball.to_world:translate=1,0,0 --spp 16 --step 50",
                 "the differences are over the step that --step asks for");
}

// Noise that derivative and difference share is not in error/rms, and makes a derivative weak all the same.
static void shared_noise_is_told(void **state) {
    Fixture *f = *state;
    write_words("rough.xml",
                "<scene version='3.0.0'><integrator type='path'><integer name='max_depth' value='3'/></integrator>\n"
                "<sensor type='perspective'><film type='hdrfilm'><integer name='width' value='16'/>\n"
                "<integer name='height' value='16'/></film>\n"
                "<transform name='to_world'><lookat origin='0,0,4' target='0,0,0' up='0,1,0'/></transform></sensor>\n"
                "<emitter type='constant'/><shape type='sphere'><bsdf type='roughdielectric' id='glass'/></shape></scene>\n");
    expect_said(f, 0, "check rough.xml --param glass.alpha.value --spp 16",
                "1 of 1 are weak: derivative and difference agree, and");
    expect(f, 0, "check two.xml --param idle.reflectance.value --spp 16");
    assert_non_null(strstr(f->out, "        -     0.00   0,0 R"));
}

// A gradient in reverse mode is told parameter by parameter, and their sums make up the value.
static void gradients_have_rows(void **state) {
    Fixture *f = *state;
    write_scene();
    static const char *const command = "grad two.xml --param grey.reflectance.value --param ball.to_world --mode reverse "
                                       "--adjoint 1 --spp 16%s";
    char arguments[256];
    snprintf(arguments, sizeof arguments, command, "");
    expect_words(f, 0, arguments, "-o DIR writes the gradients' numbers");
    assert_non_null(strstr(f->out, "parameter               shape            sum        +-           rms\n"
                                   "grey.reflectance.value  3  "));
    snprintf(arguments, sizeof arguments, command, " --json -o gradients");
    JsonNode *node = run_json(f, 0, arguments);
    const JsonNode *list = json_get(node, "gradients");
    double sum = 0, value = json_value(node, "value", 0);
    for (const JsonNode *row = list->first; row; row = row->next) {
        const JsonNode *values = json_get(row, "values");
        double entries = 0, squares = 0, count = 0;
        for (const JsonNode *entry = values->first; entry; entry = entry->next, count++) {
            entries += entry->number;
            squares += entry->number * entry->number;
        }
        assert_true(count == 3 || count == 16);
        assert_true(fabs(entries - json_value(row, "sum", 0)) <= 1e-9 * fabs(entries));
        assert_true(fabs(sqrt(squares / count) - json_value(row, "rms", 0)) <= 1e-9 * sqrt(squares));
        assert_true(json_value(row, "standard_error", 0) > 0);
        sum += entries;
    }
    assert_true(value != 0 && fabs(sum - value) <= 1e-9 * fabs(value));
    json_free(node);
    assert_int_equal(access("gradients/ball.to_world.npy", R_OK), 0);
}

// Sensors are named where they are numbered, and all libraries where some are.
static void names_are_told(void **state) {
    Fixture *f = *state;
    write_scene();
    expect_said(f, 0, "info two.xml", "sensor 0          8 x 8 pixels, R G B\nsensor 1 'side'   8 x 6 pixels, R G B\n");
    JsonNode *node = run_json(f, 0, "info two.xml --json");
    const JsonNode *ids = json_get(node, "sensor_ids");
    assert_true(ids->first->kind == JSON_NULL);
    assert_string_equal(ids->first->next->text, "side");
    json_free(node);
    expect(f, 0, "render two.xml --sensor side -o side.npy --spp 4");
    expect(f, 0, "fit job.yaml --overwrite --set 'views.0={sensor: side, target: side.npy}' --set report_spp=2");
    char page[OUTPUT_BYTES];
    read_text("fit/report.html", page);
    assert_non_null(strstr(page, "sensor 1 \xe2\x80\x98side\xe2\x80\x99, 8 &times; 6"));
    expect_said(f, 0, "doctor -t 1 --lanes 1", "\ncholmod    ");
    expect_words(f, 2, "render two.xml -o a.exr -t 0", "all that the machine allows): expected a whole number from 1 to 4096");
}

// A name that the scene does not have is told before what is wrong with its file.
static void loads_are_told(void **state) {
    Fixture *f = *state;
    write_scene();
    expect_words(f, 2, "render two.xml -o a.exr --load ball.bsdf.reflectanc.value=",
                 "did you mean 'ball.bsdf.reflectance.value'?");
    expect_words(f, 2, "render two.xml -o a.exr --load grey=", "no parameter 'grey'; there is 'grey.reflectance.value'");
    expect_words(f, 2, "render two.xml -o a.exr --load nosuch=a.npy", "no parameter 'nosuch'; 'reynolds params' lists them");
    expect_words(f, 2, "render two.xml -o a.exr --load grey.reflectance.value=", "the name of a file is missing");
    expect_words(f, 1, "render two.xml -o a.exr --load grey.reflectance.value=none.npy", "none.npy: cannot open: No such file");
}

// What a scene has and shows nothing of: attributes that a shape lacks are refused, and what has no effect is told.
static void attributes_are_looked_for(void **state) {
    Fixture *f = *state;
    static const char head[] = "<scene version='3.0.0'><integrator type='path'/><sensor type='perspective'/>"
                               "<emitter type='constant'/>\n"
                               "<bsdf type='twosided' id='cloth'><bsdf type='diffuse'><texture type='mesh_attribute' "
                               "name='reflectance'>\n<string name='name' value='%s'/></texture></bsdf></bsdf>\n"
                               "<shape type='ply' id='quilt'><string name='filename' value='a.ply'/><ref id='cloth'/></shape>\n"
                               "%s</scene>";
    static const char sphere[] = "<shape type='sphere' id='plum'><ref id='cloth'/></shape>\n";
    static const char plain[] = "<shape type='ply'><string name='filename' value='b.ply'/><ref id='cloth'/></shape>\n";
    static const char lamp[] = "<shape type='ply' id='lamp'><string name='filename' value='b.ply'/><emitter type='area'>\n"
                               "<texture type='mesh_attribute' name='radiance'><string name='name' value='vertex_color'/>\n"
                               "</texture></emitter></shape>\n";
    static const char *const cases[][3] = {
        {"vertex_colour", "", "s.xml:3:1: the ply 'quilt' has no attribute 'vertex_colour'; it has vertex_color, face_cover"},
        {"vertex_color", sphere, "s.xml:3:1: the sphere 'plum' has no attribute 'vertex_color': meshes of files have them"},
        {"face_cover", plain, "s.xml:3:1: the ply in line 5 has no attribute 'face_cover': its file has none"},
        {"face_cover", lamp, "s.xml:6:48: the ply 'lamp' has no attribute 'vertex_color': its file has none"},
    };
    static const char mesh[] = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n%s"
                               "element face 1\nproperty list uchar int vertex_indices\n%send_header\n%s";
    char text[2048];
    snprintf(text, sizeof text, mesh, "property float r\nproperty float g\nproperty float b\n", "property float cover_0\n",
             "0 0 0 1 1 1\n1 0 0 1 0 0\n0 1 0 0 1 0\n3 0 1 2 0.5\n");
    write_words("a.ply", text);
    snprintf(text, sizeof text, mesh, "", "", "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
    write_words("b.ply", text);
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        snprintf(text, sizeof text, head, cases[i][0], cases[i][1]);
        write_words("s.xml", text);
        expect_words(f, 1, "info s.xml", cases[i][2]);
        expect_words(f, 0, "info s.xml --lenient", ": it is 0 there");
    }
    snprintf(text, sizeof text, head, "vertex_color", "<shape type='merge'/>");
    write_words("s.xml", text);
    expect_note(f, "render s.xml --spp 1 --json", "warning: s.xml:5: this merge holds no shapes");
    snprintf(text, sizeof text, head, "face_cover", "<shape type='sphere'><bsdf type='bumpmap'><bsdf type='diffuse'/>\n"
             "<texture type='rawconstant'><float name='value' value='1'/></texture></bsdf></shape>");
    write_words("s.xml", text);
    expect_note(f, "render s.xml --spp 1 --json", "warning: s.xml:5: the texture of this bumpmap is constant and has no slope");
}

// An 8 x 8 picture of 0.25 with a pixel of which so many numbers are another one.
static void write_picture(float odd, int channels) {
    float numbers[8 * 8 * 3];
    FILE *file = fopen("odd.pfm", "wb");
    assert_non_null(file);
    for (size_t i = 0; i < sizeof numbers / sizeof numbers[0]; i++) {
        numbers[i] = i / 3 == 8 * 2 + 5 && (int)(i % 3) < channels ? odd : 0.25f; // in the third row from below
    }
    assert_true(fprintf(file, "PF\n8 8\n-1.0\n") > 0 && fwrite(numbers, sizeof numbers, 1, file) == 1);
    assert_int_equal(fclose(file), 0);
}

// Pictures of which numbers are lost, or are no picture's.
static void odd_pictures_are_told(void **state) {
    Fixture *f = *state;
    write_scene();
    write_words("job.yaml", "scene: two.xml\nviews: [{target: odd.pfm}]\niterations: 1\nspp: 2\nreport_spp: 0\n"
                            "parameters: [grey.reflectance.value]\n");
    write_picture(0.5f, 1);
    expect_note(f, "fit job.yaml --overwrite --json", NULL);
    write_picture(-1, 1);
    expect_note(f, "fit job.yaml --overwrite --json", "view 0: 1 of the 192 numbers of odd.pfm are negative");
    for (int channels = 3; channels >= 1; channels--) {
        write_picture(1e6f, channels);
        expect_note(f, "fit job.yaml --overwrite --json", "view 0: odd.pfm is 1e+06 at pixel 5, 5, and next to nothing elsewhere: "
                                                          "this pixel alone decides an 'l2' loss");
    }
    write_words("clear.xml",
                "<scene version='3.0.0'><integrator type='path'/><sensor type='perspective'><film type='hdrfilm'>"
                "<integer name='width' value='8'/><integer name='height' value='8'/><string name='pixel_format' value='rgba'/>\n"
                "</film><transform name='to_world'><lookat origin='0,0,9' target='0,0,0' up='0,1,0'/></transform></sensor>\n"
                "<emitter type='point'><point name='position' x='1' y='2' z='5'/></emitter><shape type='sphere'/></scene>\n");
    expect(f, 0, "render clear.xml -o clear.png --spp 4");
    expect_note(f, "fit job.yaml --overwrite --json --set views.0.target=clear.png",
                "view 0: the colours of clear.png are divided by its alpha");
    expect(f, 0, "render two.xml -o plain.png --spp 4");
    expect_words(f, 0, "compare plain.png clear.png", "the colours of clear.png are divided by its alpha, which is left out");
    expect_words(f, 0, "compare plain.png odd.pfm",
                 "1 of 192 numbers of odd.pfm lie outside of 0 to 1, to which plain.png is clipped");
    write_picture(0.5f, 1);
    expect(f, 0, "compare plain.png odd.pfm");
    assert_null(strstr(f->words, "clipped"));
}

// What a scene says and does not mean.
static void odd_scenes_are_told(void **state) {
    Fixture *f = *state;
    static const char head[] = "<scene version='3.0.0'><integrator type='path'/><emitter type='%s'/><sensor type='perspective'>\n"
                               "<film type='hdrfilm'><integer name='width' value='8'/><integer name='height' value='8'/></film>"
                               "</sensor>\n<emitter type='area' id='lamp'/>\n<shape type='sphere'><transform name='to_world'>"
                               "<scale value='%s'/></transform>%s</shape></scene>\n";
    static const char *const cases[][4] = {
        {"constant", "2", "<ref id='lamp'/>", NULL},
        {"constant", "2", "", "warning: odd.xml:3: this 'area' light belongs to no shape and lights nothing"},
        {"area", "2", "<ref id='lamp'/>", "warning: odd.xml:1: this 'area' light belongs to no shape and lights nothing"},
        {"constant", "2 3 2", "<ref id='lamp'/>", "warning: odd.xml:4: to_world stretches or shears this sphere, which stays"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        char text[2048];
        snprintf(text, sizeof text, head, cases[i][0], cases[i][1], cases[i][2]);
        write_words("odd.xml", text);
        expect_note(f, "render odd.xml --spp 1 --json", cases[i][3]);
    }
    // Glass in what is as dense.
    write_words("odd.xml", "<scene version='3.0.0'><integrator type='path'/><emitter type='constant'/>\n"
                           "<sensor type='perspective'/><shape type='sphere' id='ball'>\n"
                           "<bsdf type='roughplastic'><string name='int_ior' value='water'/>\n"
                           "<string name='ext_ior' value='water'/></bsdf></shape></scene>\n");
    expect_words(f, 1, "grad odd.xml --param ball.bsdf.eta.value --spp 1",
                 "int_ior and ext_ior agree, so that there is no interface");
}

// What stands at the wrong place of the command line is told with the right one.
static void misplaced_words_are_told(void **state) {
    Fixture *f = *state;
    static const char *const cases[][2] = {
        {"check two.xml -o a.exr", "'-o' is an option of render, grad and fit, not of check"},
        {"render two.xml -o a.exr --param x", "'--param' is an option of grad, check and params, not of render"},
        {"fit job.yaml --lenient=1", "'--lenient' is an option of render, grad, check, params, info and convert, not of fit"},
        {"render two.xml --sppp 3", "unknown option '--sppp', did you mean '--spp'?"},
        {"render two.xml -z", "unknown option '-z'"},
        {"render -hx", "option '-h' takes no value"},
        {"render two.xml a.exr", "unexpected argument 'a.exr'; -o names the result"},
        {"grad two.xml grey", "unexpected argument 'grey'; --param names a parameter"},
        {"info two.xml grey", "unexpected argument 'grey'\n"},
        {"check two.xml", "--param or --all is missing"},
        {"grad two.xml", "grad: --param is missing"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        expect_words(f, 2, cases[i][0], cases[i][1]);
    }
    expect_words(f, 1, "info job.yaml", "job.yaml:1:1: not well-formed XML");
    assert_non_null(strstr(f->words, "; jobs are for 'reynolds fit'"));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(other_cameras_are_told), cmocka_unit_test(refusals_are_no_success),
        cmocka_unit_test(unknowns_out_of_sight_are_told),
        cmocka_unit_test(small_surfaces_are_told),
        cmocka_unit_test(steps_are_told),
        cmocka_unit_test(shared_noise_is_told),
        cmocka_unit_test(gradients_have_rows),
        cmocka_unit_test(names_are_told),
        cmocka_unit_test(loads_are_told),
        cmocka_unit_test(attributes_are_looked_for),
        cmocka_unit_test(odd_pictures_are_told),
        cmocka_unit_test(odd_scenes_are_told),
        cmocka_unit_test(misplaced_words_are_told),
    };
    return cmocka_run_group_tests_name("cli_notes", tests, make_folder, remove_folder);
}
