// The curves along which surfaces pass through each other: that what is found is as long as they are, and lies on them.
#include "../quadric.h"
#include "rooms.h"

#define PI 3.14159265358979323846

#define FLOOR "<shape type='rectangle'><transform name='to_world'><scale value='4'/></transform></shape>"
#define BALL(x, z, r) \
    "<shape type='sphere'><point name='center' x='" x "' y='0' z='" z "'/><float name='radius' value='" r "'/></shape>"
#define POST(z, height) \
    "<shape type='cylinder'><point name='p0' x='2' y='0' z='" z "'/><point name='p1' x='2' y='0' z='" height "'/>" \
    "<float name='radius' value='0.5'/></shape>"
#define GROUP \
    "<shape type='shapegroup' id='pair'>" BALL("0", "0", "0.5") BALL("0.6", "0", "0.5") "</shape>" \
    "<shape type='instance'><ref id='pair'/><transform name='to_world'><scale value='2'/><translate z='9'/></transform></shape>" \
    "<shape type='instance'><ref id='pair'/><transform name='to_world'><translate z='-9'/></transform></shape>"

#define PIPE "<shape type='obj'><string name='filename' value='$file'/></shape>"
#define RING(z) "v -1 -1 " z "\nv 1 -1 " z "\nv 1 1 " z "\nv -1 1 " z "\n"
#define RINGS RING("-1") RING("0") RING("1")
#define LOWER "f 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n"
#define UPPER "f 5 6 10 9\nf 6 7 11 10\nf 7 8 12 11\nf 8 5 9 12\n"
#define STRIP "v -1 -1 0\nv 1 -1 0\nv -1 0 0\nv 1 0 0\nv -1 1 0\nv 1 1 0\nf 1 2 4 3\nf 3 4 6 5\n"
#define TURNED(z) \
    "<shape type='obj'><string name='filename' value='$file'/><transform name='to_world'><rotate x='1' angle='90'/>" \
    "<translate z='" z "'/></transform></shape>"
#define TUBE "<shape type='bsplinecurve'><string name='filename' value='$file'/></shape>"

// Lengths are in units of pi. Planes that hold middles, axes and joints are those that scenes have.
static const struct {
    const char *text, *scene, *file;
    double length;
} cases[] = {
    {"a ball in a floor", FLOOR BALL("0", "0.3", "0.5"), NULL, 2 * 0.4},
    {"two balls", BALL("0", "0", "0.5") BALL("0.6", "0", "0.5"), NULL, 2 * 0.4},
    {"two larger balls, and one far away", BALL("0", "0", "1") BALL("1", "0", "1") BALL("5", "0", "1"), NULL, 2 * 0.8660254},
    {"a ball beside another, whose boxes overlap", BALL("0", "0", "0.5") BALL("0.75", "0.75", "0.5"), NULL, 0},
    {"a ball within another", BALL("0", "0", "1") BALL("0.2", "0.1", "0.5"), NULL, 0},
    {"a ball within another, and through both a floor", FLOOR BALL("0", "0", "1") BALL("0.2", "0", "0.5"), NULL, 2 * 1.5},
    {"a row of balls",
     BALL("0", "0", "0.5") BALL("0.6", "0", "0.5") BALL("1.2", "0", "0.5") BALL("1.8", "0", "0.5"), NULL, 2 * 0.4 * 3},
    {"a post and a ball in a floor", FLOOR POST("-1", "1") BALL("-2", "0.3", "0.5"), NULL, 2 * 0.5 + 2 * 0.4},
    {"two instances of two balls", GROUP, NULL, 2 * 0.4 * 3},
    {"a pipe in a floor, its sides cut there", FLOOR PIPE, RINGS LOWER UPPER, 8 / PI},
    {"its lower half, which touches the floor", FLOOR PIPE, RINGS LOWER, 0},
    {"its upper half", FLOOR PIPE, RINGS UPPER, 0},
    {"a tent on a floor: both its sides above", FLOOR PIPE, "v -1 0 0\nv 1 0 0\nv 0 1 1\nv 0 -1 1\nf 1 2 3\nf 1 2 4\n", 0},
    {"a pipe in a disk, its sides cut there", "<shape type='disk'><transform name='to_world'><scale value='4'/></transform></shape>"
     PIPE, RINGS LOWER UPPER, 8 / PI},
    {"two walls, both cut where they cross", PIPE TURNED("0"), STRIP, 2 / PI},
    {"two walls, one of which ends at where the other is cut", PIPE TURNED("1"), STRIP, 0},
    {"a fold through a floor, whose spine is an edge by itself", FLOOR PIPE,
     "v -1 0 0\nv 1 0 0\nv 0 1 1\nv 0 1 -1\nf 1 2 3\nf 2 1 4\n", 0},
    {"a roof through a floor, cut there", FLOOR PIPE, "v -1 0 0\nv 1 0 0\nv 0 1 1\nv 0 -1 -1\nf 1 2 3\nf 1 4 2\n", 2 / PI},
    {"a log half in a floor",
     FLOOR "<shape type='cylinder'><point name='p0' x='-1' y='0' z='0'/><point name='p1' x='1.5' y='0' z='0'/>"
     "<float name='radius' value='0.5'/></shape>", NULL, 5 / PI},
    {"a coin half in a floor",
     FLOOR "<shape type='disk'><transform name='to_world'><rotate x='1' angle='90'/></transform></shape>", NULL, 2 / PI},
    {"a mast through a floor between its segments", FLOOR TUBE,
     "0 0 -2 0.3\n0 0 -1 0.3\n0 0 0 0.3\n0 0 1 0.3\n0 0 2 0.3\n", 2 * 0.3},
    {"a mast through a floor in the middle of its only segment", FLOOR TUBE,
     "0 0 -1.5 0.3\n0 0 -0.5 0.3\n0 0 0.5 0.3\n0 0 1.5 0.3\n", 2 * 0.3},
    {"a rope half in a floor", FLOOR TUBE, "-2 0 0 0.3\n-1 0 0 0.3\n0 0 0 0.3\n1 0 0 0.3\n2 0 0 0.3\n", 4 / PI},
    {"a mast that ends at a floor", FLOOR TUBE, "0 0 -1 0.3\n0 0 0 0.3\n0 0 1 0.3\n0 0 2 0.3\n", 0},
};

