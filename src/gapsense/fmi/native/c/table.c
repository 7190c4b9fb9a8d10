#include "table.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "csv.h"
#include "files.h"
#include "heads.h"
#include "sentences.h"

/* A file while it is read: where its columns are, and the numbers in them, head by head. */
typedef struct {
    const Port *port;
    Csv csv;
    int *places; /* by head; -1: missing */
    double *numbers;
    int rows;
    Text problems;
    unsigned wrong; /* problems of rows, told or not */
} Reading;

enum { MOST_TOLD = 10 };

/* Where a row is in the file; arrays count from 1. */
static int line_of(const Reading *r, int row) { return r->csv.rows ? r->csv.rows[row + 1].line : row + 1; }

static const double *column(const Reading *r, int head) { return r->numbers + (size_t)head * (size_t)r->rows; }

/* --- the rows --- */

/* Whether a problem of a row is one of the first, which are told. */
static int is_told(Reading *r) { return r->wrong++ < MOST_TOLD; }

static void note_number(Reading *r, int line, int h, const char *cell)
{
    Text shown = {NULL, 0, 0};
    if (!is_told(r))
        return;
    text_add(&shown, "%s", cell);
    text_cut(&shown, LONGEST_CELL);
    text_join(&r->problems, "; ", SAY_NO_NUMBER, line, r->port->heads[h].name, text_of(&shown));
    text_free(&shown);
}

static void read_numbers(Reading *r, int h)
{
    double *to = r->numbers + (size_t)h * (size_t)r->rows;
    for (int k = 0; k < r->rows; k++) {
        const char *cell = csv_cell(&r->csv, k + 1, r->places[h]);
        to[k] = number_in(cell);
        if (to[k] != to[k])
            note_number(r, r->csv.rows[k + 1].line, h, cell);
    }
}

static void note_disorder(Reading *r, int h)
{
    const Head *head = r->port->heads + h;
    const double *x = column(r, h);
    for (int k = 1; k < r->rows && (h == 0 || head->is_rising); k++) {
        if (x[k] < x[k - 1] && is_told(r))
            text_join(&r->problems, "; ", SAY_DECREASES, line_of(r, k), head->name, x[k - 1], x[k]);
        else if (x[k] == x[k - 1] && head->is_rising && is_told(r))
            text_join(&r->problems, "; ", SAY_DOES_NOT_RISE, line_of(r, k), head->name, x[k - 1], x[k]);
    }
}

static int is_grid(const Port *port) { return port->columns[port->column_count - 1].kind >= AXIS; }

static void note_off_grid(Reading *r, int row)
{
    if (is_told(r))
        text_join(&r->problems, "; ", SAY_OFF_GRID, line_of(r, row), r->port->heads[0].name, r->port->heads[1].name);
}

/* Rows of a grid that do not fit its first block; rows of a block that do not rise from zero. */
static void note_unevenness(Reading *r)
{
    const Head *heads = r->port->heads;
    const double *x = column(r, 0), *y = column(r, 1), *z = column(r, 2);
    const int width = r->rows ? grid_width(x, r->rows) : 1;
    for (int k = 0; k < r->rows; k++) {
        const int j = k % width;
        if (k >= width && (y[k] != y[j] || (x[k] == x[k - 1]) != (j > 0))) {
            note_off_grid(r, k);
            return;
        }
        if (j == 0 && (y[k] != 0.0 || z[k] != 0.0) && is_told(r))
            text_join(&r->problems, "; ", SAY_NOT_FROM_ZERO, line_of(r, k), heads[1].name, heads[2].name, heads[0].name,
                      y[k], z[k]);
        for (int h = 1; j && h < 3; h++)
            if (!(column(r, h)[k] > column(r, h)[k - 1]) && is_told(r))
                text_join(&r->problems, "; ", SAY_DOES_NOT_RISE, line_of(r, k), heads[h].name, column(r, h)[k - 1],
                          column(r, h)[k]);
    }
    if (r->rows % width)
        note_off_grid(r, r->rows - 1);
}

static void judge_rows(Reading *r)
{
    const double *x = r->numbers;
    for (int h = 0; h < r->port->head_count; h++)
        note_disorder(r, h);
    if (is_grid(r->port) && !r->wrong)
        note_unevenness(r);
    if (r->wrong > MOST_TOLD)
        text_join(&r->problems, "; ", SAY_AND_MORE, r->wrong - MOST_TOLD);
    const int width = r->rows ? grid_width(x, r->rows) : 0;
    if (r->rows < r->port->fewest_rows || x[r->rows - 1] <= x[0])
        text_join(&r->problems, "; ", SAY_FEW_ROWS, r->rows, r->port->fewest_rows, r->port->heads[0].name);
    else if (is_grid(r->port) && !r->wrong && (width < GRID_ROWS || r->rows < SPLINE_ROWS * width))
        text_join(&r->problems, "; ", SAY_SMALL_GRID, r->rows, width, r->port->heads[0].name, SPLINE_ROWS, GRID_ROWS);
}

