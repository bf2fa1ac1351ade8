// Borders of media that lie in other surfaces: boxes side by side, a pile of layers, fog that stands on a lamp, all in closed form
// with their derivatives; lights beside a border, which rays slip through now and then; and faces that rays run along.
#include "base/parallel.h"
#include "rooms.h"

enum { ACROSS = 16, SETS = 8, MOST_PATHS = 1 << 14 };

// Parallel rays along (6, -3, -8), all of which pass all of what a scene has.
static const char sensor[] =
    "<integrator type='volpath'><integer name='max_depth' value='8'/></integrator>"
    "<sensor type='orthographic'><transform name='to_world'><scale value='0.1'/><lookat origin='-6, 3, 8' target='0, 0, 0' "
    "up='0, 1, 0'/></transform>"
    "<film type='hdrfilm'><integer name='width' value='16'/><integer name='height' value='16'/></film></sensor>";

static const char media[] =
    "<medium type='homogeneous' id='thin'><float name='sigma_t' value='0.5'/><float name='albedo' value='0'/></medium>"
    "<medium type='homogeneous' id='dense'><float name='sigma_t' value='1.2'/><float name='albedo' value='0'/></medium>";

#define SKY "<emitter type='constant'><float name='radiance' value='1'/></emitter>"
#define BOX(half, middle, medium) \
    "<shape type='cube'><transform name='to_world'><scale x='9' y='9' z='" half "'/><translate z='" middle "'/></transform>" \
    "<bsdf type='null'/><ref name='interior' id='" medium "'/></shape>"
#define LAMP \
    "<shape type='rectangle'><transform name='to_world'><scale value='9'/></transform><emitter type='area'>" \
    "<float name='radiance' value='2'/></emitter></shape>"

// What is seen: radiance exp(-(0.5 thin + 1.2 dense) / cosine), by what the media measure along z.
typedef struct Pile {
    const char *text, *scene;
    double radiance, thin, dense;
} Pile;

static const Pile piles[] = {
    {"two boxes", SKY BOX("0.5", "0.5", "thin") BOX("0.5", "-0.5", "dense"), 1, 1, 1},
    {"two boxes of one medium", SKY BOX("0.5", "0.5", "thin") BOX("0.5", "-0.5", "thin") BOX("0.1", "3", "dense"), 1, 2, 0.2},
    {"layers",
     SKY BOX("0.1", "0.3", "thin") BOX("0.1", "0.1", "dense") BOX("0.1", "-0.1", "thin") BOX("0.1", "-0.3", "dense"), 1, 0.4, 0.4},
    {"a box on a lamp", LAMP BOX("0.5", "0.5", "dense") BOX("0.1", "3", "thin"), 2, 0.2, 1},
    {"two boxes on a lamp", LAMP BOX("0.5", "0.5", "dense") BOX("0.1", "1.1", "thin"), 2, 0.2, 1},
};

static Room pile_open(const char *text, int lanes) {
    return room_of((const char *const[]){"<scene version='3.0.0'>", sensor, media, text, "</scene>", NULL}, 2, lanes, NULL, 0);
}

// Mean over pixels and seeds of the picture (param -1) or its derivative, against what it should be.
static void expect(Room room, const char *text, int param, double expected) {
    double sum = 0, squares = 0;
    const float one = 1;
    for (int s = 0; s < SETS; s++) {
        float image[3 * ACROSS * ACROSS];
        double mean = 0;
        rey_render_def def = def_make(MOST_PATHS / (ACROSS * ACROSS), (uint32_t)s, 1);
        ok(room, param < 0 ? rey_render(room.scene, &def, image, NULL)
                           : rey_jvp(room.scene, &def, (rey_selection){&param, 1}, &one, image, NULL, NULL));
        for (int i = 0; i < 3 * ACROSS * ACROSS; i++) {
            mean += (double)image[i] / (3 * ACROSS * ACROSS);
        }
        sum += mean;
        squares += mean * mean;
    }
    double mean = sum / SETS, error = sqrt(fmax(squares / SETS - mean * mean, 0) / (SETS - 1));
    if (fabs(mean - expected) > 5 * error + 1e-3 * fabs(expected) || error * sqrt(sample_share()) > 0.01 * fabs(expected)) {
        fail_msg("%s: %.6g +- %.2g, expected %.6g", text, mean, error, expected);
    }
}

