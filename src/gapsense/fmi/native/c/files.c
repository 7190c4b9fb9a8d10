#include "files.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifdef _WIN32
#include <io.h>
#include <windows.h>
static const char SEPARATORS[] = "/\\:";
#else
#include <sys/stat.h>
static const char SEPARATORS[] = "/";
#endif

#ifndef GAPSENSE_COMPONENT /* that has only what its host lends it: fmi3_wasm.c */
/* Nothing but a file: of a pipe or a device reading might never end. */
static FILE *open_file(const char *path)
{
#ifdef _WIN32
    wchar_t wide[32768];
    const int is_utf8 = MultiByteToWideChar(CP_UTF8, MB_ERR_INVALID_CHARS, path, -1, wide, 32768);
    FILE *file = is_utf8 ? _wfopen(wide, L"rb") : fopen(path, "rb");
    if (file && GetFileType((HANDLE)_get_osfhandle(_fileno(file))) != FILE_TYPE_DISK) {
        fclose(file);
        return NULL;
    }
    return file;
#else
    struct stat about;
    return stat(path, &about) == 0 && S_ISREG(about.st_mode) ? fopen(path, "rb") : NULL;
#endif
}

int is_file(const char *path)
{
    FILE *file = open_file(path);
    if (!file)
        return 0;
    fgetc(file); /* a folder opens on some systems, but cannot be read */
    const int can_be_read = !ferror(file);
    fclose(file);
    return can_be_read;
}

static char *read_all(FILE *file, size_t *size)
{
    size_t room = 0;
    char *content = NULL;
    *size = 0;
    do {
        room = 2 * room + 4096;
        char *more = realloc(content, room + 1);
        if (!more) {
            free(content);
            return NULL;
        }
        content = more;
        *size += fread(content + *size, 1, room - *size, file);
    } while (*size == room);
    content[*size] = 0;
    return content;
}

char *file_content(const char *path, size_t *size)
{
    FILE *file = open_file(path);
    if (!file)
        return NULL;
    char *content = read_all(file, size);
    if (ferror(file)) {
        free(content);
        content = NULL;
    }
    fclose(file);
    return content;
}
#endif

static int is_full(const char *path)
{
#ifdef _WIN32
    return path[0] == '/' || path[0] == '\\' || (path[0] && path[1] == ':');
#else
    return path[0] == '/';
#endif
}

char *path_in(const char *folder, const char *name)
{
    char *path = malloc(strlen(folder) + strlen(name) + 2);
    if (path)
        sprintf(path, "%s%s%s", is_full(name) ? "" : folder, is_full(name) ? "" : "/", name);
    return path;
}

const char *last_part(const char *path)
{
    for (const char *c = path; *c; c++)
        if (strchr(SEPARATORS, *c) && c[1])
            path = c + 1;
    return path;
}

int is_csv(const char *path)
{
    const char *name = last_part(path), *end = strrchr(name, '.');
    if (!end || end == name || strlen(end) != 4)
        return 0;
    return (end[1] | 32) == 'c' && (end[2] | 32) == 's' && (end[3] | 32) == 'v';
}

static int nibble(char c)
{
    const char *const digits = "0123456789abcdef";
    const char *found = c ? strchr(digits, c >= 'A' && c <= 'F' ? c + 'a' - 'A' : c) : NULL;
    return found ? (int)(found - digits) : -1;
}

static void decode(char *text)
{
    char *to = text;
    for (; *text; text++, to++) {
        *to = *text;
        if (*text == '%' && nibble(text[1]) >= 0 && nibble(text[2]) >= 0) {
            *to = (char)(16 * nibble(text[1]) + nibble(text[2]));
            text += 2;
        }
    }
    *to = 0;
}

static int is_uri(const char *location)
{
    const char *const scheme = "file:";
    for (int k = 0; k < 5; k++)
        if (location[k] != scheme[k] && location[k] + 'a' - 'A' != scheme[k])
            return 0;
    return 1;
}

char *folder_of(const char *location)
{
    const int decodes = is_uri(location);
    if (decodes)
        location += 5;
    if (decodes && !strncmp(location, "//", 2))
        location += 2 + strcspn(location + 2, "/"); /* no machine, or `localhost` */
#ifdef _WIN32
    if (decodes && location[0] == '/' && location[1] && location[2] == ':')
        location++;
#endif
    char *folder = malloc(strlen(location) + 1);
    if (folder)
        strcpy(folder, location);
    if (folder && decodes)
        decode(folder);
    return folder;
}
