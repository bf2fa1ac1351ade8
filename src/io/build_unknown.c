// build_unknown.c: plugins that are refused: those of the format by name, with the reason; others with a near name.
#include "io/build.h"

#include <string.h>

static const char no_polarisation[] = "light has no polarisation here";
static const char no_media[] = "participating media are missing yet";
static const char no_sky[] = "sky models are missing; a picture of one can be an 'envmap'";
static const char no_splats[] = "volumetric primitives are missing";
static const char missing[] = "it is missing yet";

static const struct {
    const char *name, *why;
} refused[] = {{"polarizer", no_polarisation},
               {"retarder", no_polarisation},
               {"circular", no_polarisation},
               {"measured_polarized", no_polarisation},
               {"pplastic", "light has no polarisation here; 'roughplastic' is its unpolarised form"},
               {"measured", "measured reflectance data is not read; 'principled' can be fitted to it"},
               {"hair", "there is no scattering of hair; 'roughdielectric' is the nearest kind"},
               {"stokes", no_polarisation},
               {"sunsky", no_sky},
               {"timed_sunsky", no_sky},
               {"ellipsoids", no_splats},
               {"ellipsoidsmesh", no_splats},
               {"volprim_rf_basic", no_splats},
               {"specfilm", "there are no spectral films; 'hdrfilm' is the film"},
               {"homogeneous", no_media},
               {"heterogeneous", no_media},
               {"gridvolume", no_media},
               {"constvolume", no_media},
               {"isotropic", no_media},
               {"hg", no_media},
               {"rayleigh", no_media},
               {"blendphase", no_media},
               {"tabphase", no_media},
               {"sggx", no_media},
               {"prbvolpath", no_media},
               {"volume", missing},
               {"prb_basic", missing},
               {"direct_projective", missing},
               {"prb_projective", missing}};

const char *build_medium_word(void *user, int i) {
    static const char *const words[] = {"homogeneous", "heterogeneous", "gridvolume", "constvolume", "isotropic",
                                        "hg",          "rayleigh",      "blendphase", "tabphase",    "sggx"};
    UNUSED(user);
    return i < COUNT_OF(words) ? words[i] : NULL;
}

rey_result build_unknown(Builder *b, const rey_xml_node *node, const char *(*known)(void *user, int i), void *user) {
    const char *tag = rey_xml_tag_name(node->tag);
    for (int i = 0; i < COUNT_OF(refused); i++) {
        if (strcmp(node->type, refused[i].name) == 0) {
            return rey_xml_fail(b->ctx, node->at, REY_ERROR_UNSUPPORTED, "%s '%s' is not supported: %s", tag, node->type,
                                refused[i].why);
        }
    }
    return rey_xml_fail_word(b->ctx, node->at, node->type, known, user, "there is no %s '%s'", tag, node->type);
}
