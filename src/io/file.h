// file.h: whole files in and out, with errors that name the path.
#pragma once

#include "base/context.h"

// Reads a whole file (or a pipe that has no name, such as a shell's). *bytes holds *size bytes and one zero byte after them, so
// text readers may stop there; the caller frees it with rey_free. Directories and files that cannot be opened or read are
// REY_ERROR_IO; on failure *bytes is null and *size 0.
rey_result rey_file_read(rey_context *ctx, const char *path, unsigned char **bytes, size_t *size);

// A file to read in parts, and its size; no pipe or device. The caller closes it.
rey_result rey_file_open(rey_context *ctx, const char *path, int *file, size_t *size);
// All of the bytes from an offset; fewer are a failure.
rey_result rey_file_read_part(rey_context *ctx, const char *path, int file, size_t offset, void *bytes, size_t size);

// Writes a file so that path holds either its former content or all of the new: a temporary file beside it is
// written, flushed to the device and renamed over it. A symbolic link stays one: the file that it leads to is replaced.
// Devices and pipes are written as they are. On failure the temporary file is removed.
rey_result rey_file_write(rey_context *ctx, const char *path, const void *bytes, size_t size);

// Whether both names mean one regular file, links followed.
bool rey_file_same(const char *a, const char *b);

// Whether rey_file_write could write there now, tried with an empty temporary file: asked before long work. Removes
// temporary files that a killed process left in the folder.
rey_result rey_file_check_output(rey_context *ctx, const char *path);
