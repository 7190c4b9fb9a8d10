/* FMI 3.0: what is behind a value reference. */
#ifndef GAPSENSE_FMI3_PLACES_H
#define GAPSENSE_FMI3_PLACES_H

#include "arrays.h"
#include "fmi3.h"

typedef enum { FLOAT64, INT32, INT64, UINT64, TRUTH, TEXT } Type;

typedef struct {
    Type type;
    int is_there, head; /* of a column, of a table or of the motion; -1: the number of rows or samples */
    const Port *port;
    const Table *table;
    const Matrix *matrix;
    const Motion *motion;
} Place;

Place place_of(unsigned reference);
size_t size_of(const State *state, const Place *place); /* how many values */
void add_name(Text *text, const Place *place);          /* of a variable that is no port */

/* Are there such variables, and as many values as they have? */
Status check(Instance *instance, const char *name, Type type, const unsigned *references, size_t count, size_t values);
int are_below(unsigned limit, const unsigned *references, size_t count);
int are_scalars(const unsigned *references, size_t count);

#endif
