// Integrators and samplers as scenes write them: what is taken, what is refused and in which words, and what the scene's
// notes say about it.
#include "reynolds/reynolds.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

static char path[64];

static rey_result load(rey_context *ctx, const char *integrator, const char *sampler, rey_scene **scene) {
    snprintf(path, sizeof path, "/tmp/reynolds_integrators_%ld.xml", (long)getpid());
    FILE *f = fopen(path, "w");
    assert_non_null(f);
    fprintf(f,
            "<scene version='3.0.0'>\n%s\n<sensor type='perspective'>\n%s\n<film type='hdrfilm'><integer name='width' "
            "value='4'/><integer name='height' value='4'/></film></sensor>\n<shape type='sphere'/></scene>\n",
            integrator, sampler);
    assert_int_equal(fclose(f), 0);
    rey_result result = rey_scene_load(ctx, path, NULL, 0, scene);
    unlink(path);
    return result;
}

typedef struct Case {
    const char *text;
    rey_result result;
    const char *words; // of the message, or of the only note; "" = no note
} Case;

static void check_cases(bool samplers, const Case *cases, size_t count) {
    rey_context *ctx;
    assert_int_equal(rey_context_create(NULL, &ctx), REY_OK);
    for (size_t i = 0; i < count; i++) {
        rey_scene *scene = NULL;
        rey_result result = samplers ? load(ctx, "<integrator type='path'/>", cases[i].text, &scene)
                                     : load(ctx, cases[i].text, "", &scene);
        const char *words = result ? rey_error(ctx) : rey_scene_note_count(scene) ? rey_scene_note(scene, 0) : "";
        if (result != cases[i].result || !strstr(words, cases[i].words) || (!*cases[i].words && *words)) {
            fail_msg("%s: result %d, '%s', expected %d, '%s'", cases[i].text, (int)result, result ? rey_error(ctx) : words,
                     (int)cases[i].result, cases[i].words);
        }
        assert_null(scene ? rey_scene_note(scene, rey_scene_note_count(scene)) : NULL);
        rey_scene_destroy(scene);
    }
    rey_context_destroy(ctx);
}

static void test_samplers(void **state) {
    (void)state;
    static const Case cases[] = {
        {"", REY_OK, ""},
        {"<sampler type='independent'><integer name='sample_count' value='9'/><integer name='seed' value='3'/></sampler>",
         REY_OK, ""},
        {"<sampler type='stratified'><integer name='sample_count' value='10'/><boolean name='jitter' value='false'/>"
         "</sampler>",
         REY_OK, "takes the place of 'stratified': it is stratified for any sample count, and uses 10"},
        {"<sampler type='multijitter'><integer name='seed' value='7'/><boolean name='jitter' value='true'/></sampler>",
         REY_OK, ":4: the sampler 'sobol' (Owen-scrambled points) takes the place of 'multijitter'"},
        {"<sampler type='orthogonal'><integer name='strength' value='3'/><boolean name='jitter' value='false'/></sampler>",
         REY_OK, "'orthogonal'"},
        {"<sampler type='ldsampler'><integer name='sample_count' value='64'/></sampler>", REY_OK, "'ldsampler'"},
        {"<sampler type='ldsampler'><boolean name='jitter' value='true'/></sampler>", REY_ERROR_SCENE, "jitter"},
        {"<sampler type='independent'><boolean name='jitter' value='true'/></sampler>", REY_ERROR_SCENE, "jitter"},
        {"<sampler type='stratified'><integer name='strength' value='2'/></sampler>", REY_ERROR_SCENE, "strength"},
        {"<sampler type='orthogonal'><integer name='strength' value='0'/></sampler>", REY_ERROR_SCENE, "strength"},
        {"<sampler type='multijiter'/>", REY_ERROR_SCENE, "did you mean 'multijitter'?"},
        {"<sampler type='mersennetwister'/>", REY_ERROR_SCENE,
         "there is no sampler 'mersennetwister', expected independent, stratified, multijitter, orthogonal, ldsampler or sobol"},
        {"<sampler type='stratified'><integer name='sample_count' value='0'/></sampler>", REY_ERROR_SCENE, "sample_count"},
    };
    check_cases(true, cases, sizeof cases / sizeof *cases);
}

