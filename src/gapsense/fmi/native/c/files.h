/* Files by name in UTF-8, on all systems. */
#ifndef GAPSENSE_FILES_H
#define GAPSENSE_FILES_H

#include <stddef.h>

/* Content of a file with a zero behind it, to be freed; NULL if it cannot be read. */
char *file_content(const char *path, size_t *size);
int is_file(const char *path);
/* `folder` and `name` as a path, to be freed; the name alone if it is a full path. */
char *path_in(const char *folder, const char *name);
const char *last_part(const char *path);
int is_csv(const char *path); /* by the end of its name */
/* The folder that a location means, to be freed: an URI of the scheme `file`, or a path. */
char *folder_of(const char *location);

#endif
