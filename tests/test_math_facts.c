// Tabulated facts of another renderer: Fresnel, microfacets, warps. Skipped where the tables are not there.
#define REAL_DOUBLE
#include "math/json_lite.h"
#include "math/microfacet.h"
#include "math/warp.h"

#include <setjmp.h>
#include <stdarg.h>

#include <cmocka.h>

#define DOUBLE_PI 3.14159265358979323846

static char *facts(const char *name) {
    const char *folder = getenv("REYNOLDS_CONFORMANCE_DIR");
    char path[4096];
    snprintf(path, sizeof path, "%s/facts/%s.json", folder ? folder : PROJECT_DIR "/../shared/conformance", name);
    char *text = json_read_file(path);
    if (!text) {
        print_message("skipped: %s is absent\n", path);
        skip();
    }
    return text;
}

static void near(double got, double expected, double relative, double absolute, const char *what, int index) {
    if (!(fabs(got - expected) <= relative * fabs(expected) + absolute)) {
        fail_msg("%s %d: %.9g, expected %.9g", what, index, got, expected);
    }
}

static void test_dielectric(void **state) {
    (void)state;
    char *text = facts("fresnel");
    const char *cases = json_member(text, "dielectric");
    int count = 0;
    for (const char *c; (c = json_element(cases, count)); count++) {
        double cos_t, eta_it, eta_ti;
        double f = fresnel_dielectric(json_number(json_member(c, "cos_theta_i")), json_number(json_member(c, "eta")),
                                      &cos_t, &eta_it, &eta_ti);
        near(f, json_number(json_member(c, "F")), 1e-5, 1e-8, "F", count);
        near(cos_t, json_number(json_member(c, "cos_theta_t")), 1e-5, 1e-8, "cos_t", count);
        if (json_member(c, "eta_it")) {
            near(eta_it, json_number(json_member(c, "eta_it")), 1e-5, 1e-8, "eta_it", count);
            near(eta_ti, json_number(json_member(c, "eta_ti")), 1e-5, 1e-8, "eta_ti", count);
        }
    }
    assert_true(count >= 9);
    free(text);
}

// Needs no table: an index of 1 is no interface, and a conductor without absorption is a dielectric.
static void test_fresnel_limits(void **state) {
    (void)state;
    for (int i = 0; i < 20; i++) {
        double cos_t, eta_it, eta_ti, c = -1 + 2 * i / 19.0;
        assert_true(fresnel_dielectric(c, 1, &cos_t, &eta_it, &eta_ti) == 0);
        near(cos_t, -c, 0, 5e-7, "index matched cos_t", i);
        double angle = DOUBLE_PI / 2 * i / 19;
        for (int k = 0; k < 2; k++) {
            double eta = k ? 1.5 : 1 / 1.5;
            near(fresnel_conductor_one(cos(angle), eta, 0), fresnel_dielectric(cos(angle), eta, &cos_t, &eta_it, &eta_ti),
                 1e-9, 1e-9, "conductor without absorption", i);
        }
    }
    near(fresnel_conductor_one(0.3, 0, 1), 1, 1e-12, 0, "ideal mirror", 0);
    // The fits against the integral 2 int F(c) c dc
    for (int k = 0; k < 7; k++) {
        const double etas[7] = {1 / 1.8, 1 / 1.33, 1.3, 1.8, 0.1, 0.25, 0.399};
        double sum = 0, cos_t, eta_it, eta_ti;
        for (int i = 0; i < 20000; i++) {
            double c = (i + 0.5) / 20000;
            sum += 2 * c * fresnel_dielectric(c, etas[k], &cos_t, &eta_it, &eta_ti) / 20000;
        }
        near(fresnel_diffuse_reflectance(etas[k]), sum, 0, 0.006, "diffuse reflectance", k);
    }
}

