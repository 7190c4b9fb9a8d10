/* Tables as arrays, and matrices of the state. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "arrays.h"

const Table *table_of(int port)
{
    for (int k = 0; k < arrays.table_count; k++)
        if (arrays.tables[k].port == port)
            return arrays.tables + k;
    return NULL;
}

int table_rows(const State *s, const Table *t) { return s->rows[t->port] ? s->rows[t->port] : t->shipped_rows; }

const double *table_column(const State *s, const Table *t, int head)
{
    const double *columns = s->rows[t->port] ? s->columns[t->port] : t->shipped;
    return columns + (size_t)head * (size_t)table_rows(s, t);
}

int table_resize(State *s, const Table *t, int rows)
{
    const int heads = model.ports[t->port].head_count, before = table_rows(s, t);
    double *columns = malloc((size_t)heads * (size_t)rows * sizeof *columns);
    if (!columns)
        return 0;
    for (int h = 0; h < heads; h++)
        for (int k = 0; k < rows; k++)
            columns[(size_t)h * (size_t)rows + (size_t)k] = k < before ? table_column(s, t, h)[k] : NAN;
    free(s->columns[t->port]);
    s->columns[t->port] = columns;
    s->rows[t->port] = rows;
    return 1;
}

double *table_to_write(State *s, const Table *t, int head)
{
    if (!s->rows[t->port] && !table_resize(s, t, t->shipped_rows))
        return NULL;
    return s->columns[t->port] + (size_t)head * (size_t)s->rows[t->port];
}

int is_table_changed(const State *s, const Table *t)
{
    const size_t size = (size_t)model.ports[t->port].head_count * (size_t)t->shipped_rows * sizeof *t->shipped;
    const int rows = s->rows[t->port];
    return rows && (rows != t->shipped_rows || memcmp(s->columns[t->port], t->shipped, size) != 0);
}

void matrix_entries(const State *s, const Matrix *m, double *to)
{
    double entries[MOST_ENTRIES], *next = entries + m->first;
    arrays.kernel(s->kernel, s->memory, NULL, s->par, (const double *const *)s->tables, s->sizes, entries);
    for (int i = 0; i < m->size; i++)
        for (int j = i; j < m->size; j++)
            to[i * m->size + j] = to[j * m->size + i] = *next++;
}