static void judge(const Pile *pile, int lanes) {
    Room room = pile_open(pile->scene, lanes);
    const double along = sqrt(36 + 9 + 64) / 8, thin = pile->thin * along, dense = pile->dense * along;
    double value = pile->radiance * exp(-0.5 * thin - 1.2 * dense);
    expect(room, pile->text, -1, value);
    expect(room, pile->text, rey_param_find(room.scene, "thin.sigma_t.value.value"), -thin * value);
    expect(room, pile->text, rey_param_find(room.scene, "dense.sigma_t.value.value"), -dense * value);
    room_close(room);
}

static void test_piles(void **state) {
    UNUSED(state);
    for (size_t i = 0; i < COUNT_OF(piles); i++) {
        judge(piles + i, 0);
    }
    judge(piles, 1);
    if (rey_widest_lanes() > 8) {
        judge(piles, 8);
    }
}

// A lamp above a box of fog or in it: in the fog, and all but on its border, its gradient is refused.
static void spot_at(const char *height, rey_result expected) {
    char text[2048];
    snprintf(text, sizeof text,
             BOX("0.8", "0", "thin") "<shape type='rectangle'><transform name='to_world'><scale value='4'/><translate z='-1.1'/>"
             "</transform></shape><emitter type='spot' id='spot'><transform name='to_world'><lookat origin='0.5, 0.2, %s' "
             "target='0, 0, -9' up='0, 1, 0'/></transform></emitter>",
             height);
    Room room = pile_open(text, 1);
    int param = rey_param_find(room.scene, "spot.to_world");
    assert_true(param >= 0);
    float tangent[16] = {0}, image[3 * ACROSS * ACROSS];
    tangent[3] = 1;
    for (uint32_t seed = 0; seed < 4; seed++) {
        rey_render_def def = def_make(512, seed, 1);
        rey_result result = rey_jvp(room.scene, &def, (rey_selection){&param, 1}, tangent, image, NULL, NULL);
        if (result != expected) {
            fail_msg("a spot at z = %s, seed %u: %d, %s", height, seed, result, rey_error(room.ctx));
        }
    }
    room_close(room);
}

static void test_lights_beside_borders(void **state) {
    UNUSED(state);
    spot_at("4", REY_OK);
    spot_at("0.3", REY_OK);
    spot_at("0.7995", REY_ERROR_INCOMPLETE);
}

// Whether the gradient by the pose of a box of fog is known under a sun, the box placed so.
static void sun_over_box(const char *sun, const char *place, const char *refusal) {
    char text[2048];
    snprintf(text, sizeof text,
             "<shape type='cube' id='box'><transform name='to_world'>%s</transform><bsdf type='null'/>"
             "<ref name='interior' id='thin'/></shape><shape type='rectangle'><transform name='to_world'><scale value='4'/>"
             "<translate z='-1.1'/></transform></shape><emitter type='directional' id='sun'><vector name='direction' value='%s'/>"
             "</emitter>",
             place, sun);
    Room room = pile_open(text, 0);
    float tangent[16] = {[3] = 1}, image[3 * ACROSS * ACROSS];
    static const char *const names[] = {"box.to_world", "sun.to_world"};
    for (size_t i = 0; i < COUNT_OF(names); i++) {
        int param = rey_param_find(room.scene, names[i]);
        rey_render_def def = def_make(4, 0, 1);
        rey_result result = rey_jvp(room.scene, &def, (rey_selection){&param, 1}, tangent, image, NULL, NULL);
        bool expected = refusal && (i == 0 || strstr(refusal, "'sun'"));
        if (result != (expected ? REY_ERROR_INCOMPLETE : REY_OK) || (expected && i == 0 && !strstr(rey_error(room.ctx), refusal))) {
            fail_msg("%s, sun %s, box %s: %d, %s", names[i], sun, place, result, rey_error(room.ctx));
        }
    }
    room_close(room);
}

