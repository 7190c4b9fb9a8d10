#include "csv.h"

#include <stdlib.h>
#include <string.h>

enum { LONGEST = 131072 }; /* characters of a cell */

/* Bytes of the character that a text begins with, by its first byte; 0 for what begins none. */
static int length_of(unsigned char first)
{
    return first < 0x80 ? 1 : first < 0xc2 ? 0 : first < 0xe0 ? 2 : first < 0xf0 ? 3 : first < 0xf5 ? 4 : 0;
}

/* Whether the second byte fits the first one: no overlong forms, no surrogates, nothing beyond Unicode. */
static int fits(unsigned char first, unsigned char second)
{
    return !((first == 0xe0 && second < 0xa0) || (first == 0xed && second > 0x9f) || (first == 0xf0 && second < 0x90) ||
             (first == 0xf4 && second > 0x8f));
}

static int is_utf8(const unsigned char *c, const unsigned char *end)
{
    while (c < end) {
        const int length = length_of(*c);
        if (!length || end - c < length || (length > 1 && !fits(c[0], c[1])))
            return 0;
        for (int k = 1; k < length; k++)
            if ((c[k] & 0xc0) != 0x80)
                return 0;
        c += length;
    }
    return 1;
}

typedef struct {
    Csv *csv;
    char *from, *to, *end; /* cells are written over what has been read */
    int line;
} Reader;

static int add_cell(Csv *csv, const char *cell)
{
    if (!(csv->cell_count & (csv->cell_count + 1))) { /* room for 1, 3, 7, ... */
        const char **cells = realloc(csv->cells, (2 * csv->cell_count + 2) * sizeof *cells);
        if (!cells)
            return 0;
        csv->cells = cells;
    }
    csv->cells[csv->cell_count++] = cell;
    return 1;
}

static int add_row(Csv *csv, int line, size_t first)
{
    if (!(csv->row_count & (csv->row_count + 1))) {
        Row *rows = realloc(csv->rows, (2 * (size_t)csv->row_count + 2) * sizeof *rows);
        if (!rows)
            return 0;
        csv->rows = rows;
    }
    csv->rows[csv->row_count++] = (Row){line, first, (int)(csv->cell_count - first)};
    return 1;
}

static int is_line_end(const Reader *r) { return r->from == r->end || *r->from == '\n' || *r->from == '\r'; }

static void past_line_end(Reader *r)
{
    if (r->from == r->end) { /* the last line may end here, or in quotes that nothing closes */
        r->line += r->from[-1] != '\n' && r->from[-1] != '\r';
        return;
    }
    if (*r->from == '\r' && r->from + 1 < r->end && r->from[1] == '\n')
        r->from++;
    r->from++;
    r->line++;
}

/* What is between quotes, until the closing one; a doubled one stands for itself. */
static void read_quoted(Reader *r)
{
    for (r->from++; r->from < r->end; *r->to++ = *r->from++) {
        if (*r->from == '"' && (++r->from == r->end || *r->from != '"'))
            return;
        const int is_return = *r->from == '\r' && !(r->from + 1 < r->end && r->from[1] == '\n');
        r->line += *r->from == '\n' || is_return;
    }
}

static int is_too_long(const char *cell)
{
    size_t characters = 0;
    for (; *cell; cell++)
        characters += ((unsigned char)*cell & 0xc0) != 0x80;
    return characters > LONGEST;
}

/* One cell; what follows it, a comma or the end of the line, is still to be read. */
static const char *read_cell(Reader *r)
{
    char *cell = r->to;
    if (r->from < r->end && *r->from == '"')
        read_quoted(r);
    while (!is_line_end(r) && *r->from != ',')
        *r->to++ = *r->from++;
    return cell;
}

static const char *read_row(Reader *r)
{
    const size_t first = r->csv->cell_count;
    int is_last;
    do {
        const char *cell = read_cell(r);
        is_last = is_line_end(r);
        if (is_last)
            past_line_end(r);
        else
            r->from++;
        *r->to++ = 0;
        if (is_too_long(cell))
            return "field larger than field limit (131072)";
        if (!add_cell(r->csv, cell))
            return "out of memory";
    } while (!is_last);
    return add_row(r->csv, r->line, first) ? NULL : "out of memory";
}

const char *csv_read(Csv *csv, char *content, size_t size)
{
    *csv = (Csv){content, NULL, 0, NULL, 0};
    const size_t mark = size >= 3 && !memcmp(content, "\xef\xbb\xbf", 3) ? 3 : 0;
    Reader reader = {csv, content + mark, content + mark, content + size, 0};
    const char *problem = NULL;
    if (memchr(content, 0, size))
        return "line contains NUL";
    if (!is_utf8((const unsigned char *)content, (const unsigned char *)content + size))
        return "it has other bytes";
    while (reader.from < reader.end && !problem) {
        if (is_line_end(&reader)) /* an empty line */
            past_line_end(&reader);
        else
            problem = read_row(&reader);
    }
    return problem;
}

void csv_free(Csv *csv)
{
    free(csv->content);
    free(csv->cells);
    free(csv->rows);
}

const char *csv_cell(const Csv *csv, int row, int column)
{
    return column < csv->rows[row].count ? csv->cells[csv->rows[row].first + (size_t)column] : "";
}
