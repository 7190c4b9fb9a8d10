/* Text that grows, and numbers in it as Python writes them, whatever the process's locale is. */
#ifndef GAPSENSE_TEXT_H
#define GAPSENSE_TEXT_H

#include <stdarg.h>
#include <stddef.h>

#ifdef __GNUC__
#define FORMAT(at, values) __attribute__((format(printf, at, values)))
#else
#define FORMAT(at, values)
#endif

typedef struct {
    char *at; /* NULL while it is empty */
    size_t length, size;
} Text;

enum { REPR = 32 };

/* Formats know %s, %d, %u, %g, %.3g and the like, and %%. Without memory for it a text stays shorter. */
void text_add(Text *text, const char *format, ...) FORMAT(2, 3);
void text_add_list(Text *text, const char *format, va_list values) FORMAT(2, 0);
/* The same after `between`, if there is something before it. */
void text_join(Text *text, const char *between, const char *format, ...) FORMAT(3, 4);
void text_cut(Text *text, int most); /* to at most so many characters, then three points */
const char *text_of(const Text *text);
void text_free(Text *text);

/* The shortest decimal number that is this one, written as Python's `repr` does; but a power of two may get a digit more. */
const char *repr(double value, char to[REPR]);
/* The number that a text holds as Python's `float` reads it; NaN if it holds none, or one that is not finite. */
double number_in(const char *text);
/* Bytes of the white space, as Python sees it, that a text begins with: 0 to 3. */
size_t space(const char *text);
char *text_copy(const char *text);

#endif
