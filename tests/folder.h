// folder.h: the folders that tests write to.
#pragma once

#include <stdio.h>
#include <stdlib.h>

// Removes a folder with everything in it; 0 when that went well.
static inline int folder_remove(const char *folder) {
    char command[256];
    snprintf(command, sizeof command, "rm -r '%s'", folder);
    return system(command);
}
