// xml.c: life of a document, reading from a file or from memory, messages.
#include "io/xml_parts.h"

#include <stdio.h>
#include <string.h>

// ---- memory ------------------------------------------------------------------------------------------------------

void *rey_xml_keep(rey_context *ctx, rey_xml_document *document, size_t bytes) {
    enum { BLOCK = 1 << 14 };
    size_t size = (bytes + 15) / 16 * 16;
    XmlBlock *block = document->blocks;
    if (!block || block->size - block->used < size) {
        size_t capacity = size > BLOCK / 4 ? size : BLOCK;
        block = rey_alloc(ctx, sizeof(XmlBlock) + capacity);
        if (!block) {
            return NULL;
        }
        block->size = capacity;
        block->next = document->blocks;
        document->blocks = block;
    }
    void *memory = block->bytes + block->used;
    block->used += size;
    return memory;
}

char *rey_xml_keep_text(rey_context *ctx, rey_xml_document *document, const char *text, size_t length) {
    char *copy = rey_xml_keep(ctx, document, length + 1);
    if (copy) {
        memcpy(copy, text, length);
        copy[length] = '\0';
    }
    return copy;
}

void rey_xml_free(rey_context *ctx, rey_xml_document *document) {
    if (!document) {
        return;
    }
    for (size_t i = 0; i < document->spectra.count; i++) {
        rey_free(ctx, ARRAY_AT(document->spectra, double *, i));
    }
    rey_array_free(ctx, &document->spectra);
    rey_array_free(ctx, &document->nodes);
    rey_array_free(ctx, &document->notes);
    rey_array_free(ctx, &document->ignored);
    rey_array_free(ctx, &document->folders);
    rey_free(ctx, document->ids.slots);
    for (XmlBlock *block = document->blocks; block;) {
        XmlBlock *next = block->next;
        rey_free(ctx, block);
        block = next;
    }
    rey_free(ctx, document);
}

// ---- messages ----------------------------------------------------------------------------------------------------

rey_result rey_xml_fail_position(rey_context *ctx, rey_xml_position at, rey_result code, const char *format,
                                 va_list arguments) {
    char text[1536];
    vsnprintf(text, sizeof text, format, arguments);
    return rey_fail(ctx, code, "%s:%d:%d: %s", at.file ? at.file : "scene", at.line, at.column, text);
}

rey_result rey_xml_fail(rey_context *ctx, rey_xml_position at, rey_result code, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    rey_xml_fail_position(ctx, at, code, format, arguments);
    va_end(arguments);
    return code;
}

rey_result rey_xml_named_file(rey_context *ctx, rey_xml_position at, rey_result result) {
    return result == REY_OK || result == REY_ERROR_MEMORY ? result : rey_xml_fail(ctx, at, result, "%s", rey_error(ctx));
}

rey_result rey_xml_fail_value(rey_context *ctx, const rey_xml_node *node, const char *name, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    rey_xml_fail_position(ctx, rey_xml_place(node, name), REY_ERROR_SCENE, format, arguments);
    va_end(arguments);
    return REY_ERROR_SCENE;
}

void rey_xml_list_words(const char *word, const char *(*next)(void *user, int i), void *user, char *text, size_t size) {
    text[0] = 0;
    for (int i = 0; next(user, i) && !rey_nearest_word(word, next, user); i++) {
        size_t used = strlen(text);
        snprintf(text + used, size - used, "%s%s", !i ? ", expected " : next(user, i + 1) ? ", " : " or ", next(user, i));
    }
}

rey_result rey_xml_fail_word(rey_context *ctx, rey_xml_position at, const char *word,
                             const char *(*next)(void *user, int i), void *user, const char *format, ...) {
    char text[1536];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    const char *nearest = next ? rey_nearest_word(word, next, user) : NULL;
    return nearest ? rey_xml_fail(ctx, at, REY_ERROR_SCENE, "%s, did you mean '%.100s'?", text, nearest)
                   : rey_xml_fail(ctx, at, REY_ERROR_SCENE, "%s", text);
}

// ---- parsing -----------------------------------------------------------------------------------------------------

static rey_xml_position parser_position(const XmlFile *file) {
    return (rey_xml_position){file->name, (int)XML_GetCurrentLineNumber(file->parser),
                              (int)XML_GetCurrentColumnNumber(file->parser) + 1};
}

static void stop_on(XmlFile *file, rey_result result) {
    if (result && !file->reader->result) {
        file->reader->result = result;
    }
    if (result) {
        XML_StopParser(file->parser, XML_FALSE);
    }
}

rey_result rey_xml_overlook(XmlReader *reader, rey_result result) {
    if (!result || result == REY_ERROR_MEMORY || reader->result || !(reader->flags & REY_XML_LENIENT)) {
        return result;
    }
    const char *error = rey_error(reader->ctx);
    const char *kept = rey_xml_keep_text(reader->ctx, reader->document, error, strlen(error));
    const char **slot = kept ? rey_array_push(reader->ctx, &reader->document->ignored, sizeof *slot, 1) : NULL;
    if (!slot) {
        return REY_ERROR_MEMORY;
    }
    *slot = kept;
    return REY_OK;
}

