// save_files.c: the data files beside a saved scene. What nobody changed is copied as it is, once for all nodes that
// name it, so that it reads back to the same bits and keeps its size.
#include "io/file.h"
#include "io/save_parts.h"
#include "io/xml_parts.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static const char *file_name(const char *path) {
    const char *slash = strrchr(path, '/');
    return slash ? slash + 1 : path;
}

static bool is_taken(const Writer *w, const char *name) {
    for (size_t i = 0; i < w->files.count; i++) {
        const DataFile *file = &ARRAY_AT(w->files, DataFile, i);
        if (file->name && strcmp(file->name, name) == 0) {
            return true;
        }
    }
    return false;
}

// name, or name with the first number before its ending that nobody took.
static char *free_name(const Writer *w, const char *name) {
    const char *dot = strrchr(name, '.');
    int stem = (int)(dot ? dot - name : (long)strlen(name));
    char other[300];
    snprintf(other, sizeof other, "%.250s", name);
    for (int i = 1; is_taken(w, other); i++) {
        snprintf(other, sizeof other, "%.*s_%d%.24s", stem < 200 ? stem : 200, name, i, dot ? dot : "");
    }
    return rey_strdup(w->ctx, other);
}

// Does the file lie in the folder that is written to?
static bool is_inside(const Writer *w, const char *path) {
    char parent[4096];
    struct stat a, b;
    const char *name = file_name(path);
    snprintf(parent, sizeof parent, "%.*s", (int)(name - path), path);
    return stat(*parent ? parent : ".", &a) == 0 && stat(w->folder, &b) == 0 && a.st_dev == b.st_dev &&
           a.st_ino == b.st_ino && strlen(name) < 250;
}

static const rey_xml_property *file_property(const rey_xml_node *node) {
    const rey_xml_property *p = rey_xml_find(node, "filename");
    return p && p->kind == REY_XML_STRING_VALUE ? p : NULL;
}

static rey_result find_source(const Writer *w, const rey_xml_node *node, char **path) {
    const rey_xml_property *p = file_property(node);
    *path = NULL;
    return p && !rey_save_replaces(w, node, "filename")
               ? rey_xml_search(w->ctx, w->source->document, NULL, p->string, path)
               : REY_OK;
}

static DataFile *find_file(const Writer *w, const char *source) {
    for (size_t i = 0; i < w->files.count; i++) {
        DataFile *file = &ARRAY_AT(w->files, DataFile, i);
        if (strcmp(file->source, source) == 0) {
            return file;
        }
    }
    return NULL;
}

static rey_result list_file(Writer *w, const rey_xml_node *node) {
    char *path;
    TRY(find_source(w, node, &path));
    if (!path || find_file(w, path)) {
        rey_free(w->ctx, path);
        return REY_OK;
    }
    DataFile *file = rey_array_push(w->ctx, &w->files, sizeof *file, 1);
    if (!file) {
        rey_free(w->ctx, path);
        return REY_ERROR_MEMORY;
    }
    file->source = path;
    file->inside = is_inside(w, path);
    if (file->inside) { // keeps its name, and is never written
        file->name = rey_strdup(w->ctx, file_name(path));
        return file->name ? REY_OK : REY_ERROR_MEMORY;
    }
    return REY_OK;
}

// The path of a data file of this name; what is not the scene's to replace is left alone.
static rey_result data_path(Writer *w, const char *name, char path[4096]) {
    snprintf(path, 4096, "%s/%s", w->folder, name);
    return !w->keeps_files || access(path, F_OK) != 0
               ? REY_OK
               : rey_fail(w->ctx, REY_ERROR_IO, "%s is there and would be replaced, and no scene that it belongs to: name "
                          "another file for the scene, or move what lies in %s", path, w->folder);
}

// The same, of one that is written next: a save that fails removes it.
static rey_result new_path(Writer *w, const char *name, char path[4096]) {
    TRY(data_path(w, name, path));
    if (w->keeps_files) {
        char **made = rey_array_push(w->ctx, &w->made, sizeof *made, 1);
        char *copy = made ? rey_strdup(w->ctx, path) : NULL;
        TRY(copy ? REY_OK : REY_ERROR_MEMORY);
        *made = copy;
    }
    return REY_OK;
}

rey_result rey_save_list_files(Writer *w) {
    char path[4096];
    for (int i = 0; i < rey_xml_node_count(w->source->document); i++) {
        TRY(list_file(w, rey_xml_node_at(w->source->document, i)));
    }
    for (size_t i = 0; i < w->files.count; i++) {
        DataFile *file = &ARRAY_AT(w->files, DataFile, i);
        if (!file->name) {
            file->name = free_name(w, file_name(file->source));
            TRY(file->name ? data_path(w, file->name, path) : REY_ERROR_MEMORY);
        }
    }
    return REY_OK;
}

static rey_result make_folder(Writer *w) {
    w->folder_new = w->folder_new || (!w->folder_made && mkdir(w->folder, 0777) == 0);
    if (!w->folder_made && !w->folder_new && errno != EEXIST) {
        return rey_fail(w->ctx, REY_ERROR_IO, "%s: the folder could not be made: %s", w->folder, strerror(errno));
    }
    w->folder_made = true;
    return REY_OK;
}

rey_result rey_save_copy_files(Writer *w) {
    char path[4096];
    for (size_t i = 0; i < w->files.count; i++) {
        const DataFile *file = &ARRAY_AT(w->files, DataFile, i);
        unsigned char *bytes = NULL;
        size_t size;
        if (file->inside) {
            continue;
        }
        TRY(make_folder(w));
        TRY(new_path(w, file->name, path));
        rey_result result = rey_file_read(w->ctx, file->source, &bytes, &size);
        if (result == REY_OK) {
            result = rey_file_write(w->ctx, path, bytes, size);
        }
        rey_free(w->ctx, bytes);
        TRY(result);
    }
    return REY_OK;
}

const char *rey_save_data_name(const Writer *w, const rey_xml_node *node) {
    char *path;
    if (find_source(w, node, &path) != REY_OK || !path) {
        return NULL;
    }
    const DataFile *file = find_file(w, path);
    rey_free(w->ctx, path);
    return file ? file->name : NULL;
}

rey_result rey_save_new_file(Writer *w, int depth, const char *kind, const char *ending, char path[4096]) {
    char name[300], full[1400];
    do {
        snprintf(name, sizeof name, "%s_%d%s", kind, w->number++, ending);
    } while (is_taken(w, name));
    TRY(make_folder(w));
    TRY(new_path(w, name, path));
    snprintf(full, sizeof full, "%s/%s", w->folder_name, name);
    rey_save_value(w, depth, "string", "filename", full);
    return REY_OK;
}

void rey_save_free_files(Writer *w, bool failed) {
    for (size_t i = 0; i < w->made.count; i++) {
        char *path = ARRAY_AT(w->made, char *, i);
        if (failed && path) {
            unlink(path);
        }
        rey_free(w->ctx, path);
    }
    if (failed && w->folder_new) {
        rmdir(w->folder);
    }
    rey_array_free(w->ctx, &w->made);
    for (size_t i = 0; i < w->files.count; i++) {
        rey_free(w->ctx, ARRAY_AT(w->files, DataFile, i).source);
        rey_free(w->ctx, ARRAY_AT(w->files, DataFile, i).name);
    }
    rey_array_free(w->ctx, &w->files);
}
