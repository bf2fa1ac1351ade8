// Values and densities of functions against numbers that another renderer gave (tests/data/bsdf), and against those of
// the conformance folder, where it is installed.
#include "cases.h"

#include "math/json_lite.h"

static const KindKernels *const exact = &kind_kernels_double;

static void add_number(KindCase *c, int slot, const double *values, int n) {
    int id = c->texture_count++;
    c->textures[id] = (TextureNode){.kind = TEXTURE_CONSTANT, .theta = c->theta_count, .width = 1, .height = 1,
                                    .channels = n, .to_uv = -1};
    c->bsdfs[0].slot[slot] = id;
    for (int i = 0; i < n; i++) {
        c->theta[c->theta_count++] = values[i];
    }
}

// A function with the values of a JSON object; what is not there has its default, a number is a grey.
static void case_read(KindCase *c, const char *kind, const char *object) {
    *c = (KindCase){.coat_eta = -1, .coat_alpha = -1, .bsdf_count = 1};
    c->bsdfs[0] = (BsdfNode){.kind = rey_bsdf_kind_find(kind), .child = {-1, -1}, .table = -1};
    assert_true(c->bsdfs[0].kind >= 0);
    const BsdfKind *k = rey_bsdf_kinds + c->bsdfs[0].kind;
    for (int i = 0; i < k->param_count; i++) {
        const ParamDesc *p = k->params + i;
        const char *value = json_member(object, p->name);
        value = !value && p->type == PARAM_SPECULAR ? json_member(object, "eta") : value;
        double numbers[3] = {value ? json_number(value) : (double)p->value};
        int n = 1;
        if (p->type == PARAM_SPEC) {
            n = 3;
            numbers[1] = numbers[2] = numbers[0];
            if (value && *value == '[') {
                assert_int_equal(json_numbers(value, numbers, 3), 3);
            }
        }
        add_number(c, i, numbers, n);
    }
    for (int i = 0; i < k->config_count; i++) {
        const char *name = k->configs[i].choices;
        assert_true(strncmp(name, "given ", 6) == 0);
        const char *value = json_member(object, name + 6);
        c->bsdfs[0].config[i] = value && json_number(value) != 0;
    }
}

static int check(double got, double expected, double tolerance, const char *what) {
    if (fabs(got - expected) <= tolerance) {
        return 0;
    }
    print_error("%s is %.8g, expected %.8g: ", what, got, expected);
    return 1;
}

// Rows of wi, wo, value, density.
static int check_rows(const KindCase *c, const char *rows) {
    int failures = 0;
    for (int i = 0; json_element(rows, i); i++) {
        double row[10], f[1][3], pdf;
        assert_int_equal(json_numbers(json_element(rows, i), row, 10), 10);
        Query q = {{row[0], row[1], row[2]}, {row[3], row[4], row[5]}, {0, 0}, 0};
        exact->eval(c, 1, &q, f, &pdf);
        int here = 0;
        for (int k = 0; k < 3; k++) { // the other renderer's numbers are float: narrow lobes amplify their rounding
            here += check(f[0][k], row[6 + k], 2e-4 * row[6 + k] + 2e-6, "value");
        }
        if (pdf > 0 || row[6] > 0) { // its density from behind an opaque function is not 0, though it samples nothing
            here += check(pdf, row[9], 2e-4 * row[9] + 2e-6, "density");
        }
        if (here) {
            case_print(c, &q);
        }
        failures += here;
    }
    return failures;
}

static void test_own_facts(void **state) {
    UNUSED(state);
    char *text = json_read_file(TEST_DATA_DIR "/bsdf/principled.json");
    assert_non_null(text);
    const char *cases = json_member(text, "cases");
    int failures = 0, count = 0;
    for (const char *item; (item = json_element(cases, count)); count++) {
        const char *word = json_member(item, "kind") + 1;
        char kind[32] = {0};
        memcpy(kind, word, strcspn(word, "\""));
        KindCase c;
        case_read(&c, kind, json_member(item, "values"));
        failures += check_rows(&c, json_member(item, "rows"));
    }
    free(text);
    assert_int_equal(count, 40);
    assert_int_equal(failures, 0);
}

// Tables over wo = (sin t, 0, cos t), t from 0 to pi / 2, with a wi that is not normalised.
static int check_table(const char *text, const char *kind) {
    const char *table = json_member(text, kind);
    double wi[3], values[20], densities[20];
    KindCase c;
    case_read(&c, kind, json_member(table, "parameters"));
    assert_int_equal(json_numbers(json_member(text, "wi"), wi, 3), 3);
    assert_int_equal(json_numbers(json_member(table, "eval"), values, 20), 20);
    assert_int_equal(json_numbers(json_member(table, "pdf"), densities, 20), 20);
    int failures = 0;
    for (int i = 0; i < 20; i++) {
        double t = i / 19.0 * 1.5707963267948966, f[1][3], pdf;
        Query q = {{wi[0], wi[1], wi[2]}, {sin(t), 0, cos(t)}, {0, 0}, 0};
        exact->eval(&c, 1, &q, f, &pdf);
        int here = check(f[0][0], values[i], 1e-5 * values[i] + 1e-8, "value") +
                   check(pdf, densities[i], 1e-5 * densities[i] + 1e-8, "density");
        if (here) {
            case_print(&c, &q);
        }
        failures += here;
    }
    return failures;
}

static void test_conformance_facts(void **state) {
    UNUSED(state);
    const char *folder = getenv("REYNOLDS_CONFORMANCE_DIR");
    char path[4096];
    snprintf(path, sizeof path, "%s/facts/principled.json", folder ? folder : PROJECT_DIR "/../shared/conformance");
    char *text = json_read_file(path);
    if (!text) {
        print_message("skipped: %s is absent\n", path);
        skip();
    }
    int failures = check_table(text, "principled") + check_table(text, "principledthin");
    free(text);
    assert_int_equal(failures, 0);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_own_facts), cmocka_unit_test(test_conformance_facts)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
