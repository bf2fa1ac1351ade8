// What is seen in smooth mirrors and through glass: the interior term of scenes in which no edge is seen there, forward
// mode per image block against central differences on the same random numbers, and reverse mode against forward mode.
#include "rooms.h"

enum { ACROSS = 3, BLOCKS = ACROSS * ACROSS, SEEDS = 8, SPP = 256, POSE = 16 };

// A step of a parameter: the turn or shift of a pose, or a number.
typedef struct Step {
    const char *room, *param;
    float shift[3], turn[3], add;
    double h;
    int effort; // times the usual samples
} Step;

static const Step steps[] = {
    {"chains_sky.xml", "camera.to_world", {0, 0, 0}, {0.3f, 1, 0.2f}, 0, 0.01, 1},
    {"chains_sky.xml", "camera.x_fov", {0}, {0}, 1, 0.2, 1},
    {"chains_lens.xml", "glass.eta", {0}, {0}, 1, 0.01, 5},
    {"chains_lens.xml", "ball.to_world", {1, 0.5f, 0.3f}, {0}, 0, 0.01, 1},
    {"chains_lens.xml", "wall.to_world", {1, 0.4f, 0.5f}, {0}, 0, 0.01, 1},
    {"chains_lens.xml", "camera.to_world", {0.6f, 1, 0}, {0.2f, 0.1f, 0}, 0, 0.01, 1},
    {"chains_coat.xml", "floor.to_world", {0, 1, 0}, {0.2f, 0, 0.1f}, 0, 0.01, 2},
    {"chains_coat.xml", "ceiling.to_world", {1, 0, 0.4f}, {0.01f, 0, 0}, 0, 0.01, 6},
    {"chains_coat.xml", "camera.to_world", {0, 1, 0.5f}, {0}, 0, 0.01, 4},
    {"chains_bowl.xml", "glass.eta", {0}, {0}, 1, 0.01, 1},
    {"chains_bowl.xml", "bowl.to_world", {1, 0, 0.5f}, {0}, 0, 0.02, 3},
    {"chains_bowl.xml", "floor.to_world", {0, 1, 0}, {0.5f, 0, 0.2f}, 0, 0.03, 2},
};

static void blocks_of(const float *image, double scale, double *blocks) {
    enum { WIDTH = SIZE / ACROSS };
    for (int i = 0; i < SIZE * SIZE; i++) {
        for (int c = 0; c < 3; c++) {
            blocks[i / SIZE / WIDTH * ACROSS + i % SIZE / WIDTH] += scale * (double)image[3 * i + c];
        }
    }
}

// The rate of change of the parameter's numbers.
static int tangent_of(Room room, const Step *s, int param, float *start, float *tangent) {
    rey_param_info info;
    ok(room, rey_param_get_info(room.scene, param, &info));
    assert_true(info.count == 1 || info.count == POSE);
    memcpy(start, rey_param_values(room.scene, param), (size_t)info.count * sizeof *start);
    tangent[0] = s->add;
    for (int i = 0; i < POSE && info.count == POSE; i++) {
        int row = i / 4, column = i % 4, a = (row + 1) % 3, b = (row + 2) % 3;
        float turned = row < 3 ? s->turn[a] * start[4 * b + column] - s->turn[b] * start[4 * a + column] : 0;
        tangent[i] = turned + (column == 3 && row < 3 ? s->shift[row] : 0);
    }
    return (int)info.count;
}

// With the derivative image as adjoint, reverse mode gives its square.
static void reverse_agrees(Room room, const rey_render_def *def, rey_selection selection, const float *image,
                           const float *tangent, int n) {
    double gradient[POSE], square = 0, along = 0;
    ok(room, rey_vjp(room.scene, def, selection, image, gradient, NULL, NULL));
    for (int i = 0; i < NUMBERS; i++) {
        square += (double)image[i] * (double)image[i];
    }
    for (int i = 0; i < n; i++) {
        along += gradient[i] * (double)tangent[i];
    }
    assert_true(fabs(along - square) <= 1e-4 * square);
}

