// Complete gradients of what moves: interior and all boundary terms together, forward mode per image block, against central
// differences; reverse mode against forward mode on the same samples; and that each boundary term is needed. Volumes and borders
// of media have an interior term only.
#include "motions.h"
#include "render/facing.h"
#include "rooms.h"

#include <stdlib.h>

enum { ACROSS = 3, BLOCKS = 9, SEEDS = 10, MOST = 128 };

static bool begins_with(const char *s, const char *start) { return strncmp(s, start, strlen(start)) == 0; }
// What moves among surfaces in media.
static bool is_ride(const Motion *m) { return begins_with(m->room, "ride_") || begins_with(m->room, "beacon_"); }

static void blocks_of(const float *image, double *blocks) {
    enum { WIDTH = SIZE / ACROSS };
    memset(blocks, 0, BLOCKS * sizeof *blocks);
    for (int i = 0; i < SIZE * SIZE; i++) {
        for (int c = 0; c < 3; c++) {
            blocks[i / SIZE / WIDTH * ACROSS + i % SIZE / WIDTH] += (double)image[3 * i + c] / (3.0 * WIDTH * WIDTH);
        }
    }
}

// The rate of change of the parameter's numbers.
static int tangent_of(Room room, const Motion *m, int param, float *start, float *tangent) {
    rey_param_info info;
    ok(room, rey_param_get_info(room.scene, param, &info));
    int n = (int)info.count;
    assert_true(n <= MOST);
    memcpy(start, rey_param_values(room.scene, param), (size_t)n * sizeof *start);
    const float radian = 3.14159265f / 180;
    for (int i = 0; i < n; i++) {
        int row = i / 4, column = i % 4;
        switch (m->sort) {
        case SHIFT:
            tangent[i] = column == 3 && row < 3 ? m->axis[row] : 0;
            break;
        case TURN: { // w x column; points turn about where the pose puts the origin
            float x[3] = {start[column], start[4 + column], start[8 + column]};
            int a = (row + 1) % 3, b = (row + 2) % 3;
            tangent[i] = column < 3 && row < 3 ? radian * (m->axis[a] * x[b] - m->axis[b] * x[a]) : 0;
            break;
        }
        case GROW:
            tangent[i] = row < 3 ? start[i] - (column == 3 ? m->axis[row] : 0) : 0;
            break;
        case ADD:
            tangent[i] = 1 - 0.4f * (float)i;
            break;
        case SHEAR:
            tangent[i] = i % 3 == 0 ? start[i + 2] : 0.2f;
            break;
        case BEND:
            tangent[i] = column < 3 ? m->axis[column] * (1 - 0.1f * (float)row) : 0.03f;
            break;
        }
    }
    return n;
}

static void quotient(Room room, const Motion *m, int param, const float *start, const float *tangent, int n, uint32_t seed,
                     double *blocks) {
    static float image[NUMBERS];
    char name[128];
    snprintf(name, sizeof name, "%s %s %d %g %d %u %g", m->room, m->param, (int)m->sort, m->h, m->difference_spp, seed,
             sample_share());
    if (kept(name, blocks, BLOCKS, false)) {
        return;
    }
    memset(blocks, 0, BLOCKS * sizeof *blocks);
    for (int sign = -1; sign <= 1; sign += 2) {
        float values[MOST];
        double one[BLOCKS];
        for (int i = 0; i < n; i++) {
            values[i] = start[i] + (float)(sign * m->h) * tangent[i];
        }
        rey_render_def def = def_make(m->difference_spp, seed, 1);
        ok(room, rey_param_set(room.scene, param, values, n));
        ok(room, rey_render(room.scene, &def, image, NULL));
        blocks_of(image, one);
        for (int i = 0; i < BLOCKS; i++) {
            blocks[i] += sign * one[i] / (2 * m->h);
        }
    }
    ok(room, rey_param_set(room.scene, param, start, n));
    kept(name, blocks, BLOCKS, true);
}

static void derivative(Room room, const Motion *m, int param, const float *tangent, uint32_t seed, double *blocks) {
    static float image[NUMBERS];
    rey_render_def def = def_make(m->spp, seed, 1);
    def.terms = 0; // all that it needs
    ok(room, rey_jvp(room.scene, &def, (rey_selection){&param, 1}, tangent, image, NULL, NULL));
    blocks_of(image, blocks);
}

