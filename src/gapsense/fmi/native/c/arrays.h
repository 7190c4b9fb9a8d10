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

/* The motion that was smoothed and published last, sample by sample: those signals while a flag is set. */
typedef struct {
    unsigned count;     /* value reference of how many samples there are; those of the columns follow */
    int flag;           /* an output, as are the signals; the first of them is the time */
    const int *signals;
    int signal_count;
} Motion;

typedef struct {
    unsigned time; /* value reference of the time */
    const Table *tables;
    int table_count;
    const Matrix *matrices;
    int matrix_count;
    const Motion *motion; /* NULL: nothing is smoothed */
    Kernel *kernel; /* writes the matrices in place of outputs */
} Arrays;

enum {
    MOST_ENTRIES = 64, /* that the kernel of arrays writes */
    FEWEST_ROWS = 2,
    MOST_ROWS = 1000000, /* of a table as arrays */
    MOTION_ROWS = 2048   /* of a smoothed motion */
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

size_t motion_size(void); /* numbers in a state for it */
void motion_note(State *state); /* after each sample */
int motion_count(const State *state);
void motion_column(const State *state, int signal, double *to); /* MOTION_ROWS numbers; zeros behind the samples */
int motion_is_sound(const State *state);

void matrix_entries(const State *state, const Matrix *matrix, double *to); /* all, row by row */

#endif
