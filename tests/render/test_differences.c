// The derivative with respect to every parameter of a room, forward mode per image block, against finite differences on
// the same samples. Seeds are added until the standard error of what is left is at most 2 % of the blocks' RMS; all of
// it is judged together. Arguments are the rooms' files.
//
// Where the choice of samples depends on the parameter, differences jump, and their variance grows as the step shrinks:
// those parameters are tried again. In strict rooms with larger steps (and a formula of higher order), and with more
// samples; in the others along replayed paths (render/replay.h), on which choices stay as they are. What fresh paths
// say is judged all the same, by its sum: a density of 0 where the derivative is not would be missing from replays.
#include "rooms.h"

#include "render/replay.h"

#include <malloc.h>
#include <math.h>
#include <stdlib.h>

enum { BLOCKS_ACROSS = 3, BLOCKS = 9, LARGEST = 1024, POSE = 16 };

// Error of the differences themselves over RMS.
static const double truncation = 0.003;
// The RMS counts as at least this much of the picture, per unit of relative change of the parameter.
static const double least = 0.015;

// One way of taking differences.
typedef struct Effort {
    int spp, fewest, most;
    double step, one_sided_step; // over the size of the values
    bool high_order, replays;
    double aim, bound;             // standard error over RMS at which sampling stops, and at most
} Effort;

static const Effort quick = {16, 6, 8, 0.02, 0.02, false, false, 0.018, 0.02},
                    thorough = {128, 6, 120, 0.1, 0.06, true, false, 0.018, 0.02},
                    replayed = {16, 6, 8, 0.004, 0.002, false, true, 0.018, 0.02},
                    // Extinctions: differences of where paths collide are as noisy as the score that they are.
                    foggy = {64, 6, 24, 0.004, 0.002, false, true, 0.05, 0.055};

// Mean over pixels and channels of each block.
static void blocks_of(const float *image, double *blocks) {
    enum { ACROSS = SIZE / BLOCKS_ACROSS };
    memset(blocks, 0, BLOCKS * sizeof *blocks);
    for (int i = 0; i < SIZE * SIZE; i++) {
        int block = i / SIZE / ACROSS * BLOCKS_ACROSS + i % SIZE / ACROSS;
        for (int c = 0; c < 3; c++) {
            blocks[block] += (double)image[3 * i + c] / (3.0 * ACROSS * ACROSS);
        }
    }
}

// A parameter, the direction in which it moves, and how far.
typedef struct Move {
    const char *room;
    int param, count, spp;
    float start[LARGEST], tangent[LARGEST];
    double h, scale; // step; size of the values
    bool one_sided, high_order;
    rey_scene *replayed; // the copy of the scene that moves along its paths, null = fresh paths
} Move;

// A pose turns about an axis.
static void turn(Move *m) {
    const float w[3] = {m->tangent[0], m->tangent[1], m->tangent[2]};
    for (int column = 0; column < 4; column++) {
        for (int row = 0; row < 3; row++) {
            int next = (row + 1) % 3, last = (row + 2) % 3;
            m->tangent[4 * row + column] = w[next] * m->start[4 * last + column] - w[last] * m->start[4 * next + column];
        }
    }
    memset(m->tangent + 12, 0, 4 * sizeof *m->tangent);
    m->scale = 1;
    m->h = 0.01; // radians
}

