// build_unknown.c: plugins that are refused: those of the format by name, with the reason; others with a near name.
#include "io/build.h"

#include <string.h>

static const char no_polarisation[] = "light has no polarisation here";
static const char no_sky[] = "sky models are missing; a picture of one can be an 'envmap'";
static const char no_splats[] = "volumetric primitives are missing";
static const char same_light[] = "'path' renders the same light";
static const char inner_alone[] = "the integrator inside it renders the same picture";
static const char two_lobes[] = "'roughplastic' and 'principled' are its nearest kinds";
static const char in_layers[] = "'plastic', 'roughplastic' and the clearcoat of 'principled' are the layers that there are";
static const char no_lens[] = "'perspective', 'thinlens' and 'orthographic' are the cameras that there are";
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
               {"roughdiffuse", "'diffuse' is its limit of no roughness"},
               {"phong", two_lobes},
               {"ward", two_lobes},
               {"coating", in_layers},
               {"roughcoating", in_layers},
               {"mixturebsdf", "'blendbsdf' mixes two, and can stand in itself"},
               {"difftrans", "'principledthin' with 'diff_trans' lets light through diffusely"},
               {"hk", "'principledthin' is the nearest kind"},
               {"irawan", "there is no model of cloth; 'principled' has a 'sheen'"},
               {"bdpt", same_light},
               {"photonmapper", same_light},
               {"ppm", same_light},
               {"sppm", same_light},
               {"pssmlt", same_light},
               {"mlt", same_light},
               {"erpt", same_light},
               {"vpl", same_light},
               {"adaptive", inner_alone},
               {"irrcache", inner_alone},
               {"multichannel", "'aov' is the integrator of many channels"},
               {"field", "'aov' shows such quantities"},
               {"ao", "it is no light transport; a 'constant' light with max_depth 2 looks alike"},
               {"prb_reparam", "'prb' is the integrator of today"},
               {"direct_reparam", "'direct' is the integrator of today"},
               {"emission_reparam", "'direct' is the integrator of today"},
               {"telecentric", no_lens},
               {"spherical", no_lens},
               {"perspective_rdist", no_lens},
               {"fluencemeter", "'irradiancemeter' and 'radiancemeter' are the meters that there are"},
               {"sky", no_sky},
               {"sun", no_sky},
               {"collimated", "a beam without extent cannot be met; 'directionalarea' lights a surface's width"},
               {"heightfield", "a mesh can take its place"},
               {"gridtexture", "a picture of the grid can be a 'bitmap'"},
               {"scale", "the numbers of the texture inside can be scaled instead"},
               {"wireframe", missing},
               {"curvature", missing}};

rey_result build_unknown(Builder *b, const rey_xml_node *node, const char *(*known)(void *user, int i), void *user) {
    const char *tag = rey_xml_tag_name(node->tag);
    for (int i = 0; i < COUNT_OF(refused); i++) {
        if (strcmp(node->type, refused[i].name) == 0) {
            return rey_xml_fail(b->ctx, node->at, REY_ERROR_UNSUPPORTED, "%s '%s' is not supported: %s", tag, node->type,
                                refused[i].why);
        }
    }
    char list[1024];
    rey_xml_list_words(node->type, known, user, list, sizeof list);
    return rey_xml_fail_word(b->ctx, node->at, node->type, known, user, "there is no %s '%.100s'%s", tag, node->type, list);
}