static bool moves_any(const void *user, int32_t shape, int32_t instance) {
    UNUSED(user);
    UNUSED(shape);
    UNUSED(instance);
    return true;
}

static bool moves_none(const void *user, int32_t shape, int32_t instance) {
    UNUSED(user);
    UNUSED(shape);
    UNUSED(instance);
    return false;
}

// Of a point from a surface, to first order.
static double distance_to(const Quadric *q, const float *x) {
    double g[3], value = quadric_at(q, x, g);
    return fabs(value) / sqrt(g[0] * g[0] + g[1] * g[1] + g[2] * g[2]);
}

static Room scene_open(const char *shapes, const char *file) {
    char path[64];
    snprintf(path, sizeof path, "/tmp/reynolds_meetings_%ld.obj", (long)getpid());
    write_texts(path, (const char *const[]){file, NULL});
    const char *const texts[] = {"<scene version='3.0.0'>", shapes, "</scene>", NULL};
    Room room = room_of(texts, 1, 0, (const rey_define[]){{"file", path}}, file != NULL);
    unlink(path);
    return room;
}

static void test_lengths(void **state) {
    UNUSED(state);
    for (int i = 0; i < COUNT_OF(cases); i++) {
        Room room = scene_open(cases[i].scene, cases[i].file);
        Array found = {0};
        double length = 0;
        ok(room, rey_meetings_find(room.scene, NULL, 0, moves_none, NULL, &found));
        assert_int_equal(found.count, 0);
        ok(room, rey_meetings_find(room.scene, NULL, 0, moves_any, NULL, &found));
        for (size_t m = 0; m < found.count; m++) {
            const MeetingRecord *meeting = &ARRAY_AT(found, MeetingRecord, m);
            const float *a = meeting->ends, *b = a + 3;
            length += sqrt((double)((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) + (a[2] - b[2]) * (a[2] - b[2])));
            for (int k = 0; k < 4 && !cases[i].file; k++) {
                assert_true(distance_to(meeting->surface + k / 2, meeting->ends + 3 * (k % 2)) < 1e-5);
            }
        }
        print_message("%-48s %4d pieces, length %8.5f of %8.5f\n", cases[i].text, (int)found.count, length, PI * cases[i].length);
        assert_true(fabs(length - PI * cases[i].length) <= 0.01 * PI * cases[i].length); // they are chords
        rey_array_free(room.ctx, &found);
        room_close(room);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_lengths)};
    return cmocka_run_group_tests_name("meetings", tests, NULL, NULL);
}
