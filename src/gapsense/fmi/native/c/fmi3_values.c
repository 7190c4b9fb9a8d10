/* FMI 3.0: getting and setting values. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "arrays.h"
#include "fmi3.h"

typedef enum { FLOAT64, INT32, INT64, UINT64, TRUTH, TEXT } Type;

/* What is behind a value reference. */
typedef struct {
    Type type;
    int is_there, head; /* of a column; -1: the number of rows */
    const Port *port;
    const Table *table;
    const Matrix *matrix;
} Place;

static Place of_port(const Port *port)
{
    static const Type types[] = {FLOAT64, INT32, TRUTH, TEXT};
    const Place place = {port->choices ? INT64 : types[port->kind], 1, 0, port, NULL, NULL};
    return place;
}

static Place place_of(unsigned reference)
{
    Place place = {FLOAT64, reference == arrays.time, 0, NULL, NULL, NULL};
    if (reference < (unsigned)model.port_count)
        return of_port(model.ports + reference);
    for (int k = 0; k < arrays.table_count; k++) {
        const Table *table = arrays.tables + k;
        if (reference - table->rows > (unsigned)model.ports[table->port].head_count)
            continue;
        place.head = (int)(reference - table->rows) - 1;
        place.type = place.head < 0 ? UINT64 : FLOAT64;
        place.table = table;
    }
    for (int k = 0; k < arrays.matrix_count; k++)
        if (arrays.matrices[k].reference == reference)
            place.matrix = arrays.matrices + k;
    place.is_there |= place.table || place.matrix;
    return place;
}

static size_t size_of(const State *s, const Place *place)
{
    if (place->matrix)
        return (size_t)place->matrix->size * (size_t)place->matrix->size;
    return place->table && place->head >= 0 ? (size_t)table_rows(s, place->table) : 1;
}

/* Are there such variables, and as many values as they have? */
static Status check(Instance *i, const char *name, Type type, const unsigned *references, size_t count, size_t values)
{
    static const char *const names[] = {"Float64", "Int32", "Int64 or Enumeration", "UInt64", "Boolean", "String"};
    size_t expected = 0;
    for (size_t k = 0; k < count; k++) {
        const Place place = place_of(references[k]);
        if (!place.is_there || place.type != type)
            return refuse(i, SAY_NO_VARIABLE, names[type], references[k]);
        expected += size_of(i->state, &place);
    }
    if (expected != values)
        return refuse(i, SAY_VALUE_COUNT, name, (unsigned)expected, (unsigned)values);
    return FINE;
}

static int are_scalars(const unsigned *references, size_t count)
{
    int below = 1;
    for (size_t k = 0; k < count; k++)
        below &= references[k] < (unsigned)model.port_count;
    return below;
}

/* --- getting --- */

static Status begin_get(Instance *i, const char *name, Type type, const unsigned *references, size_t count, size_t values)
{
    static const unsigned none = 0;
    if (outside_configuration(i, CALL_Get, name) || instance_begin_get(i, name, REAL, &none, 0))
        return REFUSED;
    return check(i, name, type, references, count, values);
}

static Status get_place(Instance *i, const char *name, unsigned reference, double **to)
{
    const Place place = place_of(reference);
    const size_t size = size_of(i->state, &place);
    const unsigned output = (unsigned)model.inputs; /* the first: the matrices are as current as it */
    if (place.port ? instance_begin_get(i, name, REAL, &reference, 1) : FINE)
        return REFUSED;
    if (place.matrix && instance_begin_get(i, name, REAL, &output, 1))
        return REFUSED;
    if (place.matrix)
        matrix_entries(i->state, place.matrix, *to);
    else if (place.table)
        memcpy(*to, table_column(i->state, place.table, place.head), size * sizeof **to);
    else
        **to = place.port ? i->state->values[reference] : i->state->time;
    *to += size;
    return FINE;
}

fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference references[], size_t count, fmi3Float64 values[],
                          size_t value_count)
{
    Instance *i = c;
    if (!i || begin_get(i, __func__, FLOAT64, references, count, value_count))
        return fmi3Error;
    if (!are_scalars(references, count)) {
        for (size_t k = 0; k < count; k++)
            if (get_place(i, __func__, references[k], &values))
                return fmi3Error;
        return fmi3OK;
    }
    if (instance_begin_get(i, __func__, REAL, references, count))
        return fmi3Error;
    for (size_t k = 0; k < count; k++)
        values[k] = i->state->values[references[k]];
    return fmi3OK;
}

/* The number of a choice, from 1 on; what was set if there is no such choice. */
static fmi3Int64 number_of(const State *s, unsigned reference)
{
    const Port *port = model.ports + reference;
    for (int k = 0; k < port->choice_count; k++)
        if (!strcmp(port->choices[k], s->texts[reference]))
            return k + 1;
    return strtoll(s->texts[reference], NULL, 10);
}