static void test_directions(void **state) {
    (void)state;
    char *text = facts("dielectric");
    const char *spot = json_element(json_member(text, "spot"), 1);
    double angle = json_number(json_member(spot, "wi_deg")) * DOUBLE_PI / 180, cos_t, eta_it, eta_ti;
    double refracted = json_number(json_member(spot, "wo_deg")) * DOUBLE_PI / 180;
    Vec3 wi = v3(sin(angle), 0, cos(angle)), m = v3(0, 0, 1);
    double f = fresnel_dielectric(wi.z, 1.5, &cos_t, &eta_it, &eta_ti);
    near(1 - f, json_number(json_member(spot, "pdf")), 1e-5, 0, "transmission probability", 0);
    Vec3 wo = refract(wi, m, cos_t, eta_ti), back;
    near(wo.x, -sin(refracted), 1e-9, 1e-9, "refracted x", 0);
    near(wo.z, -cos(refracted), 1e-9, 1e-9, "refracted z", 0);
    fresnel_dielectric(wo.z, 1.5, &cos_t, &eta_it, &eta_ti);
    back = refract(wo, m, cos_t, eta_ti);
    near(back.x, wi.x, 1e-9, 1e-9, "reversed x", 0);
    near(back.z, wi.z, 1e-9, 1e-9, "reversed z", 0);
    wo = reflect(wi, m);
    near(wo.x, -wi.x, 1e-12, 0, "reflected x", 0);
    near(wo.z, wi.z, 1e-12, 0, "reflected z", 0);
    free(text);
}

enum { D, PDF, G1 };

// Compares a table of 20 values along theta (elevation) or phi with one of the functions.
static void check_table(const Microfacet *mf, const char *table, const char *key, int what, double absolute) {
    const char *values = json_member(table, key);
    bool azimuth = json_member(table, "phi") && strstr(json_member(table, "phi"), "linspace") == json_member(table, "phi") + 1;
    for (int i = 0; i < 20; i++) {
        double theta = DOUBLE_PI * i / 19, phi = DOUBLE_PI / 2;
        if (azimuth) {
            theta = what == G1 ? 0.98 * DOUBLE_PI / 2 : 0.1;
            phi = 2 * DOUBLE_PI * i / 19;
        } else if (what == G1) {
            theta = DOUBLE_PI / 3 + DOUBLE_PI / 6 * i / 19;
        }
        Vec3 v = v3(cos(phi) * sin(theta), sin(phi) * sin(theta), cos(theta)), up = v3(0, 0, 1);
        double got = what == D ? microfacet_D(mf, v) : what == PDF ? microfacet_pdf(mf, up, v) : smith_G1(mf, v, up);
        double expected = json_number(*values == '[' ? json_element(values, i) : values);
        near(got, expected, 1e-5, absolute, key, i);
    }
}

static void test_microfacet(void **state) {
    (void)state;
    char *text = facts("microfacet");
    for (int ggx = 0; ggx < 2; ggx++) {
        const char *table = json_member(text, ggx ? "ggx" : "beckmann");
        Microfacet aniso = microfacet_make(ggx, false, 0.1, 0.3), iso = microfacet_make(ggx, false, 0.1, 0.1);
        check_table(&aniso, json_member(table, "g1_elevation"), "aniso", G1, 1e-5);
        check_table(&iso, json_member(table, "g1_elevation"), "iso", G1, 1e-5);
        check_table(&aniso, json_member(table, "g1_azimuth"), "aniso", G1, 1e-5);
        check_table(&iso, json_member(table, "g1_azimuth"), "iso", G1, 1e-5);
        if (!ggx) {
            check_table(&aniso, json_member(table, "elevation"), "aniso_eval", D, 1e-8);
            check_table(&aniso, json_member(table, "elevation"), "aniso_pdf", PDF, 1e-8);
            check_table(&iso, json_member(table, "elevation"), "iso_eval", D, 1e-8);
            check_table(&iso, json_member(table, "elevation"), "iso_pdf", PDF, 1e-8);
            check_table(&aniso, json_member(table, "azimuth"), "aniso_eval", D, 1e-8);
            check_table(&aniso, json_member(table, "azimuth"), "aniso_pdf", PDF, 1e-8);
            check_table(&iso, json_member(table, "azimuth"), "iso_eval", D, 1e-8);
            check_table(&iso, json_member(table, "azimuth"), "iso_pdf", PDF, 1e-8);
        }
    }
    free(text);
}