// Mean over seeds of what is in a column, and its squared standard error.
static double mean_of(double rows[SEEDS][BLOCKS], int block, double *error2) {
    double mean = 0, square = 0;
    for (int s = 0; s < SEEDS; s++) {
        mean += rows[s][block] / SEEDS;
    }
    for (int s = 0; s < SEEDS; s++) {
        square += (rows[s][block] - mean) * (rows[s][block] - mean);
    }
    *error2 = square / (SEEDS - 1) / SEEDS;
    return mean;
}

static void test_motion(void **state) {
    const Motion *m = *state;
    Room room = room_open(m->room, 1, 0);
    int param = rey_param_find(room.scene, m->param);
    assert_true(param >= 0);
    float start[MOST], tangent[MOST];
    int n = tangent_of(room, m, param, start, tangent);
    double off[SEEDS][BLOCKS], whole[SEEDS][BLOCKS], error2, rms = 0, worst = 0, sum = 0, noise = 0;
    for (int s = 0; s < SEEDS; s++) {
        double differences[BLOCKS];
        derivative(room, m, param, tangent, (uint32_t)s + 1, whole[s]);
        quotient(room, m, param, start, tangent, n, (uint32_t)s + 101, differences);
        for (int i = 0; i < BLOCKS; i++) {
            off[s][i] = whole[s][i] - differences[i];
        }
    }
    for (int i = 0; i < BLOCKS; i++) {
        double mean = mean_of(whole, i, &error2);
        rms += mean * mean / BLOCKS;
    }
    rms = sqrt(rms);
    for (int i = 0; i < BLOCKS; i++) {
        const double truncation = 0.01 * rms; // of the differences
        double mean = mean_of(off, i, &error2), z = normal_of_t(mean / sqrt(error2 + truncation * truncation), SEEDS - 1);
        worst = fmax(worst, fabs(z));
        sum += z;
        noise += error2 / BLOCKS;
    }
    print_message("%-20s %-22s RMS %9.3g, standard error %5.2f %%, worst z %5.2f, sum / sqrt(n) %5.2f\n", m->room, m->param,
                  rms, 100 * sqrt(noise) / rms, worst, sum / sqrt(BLOCKS));
    room_close(room);
    const bool in_media = begins_with(m->room, "media_") || begins_with(m->room, "air_") || is_ride(m);
    assert_true(rms > 0);
    // Differences of where paths collide are noisy, and so are the edges of mirrors.
    const bool mirrors = begins_with(m->room, "mirror_") || begins_with(m->room, "smooth_");
    const double noisy = mirrors ? 0.25 : begins_with(m->room, "seen_") ? 0.12 : 0;
    const bool glossy = begins_with(m->room, "glossy_"); // several times as noisy without glossy.h
    const double plain = begins_with(m->room, "panes_") ? 0.04 : 0.02; // three to six times as noisy without pane.h
    const double most = noisy > 0 ? noisy : begins_with(m->room, "air_") ? 0.03 : in_media ? 0.08 : glossy ? 0.004 : plain;
    assert_true(sqrt(noise * sample_share()) <= most * rms);
    // At 1 % for all motions together [Sidak].
    assert_true(erfc(worst / sqrt(2)) > -expm1(log1p(-0.01) / (BLOCKS * COUNT_OF(motions))));
    assert_true(fabs(sum) / sqrt(BLOCKS) < 3);
}

// The terms that a parameter names are all that its gradient has.
static void test_named(Room room, const Motion *m, int param, const float *tangent) {
    static float images[2][NUMBERS];
    rey_param_info info;
    ok(room, rey_param_get_info(room.scene, param, &info));
    for (int i = 0; i < 2; i++) {
        rey_render_def def = def_make(16, 5, 2);
        def.terms = i ? rey_terms_stated(room.scene, 0, info.terms) & ~REY_TERM_MEDIUM : 0;
        ok(room, rey_jvp(room.scene, &def, (rey_selection){&param, 1}, tangent, images[i], NULL, NULL));
    }
    if (memcmp(images[0], images[1], sizeof images[0]) != 0) {
        fail_msg("%s of %s: what the terms that it names bring is not its gradient", m->param, m->room);
    }
}