// An element that failed before it left a trace is left out with all within it.
static void XMLCALL on_start(void *user, const XML_Char *name, const XML_Char **attributes) {
    XmlFile *file = user;
    XmlReader *reader = file->reader;
    if (reader->result || file->skipped) {
        file->skipped += file->skipped > 0;
        return;
    }
    size_t frames = reader->frames.count, nodes = reader->document->nodes.count;
    rey_result result = rey_xml_start_element(file, name, attributes);
    if (result && frames > file->base && reader->frames.count == frames && reader->document->nodes.count == nodes) {
        result = rey_xml_overlook(reader, result);
        file->skipped = !result;
    }
    stop_on(file, result);
}

static void XMLCALL on_end(void *user, const XML_Char *name) {
    UNUSED(name);
    XmlFile *file = user;
    if (file->skipped) {
        file->skipped--;
    } else if (!file->reader->result) {
        stop_on(file, rey_xml_end_element(file));
    }
}

static void XMLCALL on_text(void *user, const XML_Char *text, int length) {
    XmlFile *file = user;
    for (int i = 0; i < length && !file->reader->result && !file->skipped; i++) {
        if (text[i] != ' ' && text[i] != '\t' && text[i] != '\n' && text[i] != '\r') {
            rey_result result = rey_xml_fail(file->reader->ctx, parser_position(file), REY_ERROR_SCENE,
                                             "text '%.*s' between the tags, expected tags only",
                                             length - i < 20 ? length - i : 20, text + i);
            stop_on(file, rey_xml_overlook(file->reader, result));
            return;
        }
    }
}

// Entities are how a small file grows without bound, or names other files; scene files have no use for them.
static void XMLCALL on_doctype(void *user, const XML_Char *name, const XML_Char *system_id, const XML_Char *public_id,
                               int has_subset) {
    UNUSED(name);
    UNUSED(system_id);
    UNUSED(public_id);
    UNUSED(has_subset);
    XmlFile *file = user;
    if (!file->reader->result) {
        stop_on(file, rey_xml_fail(file->reader->ctx, parser_position(file), REY_ERROR_SCENE,
                                   "document type declarations (<!DOCTYPE) are not allowed in scene files"));
    }
}

// What expat stopped at, and which element was open there.
static rey_result fail_parse(const XmlFile *file) {
    rey_context *ctx = file->reader->ctx;
    enum XML_Error error = XML_GetErrorCode(file->parser);
    const bool open = file->reader->frames.count > file->base && !file->skipped;
    const bool other = XML_GetErrorByteIndex(file->parser) < 8 && error != XML_ERROR_NO_ELEMENTS;
    char hint[128] = "";
    if (error == XML_ERROR_NO_MEMORY) {
        return rey_fail_memory(ctx, 0);
    }
    if (open && (error == XML_ERROR_TAG_MISMATCH || error == XML_ERROR_NO_ELEMENTS)) {
        const XmlFrame *frame = rey_xml_top_frame(file->reader);
        snprintf(hint, sizeof hint, ", expected </%s>, which line %d opens", frame->tag->name, frame->line);
    } else if (other) {
        snprintf(hint, sizeof hint, "; a scene begins with <scene version=\"3.0.0\">");
    }
    return rey_xml_fail(ctx, parser_position(file), REY_ERROR_FORMAT, "not well-formed XML: %s%s", XML_ErrorString(error), hint);
}

// expat takes its memory from the C library: its allocator hooks have no argument through which to reach a context.
static rey_result run_parser(XmlFile *file) {
    rey_context *ctx = file->reader->ctx;
    file->parser = XML_ParserCreate(NULL);
    if (!file->parser) {
        return rey_fail_memory(ctx, 0);
    }
    XML_SetUserData(file->parser, file);
    XML_SetElementHandler(file->parser, on_start, on_end);
    XML_SetCharacterDataHandler(file->parser, on_text);
    XML_SetStartDoctypeDeclHandler(file->parser, on_doctype);
    // In slices, so that a length always fits an int.
    enum { SLICE = 1 << 20 };
    rey_result result = REY_OK;
    for (size_t at = 0; !result; at += SLICE) {
        bool last = file->bytes - at <= SLICE;
        int length = last ? (int)(file->bytes - at) : SLICE;
        if (XML_Parse(file->parser, file->text + at, length, last) != XML_STATUS_OK) {
            result = file->reader->result;
            result = result ? result : fail_parse(file);
        }
        if (last) {
            break;
        }
    }
    XML_ParserFree(file->parser);
    return result;
}

rey_result rey_xml_parse_text(XmlReader *reader, const char *name, const char *text, size_t bytes) {
    XmlFile file = {.reader = reader,
                    .parent = reader->file,
                    .name = rey_xml_keep_text(reader->ctx, reader->document, name, strlen(name)),
                    .folder = rey_xml_folder_of(reader->ctx, reader->document, name),
                    .text = text,
                    .bytes = bytes,
                    .base = reader->frames.count,
                    .depth = reader->file ? reader->file->depth + 1 : 0};
    if (!file.name || !file.folder) {
        return REY_ERROR_MEMORY;
    }
    reader->file_count++;
    reader->file = &file;
    rey_result result = run_parser(&file);
    reader->file = file.parent;
    return result;
}

