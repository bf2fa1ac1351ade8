// xml_file.c: finding and loading the files that a scene names.
#include "io/xml_parts.h"

#include "io/file.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

bool rey_xml_is_folder(const char *path) {
    struct stat info;
    return stat(path, &info) == 0 && S_ISDIR(info.st_mode);
}

char *rey_xml_folder_of(rey_context *ctx, rey_xml_document *document, const char *path) {
    const char *slash = strrchr(path, '/');
    if (!slash) {
        return rey_xml_keep_text(ctx, document, ".", 1);
    }
    return rey_xml_keep_text(ctx, document, path, slash == path ? 1 : (size_t)(slash - path));
}

char *rey_xml_join(rey_context *ctx, const char *folder, const char *path) {
    if (path[0] == '/' || strcmp(folder, ".") == 0) {
        return rey_strdup(ctx, path);
    }
    size_t a = strlen(folder), b = strlen(path);
    bool slash = a > 0 && folder[a - 1] != '/';
    char *joined = rey_alloc(ctx, a + slash + b + 1);
    if (joined) {
        memcpy(joined, folder, a);
        joined[a] = '/';
        memcpy(joined + a + slash, path, b + 1);
    }
    return joined;
}

// The i-th folder to search: first_folder (when given), the <path> folders, latest first, then the scene's folder.
static const char *search_folder(const rey_xml_document *document, const char *first_folder, size_t i) {
    if (first_folder && i-- == 0) {
        return first_folder;
    }
    size_t count = document->folders.count;
    if (i < count) {
        return ARRAY_AT(document->folders, const char *, count - 1 - i);
    }
    return i == count ? document->folder : NULL;
}

rey_result rey_xml_search(rey_context *ctx, const rey_xml_document *document, const char *first_folder,
                          const char *path, char **out) {
    *out = NULL;
    const char *folder;
    for (size_t i = 0; (folder = search_folder(document, first_folder, i)); i++) {
        char *candidate = rey_xml_join(ctx, folder, path);
        if (!candidate) {
            return REY_ERROR_MEMORY;
        }
        struct stat info;
        if (stat(candidate, &info) == 0 && S_ISREG(info.st_mode)) {
            *out = candidate;
            return REY_OK;
        }
        rey_free(ctx, candidate);
    }
    return REY_OK;
}

static size_t length_without_dots(const char *folder) {
    size_t n = strlen(folder);
    while (n > 1 && (folder[n - 1] == '/' || (n > 2 && folder[n - 1] == '.' && folder[n - 2] == '/'))) {
        n--;
    }
    return n;
}

static bool same_folder(const char *a, const char *b) { // as far as their names say
    size_t n = length_without_dots(a);
    return n == length_without_dots(b) && memcmp(a, b, n) == 0;
}

// What stands in the place of a file, or null.
static const char *what_else(rey_context *ctx, const char *folder, const char *path) {
    struct stat info;
    char *candidate = rey_xml_join(ctx, folder, path);
    bool exists = candidate && stat(candidate, &info) == 0;
    rey_free(ctx, candidate);
    return !exists                                            ? NULL
           : S_ISDIR(info.st_mode)                            ? "a folder"
           : S_ISCHR(info.st_mode) || S_ISBLK(info.st_mode) ? "a device"
                                                              : "a pipe or socket";
}

rey_result rey_xml_not_found(rey_context *ctx, const rey_xml_document *document, rey_xml_position at,
                             const char *first_folder, const char *path) {
    const char *searched, *other = NULL;
    for (size_t i = 0; !other && (searched = search_folder(document, first_folder, i)); i++) {
        other = what_else(ctx, searched, path);
    }
    if (other) {
        return rey_xml_fail(ctx, at, REY_ERROR_IO, "'%.400s' is %s, expected a file", path, other);
    }
    if (path[0] == '/') {
        return rey_xml_fail(ctx, at, REY_ERROR_IO, "there is no file '%.400s'", path);
    }
    char list[900] = "";
    size_t used = 0;
    const char *folder;
    for (size_t i = 0; (folder = search_folder(document, first_folder, i)); i++) {
        bool listed = false;
        for (size_t k = 0; k < i && !listed; k++) {
            listed = same_folder(search_folder(document, first_folder, k), folder);
        }
        if (listed) {
            continue;
        }
        int written = snprintf(list + used, sizeof list - used, "%s'%s'", i ? ", " : "", folder);
        if (written < 0 || (size_t)written >= sizeof list - used) {
            memcpy(list + sizeof list - 4, "...", 4);
            break;
        }
        used += (size_t)written;
    }
    return rey_xml_fail(ctx, at, REY_ERROR_IO, "file '%.400s' was not found, looked in %s", path, list);
}

rey_result rey_xml_load(XmlReader *reader, rey_xml_position at, const char *path, bool scene, char **text,
                        size_t *bytes) {
    rey_context *ctx = reader->ctx;
    *text = NULL;
    *bytes = 0;
    struct stat info;
    const char *why = stat(path, &info) != 0                                          ? strerror(errno)
                      : S_ISDIR(info.st_mode) || (!scene && !S_ISREG(info.st_mode)) ? "not a file"
                                                                                      : NULL;
    if (why && scene) {
        return rey_fail(ctx, REY_ERROR_IO, "%.400s: cannot open the scene: %s", path, why);
    }
    if (why) {
        return rey_xml_fail(ctx, at, REY_ERROR_IO, "cannot open '%.400s': %s", path, why);
    }
    if (info.st_size > (off_t)(XML_LARGEST_FILE - reader->bytes_read)) {
        return rey_xml_fail(ctx, at, REY_ERROR_SCENE, "the scene's files together exceed %d bytes", XML_LARGEST_FILE);
    }
    unsigned char *content = NULL;
    rey_result result = rey_file_read(ctx, path, &content, bytes);
    if (!result && *bytes > XML_LARGEST_FILE - reader->bytes_read) { // a pipe does not say its size beforehand
        rey_free(ctx, content);
        return rey_xml_fail(ctx, at, REY_ERROR_SCENE, "the scene's files together exceed %d bytes", XML_LARGEST_FILE);
    }
    reader->bytes_read += *bytes;
    *text = (char *)content;
    return result;
}

rey_result rey_xml_resolve_file(rey_context *ctx, const rey_xml_document *document, const rey_xml_node *node,
                                const char *name, char **out) {
    *out = NULL;
    const char *path = NULL;
    rey_result result = rey_xml_require(ctx, node, name);
    if (!result) {
        result = rey_xml_get_string(ctx, node, name, NULL, &path);
    }
    if (result) {
        return result;
    }
    if (!path) {
        return rey_xml_fail(ctx, node->at, REY_ERROR_SCENE, "'%s' must be a string, not an object", name);
    }
    result = rey_xml_search(ctx, document, NULL, path, out);
    if (!result && !*out) {
        result = rey_xml_not_found(ctx, document, rey_xml_find(node, name)->at, NULL, path);
    }
    return result;
}