static Move move_make(Room room, const char *file, int param, const Effort *effort) {
    Move m = {.room = file, .param = param, .spp = effort->spp, .high_order = effort->high_order};
    rey_param_info info;
    rey_param_get_info(room.scene, param, &info);
    assert_true(info.count <= LARGEST);
    m.count = (int)info.count;
    memcpy(m.start, rey_param_values(room.scene, param), (size_t)m.count * sizeof *m.start);
    uint64_t random = (uint64_t)param + 77;
    for (int i = 0; i < m.count; i++) { // what is at the end of its range moves away from it
        float x = m.start[i], step = 2.01f * (float)effort->step * fabsf(x);
        bool low = x - step <= info.low, high = x + step >= info.high;
        double t = 0.5 + 0.5 * uniform(&random);
        m.tangent[i] = (float)(high && !low ? -t : t);
        m.one_sided |= low || high;
        m.scale = fmax(m.scale, fabs((double)x));
    }
    m.scale = m.scale > 0 ? m.scale : 1;
    // Texture coordinates move over texels' edges, where values have kinks.
    m.h = (strstr(info.name, "to_uv") ? 0.001 : m.one_sided ? effort->one_sided_step : effort->step) * m.scale;
    if (m.count == POSE) {
        turn(&m);
    }
    return m;
}

// Renders the scene moved by theta along the direction.
static void moved(Room room, const Move *m, double theta, uint32_t seed, double *blocks) {
    static float image[NUMBERS];
    float values[LARGEST];
    for (int i = 0; i < m->count; i++) {
        values[i] = m->start[i] + (float)(theta * (double)m->tangent[i]);
    }
    rey_render_def def = def_make(m->spp, seed, 1);
    rey_scene *scene = m->replayed ? m->replayed : room.scene;
    ok(room, rey_param_set(scene, m->param, values, m->count));
    ok(room, m->replayed ? rey_replay(room.scene, scene, &def, image, NULL) : rey_render(scene, &def, image, NULL));
    blocks_of(image, blocks);
}

// d(blocks) / d theta by differences, and the level of the picture.
static void difference(Room room, const Move *m, uint32_t seed, double *d, double *level) {
    static const struct {
        int n, at[4];
        double weight[4];
    } rules[] = {{2, {-1, 1}, {-0.5, 0.5}},
                 {4, {-2, -1, 1, 2}, {1 / 12.0, -8 / 12.0, 8 / 12.0, -1 / 12.0}},
                 {3, {0, 1, 2}, {-1.5, 2, -0.5}},
                 {4, {0, 1, 2, 3}, {-11 / 6.0, 3, -1.5, 1 / 3.0}}};
    int rule = 2 * m->one_sided + m->high_order;
    double values[BLOCKS + 1] = {0}; // the level last
    char name[128];
    snprintf(name, sizeof name, "%s %d %d %d %g %d %u", m->room, m->param, rule, m->spp, m->h, m->replayed != NULL, seed);
    if (kept(name, values, BLOCKS + 1, false)) {
        memcpy(d, values, BLOCKS * sizeof *d);
        *level = values[BLOCKS];
        return;
    }
    for (int k = 0; k < rules[rule].n; k++) {
        double blocks[BLOCKS];
        moved(room, m, rules[rule].at[k] * m->h, seed, blocks);
        for (int i = 0; i < BLOCKS; i++) {
            values[i] += rules[rule].weight[k] * blocks[i] / m->h;
            values[BLOCKS] += k == 0 ? blocks[i] / BLOCKS : 0;
        }
    }
    kept(name, values, BLOCKS + 1, true);
    memcpy(d, values, BLOCKS * sizeof *d);
    *level = values[BLOCKS];
    ok(room, rey_param_set(m->replayed ? m->replayed : room.scene, m->param, m->start, m->count));
}

typedef struct Sum {
    double n, mean, m2;
} Sum;

static void sum_add(Sum *s, double x) {
    double d = x - s->mean;
    s->n++;
    s->mean += d / s->n;
    s->m2 += d * (x - s->mean);
}

static double sum_error2(const Sum *s) { return s->m2 / (s->n - 1) / s->n; }

// Derivatives of the blocks, and their differences from the quotients.
typedef struct Blocks {
    Sum forward[BLOCKS], off[BLOCKS], total; // total: off, of all blocks together
    double level;
} Blocks;