// Sum over the picture of a ramp times the derivative, in both modes, and what each term contributes.
static void test_modes(void **state) {
    const Motion *m = *state;
    static float image[NUMBERS], ramp[NUMBERS];
    Room room = room_open(m->room, 2, 0);
    int param = rey_param_find(room.scene, m->param);
    float start[MOST], tangent[MOST];
    double gradient[MOST], sizes[2] = {0, 0};
    int n = tangent_of(room, m, param, start, tangent);
    rey_param_info info;
    ok(room, rey_param_get_info(room.scene, param, &info));
    for (int i = 0; i < NUMBERS; i++) {
        ramp[i] = (float)(i / 3 % SIZE) / SIZE - 0.3f * (float)(i % 3);
    }
    const bool chains = begins_with(m->room, "mirror_") || begins_with(m->room, "seen_") || begins_with(m->room, "smooth_");
    const int specular = chains ? REY_TERM_SPECULAR : info.terms & REY_TERM_SPECULAR;
    const int all = REY_TERM_INTERIOR | REY_TERM_PRIMARY | REY_TERM_INDIRECT | specular;
    const int asked = all | rey_terms_stated(room.scene, 0, info.terms & REY_TERM_TERMINATOR);
    for (int term = REY_TERM_INTERIOR; term <= asked; term *= 2) {
        if (!(term & asked)) {
            continue;
        }
        rey_render_def def = def_make(64, 5, 2);
        def.terms = term;
        if (!(info.terms & term)) {
            assert_int_equal(rey_jvp(room.scene, &def, (rey_selection){&param, 1}, tangent, image, NULL, NULL),
                             REY_ERROR_INCOMPLETE);
            continue;
        }
        double forward = 0, reverse = 0, size = 0, least = 1e-8 * (sizes[0] + sizes[1]); // floats round what cancels
        ok(room, rey_jvp(room.scene, &def, (rey_selection){&param, 1}, tangent, image, NULL, NULL));
        ok(room, rey_vjp(room.scene, &def, (rey_selection){&param, 1}, ramp, gradient, NULL, NULL));
        for (int i = 0; i < NUMBERS; i++) {
            forward += (double)image[i] * (double)ramp[i];
            size += fabs((double)image[i] * (double)ramp[i]);
            least += 1e-10 * fabs((double)ramp[i]) / sqrt(sample_share()); // of terms that are 0 but for rounding
        }
        for (int i = 0; i < n; i++) {
            reverse += gradient[i] * (double)tangent[i];
        }
        if (!(fabs(forward - reverse) <= 2e-5 * size + least)) {
            fail_msg("%s of %s: forward %.9g, reverse %.9g", rey_term_name(term), m->param, forward, reverse);
        }
        sizes[term != REY_TERM_INTERIOR] += size;
    }
    test_named(room, m, param, tangent);
    room_close(room);
    const bool volumes = begins_with(m->room, "media_");
    const bool glass = begins_with(m->room, "glossy_") || begins_with(m->room, "panes_");
    const bool bare = strcmp(m->room, "ride_room.xml") == 0 || strcmp(m->room, "beacon_relief.xml") == 0; // no edge is in the way
    const bool seamless = volumes || glass || bare;
    const bool smoky = begins_with(m->room, "beacon_smoke") || begins_with(m->room, "beacon_flakes");
    const bool bulbs = begins_with(m->room, "ride_bulb") || smoky;
    const bool shades = strcmp(m->param, "block.to_world") == 0 || strcmp(m->param, "ball.to_world") == 0;
    const bool lights = bulbs && !shades; // few shadows are in sight
    assert_true(seamless ? sizes[0] > 0 && (!volumes || sizes[1] == 0) : sizes[1] > (lights ? 0 : 0.05) * sizes[0]);
}