static void test_faces_that_rays_run_along(void **state) {
    UNUSED(state);
    sun_over_box("0.1, 0.05, -1", "", NULL);
    sun_over_box("0, 0, -1", "", "the rays of 'sun' run along a face");
    sun_over_box("0, 0, -1", "<rotate z='1' angle='10'/>", "the rays of 'sun' run along a face");
    sun_over_box("0, 0.1, -1", "<rotate z='1' angle='10'/>", NULL);
    // Parallel to what the sensor looks along, within the film and outside of it.
    sun_over_box("0.1, 0.05, -1", "<scale value='0.05'/><lookat origin='0, 0, 0' target='6, -3, -8' up='0, 1, 0'/>",
                 "the sensor's rays run along a face of a medium's border ('box')");
    sun_over_box("0.1, 0.05, -1", "<lookat origin='0, 0, 0' target='6, -3, -8' up='0, 1, 0'/>", NULL);
}

// A clear box of fog, whose edges rays pass at less than a step from its next face, lets all of the sky through; near and far from
// the origin. A lamp on a surface of the kind null hangs before a body of fog and is seen.
static void see(const char *what, const char *text, int lanes, double expected, double least) {
    float image[3 * ACROSS * ACROSS];
    Room room = room_of((const char *const[]){"<scene version='3.0.0'>", text, "</scene>", NULL}, 2, lanes, NULL, 0);
    rey_render_def def = def_make(256, 0, 1);
    ok(room, rey_render(room.scene, &def, image, NULL));
    double mean = 0, lowest = 1e9;
    for (int i = 0; i < 3 * ACROSS * ACROSS; i++) {
        mean += (double)image[i] / (3 * ACROSS * ACROSS);
        lowest = fmin(lowest, (double)image[i]);
    }
    if (fabs(mean - expected) > 2e-4 || lowest < least) {
        fail_msg("%s, %d lanes: mean %.6g, least %.6g, expected %.6g", what, lanes, mean, lowest, expected);
    }
    room_close(room);
}

#define CLEAR_BOX(place) \
    "<integrator type='volpath'/><medium type='homogeneous' id='fog'><float name='sigma_t' value='1e-6'/>" \
    "<float name='albedo' value='0'/></medium>" \
    "<sensor type='orthographic'><transform name='to_world'><scale value='2'/><lookat origin='-3, 2, 4' target='0, 0, 0' " \
    "up='0, 1, 0'/><translate " place "/></transform>" \
    "<film type='hdrfilm'><integer name='width' value='16'/><integer name='height' value='16'/></film></sensor>" \
    "<shape type='cube'><transform name='to_world'><rotate x='1' y='0.3' z='0.2' angle='35'/><translate " place "/></transform>" \
    "<bsdf type='null'/><ref name='interior' id='fog'/></shape>" SKY

static void test_edges_of_borders(void **state) {
    UNUSED(state);
    for (int lanes = 0; lanes < 2; lanes++) {
        see("a box", CLEAR_BOX("x='0'"), lanes, 1, 0.995);
        see("a box at 100", CLEAR_BOX("x='100' z='-100'"), lanes, 1, 0.99);
        see("a box at 1000", CLEAR_BOX("x='1000' z='-1000'"), lanes, 1, 0.98);
    }
}

static void test_null_lamps(void **state) {
    UNUSED(state);
    for (int lanes = 0; lanes < 2; lanes++) {
        see("a lamp",
            "<integrator type='volpath'/><medium type='homogeneous' id='fog'><float name='sigma_t' value='1e-6'/></medium>"
            "<sensor type='orthographic'><transform name='to_world'><scale value='0.3'/><lookat origin='0, 0, 4' target='0, 0, 0' "
            "up='0, 1, 0'/></transform>"
            "<film type='hdrfilm'><integer name='width' value='16'/><integer name='height' value='16'/></film></sensor>"
            "<shape type='sphere'><bsdf type='null'/><ref name='interior' id='fog'/></shape>"
            "<shape type='rectangle'><transform name='to_world'><translate z='1.5'/></transform><bsdf type='null'/>"
            "<emitter type='area'><float name='radiance' value='2'/></emitter></shape>",
            lanes, 2, 1.99);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_piles), cmocka_unit_test(test_lights_beside_borders),
                                       cmocka_unit_test(test_faces_that_rays_run_along),
                                       cmocka_unit_test(test_edges_of_borders), cmocka_unit_test(test_null_lamps)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