static void test_integrators(void **state) {
    (void)state;
    static const Case cases[] = {
        {"<integrator type='volpath'><integer name='max_depth' value='8'/></integrator>", REY_OK, ""},
        {"<integrator type='volpathmis'><boolean name='use_spectral_mis' value='false'/></integrator>", REY_OK, ""},
        {"<integrator type='volpath'><boolean name='use_spectral_mis' value='false'/></integrator>", REY_ERROR_SCENE,
         "use_spectral_mis"},
        {"<integrator type='direct'><integer name='shading_samples' value='4'/></integrator>", REY_OK, ""},
        {"<integrator type='direct'><integer name='shading_samples' value='4'/><integer name='bsdf_samples' value='4'/>"
         "</integrator>",
         REY_ERROR_SCENE, "either 'shading_samples' or"},
        {"<integrator type='direct'><integer name='emitter_samples' value='0'/><integer name='bsdf_samples' value='0'/>"
         "</integrator>",
         REY_ERROR_SCENE, "both 0"},
        {"<integrator type='direct'><integer name='shading_samples' value='0'/></integrator>", REY_ERROR_SCENE,
         "shading_samples"},
        {"<integrator type='direct'><integer name='max_depth' value='2'/></integrator>", REY_ERROR_SCENE, "max_depth"},
        {"<integrator type='depth'/>", REY_OK, ""},
        {"<integrator type='prb_basic'><integer name='max_depth' value='4'/></integrator>", REY_OK, ""},
        {"<integrator type='prb_projective'><integer name='sppi' value='0'/><string name='guiding' value='no'/></integrator>",
         REY_OK, ":2: 'prb_projective' is read as 'path' with its max_depth: every integrator finds the terms of moving edges"},
        {"<integrator type='direct_projective'><string name='project_seed' value='bsdf'/></integrator>", REY_OK,
         "read as 'direct'"},
        {"<integrator type='prb'><integer name='sppi' value='0'/></integrator>", REY_ERROR_SCENE, "sppi"},
        {"<integrator type='pathtracing-of-light'/>", REY_ERROR_SCENE,
         "there is no integrator 'pathtracing-of-light', expected path, direct, moment,"},
        {"<integrator type='volpaht'/>", REY_ERROR_SCENE, "did you mean 'volpath'?"},
    };
    check_cases(false, cases, sizeof cases / sizeof *cases);
}

