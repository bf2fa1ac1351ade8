// xml_old_names.c: plugins and properties of versions 0.5 to 2.x that have other names now, or none: renamed, or left
// out where no picture depends on them. None of the old names means anything else today.
#include "io/xml_parts.h"

#include <string.h>
#include <strings.h>

typedef struct OldType {
    rey_xml_tag tag;
    const char *name, *now, *note; // note: what a user should know, null = nothing
} OldType;

static const OldType old_types[] = {
    {REY_XML_FILM, "ldrfilm", "hdrfilm",
     "the film 'ldrfilm' was read as 'hdrfilm': pictures stay linear, the ending of the output's name decides on sRGB"},
    {REY_XML_FILM, "mfilm", "hdrfilm", "the film 'mfilm' was read as 'hdrfilm': an output that ends in .npy holds the numbers"},
    {REY_XML_FILM, "tiledhdrfilm", "hdrfilm", NULL},
    {REY_XML_INTEGRATOR, "volpath_simple", "volpath", NULL},
    {REY_XML_SAMPLER, "halton", "ldsampler", "the sampler 'halton' was read as 'ldsampler', the sequence of today"},
    {REY_XML_SAMPLER, "hammersley", "ldsampler", "the sampler 'hammersley' was read as 'ldsampler', the sequence of today"},
    {REY_XML_TEXTURE, "vertexcolors", "mesh_attribute", NULL},
};

typedef struct OldProperty {
    rey_xml_tag tag;
    const char *type; // as the file says it; null = any
    const char *name;
    const char *value; // only where it has this one; null = any
    const char *now, *now_value; // now null = left out
    const char *note;
} OldProperty;

static const char low_range[] = "tone mapping of a film is not followed: pictures stay linear";
static const char sharp_filter[] = "'ewa' and 'trilinear' textures are looked up bilinearly";

static const OldProperty old_properties[] = {
    {REY_XML_FILM, NULL, "high_quality_edges", NULL, "sample_border", NULL, NULL},
    {REY_XML_FILM, NULL, "banner", NULL, NULL, NULL, NULL},
    {REY_XML_FILM, NULL, "attach_log", NULL, NULL, NULL, NULL},
    {REY_XML_FILM, NULL, "compensate", NULL, NULL, NULL, NULL},
    {REY_XML_FILM, NULL, "pixel_format", "luminanceAlpha", "pixel_format", "luminance_alpha", NULL},
    {REY_XML_FILM, "ldrfilm", "file_format", NULL, NULL, NULL, NULL},
    {REY_XML_FILM, "ldrfilm", "tonemap_method", NULL, NULL, NULL, low_range},
    {REY_XML_FILM, "ldrfilm", "gamma", NULL, NULL, NULL, low_range},
    {REY_XML_FILM, "ldrfilm", "exposure", NULL, NULL, NULL, low_range},
    {REY_XML_FILM, "ldrfilm", "key", NULL, NULL, NULL, low_range},
    {REY_XML_FILM, "ldrfilm", "burn", NULL, NULL, NULL, low_range},
    {REY_XML_FILM, "mfilm", "file_format", NULL, NULL, NULL, NULL},
    {REY_XML_FILM, "mfilm", "digits", NULL, NULL, NULL, NULL},
    {REY_XML_FILM, "mfilm", "variable", NULL, NULL, NULL, NULL},
    {REY_XML_SAMPLER, NULL, "scramble", NULL, NULL, NULL, NULL},
    {REY_XML_SAMPLER, NULL, "dimension", NULL, NULL, NULL, NULL},
    {REY_XML_INTEGRATOR, NULL, "strict_normals", "false", NULL, NULL, NULL},
    {REY_XML_INTEGRATOR, "ptracer", "granularity", NULL, NULL, NULL, NULL},
    {REY_XML_INTEGRATOR, "ptracer", "brute_force", NULL, NULL, NULL, NULL},
    {REY_XML_TEXTURE, "bitmap", "max_anisotropy", NULL, NULL, NULL, NULL},
    {REY_XML_TEXTURE, "bitmap", "cache", NULL, NULL, NULL, NULL},
    {REY_XML_TEXTURE, "bitmap", "filter_type", "ewa", "filter_type", "bilinear", sharp_filter},
    {REY_XML_TEXTURE, "bitmap", "filter_type", "trilinear", "filter_type", "bilinear", sharp_filter},
    {REY_XML_EMITTER, "envmap", "cache", NULL, NULL, NULL, NULL},
    {REY_XML_SHAPE, "obj", "collapse", NULL, NULL, NULL, NULL},
    {REY_XML_SHAPE, NULL, "optimize_geometry", NULL, NULL, NULL, NULL},
};