#define GETTER(Name, TYPE, Type, VALUE)                                                                                \
    fmi3Status fmi3Get##Name(fmi3Instance c, const fmi3ValueReference references[], size_t count, Type values[],        \
                             size_t value_count)                                                                       \
    {                                                                                                                  \
        Instance *i = c;                                                                                               \
        if (!i || begin_get(i, __func__, TYPE, references, count, value_count))                                        \
            return fmi3Error;                                                                                          \
        const State *s = i->state;                                                                                     \
        for (size_t k = 0; k < count; k++)                                                                             \
            values[k] = VALUE;                                                                                         \
        return fmi3OK;                                                                                                 \
    }

GETTER(Int32, INT32, fmi3Int32, (fmi3Int32)s->values[references[k]])
GETTER(Boolean, TRUTH, fmi3Boolean, s->values[references[k]] != 0.0)
GETTER(String, TEXT, fmi3String, s->texts[references[k]])
GETTER(Int64, INT64, fmi3Int64, number_of(s, references[k]))

fmi3Status fmi3GetUInt64(fmi3Instance c, const fmi3ValueReference references[], size_t count, fmi3UInt64 values[],
                         size_t value_count)
{
    Instance *i = c; /* also in the configuration mode, which is there for them */
    if (!i || check(i, __func__, UINT64, references, count, value_count))
        return fmi3Error;
    if (!is_configuring(i) && instance_may(i, CALL_Get, __func__))
        return fmi3Error;
    for (size_t k = 0; k < count; k++)
        values[k] = (fmi3UInt64)table_rows(i->state, place_of(references[k]).table);
    return fmi3OK;
}

/* --- setting --- */

static Status begin_set(Instance *i, const char *name, Type type, const unsigned *references, size_t count, size_t values)
{
    if (outside_configuration(i, CALL_Set, name) || instance_may(i, CALL_Set, name))
        return REFUSED;
    return check(i, name, type, references, count, values);
}

static void add_name(Text *text, const Place *place)
{
    if (!place->table) {
        text_add(text, "%s", place->matrix ? place->matrix->name : "time");
        return;
    }
    const Port *port = model.ports + place->table->port;
    text_add(text, "%s.%s", port->name, place->head < 0 ? "rows" : port->heads[place->head].name);
}

static Status refuse_place(Instance *i, const Place *place)
{
    Text name = {NULL, 0, 0};
    add_name(&name, place);
    if (place->table)
        refuse(i, SAY_IS_FIXED, text_of(&name));
    else
        refuse(i, SAY_IS_OUTPUT, text_of(&name));
    text_free(&name);
    return REFUSED;
}

static Status may_set_place(Instance *i, const char *name, unsigned reference)
{
    const Place place = place_of(reference);
    if (place.port)
        return instance_begin_set(i, name, REAL, &reference, 1);
    if (!place.table || i->state->phase == RUNNING)
        return refuse_place(i, &place);
    i->state->is_due = 1;
    return table_to_write(i->state, place.table, place.head) ? FINE : refuse(i, SAY_NO_MEMORY);
}

static const double *set_place(Instance *i, unsigned reference, const double *values)
{
    const Place place = place_of(reference);
    const size_t size = size_of(i->state, &place);
    if (place.table)
        memcpy(table_to_write(i->state, place.table, place.head), values, size * sizeof *values);
    else
        i->state->values[reference] = *values;
    return values + size;
}

static fmi3Status set_places(Instance *i, const char *name, const unsigned *references, size_t count, const double *values)
{
    for (size_t k = 0; k < count; k++)
        if (may_set_place(i, name, references[k]))
            return fmi3Error;
    for (size_t k = 0; k < count; k++)
        values = set_place(i, references[k], values);
    return fmi3OK;
}

fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference references[], size_t count,
                          const fmi3Float64 values[], size_t value_count)
{
    Instance *i = c;
    if (!i || begin_set(i, __func__, FLOAT64, references, count, value_count))
        return fmi3Error;
    if (!are_scalars(references, count))
        return set_places(i, __func__, references, count, values);
    if (instance_begin_set(i, __func__, REAL, references, count))
        return fmi3Error;
    for (size_t k = 0; k < count; k++)
        i->state->values[references[k]] = values[k];
    return (fmi3Status)instance_end_set(i);
}

#define SETTER(Name, TYPE, KIND, Type, VALUE)                                                                          \
    fmi3Status fmi3Set##Name(fmi3Instance c, const fmi3ValueReference references[], size_t count, const Type values[],  \
                             size_t value_count)                                                                       \
    {                                                                                                                  \
        Instance *i = c;                                                                                               \
        if (!i || begin_set(i, __func__, TYPE, references, count, value_count) ||                                      \
            instance_begin_set(i, __func__, KIND, references, count))                                                  \
            return fmi3Error;                                                                                          \
        for (size_t k = 0; k < count; k++)                                                                             \
            i->state->values[references[k]] = VALUE;                                                                   \
        return (fmi3Status)instance_end_set(i);                                                                        \
    }