// Those that hold others.
static void test_nested(void **state) {
    (void)state;
    static const Case cases[] = {
        {"<integrator type='moment'/>", REY_ERROR_SCENE, "needs a nested integrator"},
        {"<integrator type='aov'><string name='aovs' value='a:depth'/></integrator>", REY_OK, ""},
        {"<integrator type='aov'/>", REY_ERROR_SCENE, "aovs"},
        {"<integrator type='aov'><string name='aovs' value='a:depth, a:depth'/></integrator>", REY_ERROR_SCENE,
         "two channels have the name 'a.T'"},
        {"<integrator type='aov'><string name='aovs' value='a:dept'/></integrator>", REY_ERROR_SCENE,
         "there is no quantity 'dept', expected one of depth, position, uv, geo_normal, sh_normal, dp_du, dp_dv, duv_dx, duv_dy"},
        {"<integrator type='aov'><string name='aovs' value='a:dept'/></integrator>", REY_ERROR_SCENE, "did you mean 'depth'?"},
        {"<integrator type='aov'><string name='aovs' value='depth'/></integrator>", REY_ERROR_SCENE,
         "'depth' in 'aovs', expected NAME:QUANTITY"},
        {"<integrator type='aov'><string name='aovs' value='a:depth'/><integrator type='path'/><integrator type='path'/>"
         "</integrator>",
         REY_OK, "derivatives: "},
        {"<integrator type='aov'><string name='aovs' value='a:depth'/>\n<integrator type='path' name='p'/>\n<integrator "
         "type='direct' name='p'/></integrator>",
         REY_ERROR_SCENE, ":4:1: 'p' is given twice in integrator 'aov'"},
        {"<integrator type='aov'><string name='aovs' value='a:depth, b:albedo'/><integrator type='path' name='c'/><integrator "
         "type='direct' name='b'/></integrator>",
         REY_ERROR_SCENE, "two channels have the name 'b.R'"},
        {"<integrator type='aov'><string name='aovs' value='a:depth'/><integrator type='path'/>\n<integrator type='voldepth'/>"
         "</integrator>",
         REY_ERROR_SCENE, ":3:1: there is no integrator 'voldepth', did you mean 'volpath'?"},
        {"<integrator type='aov'><integrator type='path'/><integrator type='direct'/></integrator>", REY_ERROR_SCENE,
         "'aov' lacks 'aovs', a list of NAME:QUANTITY"},
        {"<integrator type='aov'><string name='aovs' value='a:depth'/><integrator type='path'><integer name='maxdepth' value='2'/>"
         "</integrator></integrator>",
         REY_ERROR_SCENE, "did you mean 'max_depth'?"},
        {"<integrator type='moment'><integrator type='moment'><integrator type='path'/></integrator></integrator>", REY_OK, ""},
        {"<integrator type='moment'><integrator type='moment'><integrator type='moment'><integrator type='path'/></integrator>"
         "</integrator></integrator>",
         REY_ERROR_UNSUPPORTED, "'moment' inside 'moment' inside 'moment'"},
        {"<integrator type='moment'><integrator type='path'/><integrator type='moment' name='n'/></integrator>", REY_ERROR_SCENE,
         "'moment' needs a nested integrator"},
        {"<integrator type='moment'><integrator type='path'/><integrator type='ptracer'/></integrator>", REY_ERROR_UNSUPPORTED,
         "'ptracer' inside 'moment' is not supported"},
        {"<integrator type='moment'><integrator type='aov'><string name='aovs' value='a:uv'/><integrator type='ptracer'/>"
         "</integrator></integrator>",
         REY_ERROR_UNSUPPORTED, "'ptracer' inside 'moment' is not supported"},
        {"<integrator type='moment'><integrator type='direct'><integer name='emitter_samples' value='3'/></integrator>"
         "</integrator>",
         REY_OK, "the moments of 'direct' are those of single samples, of which it takes 3 where the format takes one"},
    };
    check_cases(false, cases, sizeof cases / sizeof *cases);
}

// The depths of integrators that stand for others: those of the format.
static void test_depths(void **state) {
    (void)state;
    static const struct {
        const char *type;
        int depth;
    } cases[] = {{"path", -1}, {"direct", 2}, {"prb", 6}, {"prb_basic", 6}, {"prb_projective", 6}, {"prbvolpath", 6},
                 {"direct_projective", 2}};
    rey_context *ctx;
    assert_int_equal(rey_context_create(NULL, &ctx), REY_OK);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char text[128];
        rey_scene *scene = NULL;
        rey_scene_info info;
        snprintf(text, sizeof text, "<integrator type='%s'/>", cases[i].type);
        assert_int_equal(load(ctx, text, "", &scene), REY_OK);
        rey_scene_get_info(scene, &info);
        assert_int_equal(info.max_depth, cases[i].depth);
        assert_string_equal(info.integrator, cases[i].type);
        rey_scene_destroy(scene);
    }
    rey_context_destroy(ctx);
}

// Far more threads than processors: as many run as make sense.
static void test_threads(void **state) {
    (void)state;
    rey_context_def def = rey_default_context_def();
    rey_context *ctx;
    assert_int_equal(rey_context_create(&def, &ctx), REY_OK);
    int available = rey_threads(ctx);
    rey_context_destroy(ctx);
    def.threads = 4096;
    assert_int_equal(rey_context_create(&def, &ctx), REY_OK);
    assert_true(rey_threads(ctx) >= available && rey_threads(ctx) <= (4 * available < 16 ? 16 : 4 * available));
    rey_context_destroy(ctx);
    def.threads = 7;
    assert_int_equal(rey_context_create(&def, &ctx), REY_OK);
    assert_int_equal(rey_threads(ctx), 7);
    rey_context_destroy(ctx);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_samplers), cmocka_unit_test(test_integrators),
                                       cmocka_unit_test(test_nested), cmocka_unit_test(test_depths),
                                       cmocka_unit_test(test_threads)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
