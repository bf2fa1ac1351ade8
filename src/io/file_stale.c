// file_stale.c: temporary files that a process left behind when it was killed while it wrote.
#define _POSIX_C_SOURCE 200809L
#include "io/file_stale.h"

#include <dirent.h>
#include <errno.h>
#include <limits.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static const char prefix[] = ".reynolds-";

// FNV-1a of the machine's name: a folder may be shared with others, whose processes cannot be asked about.
static unsigned machine(void) {
    char name[256] = "";
    unsigned hash = 2166136261u;
    if (gethostname(name, sizeof name - 1) != 0) {
        return 0;
    }
    for (const char *c = name; *c; c++) {
        hash = (hash ^ (unsigned char)*c) * 16777619u;
    }
    return hash;
}

void rey_file_temporary_name(char *out, size_t size, unsigned long long moment) {
    snprintf(out, size, "%s%x-%lx-%llx", prefix, machine(), (long)getpid(), moment);
}

// Was it made by a process of this machine that runs no more?
static bool is_stale(const char *name) {
    char *end;
    if (strncmp(name, prefix, sizeof prefix - 1) != 0) {
        return false;
    }
    unsigned long host = strtoul(name + sizeof prefix - 1, &end, 16);
    if (*end != '-' || host != machine()) {
        return false;
    }
    long process = strtol(end + 1, &end, 16);
    return *end == '-' && process > 0 && kill((pid_t)process, 0) != 0 && errno == ESRCH;
}

void rey_file_remove_stale(const char *folder) {
    DIR *list = opendir(folder);
    for (struct dirent *entry; list && (entry = readdir(list));) {
        char path[PATH_MAX];
        if (is_stale(entry->d_name) &&
            (size_t)snprintf(path, sizeof path, "%s/%s", folder, entry->d_name) < sizeof path) {
            unlink(path);
        }
    }
    if (list) {
        closedir(list);
    }
}