SETTER(Int32, INT32, INTEGER, fmi3Int32, values[k])
SETTER(Boolean, TRUTH, BOOLEAN, fmi3Boolean, values[k] ? 1.0 : 0.0)

fmi3Status fmi3SetString(fmi3Instance c, const fmi3ValueReference references[], size_t count, const fmi3String values[],
                         size_t value_count)
{
    Instance *i = c;
    if (!i || begin_set(i, __func__, TEXT, references, count, value_count) ||
        instance_begin_set(i, __func__, STRING, references, count))
        return fmi3Error;
    for (size_t k = 0; k < count; k++)
        if (instance_set_text(i, references[k], values[k] ? values[k] : ""))
            return fmi3Error;
    return (fmi3Status)instance_end_set(i);
}

/* A number without a choice is kept, to be refused with all other parameters. */
static Status choose(Instance *i, unsigned reference, fmi3Int64 number)
{
    const Port *port = model.ports + reference;
    char text[24];
    snprintf(text, sizeof text, "%lld", (long long)number);
    return instance_set_text(i, reference, number > 0 && number <= port->choice_count ? port->choices[number - 1] : text);
}

fmi3Status fmi3SetInt64(fmi3Instance c, const fmi3ValueReference references[], size_t count, const fmi3Int64 values[],
                        size_t value_count)
{
    Instance *i = c;
    if (!i || begin_set(i, __func__, INT64, references, count, value_count) ||
        instance_begin_set(i, __func__, STRING, references, count))
        return fmi3Error;
    for (size_t k = 0; k < count; k++)
        if (choose(i, references[k], values[k]))
            return fmi3Error;
    return (fmi3Status)instance_end_set(i);
}

static Status may_have_rows(Instance *i, unsigned reference, fmi3UInt64 rows)
{
    const Place place = place_of(reference);
    Text name = {NULL, 0, 0}, found = {NULL, 0, 0}, range = {NULL, 0, 0}, problem = {NULL, 0, 0};
    if (rows >= FEWEST_ROWS && rows <= MOST_ROWS)
        return FINE;
    add_name(&name, &place);
    text_add(&found, "%.9g", (double)rows);
    text_add(&range, SAY_FROM_TO, (double)FEWEST_ROWS, (double)MOST_ROWS, "");
    text_add(&problem, SAY_IS_WRONG, text_of(&name), text_of(&found), text_of(&range));
    refuse(i, SAY_CORRECT_PARAMETERS, text_of(&problem));
    text_free(&name), text_free(&found), text_free(&range), text_free(&problem);
    return REFUSED;
}

fmi3Status fmi3SetUInt64(fmi3Instance c, const fmi3ValueReference references[], size_t count, const fmi3UInt64 values[],
                         size_t value_count)
{
    Instance *i = c;
    if (!i || in_configuration(i, __func__) || check(i, __func__, UINT64, references, count, value_count))
        return fmi3Error;
    for (size_t k = 0; k < count; k++)
        if (may_have_rows(i, references[k], values[k]))
            return fmi3Error;
    for (size_t k = 0; k < count; k++)
        if (!table_resize(i->state, place_of(references[k]).table, (int)values[k]))
            return (fmi3Status)refuse(i, SAY_NO_MEMORY);
    i->state->is_due = 1;
    return fmi3OK;
}

/* --- types that no component has --- */

#define LACKING(Name, Type)                                                                                            \
    fmi3Status fmi3Get##Name(fmi3Instance c, const fmi3ValueReference references[], size_t count, Type values[],        \
                             size_t value_count)                                                                       \
    {                                                                                                                  \
        (void)values, (void)value_count;                                                                               \
        return count ? CALLED(c, refuse(c, SAY_NO_VARIABLE, #Name, references[0])) : fmi3OK;                           \
    }                                                                                                                  \
    fmi3Status fmi3Set##Name(fmi3Instance c, const fmi3ValueReference references[], size_t count, const Type values[],  \
                             size_t value_count)                                                                       \
    {                                                                                                                  \
        (void)values, (void)value_count;                                                                               \
        return count ? CALLED(c, refuse(c, SAY_NO_VARIABLE, #Name, references[0])) : fmi3OK;                           \
    }

LACKING(Float32, fmi3Float32)
LACKING(Int8, fmi3Int8)
LACKING(UInt8, fmi3UInt8)
LACKING(Int16, fmi3Int16)
LACKING(UInt16, fmi3UInt16)
LACKING(UInt32, fmi3UInt32)