// ---- entry points ------------------------------------------------------------------------------------------------

static rey_result take_defines(XmlReader *reader, const rey_define *defines, int count, rey_xml_position at) {
    for (int i = 0; i < count; i++) {
        if (!defines[i].name || !defines[i].value || !defines[i].name[0]) {
            return rey_xml_fail(reader->ctx, at, REY_ERROR_ARGUMENT, "a define needs a name and a value");
        }
        rey_result result = rey_xml_add_define(reader, defines[i].name, defines[i].value, true, at);
        if (result) {
            return result;
        }
    }
    return REY_OK;
}

static rey_result read_document(XmlReader *reader, const char *path, const char *text, size_t bytes,
                                const rey_define *defines, int count) {
    rey_xml_document *document = reader->document;
    rey_xml_position at = {rey_xml_keep_text(reader->ctx, document, path, strlen(path)), 1, 1};
    document->folder = rey_xml_folder_of(reader->ctx, document, path);
    if (!at.file || !document->folder) {
        return REY_ERROR_MEMORY;
    }
    char *loaded = NULL;
    rey_result result = take_defines(reader, defines, count, at);
    if (!result && !text) {
        result = rey_xml_load(reader, at, path, true, &loaded, &bytes);
    }
    if (!result) {
        result = rey_xml_parse_text(reader, path, text ? text : loaded, bytes);
    }
    if (!result) {
        result = rey_xml_resolve_references(reader);
    }
    if (!result && !(reader->flags & REY_XML_SPARE)) {
        result = rey_xml_check_defines(reader, at);
    }
    rey_free(reader->ctx, loaded);
    return result;
}

static rey_result read_scene(rey_context *ctx, const char *path, const char *text, size_t bytes,
                             const rey_define *defines, int define_count, int flags, rey_xml_document **out) {
    *out = NULL;
    XmlReader reader = {.ctx = ctx, .document = rey_alloc(ctx, sizeof(rey_xml_document)), .flags = flags};
    if (!reader.document) {
        return REY_ERROR_MEMORY;
    }
    rey_result result = read_document(&reader, path, text, bytes, defines, define_count);
    for (size_t i = 0; i < reader.frames.count; i++) {
        rey_xml_free_frame(ctx, &ARRAY_AT(reader.frames, XmlFrame, i));
    }
    rey_array_free(ctx, &reader.frames);
    rey_array_free(ctx, &reader.defines);
    if (result) {
        rey_xml_free(ctx, reader.document);
        return result;
    }
    *out = reader.document;
    return REY_OK;
}

rey_result rey_xml_read(rey_context *ctx, const char *path, const rey_define *defines, int define_count,
                        rey_xml_document **out) {
    return read_scene(ctx, path, NULL, 0, defines, define_count, 0, out);
}

rey_result rey_xml_read_with(rey_context *ctx, const char *path, const rey_define *defines, int define_count, int flags,
                             rey_xml_document **out) {
    return read_scene(ctx, path, NULL, 0, defines, define_count, flags, out);
}

rey_result rey_xml_read_memory(rey_context *ctx, const char *path, const char *text, size_t bytes,
                               const rey_define *defines, int define_count, rey_xml_document **out) {
    return read_scene(ctx, path, text, bytes, defines, define_count, 0, out);
}

// ---- access ------------------------------------------------------------------------------------------------------

rey_xml_node *rey_xml_root(const rey_xml_document *document) {
    return document->root;
}

int rey_xml_node_count(const rey_xml_document *document) {
    return (int)document->nodes.count;
}

rey_xml_node *rey_xml_node_at(const rey_xml_document *document, int index) {
    return ARRAY_AT(document->nodes, rey_xml_node *, index);
}

rey_xml_node *rey_xml_find_id(const rey_xml_document *document, const char *id) {
    return rey_xml_lookup_id(&document->ids, id);
}

const char *rey_xml_note(const rey_xml_document *document, int index) {
    return (size_t)index < document->notes.count ? ARRAY_AT(document->notes, const char *, index) : NULL;
}

const char *rey_xml_ignored(const rey_xml_document *document, int index) {
    return (size_t)index < document->ignored.count ? ARRAY_AT(document->ignored, const char *, index) : NULL;
}

const char *rey_xml_tag_name(rey_xml_tag tag) {
    static const char *const names[] = {
#define TAG_NAME(symbol, name) name,
        REY_XML_TAGS(TAG_NAME)
#undef TAG_NAME
    };
    return (unsigned)tag < REY_XML_TAG_COUNT ? names[tag] : "object";
}

const char *rey_xml_kind_name(rey_xml_kind kind) {
    static const char *const names[] = {"boolean", "integer", "float",    "string",
                                        "vector",  "rgb",     "spectrum", "transform"};
    return (unsigned)kind < REY_XML_KIND_COUNT ? names[kind] : "value";
}
