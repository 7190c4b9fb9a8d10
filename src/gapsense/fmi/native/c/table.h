/* Tables of a component from CSV files; `tables.py` does the same for the Python FMU. */
#ifndef GAPSENSE_TABLE_H
#define GAPSENSE_TABLE_H

#include "state.h"

/* The tables of a port from a file that lies in `folder`, or else from the working folder on; 0 and all problems of the
 * file if it cannot be. */
int read_table(State *state, const Port *port, const char *folder, const char *file, Text *problem);

/* The same from the columns that arrays give. */
int read_columns(State *state, int port, Text *problem);

/* From columns of `rows` numbers, as `tables.py` computes them, to the last bit. */
void integrate(const double *xs, const double *ys, int rows, double *to);
int spline(const double *xs, const double *ys, int rows, double *to); /* 0 without memory */
int grid_width(const double *xs, int rows); /* rows of the first block */
int grid(ColumnKind kind, const double *xs, const double *ys, const double *zs, int rows, double *to); /* likewise */

#endif
