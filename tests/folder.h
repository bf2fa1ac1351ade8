// folder.h: the folders that tests write to.
#pragma once

#include <fcntl.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

// Removes a folder with everything in it; 0 when that went well.
static inline int folder_remove(const char *folder) {
    char command[256];
    snprintf(command, sizeof command, "rm -r '%s'", folder);
    return system(command);
}

// Waits for the end of the process that holds the other end of a pipe, and removes its folder.
static inline void folder_watch(const char *folder, const int ends[2]) {
    char byte;
    close(ends[1]);
    for (int i = 0; i < 3; i++) { // who waits for the test's output does not wait for this
        close(i);
    }
    setsid();
    while (read(ends[0], &byte, 1) > 0) {
    }
    execl("/bin/rm", "rm", "-rf", folder, (char *)NULL);
    _exit(1);
}

// A new folder: as mkdtemp, whose template it takes, and gone when the process is, even if it crashed or was killed.
static inline bool folder_make(char *folder) {
    int ends[2];
    if (!mkdtemp(folder) || pipe(ends)) {
        return false;
    }
    fcntl(ends[1], F_SETFD, FD_CLOEXEC);
    pid_t child = fork();
    if (child == 0) {
        folder_watch(folder, ends);
    }
    close(ends[0]);
    return child > 0;
}
