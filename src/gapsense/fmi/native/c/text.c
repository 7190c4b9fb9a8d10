#include "text.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { DIGITS = 17 }; /* tell any two doubles apart */

static void add(Text *text, const char *more, size_t length)
{
    if (text->length + length + 1 > text->size) {
        const size_t size = 2 * (text->length + length) + 64;
        char *at = realloc(text->at, size);
        if (!at)
            return;
        text->at = at;
        text->size = size;
    }
    memcpy(text->at + text->length, more, length);
    text->length += length;
    text->at[text->length] = 0;
}

/* The decimal digits of a finite number without zeros at the end, at most `count`; returns the power of the first. */
static int digits(double value, int count, char to[DIGITS + 1])
{
    char printed[DIGITS + 16];
    const char *c = printed;
    int n = 0;
    snprintf(printed, sizeof printed, "%.*e", count - 1, fabs(value));
    for (; *c != 'e'; c++) /* between the digits stands the decimal point of the locale */
        if (*c >= '0' && *c <= '9')
            to[n++] = *c;
    while (n > 1 && to[n - 1] == '0')
        n--;
    to[n] = 0;
    return atoi(c + 1);
}

/* Digits as a number: without an exponent if that is at least -4 and below `limit`. */
static void lay_out(const char *digits, int exponent, int limit, char to[REPR])
{
    const int n = (int)strlen(digits);
    if (exponent < -4 || exponent >= limit)
        sprintf(to, "%c%s%se%c%02d", digits[0], n > 1 ? "." : "", digits + 1, exponent < 0 ? '-' : '+', abs(exponent));
    else if (exponent < 0)
        sprintf(to, "0.%.*s%s", -exponent - 1, "000", digits);
    else if (n > exponent + 1)
        sprintf(to, "%.*s.%s", exponent + 1, digits, digits + exponent + 1);
    else
        sprintf(to, "%s%.*s", digits, exponent + 1 - n, "0000000000000000");
}

static int odd(double value, char to[REPR])
{
    if (value - value == 0.0)
        return 0;
    strcpy(to, isnan(value) ? "nan" : value < 0.0 ? "-inf" : "inf");
    return 1;
}

static void general(double value, int precision, char to[REPR])
{
    char found[DIGITS + 1];
    if (odd(value, to))
        return;
    const int exponent = digits(value, precision, found);
    if (signbit(value))
        *to++ = '-';
    lay_out(found, exponent, precision, to);
}

/* A number without its spaces and underscores; the C library expects the decimal point of the locale. */
static void localize(const char *c, char *to)
{
    char point[16];
    snprintf(point, sizeof point, "%.1f", 0.5);
    point[strlen(point) - 1] = 0; /* between `0` and `5` */
    for (; *c; c++) {
        if (*c == '.')
            to += sprintf(to, "%s", point + 1);
        else if (*c != '_')
            *to++ = *c;
    }
    *to = 0;
}

static double plain_number(const char *text)
{
    char few[64], *many = NULL;
    const size_t size = strlen(text) + 16;
    if (size > sizeof few && !(many = malloc(size)))
        return NAN;
    localize(text, many ? many : few);
    const double value = strtod(many ? many : few, NULL);
    free(many);
    return value;
}

const char *repr(double value, char to[REPR])
{
    char found[DIGITS + 1], tried[REPR], *start = to;
    int exponent = 0;
    if (odd(value, to))
        return to;
    if (signbit(value))
        *start++ = '-';
    for (int count = 1; count <= DIGITS; count++) {
        exponent = digits(value, count, found);
        lay_out(found, exponent, 16, tried);
        if (plain_number(tried) == fabs(value))
            break;
    }
    lay_out(found, exponent, 16, start);
    if (!strpbrk(start, ".e"))
        strcat(start, ".0");
    return to;
}