// RMS over the blocks of the derivative, and of the standard error.
static double rms_of(const Blocks *b, const Move *m, double *error) {
    double square = 0, error2 = 0;
    for (int i = 0; i < BLOCKS; i++) {
        square += b->forward[i].mean * b->forward[i].mean / BLOCKS;
        error2 += sum_error2(b->off + i) / BLOCKS;
    }
    *error = sqrt(error2);
    return fmax(sqrt(square), least * b->level / m->scale);
}

// The mean over its standard error, made normal [wallace1959].
static double z_of(const Sum *off, double rms) {
    double error2 = sum_error2(off) + (truncation * rms) * (truncation * rms), degrees = off->n - 1;
    double t2 = off->mean * off->mean / error2;
    double z = sqrt(degrees * log1p(t2 / degrees)) * (8 * degrees + 1) / (8 * degrees + 3);
    return off->mean < 0 ? -z : z;
}

typedef struct Score {
    double sum, worst;
    int n, judged;
    double fresh_sum; // of parameters that are judged along replayed paths: z of fresh ones
    int fresh_n, left_out;
} Score;

// Adds seeds until the standard error is small enough; whether it became so.
static bool measure(Room room, const Move *m, const Effort *effort, Blocks *blocks, double *rms, int *seeds) {
    static float derivative[NUMBERS];
    const double coarse = 1 / sqrt(sample_share());
    double error = 0;
    *rms = 0;
    int seed = 0;
    for (; seed < effort->most && (seed < effort->fewest || error > coarse * effort->aim * *rms); seed++) {
        double quotient[BLOCKS], forward[BLOCKS];
        difference(room, m, (uint32_t)seed, quotient, &blocks->level);
        rey_render_def def = def_make(effort->spp, (uint32_t)seed, 1);
        ok(room, rey_jvp(room.scene, &def, (rey_selection){&m->param, 1}, m->tangent, derivative, NULL, NULL));
        blocks_of(derivative, forward);
        double total = 0;
        for (int i = 0; i < BLOCKS; i++) {
            sum_add(blocks->forward + i, forward[i]);
            sum_add(blocks->off + i, forward[i] - quotient[i]);
            total += forward[i] - quotient[i];
        }
        sum_add(&blocks->total, total);
        *rms = seed ? rms_of(blocks, m, &error) : 0;
    }
    *seeds = seed;
    if (getenv("REYNOLDS_TEST_VERBOSE") || error > coarse * effort->bound * *rms) {
        rey_param_info info;
        rey_param_get_info(room.scene, m->param, &info);
        print_message("%-44s RMS %10.3g, standard error %6.2f %%, %3d x %3d %s\n", info.name, *rms,
                      *rms > 0 ? 100 * error / *rms : 0, seed, effort->spp, m->replayed ? "replayed" : "samples");
    }
    return error <= coarse * effort->bound * *rms;
}

static void judge(Room room, const Move *m, const Blocks *blocks, double rms, Score *score) {
    double worst = 0;
    for (int i = 0; i < BLOCKS; i++) {
        double z = z_of(blocks->off + i, rms);
        worst = fabs(z) > fabs(worst) ? z : worst;
        score->sum += z;
        score->n++;
    }
    score->judged++;
    score->worst = fmax(score->worst, fabs(worst));
    if (fabs(worst) > 4) {
        rey_param_info info;
        rey_param_get_info(room.scene, m->param, &info);
        print_message("%s: worst z %.2f\n", info.name, worst);
    }
}

// The index of rough glass: its derivative is unbounded at the critical angle, which differences straddle. It is judged in
// a strict room.
static bool is_glass(Room room, int param) {
    static const char end[] = "bsdf.eta.value";
    rey_param_info info;
    rey_param_get_info(room.scene, param, &info);
    const char *found = strstr(info.name, end);
    return found && found[sizeof end - 1] == 0;
}

// Each slot of a function is quiet on fresh paths in a strict room.
typedef struct RoomCase {
    const char *file;
    bool strict, media;
} RoomCase;