/* --- what the kernel gets --- */

static int make(State *s, const Reading *r, const Column *wanted)
{
    const double *xs = column(r, 0), *ys = column(r, wanted->head);
    double *table = malloc((size_t)r->rows * sizeof *table);
    if (!table)
        return 0;
    if (wanted->kind == INTEGRAL)
        integrate(xs, ys, r->rows, table);
    else if (wanted->kind == PLAIN)
        memcpy(table, ys, (size_t)r->rows * sizeof *table);
    else if (wanted->kind == SPLINE ? !spline(xs, ys, r->rows, table)
                                    : !grid(wanted->kind, xs, column(r, 1), column(r, 2), r->rows, table)) {
        free(table);
        return 0;
    }
    free(s->tables[wanted->place]);
    s->tables[wanted->place] = table;
    s->sizes[wanted->place] = r->rows;
    return 1;
}

static int make_all(State *s, const Reading *r)
{
    for (int k = 0; k < r->port->column_count; k++)
        if (!make(s, r, r->port->columns + k))
            return 0;
    return 1;
}

/* Columns, numbers and tables of what the CSV file holds; all that is wrong is noted. */
static int understand(State *s, Reading *r)
{
    r->rows = r->csv.row_count ? r->csv.row_count - 1 : 0;
    r->places = malloc((size_t)r->port->head_count * sizeof *r->places);
    r->numbers = malloc((size_t)r->port->head_count * ((size_t)r->rows + 1) * sizeof *r->numbers);
    if (!r->places || !r->numbers)
        return 0;
    if (find_columns(r->port, &r->csv, r->places, &r->problems)) {
        for (int h = 0; h < r->port->head_count; h++)
            read_numbers(r, h);
        judge_rows(r);
    }
    return r->problems.length || make_all(s, r);
}

static int read_content(State *s, const Port *port, const char *name, char *content, size_t size, Text *problem)
{
    Reading r = {port, {NULL, NULL, 0, NULL, 0}, NULL, NULL, 0, {NULL, 0, 0}, 0};
    const char *fault = csv_read(&r.csv, content, size);
    if (fault)
        text_add(problem, SAY_NO_CSV, name, fault);
    else if (!understand(s, &r))
        text_add(problem, SAY_NO_MEMORY);
    else if (r.problems.length)
        text_add(problem, SAY_WRONG_FILE, name, text_of(&r.problems));
    csv_free(&r.csv);
    free(r.places);
    free(r.numbers);
    text_free(&r.problems);
    return problem->length == 0;
}

/* --- arrays --- */

static void judge_numbers(Reading *r)
{
    char number[REPR];
    for (int h = 0; h < r->port->head_count; h++)
        for (int k = 0; k < r->rows; k++) {
            const double x = column(r, h)[k];
            if (!(x - x == 0.0))
                note_number(r, k + 1, h, repr(x, number));
        }
}

int read_columns(State *s, int port, Text *problem)
{
    Reading r = {model.ports + port, {NULL, NULL, 0, NULL, 0}, NULL, s->columns[port], s->rows[port], {NULL, 0, 0}, 0};
    judge_numbers(&r);
    judge_rows(&r);
    if (r.problems.length)
        text_add(problem, SAY_WRONG_ARRAYS, text_of(&r.problems));
    else if (!make_all(s, &r))
        text_add(problem, SAY_NO_MEMORY);
    text_free(&r.problems);
    return problem->length == 0;
}

/* --- the file --- */

static int refuse_file(const Port *port, const char *file, const char *format, Text *problem)
{
    Text heads = {NULL, 0, 0};
    for (int h = 0; h < port->head_count; h++)
        text_join(&heads, ", ", "%s", port->heads[h].text);
    text_add(problem, format, file, text_of(&heads));
    text_free(&heads);
    return 0;
}

int read_table(State *s, const Port *port, const char *folder, const char *file, Text *problem)
{
    size_t size = 0;
    if (!is_csv(file)) /* what other files hold is nobody's business: messages tell cells and headers */
        return refuse_file(port, file, SAY_NO_CSV_NAME, problem);
    char *shipped = path_in(folder, file);
    char *content = shipped ? file_content(shipped, &size) : NULL;
    if (!content)
        content = file_content(file, &size);
    free(shipped);
    if (!content)
        return refuse_file(port, file, SAY_NO_FILE, problem);
    return read_content(s, port, last_part(file), content, size, problem);
}
