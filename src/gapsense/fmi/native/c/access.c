/* Values of an instance: may they be read or written, and what follows. */
#include <string.h>

#include "instance.h"
#include "sentences.h"
#include "values.h"

static const char *const KIND_NAMES[] = {"Real", "Integer", "Boolean", "String"};

static int is_there(Kind kind, unsigned reference)
{
    return reference < (unsigned)model.port_count && model.ports[reference].kind == kind;
}

/* All are inputs, or outputs if those count too: then they are Real, and there is little to look at. */
static int are_below(int limit, Kind kind, const unsigned *references, size_t count)
{
    int below = kind == REAL;
    for (size_t k = 0; k < count; k++)
        below &= references[k] < (unsigned)limit;
    return below;
}

static Status look_up(Instance *i, Kind kind, const unsigned *references, size_t count)
{
    for (size_t k = 0; k < count; k++)
        if (!is_there(kind, references[k]))
            return refuse(i, SAY_NO_VARIABLE, KIND_NAMES[kind], references[k]);
    return FINE;
}

static Status bring_up(Instance *i, const unsigned *references, size_t count)
{
    for (size_t k = 0; k < count; k++)
        if (model.ports[references[k]].causality == OUTPUT)
            return instance_initialize(i);
    return FINE;
}

Status instance_given(Instance *i, const char *name, const char *what, const void *address, size_t count)
{
    return address || !count ? FINE : refuse(i, SAY_NO_ADDRESS, name, what);
}

Status instance_given_texts(Instance *i, const char *name, const char *const *texts, size_t count)
{
    for (size_t k = 0; k < count; k++)
        if (!texts[k])
            return refuse(i, SAY_NO_ADDRESS, name, "texts");
    return FINE;
}

Status instance_begin_get(Instance *i, const char *name, Kind kind, const unsigned *references, size_t count)
{
    if (instance_may(i, CALL_Get, name))
        return REFUSED;
    if (!are_below(model.signals, kind, references, count) && look_up(i, kind, references, count))
        return REFUSED;
    return i->state->phase == INITIALIZING ? bring_up(i, references, count) : FINE;
}

static Status may_set(Instance *i, unsigned reference)
{
    const Port *port = model.ports + reference;
    if (port->causality == OUTPUT)
        return refuse(i, SAY_IS_OUTPUT, port->name);
    if (i->state->phase == RUNNING && port->causality == PARAMETER && !port->is_tunable)
        return refuse(i, SAY_IS_FIXED, port->name);
    return FINE;
}

static Status begin_set_parameters(Instance *i, Kind kind, const unsigned *references, size_t count)
{
    if (look_up(i, kind, references, count))
        return REFUSED;
    for (size_t k = 0; k < count; k++)
        if (may_set(i, references[k]))
            return REFUSED;
    i->is_tuning = i->state->phase == RUNNING;
    if (i->is_tuning)
        memcpy(i->before, i->state->values, (size_t)model.port_count * sizeof *i->before);
    return FINE;
}

Status instance_begin_set(Instance *i, const char *name, Kind kind, const unsigned *references, size_t count)
{
    if (instance_may(i, CALL_Set, name))
        return REFUSED;
    i->state->is_due = 1;
    i->is_tuning = 0;
    return are_below(model.inputs, kind, references, count) ? FINE : begin_set_parameters(i, kind, references, count);
}

Status instance_end_set(Instance *i)
{
    Text problems = {NULL, 0, 0};
    if (!i->is_tuning)
        return FINE;
    i->is_tuning = 0;
    judge(i->state, &problems);
    if (!problems.length) {
        take_parameters(i->state);
        return FINE;
    }
    memcpy(i->state->values, i->before, (size_t)model.port_count * sizeof *i->before);
    refuse(i, SAY_CORRECT_PARAMETERS, text_of(&problems));
    text_free(&problems);
    return REFUSED;
}

Status instance_set_text(Instance *i, unsigned reference, const char *text)
{
    return state_set_text(i->state, (int)reference, text) ? FINE : refuse(i, SAY_NO_MEMORY);
}