// The differences' blocks, taken away from what is there.
static void subtract_quotient(Room room, const Step *s, int param, const float *start, const float *tangent, int n,
                              const rey_render_def *def, double *off) {
    static float image[NUMBERS];
    double blocks[BLOCKS] = {0};
    char name[128];
    snprintf(name, sizeof name, "%s %s %g %u %d", s->room, s->param, s->h, def->seed, def->spp);
    if (!kept(name, blocks, BLOCKS, false)) {
        for (int sign = -1; sign <= 1; sign += 2) {
            float values[POSE];
            for (int i = 0; i < n; i++) {
                values[i] = start[i] + (float)(sign * s->h) * tangent[i];
            }
            ok(room, rey_param_set(room.scene, param, values, n));
            ok(room, rey_render(room.scene, def, image, NULL));
            blocks_of(image, sign / (2 * s->h), blocks);
        }
        ok(room, rey_param_set(room.scene, param, start, n));
        kept(name, blocks, BLOCKS, true);
    }
    for (int b = 0; b < BLOCKS; b++) {
        off[b] -= blocks[b];
    }
}

static void test_step(void **state) {
    const Step *s = *state;
    static float image[NUMBERS];
    Room room = room_open(s->room, 1, 0);
    int param = rey_param_find(room.scene, s->param);
    assert_true(param >= 0);
    rey_selection selection = {&param, 1};
    float start[POSE], tangent[POSE];
    int n = tangent_of(room, s, param, start, tangent);
    double off[SEEDS][BLOCKS] = {{0}}, rms = 0, noise = 0, worst = 0, sum = 0;
    for (int seed = 0; seed < SEEDS; seed++) {
        rey_render_def def = def_make(SPP * s->effort, (uint32_t)seed + 1, 1);
        double blocks[BLOCKS] = {0};
        ok(room, rey_jvp(room.scene, &def, selection, tangent, image, NULL, NULL));
        blocks_of(image, 1, blocks);
        reverse_agrees(room, &def, selection, image, tangent, n);
        for (int b = 0; b < BLOCKS; b++) {
            off[seed][b] = blocks[b];
            rms += blocks[b] * blocks[b] / (SEEDS * BLOCKS);
        }
        subtract_quotient(room, s, param, start, tangent, n, &def, off[seed]);
    }
    for (int b = 0; b < BLOCKS; b++) {
        double mean = 0, variance = 0;
        for (int k = 0; k < SEEDS; k++) {
            mean += off[k][b] / SEEDS;
        }
        for (int k = 0; k < SEEDS; k++) {
            variance += (off[k][b] - mean) * (off[k][b] - mean) / (SEEDS - 1.0) / SEEDS;
        }
        noise = fmax(noise, variance);
        // Rounding and the step's own error beside the noise.
        double z = mean / sqrt(variance + 1e-5 * rms);
        worst = fmax(worst, fabs(z));
        sum += z;
    }
    print_message("%s %s: worst z %.2f, sum %.2f, error/rms %.3f%%\n", s->room, s->param, worst, sum / sqrt(BLOCKS),
                  100 * sqrt(noise / rms));
    assert_true(rms > 0);
    assert_true(noise * sample_share() <= 0.02 * 0.02 * rms);
    assert_true(worst < 5.5 && fabs(sum) / sqrt(BLOCKS) < 3.5); // t with 7 degrees of freedom
    room_close(room);
}

// Arguments: what the names of rooms, and parameters in them, begin with.
int main(int argc, char **argv) {
    struct CMUnitTest tests[COUNT_OF(steps)];
    static char names[COUNT_OF(steps)][64];
    for (int i = 0; i < COUNT_OF(steps); i++) {
        snprintf(names[i], sizeof names[i], "%s %s", steps[i].room, steps[i].param);
        tests[i] = (struct CMUnitTest){names[i], test_step, NULL, NULL, (void *)(uintptr_t)(steps + i)};
    }
    size_t count = tests_asked(tests, COUNT_OF(steps), argc, argv);
    return _cmocka_run_group_tests("chains", tests, count, write_pictures, remove_pictures);
}
