/* Where the columns of a table are, by the header of its file. */
#ifndef GAPSENSE_HEADS_H
#define GAPSENSE_HEADS_H

#include "csv.h"
#include "model.h"
#include "text.h"

enum { LONGEST_CELL = 40, LONGEST_LIST = 200 }; /* characters of a cell, and of a list of them, that messages show */

/* Place of the column of each head, -1 if it is missing; 1 if all are there. Notes what is wrong with the header. */
int find_columns(const Port *port, const Csv *csv, int *places, Text *problems);

#endif
