/* What hosts that know arrays have besides the ports: the columns of tables, and matrices made of the kernel's state.
 * `arrays.c`, which is generated, holds the data. Value references go on behind those of the ports. */
#ifndef GAPSENSE_ARRAYS_H
#define GAPSENSE_ARRAYS_H

#include "state.h"

/* A table as arrays. They count while the parameter that names a file has its start value, and they have not. */
typedef struct {
    int port;      /* the parameter */
    unsigned rows; /* value reference of their length; those of the columns follow */
    const double *shipped; /* column after column */
    int shipped_rows;
} Table;

/* A symmetric matrix. */
typedef struct {
    const char *name;
    unsigned reference;
    int size;
    int first; /* of its upper triangle, row by row, in what `kernel` computes */
} Matrix;

typedef struct {
    unsigned time; /* value reference of the time */
    const Table *tables;
    int table_count;
    const Matrix *matrices;
    int matrix_count;
    Kernel *kernel; /* writes the matrices in place of a new state */
} Arrays;

enum {
    MOST_ENTRIES = 64, /* that the kernel of arrays writes */
    FEWEST_ROWS = 2,
    MOST_ROWS = 1000000 /* of a table as arrays */
};

extern const Arrays arrays;

const Table *table_of(int port); /* NULL: it names no file */
int table_rows(const State *state, const Table *table);
/* A column of `table_rows` numbers. */
const double *table_column(const State *state, const Table *table, int head);
/* The same to be written; NULL without memory. */
double *table_to_write(State *state, const Table *table, int head);
/* Another length: what is there stays, what is new is not a number. */
int table_resize(State *state, const Table *table, int rows);
int is_table_changed(const State *state, const Table *table);

void matrix_entries(const State *state, const Matrix *matrix, double *to); /* all, row by row */

#endif
