/* FMI 3.0: getting values. */
#include <stdlib.h>
#include <string.h>

#include "fmi3_places.h"

static Status begin_get(Instance *i, const char *name, Type type, const unsigned *references, size_t count,
                        const void *values, size_t value_count)
{
    static const unsigned none = 0;
    if (instance_given_values(i, name, references, count, values, value_count))
        return REFUSED;
    if (outside_configuration(i, CALL_Get, name) || instance_begin_get(i, name, REAL, &none, 0))
        return REFUSED;
    return check(i, name, type, references, count, value_count);
}

static Status get_place(Instance *i, const char *name, unsigned reference, double **to)
{
    const Place place = place_of(reference);
    const size_t size = size_of(i->state, &place);
    const unsigned output = (unsigned)model.inputs; /* the first: the matrices are as current as it */
    if (place.port ? instance_begin_get(i, name, REAL, &reference, 1) : FINE)
        return REFUSED;
    if ((place.matrix || place.motion) && instance_begin_get(i, name, REAL, &output, 1))
        return REFUSED;
    if (place.matrix)
        matrix_entries(i->state, place.matrix, *to);
    else if (place.motion)
        motion_column(i->state, place.head, *to);
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
    if (!i || begin_get(i, __func__, FLOAT64, references, count, values, value_count))
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

static fmi3Int32 whole(const State *s, unsigned reference)
{
    return reference < (unsigned)model.port_count ? (fmi3Int32)s->values[reference] : motion_count(s);
}

#define GETTER(Name, TYPE, Type, VALUE)                                                                                \
    fmi3Status fmi3Get##Name(fmi3Instance c, const fmi3ValueReference references[], size_t count, Type values[],        \
                             size_t value_count)                                                                       \
    {                                                                                                                  \
        Instance *i = c;                                                                                               \
        if (!i || begin_get(i, __func__, TYPE, references, count, values, value_count))                                        \
            return fmi3Error;                                                                                          \
        const State *s = i->state;                                                                                     \
        for (size_t k = 0; k < count; k++)                                                                             \
            values[k] = VALUE;                                                                                         \
        return fmi3OK;                                                                                                 \
    }

GETTER(Int32, INT32, fmi3Int32, whole(s, references[k]))
GETTER(Boolean, TRUTH, fmi3Boolean, s->values[references[k]] != 0.0)
GETTER(String, TEXT, fmi3String, s->texts[references[k]])
GETTER(Int64, INT64, fmi3Int64, number_of(s, references[k]))

fmi3Status fmi3GetUInt64(fmi3Instance c, const fmi3ValueReference references[], size_t count, fmi3UInt64 values[],
                         size_t value_count)
{
    Instance *i = c; /* also in the configuration mode, which is there for them */
    if (!i || instance_given_values(i, __func__, references, count, values, value_count) ||
        check(i, __func__, UINT64, references, count, value_count))
        return fmi3Error;
    if (!is_configuring(i) && instance_may(i, CALL_Get, __func__))
        return fmi3Error;
    for (size_t k = 0; k < count; k++)
        values[k] = (fmi3UInt64)table_rows(i->state, place_of(references[k]).table);
    return fmi3OK;
}