static rey_result add_note(XmlReader *reader, const char *note) {
    Array *notes = &reader->document->notes;
    for (size_t i = 0; note && i < notes->count; i++) { // at most one of each of the above
        note = ARRAY_AT(*notes, const char *, i) == note ? NULL : note;
    }
    const char **slot = note ? rey_array_push(reader->ctx, notes, sizeof *slot, 1) : NULL;
    if (slot) {
        *slot = note;
    }
    return slot || !note ? REY_OK : REY_ERROR_MEMORY;
}

static const OldProperty *find_row(const rey_xml_node *node, const char *type, const rey_xml_property *property) {
    for (int i = 0; i < COUNT_OF(old_properties); i++) {
        const OldProperty *row = &old_properties[i];
        if (row->tag == node->tag && strcmp(row->name, property->name) == 0 &&
            (!row->type || strcmp(row->type, type) == 0)) {
            const char *value = property->kind == REY_XML_BOOLEAN_VALUE  ? property->boolean ? "true" : "false"
                                : property->kind == REY_XML_STRING_VALUE ? property->string
                                                                         : "";
            if (!row->value || strcasecmp(row->value, value) == 0) {
                return row;
            }
        }
    }
    return NULL;
}

static rey_result renew_properties(XmlReader *reader, XmlFrame *frame, const char *type) {
    rey_xml_property *properties = frame->properties.data;
    size_t kept = 0;
    rey_result result = REY_OK;
    for (size_t i = 0; i < frame->properties.count && !result; i++) {
        const OldProperty *row = find_row(frame->node, type, &properties[i]);
        rey_xml_property *p = &properties[kept];
        *p = properties[i];
        kept += !row || row->now;
        if (row && row->now_value) {
            p->string = row->now_value;
        }
        if (row && row->now && strcmp(row->now, row->name) != 0) {
            p->name = row->now;
            result = rey_xml_claim_name(reader, frame, p->name, p->at);
        }
        if (!result && row) {
            result = add_note(reader, row->note);
        }
    }
    if (!result) {
        frame->properties.count = kept;
    }
    return result;
}

// gamma 1 of a picture is `raw` now; 2.2 and the former default of -1 (as the file says) are the decoding of today.
static rey_result renew_gamma(XmlReader *reader, XmlFrame *frame) {
    for (size_t i = 0; i < frame->properties.count; i++) {
        rey_xml_property *p = &ARRAY_AT(frame->properties, rey_xml_property, i);
        if (strcmp(p->name, "gamma") != 0 || (p->kind != REY_XML_FLOAT_VALUE && p->kind != REY_XML_INTEGER_VALUE)) {
            continue;
        }
        if (p->number != 1 && p->number != 2.2 && p->number != -1) {
            return rey_xml_fail(reader->ctx, p->at, REY_ERROR_UNSUPPORTED,
                                "gamma is %g, expected 1 (linear), 2.2 or -1 (sRGB)", p->number);
        }
        p->name = "raw";
        p->boolean = p->number == 1;
        p->kind = REY_XML_BOOLEAN_VALUE;
        return rey_xml_claim_name(reader, frame, p->name, p->at);
    }
    return REY_OK;
}

static rey_result name_vertex_colours(XmlReader *reader, XmlFrame *frame) {
    rey_xml_property name = {.name = "name", .at = frame->node->at, .kind = REY_XML_STRING_VALUE,
                             .string = "vertex_color"};
    rey_result result = rey_xml_claim_name(reader, frame, name.name, name.at);
    name.order = (int)(frame->properties.count + frame->children.count);
    rey_xml_property *slot = result ? NULL : rey_array_push(reader->ctx, &frame->properties, sizeof name, 1);
    if (!slot) {
        return result ? result : REY_ERROR_MEMORY;
    }
    *slot = name;
    return REY_OK;
}

rey_result rey_xml_renew_object(XmlReader *reader, XmlFrame *frame) {
    rey_xml_node *node = frame->node;
    const char *type = node->type;
    rey_result result = REY_OK;
    for (int i = 0; i < COUNT_OF(old_types) && !result; i++) {
        if (old_types[i].tag == node->tag && strcmp(old_types[i].name, type) == 0) {
            node->type = old_types[i].now;
            result = add_note(reader, old_types[i].note);
        }
    }
    if (!result && frame->properties.count) {
        result = renew_properties(reader, frame, type);
    }
    if (!result && node->tag == REY_XML_TEXTURE && strcmp(type, "bitmap") == 0) {
        result = renew_gamma(reader, frame);
    }
    return !result && node->type != type && strcmp(type, "vertexcolors") == 0 ? name_vertex_colours(reader, frame)
                                                                              : result;
}