static void test_microfacet_samples(void **state) {
    (void)state;
    char *text = facts("microfacet");
    for (int ggx = 0; ggx < 2; ggx++) {
        const char *table = json_member(json_member(text, ggx ? "ggx" : "beckmann"), "sample");
        double normals[36 * 3], pdfs[36];
        assert_int_equal(json_numbers(json_member(table, "normal"), normals, 36 * 3), 36 * 3);
        assert_int_equal(json_numbers(json_member(table, "pdf"), pdfs, 36), 36);
        Microfacet mf = microfacet_make(ggx, false, 0.1, 0.3);
        for (int i = 0; i < 36; i++) {
            Vec3 up = v3(0, 0, 1), m = microfacet_sample(&mf, up, i % 6 / 6.0, i / 6 / 6.0);
            near(m.x, normals[3 * i], 0, 5e-4, "sampled x", i);
            near(m.y, normals[3 * i + 1], 0, 5e-4, "sampled y", i);
            near(m.z, normals[3 * i + 2], 0, 5e-4, "sampled z", i);
            near(microfacet_pdf(&mf, up, m), pdfs[i], 0, 1e-4, "density of sample", i);
        }
    }
    free(text);
}

static Vec3 warp_plane(Vec2 (*warp)(Vec2), Vec2 u) {
    Vec2 p = warp(u);
    return v3(p.x, p.y, 0);
}
static Vec3 apply_disk_polar(Vec2 u) { return warp_plane(warp_uniform_disk_polar, u); }
static Vec3 apply_disk(Vec2 u) { return warp_plane(warp_uniform_disk, u); }
static Vec3 apply_triangle(Vec2 u) { return warp_plane(warp_uniform_triangle, u); }
static Vec3 apply_sphere(Vec2 u) { return warp_uniform_sphere(u); }
static Vec3 apply_hemisphere(Vec2 u) { return warp_uniform_hemisphere(u); }
static Vec3 apply_cosine(Vec2 u) { return warp_cosine_hemisphere(u); }

static void test_warps(void **state) {
    (void)state;
    const struct {
        const char *key;
        Vec3 (*warp)(Vec2);
    } warps[] = {{"uniform_disk", apply_disk_polar}, {"uniform_disk_concentric", apply_disk},
                 {"uniform_triangle", apply_triangle}, {"uniform_sphere", apply_sphere},
                 {"uniform_hemisphere", apply_hemisphere}, {"cosine_hemisphere", apply_cosine}};
    char *text = facts("numerics");
    for (int w = 0; w < COUNT_OF(warps); w++) {
        const char *cases = json_member(json_member(text, "warp"), warps[w].key), *c;
        int i = 0;
        for (; (c = json_element(cases, i)); i++) {
            double u[2], expected[3] = {0, 0, 0};
            json_numbers(json_element(c, 0), u, 2);
            json_numbers(json_element(c, 1), expected, 3);
            Vec3 got = warps[w].warp((Vec2){u[0], u[1]});
            near(got.x, expected[0], 1e-5, 1e-7, warps[w].key, i);
            near(got.y, expected[1], 1e-5, 1e-7, warps[w].key, i);
            near(got.z, expected[2], 1e-5, 2e-5, warps[w].key, i);
        }
        assert_true(i >= 2);
    }
    free(text);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_dielectric),        cmocka_unit_test(test_fresnel_limits), cmocka_unit_test(test_directions),
        cmocka_unit_test(test_microfacet),        cmocka_unit_test(test_microfacet_samples),
        cmocka_unit_test(test_warps),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