size_t space(const char *text)
{
    static const char *const wide[] = {"\xc2\x85", "\xc2\xa0", "\xe1\x9a\x80", "\xe2\x80\xa8", "\xe2\x80\xa9",
                                       "\xe2\x80\xaf", "\xe2\x81\x9f", "\xe3\x80\x80"};
    const unsigned char *c = (const unsigned char *)text;
    if (*c == ' ' || (*c >= 9 && *c <= 13) || (*c >= 28 && *c <= 31))
        return 1;
    if (c[0] == 0xe2 && c[1] == 0x80 && c[2] >= 0x80 && c[2] <= 0x8a)
        return 3;
    for (size_t k = 0; k < sizeof wide / sizeof *wide; k++)
        if (!strncmp(text, wide[k], strlen(wide[k])))
            return strlen(wide[k]);
    return 0;
}

/* Digits, between which single underscores may stand; returns what follows, NULL if there is no digit. */
static const char *past_digits(const char *c)
{
    if (*c < '0' || *c > '9')
        return NULL;
    while ((*c >= '0' && *c <= '9') || (*c == '_' && c[1] >= '0' && c[1] <= '9'))
        c++;
    return c;
}

/* What follows a decimal number; NULL if there is none. */
static const char *past_number(const char *c)
{
    c += *c == '+' || *c == '-';
    const char *whole = past_digits(c), *end = whole ? whole : c;
    if (*end == '.') {
        const char *fraction = past_digits(end + 1);
        if (!whole && !fraction)
            return NULL;
        end = fraction ? fraction : end + 1;
    } else if (!whole) {
        return NULL;
    }
    if (*end != 'e' && *end != 'E')
        return end;
    return past_digits(end + 1 + (end[1] == '+' || end[1] == '-'));
}

double number_in(const char *text)
{
    size_t n;
    while ((n = space(text)))
        text += n;
    const char *end = past_number(text);
    if (!end)
        return NAN;
    const double value = plain_number(text);
    while ((n = space(end)))
        end += n;
    return *end || value - value != 0.0 ? NAN : value;
}

static void add_number(Text *text, const char *format, va_list *values)
{
    char number[REPR];
    if (*format == 'd')
        sprintf(number, "%d", va_arg(*values, int));
    else if (*format == 'u')
        sprintf(number, "%u", va_arg(*values, unsigned));
    else
        general(va_arg(*values, double), *format == '.' ? format[1] - '0' : 6, number);
    add(text, number, strlen(number));
}

void text_add_list(Text *text, const char *format, va_list values)
{
    va_list rest;
    va_copy(rest, values);
    while (*format) {
        const size_t plain = strcspn(format, "%");
        add(text, format, plain);
        format += plain;
        if (!*format++)
            break;
        if (*format == '%') {
            add(text, "%", 1);
        } else if (*format == 's') {
            const char *more = va_arg(rest, const char *);
            add(text, more, strlen(more));
        } else {
            add_number(text, format, &rest);
            format += *format == '.' ? 2 : 0;
        }
        format++;
    }
    va_end(rest);
}

void text_add(Text *text, const char *format, ...)
{
    va_list values;
    va_start(values, format);
    text_add_list(text, format, values);
    va_end(values);
}

void text_join(Text *text, const char *between, const char *format, ...)
{
    va_list values;
    if (text->length)
        add(text, between, strlen(between));
    va_start(values, format);
    text_add_list(text, format, values);
    va_end(values);
}

void text_cut(Text *text, int most)
{
    size_t length = 0;
    for (int count = 0; length < text->length; length++)
        if (((unsigned char)text->at[length] & 0xc0) != 0x80 && count++ == most)
            break;
    if (length == text->length)
        return;
    text->length = length;
    add(text, "...", 3);
}

const char *text_of(const Text *text) { return text->at ? text->at : ""; }

void text_free(Text *text)
{
    free(text->at);
    *text = (Text){NULL, 0, 0};
}

char *text_copy(const char *text)
{
    const size_t size = strlen(text) + 1;
    char *copy = malloc(size);
    return copy ? memcpy(copy, text, size) : NULL;
}
