/* FMI 3.0: setting values. */
#include <stdio.h>
#include <string.h>

#include "fmi3_places.h"

static Status begin_set(Instance *i, const char *name, Type type, const unsigned *references, size_t count,
                        const void *values, size_t value_count)
{
    if (instance_given_values(i, name, references, count, values, value_count))
        return REFUSED;
    if (outside_configuration(i, CALL_Set, name) || instance_may(i, CALL_Set, name))
        return REFUSED;
    return check(i, name, type, references, count, value_count);
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
    if (!i || begin_set(i, __func__, FLOAT64, references, count, values, value_count))
        return fmi3Error;
    if (!are_scalars(references, count))
        return set_places(i, __func__, references, count, values);
    if (instance_begin_set(i, __func__, REAL, references, count))
        return fmi3Error;
    for (size_t k = 0; k < count; k++)
        i->state->values[references[k]] = values[k];
    return (fmi3Status)instance_end_set(i);
}

/* Refuses what is there to be read only, behind the ports. */
static Status are_set(Instance *i, const unsigned *references, size_t count)
{
    for (size_t k = 0; k < count; k++) {
        const Place place = place_of(references[k]);
        if (!place.port)
            return refuse_place(i, &place);
    }
    return FINE;
}

#define SETTER(Name, TYPE, KIND, Type, VALUE)                                                                          \
    fmi3Status fmi3Set##Name(fmi3Instance c, const fmi3ValueReference references[], size_t count, const Type values[],  \
                             size_t value_count)                                                                       \
    {                                                                                                                  \
        Instance *i = c;                                                                                               \
        if (!i || begin_set(i, __func__, TYPE, references, count, values, value_count) ||                                      \
            are_set(i, references, count) || instance_begin_set(i, __func__, KIND, references, count))                                                  \
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
    if (!i || begin_set(i, __func__, TEXT, references, count, values, value_count) ||
        instance_given_texts(i, __func__, values, value_count) ||
        instance_begin_set(i, __func__, STRING, references, count))
        return fmi3Error;
    for (size_t k = 0; k < count; k++)
        if (instance_set_text(i, references[k], values[k]))
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
    if (!i || begin_set(i, __func__, INT64, references, count, values, value_count) ||
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
    if (!i || instance_given_values(i, __func__, references, count, values, value_count) ||
        in_configuration(i, __func__) || check(i, __func__, UINT64, references, count, value_count))
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
