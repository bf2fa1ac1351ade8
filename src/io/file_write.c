// file_write.c: whole files out: complete or not at all, whatever the path names.
#define _GNU_SOURCE // the GNU strerror_r
#include "io/file.h"
#include "io/file_stale.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

static rey_result fail_errno(rey_context *ctx, const char *path, const char *action) {
    int code = errno;
    char reason[128] = "";
    const char *text = strerror_r(code, reason, sizeof reason); // the GNU form: may return a constant instead
    return rey_fail(ctx, REY_ERROR_IO, "%s: cannot %s: %s", path, action, text);
}

// Where the bytes of a path go. Regular files are replaced by a temporary file in their own folder; devices, pipes and
// sockets are written as they are.
typedef struct Target {
    char path[PATH_MAX];      // of the file itself, symbolic links followed
    char temporary[PATH_MAX]; // beside it; its name is short whatever the file's
    bool special;
    mode_t mode; // of the file that is replaced, 0 = there is none
} Target;

// Follows a symbolic link that leads to no file yet, so that the link stays one; false when there are too many.
static bool follow_links(char path[PATH_MAX]) {
    for (int i = 0; i < 40; i++) {
        char link[PATH_MAX], joined[PATH_MAX];
        ssize_t length = readlink(path, link, sizeof link - 1);
        if (length < 0) {
            return errno == EINVAL || errno == ENOENT;
        }
        link[length] = 0;
        const char *slash = strrchr(path, '/');
        int folder = link[0] == '/' || !slash ? 0 : (int)(slash - path) + 1;
        int all = snprintf(joined, sizeof joined, "%.*s%s", folder, path, link);
        if (all >= (int)sizeof joined) {
            errno = ENAMETOOLONG;
            return false;
        }
        memcpy(path, joined, (size_t)all + 1);
    }
    errno = ELOOP;
    return false;
}

static rey_result find_target(rey_context *ctx, const char *path, Target *target) {
    struct stat status;
    *target = (Target){.mode = 0};
    if (!path[0]) {
        return rey_fail(ctx, REY_ERROR_IO, "the name of the file to write is empty");
    }
    if ((size_t)snprintf(target->path, sizeof target->path, "%s", path) >= sizeof target->path) {
        errno = ENAMETOOLONG;
        return fail_errno(ctx, path, "create");
    }
    if (stat(path, &status) == 0) {
        if (S_ISDIR(status.st_mode)) {
            return rey_fail(ctx, REY_ERROR_IO, "%s: cannot write: is a folder, expected a file", path);
        }
        target->special = !S_ISREG(status.st_mode);
        target->mode = status.st_mode & 0777;
        if (access(path, W_OK) != 0) { // a rename would not ask
            return fail_errno(ctx, path, "write");
        }
    } else if (errno != ENOENT) {
        return fail_errno(ctx, path, "create");
    }
    if (target->special) {
        return REY_OK;
    }
    if (!follow_links(target->path)) {
        return fail_errno(ctx, path, "create");
    }
    const char *slash = strrchr(target->path, '/');
    const char *name = slash ? slash + 1 : target->path;
    if (!name[0]) {
        return rey_fail(ctx, REY_ERROR_IO, "%s: cannot write: names a folder, expected a file", path);
    }
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    char temporary[64];
    rey_file_temporary_name(temporary, sizeof temporary,
                            (unsigned long long)now.tv_sec * 1000000000u + (unsigned)now.tv_nsec);
    int all = snprintf(target->temporary, sizeof target->temporary, "%.*s%s", (int)(name - target->path), target->path,
                       temporary);
    if (all >= (int)sizeof target->temporary) {
        errno = ENAMETOOLONG;
        return fail_errno(ctx, path, "create");
    }
    return REY_OK;
}

// Creates the temporary file, with the modes that an ordinary new file or the replaced file has; -1 on failure.
static int open_temporary(Target *target) {
    size_t length = strlen(target->temporary);
    for (int i = 0; i < 100; i++) {
        int file = open(target->temporary, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
        if (file >= 0 && target->mode && fchmod(file, target->mode) != 0) {
            int code = errno;
            close(file);
            unlink(target->temporary);
            errno = code;
            return -1;
        }
        if (file >= 0 || errno != EEXIST) {
            return file;
        }
        snprintf(target->temporary + length, sizeof target->temporary - length, ".%d", i); // another thread's, this moment
    }
    return -1;
}

static rey_result write_all(rey_context *ctx, const char *path, int file, const unsigned char *bytes, size_t size) {
    enum { MOST = 1 << 30 };
    while (size) {
        ssize_t put = write(file, bytes, size < MOST ? size : MOST);
        if (put > 0) {
            bytes += put;
            size -= (size_t)put;
        } else if (put == 0 || errno != EINTR) {
            return fail_errno(ctx, path, "write");
        }
    }
    return fsync(file) == 0 || errno == EINVAL || errno == EROFS ? REY_OK : fail_errno(ctx, path, "write");
}

// The signals with which the system answers a write past the limit of file sizes or into a closed pipe would end the
// program; held back, the write fails and says why.
static rey_result write_quietly(rey_context *ctx, const char *path, int file, const void *bytes, size_t size) {
    sigset_t held, before, pending;
    const struct timespec no_wait = {0, 0};
    sigemptyset(&held);
    sigaddset(&held, SIGXFSZ);
    sigaddset(&held, SIGPIPE);
    sigpending(&pending);
    bool waiting = sigismember(&pending, SIGXFSZ) == 1 || sigismember(&pending, SIGPIPE) == 1; // not ours to take
    pthread_sigmask(SIG_BLOCK, &held, &before);
    rey_result result = write_all(ctx, path, file, bytes, size);
    while (result && !waiting && sigtimedwait(&held, NULL, &no_wait) > 0) {
    }
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    return result;
}

static rey_result write_special(rey_context *ctx, const Target *target, const void *bytes, size_t size) {
    int file = open(target->path, O_WRONLY | O_CLOEXEC);
    if (file < 0) {
        return fail_errno(ctx, target->path, "open");
    }
    rey_result result = write_quietly(ctx, target->path, file, bytes, size);
    close(file);
    return result;
}

rey_result rey_file_write(rey_context *ctx, const char *path, const void *bytes, size_t size) {
    Target target;
    rey_result result = find_target(ctx, path, &target);
    if (result || target.special) {
        return result ? result : write_special(ctx, &target, bytes, size);
    }
    int file = open_temporary(&target);
    if (file < 0) {
        return fail_errno(ctx, path, "create");
    }
    result = write_quietly(ctx, path, file, bytes, size);
    if (close(file) != 0 && result == REY_OK) {
        result = fail_errno(ctx, path, "write");
    }
    if (result == REY_OK && rename(target.temporary, target.path) != 0) {
        result = fail_errno(ctx, path, "replace");
    }
    if (result != REY_OK) {
        unlink(target.temporary);
    }
    return result;
}

rey_result rey_file_check_output(rey_context *ctx, const char *path) {
    Target target;
    rey_result result = find_target(ctx, path, &target);
    if (result) {
        return result;
    }
    if (target.special) {
        return REY_OK;
    }
    int file = open_temporary(&target);
    if (file < 0) {
        return fail_errno(ctx, path, "create");
    }
    close(file);
    unlink(target.temporary);
    char *slash = strrchr(target.path, '/');
    if (slash) {
        slash[slash == target.path] = '\0';
    }
    rey_file_remove_stale(slash ? target.path : ".");
    return REY_OK;
}
