/* Rows of a CSV file, as Python's module of that name reads them. */
#ifndef GAPSENSE_CSV_H
#define GAPSENSE_CSV_H

#include <stddef.h>

typedef struct {
    int line; /* of the file at which the row ends */
    size_t first;
    int count;
} Row;

typedef struct {
    char *content; /* holds the cells */
    const char **cells;
    size_t cell_count;
    Row *rows; /* without empty ones */
    int row_count;
} Csv;

/* Takes the content over. NULL if all is well, else what is wrong with the file. */
const char *csv_read(Csv *csv, char *content, size_t size);
void csv_free(Csv *csv);
const char *csv_cell(const Csv *csv, int row, int column); /* empty if the row is shorter */

#endif
