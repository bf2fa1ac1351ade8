// test_cli_convert.c: `reynolds convert`, as a user runs it.
#include "command.h"

static void converted_scenes_render_the_same_bits(void **state) {
    Fixture *f = *state;
    JsonNode *node = run_json(f, 0, "convert %s copy.xml --json");
    assert_string_equal(json_text(node, "output", ""), "copy.xml");
    json_free(node);
    expect(f, 0, "render %s --spp 2 -o a.npy");
    expect(f, 0, "render copy.xml --spp 2 -o b.npy");
    assert_int_equal(system("cmp -s a.npy b.npy"), 0);
    assert_int_not_equal(system("cmp -s a.npy copy.xml"), 0);
}

static void failures_of_convert(void **state) {
    Fixture *f = *state;
    expect(f, 2, "convert %s");
    assert_non_null(strstr(f->words, "IN and OUT.xml"));
    expect(f, 1, "convert missing.xml copy.xml");
    expect(f, 1, "convert %s no/such/folder.xml");
    assert_non_null(strstr(f->words, "no/such/folder.xml"));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(converted_scenes_render_the_same_bits),
        cmocka_unit_test(failures_of_convert),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
