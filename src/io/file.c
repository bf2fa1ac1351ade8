// file.c: whole files in and out.
#define _GNU_SOURCE // the GNU strerror_r
#include "io/file.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static rey_result fail_errno(rey_context *ctx, const char *path, const char *action) {
    int code = errno;
    char reason[128] = "";
    const char *text = strerror_r(code, reason, sizeof reason); // the GNU form: may return a constant instead
    return rey_fail(ctx, REY_ERROR_IO, "%s: cannot %s: %s", path, action, text);
}

// Makes room for more bytes: the size already read plus half of it again, at least `least` in all.
static unsigned char *grow(rey_context *ctx, unsigned char *bytes, size_t size, size_t *capacity, size_t least) {
    size_t larger = *capacity + *capacity / 2;
    larger = larger < least ? least : larger;
    unsigned char *grown = rey_alloc(ctx, larger);
    if (grown) {
        if (size) {
            memcpy(grown, bytes, size);
        }
        *capacity = larger;
    }
    rey_free(ctx, bytes);
    return grown;
}

// Reads until the end of the file. The size that the system states is only a hint: pipes and /proc files state 0.
static rey_result read_all(rey_context *ctx, const char *path, int file, size_t hint, unsigned char **out,
                           size_t *out_size) {
    enum { STEP = 1 << 16, MOST = 1 << 30 };
    size_t size = 0, capacity = hint + 1;
    unsigned char *bytes = rey_alloc(ctx, capacity);
    while (bytes) {
        size_t room = capacity - size - 1; // one byte stays for the closing zero
        if (room == 0) {
            // A file that filled its stated size usually ends here: look before growing.
            unsigned char extra;
            ssize_t more = read(file, &extra, 1);
            if (more == 0) {
                break;
            }
            if (more > 0) {
                bytes = grow(ctx, bytes, size, &capacity, size + STEP);
                if (bytes) {
                    bytes[size++] = extra;
                }
            } else if (errno != EINTR) {
                rey_free(ctx, bytes);
                return fail_errno(ctx, path, "read");
            }
            continue;
        }
        ssize_t got = read(file, bytes + size, room < MOST ? room : MOST);
        if (got == 0) {
            break;
        }
        if (got > 0) {
            size += (size_t)got;
        } else if (errno != EINTR) {
            rey_free(ctx, bytes);
            return fail_errno(ctx, path, "read");
        }
    }
    if (!bytes) {
        return rey_fail(ctx, REY_ERROR_MEMORY, "%s: out of memory reading the file", path);
    }
    bytes[size] = 0;
    *out = bytes;
    *out_size = size;
    return REY_OK;
}

// Opening a pipe that lies in a folder waits for somebody to write into it. Those of the shell (/dev/stdin, /dev/fd/63)
// lie nowhere, and have a writer.
static bool is_named_pipe(const char *path) {
    struct stat status;
    char *resolved = stat(path, &status) == 0 && S_ISFIFO(status.st_mode) ? realpath(path, NULL) : NULL;
    bool named = resolved != NULL;
    free(resolved);
    return named;
}

rey_result rey_file_read(rey_context *ctx, const char *path, unsigned char **bytes, size_t *size) {
    *bytes = NULL;
    *size = 0;
    if (is_named_pipe(path)) {
        return rey_fail(ctx, REY_ERROR_IO, "%s: cannot read: is a pipe, which may never end, expected a file", path);
    }
    int file = open(path, O_RDONLY | O_CLOEXEC);
    if (file < 0) {
        return fail_errno(ctx, path, "open");
    }
    struct stat status;
    rey_result result = REY_OK;
    if (fstat(file, &status) != 0) {
        result = fail_errno(ctx, path, "read");
    } else if (S_ISDIR(status.st_mode)) {
        result = rey_fail(ctx, REY_ERROR_IO, "%s: cannot read: is a directory, expected a file", path);
    } else if (S_ISCHR(status.st_mode) || S_ISBLK(status.st_mode)) {
        result = rey_fail(ctx, REY_ERROR_IO, "%s: cannot read: is a device, which may never end, expected a file", path);
    } else {
        size_t hint = S_ISREG(status.st_mode) && status.st_size > 0 ? (size_t)status.st_size : 0;
        result = read_all(ctx, path, file, hint, bytes, size);
    }
    close(file);
    return result;
}

rey_result rey_file_open(rey_context *ctx, const char *path, int *file, size_t *size) {
    struct stat status;
    *size = 0;
    *file = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    if (*file < 0) {
        return fail_errno(ctx, path, "open");
    }
    rey_result result = fstat(*file, &status) != 0 ? fail_errno(ctx, path, "read")
                        : S_ISREG(status.st_mode)  ? REY_OK
                                                   : rey_fail(ctx, REY_ERROR_IO, "%s: cannot read: expected a regular file", path);
    if (result != REY_OK) {
        close(*file);
        *file = -1;
        return result;
    }
    *size = (size_t)status.st_size;
    return REY_OK;
}

rey_result rey_file_read_part(rey_context *ctx, const char *path, int file, size_t offset, void *bytes, size_t size) {
    enum { MOST = 1 << 30 };
    unsigned char *to = bytes;
    while (size > 0) {
        ssize_t got = pread(file, to, size < MOST ? size : MOST, (off_t)offset);
        if (got == 0) {
            return rey_fail(ctx, REY_ERROR_IO, "%s: byte %zu: the file ended while it was read", path, offset);
        }
        if (got < 0 && errno != EINTR) {
            return fail_errno(ctx, path, "read");
        }
        size_t n = got > 0 ? (size_t)got : 0;
        to += n;
        offset += n;
        size -= n;
    }
    return REY_OK;
}

bool rey_file_same(const char *a, const char *b) {
    struct stat x, y;
    return stat(a, &x) == 0 && stat(b, &y) == 0 && S_ISREG(x.st_mode) && x.st_dev == y.st_dev && x.st_ino == y.st_ino;
}
