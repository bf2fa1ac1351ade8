// file_stale.h: names of temporary files, and the end of those that were left behind.
#pragma once

#include "base/context.h"

// A name that tells machine and process; moment tells the files of a process apart.
void rey_file_temporary_name(char *out, size_t size, unsigned long long moment);
// Removes the temporary files in a folder whose process, of this machine, was killed before it could.
void rey_file_remove_stale(const char *folder);
