// doctor.c: `reynolds doctor`: this build, this machine, the libraries, and a picture with a known answer at each
// width.
#include "cli.h"

#include "base/context.h"
#include "base/parallel.h"

#include <OpenEXR/openexr.h>
#include <blosc.h>
#include <embree3/rtcore.h>
#include <expat.h>
#include <math.h>
#include <png.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <yaml.h>
#include <zlib.h>

#include <jpeglib.h> // needs stdio.h before it
#include <suitesparse/cholmod.h> // defines what zlib.h would look at

// A square that fills the view under a constant sky of radiance 1: the mean of the pixels is its reflectance, and each
// pixel is the reflectance times its derivative.
static const char scene_text[] =
    "<scene version=\"3.0.0\">\n"
    "  <integrator type=\"path\"><integer name=\"max_depth\" value=\"2\"/></integrator>\n"
    "  <sensor type=\"perspective\"><float name=\"fov\" value=\"30\"/>\n"
    "    <transform name=\"to_world\"><lookat origin=\"0,0,3\" target=\"0,0,0\" up=\"0,1,0\"/></transform>\n"
    "    <film type=\"hdrfilm\"><integer name=\"width\" value=\"8\"/><integer name=\"height\" value=\"8\"/>\n"
    "      <rfilter type=\"box\"/></film>\n"
    "    <sampler type=\"independent\"><integer name=\"sample_count\" value=\"64\"/></sampler></sensor>\n"
    "  <shape type=\"rectangle\" id=\"wall\"><bsdf type=\"diffuse\">\n"
    "    <rgb name=\"reflectance\" value=\"0.25, 0.5, 0.75\"/></bsdf></shape>\n"
    "  <emitter type=\"constant\"/>\n"
    "</scene>\n";

enum { TEST_PIXELS = 64, TEST_WIDTHS = 3, LIBRARIES = 9 };

#if defined(__clang__) || !defined(__GNUC__)
static const char compiler[] = __VERSION__; // holds clang's name
#else
static const char compiler[] = "gcc " __VERSION__;
#endif

typedef struct WidthTest {
    int lanes;
    bool available, passed;
    char verdict[512];
} WidthTest;

typedef struct Library {
    const char *name;
    char version[64];
} Library;

typedef struct Examination {
    char cpu[128];
    int threads_allowed, threads, widest;
    Library libraries[LIBRARIES];
    WidthTest tests[TEST_WIDTHS];
    bool passed;
} Examination;

static void cpu_name(char *name, size_t size) {
    snprintf(name, size, "unknown");
    FILE *file = fopen("/proc/cpuinfo", "r");
    char line[512];
    while (file && fgets(line, sizeof line, file)) {
        char *colon = strchr(line, ':');
        if (!strncmp(line, "model name", 10) && colon) {
            colon[1 + strcspn(colon + 1, "\n")] = 0;
            snprintf(name, size, "%.*s", (int)size - 1, colon + 2);
            break;
        }
    }
    if (file) {
        fclose(file);
    }
}

static void library_version(Library *library, const char *name, const char *version) {
    library->name = name;
    snprintf(library->version, sizeof library->version, "%s", version);
}

static void find_libraries(Library list[LIBRARIES]) {
    char text[64];
    RTCDevice device = rtcNewDevice(NULL);
    long embree = device ? (long)rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_VERSION) : 0;
    snprintf(text, sizeof text, device ? "%ld.%ld.%ld" : "no device", embree / 10000, embree / 100 % 100, embree % 100);
    if (device) {
        rtcReleaseDevice(device);
    }
    library_version(&list[0], "embree", text);
    int major, minor, patch;
    const char *extra;
    exr_get_library_version(&major, &minor, &patch, &extra);
    snprintf(text, sizeof text, "%d.%d.%d", major, minor, patch);
    library_version(&list[1], "openexr", text);
    library_version(&list[2], "libpng", png_get_libpng_ver(NULL));
    snprintf(text, sizeof text, "%d (interface)", JPEG_LIB_VERSION);
    library_version(&list[3], "libjpeg", text);
    library_version(&list[4], "zlib", zlibVersion());
    library_version(&list[5], "expat", XML_ExpatVersion());
    library_version(&list[6], "libyaml", yaml_get_version_string());
    int cholmod[3];
    cholmod_version(cholmod);
    snprintf(text, sizeof text, "%d.%d.%d", cholmod[0], cholmod[1], cholmod[2]);
    library_version(&list[7], "cholmod", text);
    library_version(&list[8], "blosc", blosc_get_version_string());
}

// Renders the scene and its derivative; the sentence on what was found goes to test->verdict.
static void test_pictures(WidthTest *test, rey_context *ctx, rey_scene *scene) {
    static const double reflectance[3] = {0.25, 0.5, 0.75};
    const float tangent[3] = {1, 1, 1};
    float image[TEST_PIXELS * 3] = {0}, derivative[TEST_PIXELS * 3] = {0};
    rey_render_def def = rey_default_render_def();
    def.sets = 1; // the derivative then uses the picture's samples
    int param = rey_param_find(scene, "wall.bsdf.reflectance.value");
    rey_result result = rey_render(scene, &def, image, NULL);
    if (!result && param >= 0) {
        result = rey_jvp(scene, &def, (rey_selection){.params = &param, .count = 1}, tangent, derivative, NULL, NULL);
    }
    if (result || param < 0) {
        snprintf(test->verdict, sizeof test->verdict, "%s",
                 param < 0 ? "the test scene lost its parameter" : rey_error(ctx));
        return;
    }
    double mean[3] = {0}, slope_error = 0;
    for (int i = 0; i < TEST_PIXELS * 3; i++) {
        mean[i % 3] += (double)image[i] / reflectance[i % 3] / TEST_PIXELS;
        double e = fabs((double)image[i] - reflectance[i % 3] * (double)derivative[i]);
        slope_error = e <= slope_error ? slope_error : e;
    }
    double picture_error = fmax(fabs(mean[0] - 1), fmax(fabs(mean[1] - 1), fabs(mean[2] - 1)));
    test->passed = picture_error < 0.02 && slope_error < 1e-4;
    snprintf(test->verdict, sizeof test->verdict, "picture off by %.2f %%, derivative by %.1e", 100 * picture_error,
             slope_error);
}