// Whether the parameter could be judged, or need not be.
static bool compare(Room room, rey_scene *copy, int param, const RoomCase *r, Score *score) {
    const bool strict = r->strict;
    Move m = move_make(room, r->file, param, &quick);
    Blocks fresh = {.level = 0}, again = {.level = 0};
    double rms;
    int seeds;
    if (measure(room, &m, &quick, &fresh, &rms, &seeds)) {
        judge(room, &m, &fresh, rms, score);
        return true;
    }
    bool replays = !strict && rey_can_replay(room.scene, param);
    if (replays) {
        score->fresh_sum += z_of(&fresh.total, rms);
        score->fresh_n++;
    }
    const Effort *effort = replays ? (r->media ? &foggy : &replayed) : &thorough;
    m = move_make(room, r->file, param, effort);
    m.replayed = replays ? copy : NULL;
    if ((strict || replays) && measure(room, &m, effort, &again, &rms, &seeds)) {
        judge(room, &m, &again, rms, score);
        return true;
    }
    // What turns normals or lights is not replayed, and turned lights are not made for large steps.
    bool may = strict ? m.count == POSE : !replays || is_glass(room, param);
    score->left_out += may;
    return may;
}

static const RoomCase rooms[] = {{"tiles.xml", true, false},        {"edges.xml", true, false},
                                 {"materials.xml", false, false},   {"shapes.xml", false, false},
                                 {"principled.xml", false, false},  {"layers.xml", false, false},
                                 {"lights.xml", false, false},      {"moving_ball.xml", false, false},
                                 {"moving_box.xml", false, false},  {"moving_dome.xml", true, false},
                                 {"moving_disk.xml", true, false},  {"moving_tube.xml", true, false},
                                 {"fog.xml", false, true},          {"smoke.xml", false, true},
                                 {"media_flakes.xml", false, true}, {"media_pair.xml", false, true},
                                 {"dropped.xml", false, false},       {"sieve.xml", false, false},
                                 {"glowing.xml", false, false},      {"glowing_round.xml", false, false}};

static void test_differences(void **state) {
    const RoomCase *r = *state;
    Room room = room_open(r->file, 1, 0);
    rey_scene *copy = room_load(room.ctx, r->file);
    Score score = {0};
    int noisy = 0;
    for (int i = 0; i < rey_param_count(room.scene); i++) {
        noisy += has_interior(room, i) && !compare(room, copy, i, r, &score);
    }
    double p = erfc(score.worst / sqrt(2)), threshold = -expm1(log1p(-0.01 / COUNT_OF(rooms)) / score.n);
    double fresh = score.fresh_n ? score.fresh_sum / sqrt(score.fresh_n) : 0;
    print_message("%d parameters, %d blocks, largest |z| %.2f, sum / sqrt(n) %.2f; %d replayed, fresh sum %.2f; "
                  "%d left out\n",
                  score.judged, score.n, score.worst, score.sum / sqrt(score.n), score.fresh_n, fresh, score.left_out);
    rey_scene_destroy(copy);
    room_close(room);
    assert_int_equal(noisy, 0);
    assert_true(score.judged > score.left_out);
    assert_true(p > threshold);
    assert_true(fabs(score.sum) / sqrt(score.n) < 3);
    assert_true(fabs(fresh) < 3);
}

// Arguments: what the names of rooms begin with.
int main(int argc, char **argv) {
    // Thousands of short renders: their memory is kept.
    mallopt(M_MMAP_THRESHOLD, 1 << 30);
    mallopt(M_TRIM_THRESHOLD, 1 << 30);
    struct CMUnitTest tests[COUNT_OF(rooms)];
    for (int i = 0; i < COUNT_OF(rooms); i++) {
        tests[i] = (struct CMUnitTest){rooms[i].file, test_differences, NULL, NULL, (void *)(uintptr_t)(rooms + i)};
    }
    size_t count = tests_asked(tests, COUNT_OF(rooms), argc, argv);
    return _cmocka_run_group_tests("differences", tests, count, write_pictures, remove_pictures);
}