// Threads and runs do not change a bit.
static void test_bits(void **state) {
    UNUSED(state);
    static float images[2][NUMBERS];
    const Motion *m = motions;
    double gradients[2][MOST];
    for (int k = 0; k < 2; k++) {
        Room room = room_open(m->room, k ? 3 : 1, 0);
        int param = rey_param_find(room.scene, m->param);
        float start[MOST], tangent[MOST];
        tangent_of(room, m, param, start, tangent);
        rey_render_def def = def_make(32, 9, 2);
        def.terms = 0;
        ok(room, rey_jvp(room.scene, &def, (rey_selection){&param, 1}, tangent, images[k], NULL, NULL));
        ok(room, rey_vjp(room.scene, &def, (rey_selection){&param, 1}, images[0], gradients[k], NULL, NULL));
        room_close(room);
    }
    assert_memory_equal(images[0], images[1], sizeof images[0]);
    assert_memory_equal(gradients[0], gradients[1], 16 * sizeof gradients[0][0]);
}

// Edges behind mirrors and glass are not found beside mirrors whose normals are a map's. Lines of
// textures that to_uv moves: not where two textures share them, nor where they lie on edges that mirrors may show. Nor what is
// there twice.
static void test_refused(void **state) {
    UNUSED(state);
    static const struct {
        const char *room, *param;
        int moved; // number of the parameter
        const char *word;
    } cases[] = {{"layers.xml", "camera.to_world", 3, "'specular'"},
                 {"ride_veil.xml", "camera.to_world", 3, "smooth mirrors, glass, masks"},
                 {"ride_hidden.xml", "camera.to_world", 3, "look past them"},
                 {"ride_hidden.xml", "bulb.to_world", 3, "look past them"},
                 {"ride_cut.xml", "tile.to_world", 3, "cut off what comes through participating media"},
                 {"ride_cut.xml", "lamp.to_world", 3, "cut off what comes through participating media"},
                 {"ride_sky.xml", "board.to_world", 3, "a medium without end"},
                 {"ride_sky.xml", "floor.bsdf.roughness.value", 0, "a medium without end"},
                 {"ride_sky.xml", "haze.albedo.value.value", 0, "a medium without end"},
                 {"clip_hull.xml", "camera.to_world", 3, "cuts the border of a medium"},
                 {"clip_hull.xml", "hull.to_world", 3, "cuts the border of a medium"},
                 {"marks_faces.xml", "grid.bsdf.bsdf_0.reflectance.to_uv", 0, "the same line"},
                 {"seen_tiles.xml", "coin.emitter.radiance.to_uv", 0, "edges of their surfaces"},
                 {"seen_beam.xml", "lamp.cutoff_angle.value", 0, "move with its cutoff_angle"},
                 {"seen_beam.xml", "lamp.texture.to_uv", 0, "other kinds than 'area'"},
                 {"twins.xml", "camera.to_world", 3, "the same place, as"},
                 {"twins_group.xml", "camera.to_world", 3, "the same place, as"}};
    static float image[NUMBERS];
    for (int i = 0; i < COUNT_OF(cases); i++) {
        Room room = room_open(cases[i].room, 1, 0);
        int param = rey_param_find(room.scene, cases[i].param);
        assert_true(param >= 0);
        float tangent[MOST] = {0};
        rey_render_def def = def_make(16, 1, 1);
        def.terms = 0;
        tangent[cases[i].moved] = 1;
        assert_int_equal(rey_jvp(room.scene, &def, (rey_selection){&param, 1}, tangent, image, NULL, NULL), REY_ERROR_INCOMPLETE);
        assert_non_null(strstr(rey_error(room.ctx), cases[i].word));
        room_close(room);
    }
}

// Arguments: what the names of rooms, parameters in them, or other tests begin with.
int main(int argc, char **argv) {
    struct CMUnitTest tests[2 * COUNT_OF(motions) + 2];
    static char names[COUNT_OF(motions)][64];
    size_t count = 0;
    for (int i = 0; i < COUNT_OF(motions); i++) {
        void *motion = (void *)(uintptr_t)(motions + i);
        snprintf(names[i], sizeof names[i], "%s %s", motions[i].room, motions[i].param);
        tests[count++] = (struct CMUnitTest){names[i], test_motion, NULL, NULL, motion};
        tests[count++] = (struct CMUnitTest){names[i], test_modes, NULL, NULL, motion};
    }
    tests[count++] = (struct CMUnitTest)cmocka_unit_test(test_bits);
    tests[count++] = (struct CMUnitTest)cmocka_unit_test(test_refused);
    count = tests_asked(tests, count, argc, argv);
    return _cmocka_run_group_tests("boundary", tests, count, write_pictures, remove_pictures);
}