static void test_width(WidthTest *test, const char *path, int threads) {
    rey_context_def def = rey_default_context_def();
    def.lanes = test->lanes;
    def.threads = threads;
    rey_context *ctx = NULL;
    rey_scene *scene = NULL;
    rey_result result = rey_context_create(&def, &ctx);
    if (result) {
        snprintf(test->verdict, sizeof test->verdict, "%s", rey_result_text(result));
        return;
    }
    result = rey_scene_load(ctx, path, NULL, 0, &scene);
    if (result) {
        snprintf(test->verdict, sizeof test->verdict, "%.500s", rey_error(ctx));
    } else {
        test_pictures(test, ctx, scene);
    }
    rey_scene_destroy(scene);
    rey_context_destroy(ctx);
}

// Writes the test scene to a temporary file; false when none can be made.
static bool write_scene(char *path, size_t size) {
    const char *folder = getenv("TMPDIR");
    snprintf(path, size, "%s/reynolds-doctor-XXXXXX", folder && folder[0] ? folder : "/tmp");
    int descriptor = mkstemp(path);
    if (descriptor < 0) {
        return false;
    }
    ssize_t length = (ssize_t)strlen(scene_text);
    bool written = write(descriptor, scene_text, (size_t)length) == length;
    if (close(descriptor) || !written) {
        unlink(path);
        return false;
    }
    return true;
}

static void examine(const Options *options, Examination *e) {
    static const int widths[TEST_WIDTHS] = {1, 8, 16};
    char path[4096];
    cpu_name(e->cpu, sizeof e->cpu);
    e->threads_allowed = rey_available_threads();
    e->threads = options->threads ? options->threads : e->threads_allowed;
    e->widest = rey_widest_lanes();
    find_libraries(e->libraries);
    bool have_scene = write_scene(path, sizeof path);
    e->passed = have_scene;
    for (int i = 0; i < TEST_WIDTHS; i++) {
        WidthTest *test = &e->tests[i];
        test->lanes = widths[i];
        test->available = widths[i] <= e->widest && (!options->lanes || options->lanes == widths[i]);
        if (!test->available) {
            snprintf(test->verdict, sizeof test->verdict, "%s",
                     widths[i] > e->widest ? "not on this machine" : "not asked for");
        } else if (!have_scene) {
            snprintf(test->verdict, sizeof test->verdict, "no temporary file could be made");
        } else {
            test_width(test, path, e->threads);
            e->passed = e->passed && test->passed;
        }
    }
    if (have_scene) {
        unlink(path);
    }
}

static void print_text(const Examination *e) {
    printf("reynolds   %s\ncompiler   %s\ncpu        %s\nthreads    %d of %d that are allowed\nlanes      up to %d\n",
           rey_version(), compiler, e->cpu, e->threads, e->threads_allowed, e->widest);
    for (int i = 0; i < LIBRARIES; i++) {
        printf("%-10s %s\n", e->libraries[i].name, e->libraries[i].version);
    }
    for (int i = 0; i < TEST_WIDTHS; i++) {
        const WidthTest *t = &e->tests[i];
        printf("width %-4d %s: %s\n", t->lanes, !t->available ? "skipped" : t->passed ? "ok" : "FAILED", t->verdict);
    }
    printf("verdict    %s\n", e->passed ? "all is well" : "something is WRONG");
}

static void print_json(const Examination *e) {
    Json json = json_begin(stdout);
    json_object(&json, NULL);
    json_bool(&json, "passed", e->passed);
    json_string(&json, "version", rey_version());
    json_string(&json, "compiler", compiler);
    json_string(&json, "cpu", e->cpu);
    json_integer(&json, "threads", e->threads);
    json_integer(&json, "threads_allowed", e->threads_allowed);
    json_integer(&json, "lanes", e->widest);
    json_object(&json, "libraries");
    for (int i = 0; i < LIBRARIES; i++) {
        json_string(&json, e->libraries[i].name, e->libraries[i].version);
    }
    json_object_end(&json);
    json_array(&json, "widths");
    for (int i = 0; i < TEST_WIDTHS; i++) {
        json_object(&json, NULL);
        json_integer(&json, "lanes", e->tests[i].lanes);
        json_bool(&json, "available", e->tests[i].available);
        json_bool(&json, "passed", e->tests[i].passed);
        json_string(&json, "verdict", e->tests[i].verdict);
        json_object_end(&json);
    }
    json_array_end(&json);
    json_object_end(&json);
    json_end(&json);
}

int cli_doctor(int argc, char **argv) {
    Options options;
    Examination examination = {0};
    int status;
    if (!cli_options_parse(COMMAND_DOCTOR, argc, argv, &options, &status)) {
        return status;
    }
    examine(&options, &examination);
    (options.json ? print_json : print_text)(&examination);
    status = cli_finish_output();
    status = status ? status : examination.passed ? EXIT_OK : EXIT_FAILED;
    cli_options_free(&options);
    return status;
}
