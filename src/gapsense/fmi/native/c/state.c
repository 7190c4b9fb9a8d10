#include "state.h"

#include <stdlib.h>
#include <string.h>

#include "arrays.h"

enum { CLOCK = 2 }; /* time and dt, before the values */

static size_t block_size(void)
{
    size_t size = CLOCK + (size_t)model.port_count + (size_t)model.par_count + (size_t)model.state_count;
    for (int k = 0; k < model.memory_count; k++)
        size += (size_t)model.memory_sizes[k];
    return size + motion_size() + (size_t)model.constant_count;
}

/* Room for the numbers and tables of fixed count; one place more, so that there is always one. */
static int allocate(State *s)
{
    s->block = calloc(block_size(), sizeof *s->block);
    s->memory = calloc((size_t)model.memory_count + 1, sizeof *s->memory);
    s->texts = calloc((size_t)model.port_count + 1, sizeof *s->texts);
    s->tables = calloc((size_t)model.table_count + 1, sizeof *s->tables);
    s->sizes = calloc((size_t)model.table_count + 1, sizeof *s->sizes);
    s->columns = calloc((size_t)model.port_count + 1, sizeof *s->columns);
    s->rows = calloc((size_t)model.port_count + 1, sizeof *s->rows);
    return s->block && s->memory && s->texts && s->tables && s->sizes && s->columns && s->rows;
}

static void divide(State *s)
{
    s->values = s->block + CLOCK;
    s->par = s->values + model.port_count;
    s->kernel = s->par + model.par_count;
    double *next = s->kernel + model.state_count;
    for (int k = 0; k < model.memory_count; k++) {
        s->memory[k] = next;
        next += model.memory_sizes[k];
    }
    s->motion = next;
    s->constants = next + motion_size();
}

State *state_new(void)
{
    State *s = calloc(1, sizeof *s);
    if (s && allocate(s)) {
        divide(s);
        if (state_reset(s))
            return s;
    }
    state_free(s);
    return NULL;
}

void state_free(State *s)
{
    if (!s)
        return;
    for (int k = 0; s->texts && k < model.port_count; k++)
        free(s->texts[k]);
    for (int k = 0; s->tables && k < model.table_count; k++)
        free(s->tables[k]);
    for (int k = 0; s->columns && k < model.port_count; k++)
        free(s->columns[k]);
    free(s->columns);
    free(s->rows);
    free(s->block);
    free(s->memory);
    free(s->texts);
    free(s->tables);
    free(s->sizes);
    free(s);
}

int state_set_text(State *s, int port, const char *text)
{
    char *copy = text_copy(text);
    if (!copy)
        return 0;
    free(s->texts[port]);
    s->texts[port] = copy;
    return 1;
}

int state_reset(State *s)
{
    for (int k = 0; k < model.port_count; k++)
        if (model.ports[k].kind == STRING && !state_set_text(s, k, model.ports[k].text))
            return 0;
    memset(s->block, 0, block_size() * sizeof *s->block);
    for (int k = 0; k < model.port_count; k++)
        s->values[k] = model.ports[k].start;
    memset(s->sizes, 0, (size_t)model.table_count * sizeof *s->sizes);
    memset(s->rows, 0, (size_t)model.port_count * sizeof *s->rows);
    s->phase = INSTANTIATED;
    s->is_configuring = 0;
    s->is_timed = 0;
    s->is_due = 1;
    s->start_time = s->time = s->period = s->elapsed = 0.0;
    return 1;
}

/* Room for at least so many numbers; those that are there stay. */
static int grow(double **numbers, size_t count)
{
    double *grown = realloc(*numbers, (count + 1) * sizeof **numbers);
    *numbers = grown ? grown : *numbers;
    return grown != NULL;
}

size_t state_given(const State *s, int port) { return (size_t)model.ports[port].head_count * (size_t)s->rows[port]; }

/* Make room for what is of another length; what is there stays. */
static int make_room(State *to, const State *from)
{
    for (int k = 0; k < model.port_count; k++)
        if (state_given(from, k) > state_given(to, k) && !grow(to->columns + k, state_given(from, k)))
            return 0;
    for (int k = 0; k < model.port_count; k++) {
        if (from->texts[k] && strlen(from->texts[k]) > strlen(to->texts[k])) {
            char *text = realloc(to->texts[k], strlen(from->texts[k]) + 1);
            if (!text)
                return 0;
            to->texts[k] = text;
        }
    }
    for (int k = 0; k < model.table_count; k++) {
        if (from->sizes[k] > to->sizes[k] && !grow(to->tables + k, (size_t)from->sizes[k]))
            return 0;
    }
    return 1;
}

int state_copy(State *to, const State *from)
{
    if (!make_room(to, from))
        return 0;
    for (int k = 0; k < model.port_count; k++)
        if (from->texts[k])
            strcpy(to->texts[k], from->texts[k]);
    for (int k = 0; k < model.table_count; k++)
        if (from->sizes[k])
            memcpy(to->tables[k], from->tables[k], (size_t)from->sizes[k] * sizeof **to->tables);
    for (int k = 0; k < model.port_count; k++)
        if (from->rows[k])
            memcpy(to->columns[k], from->columns[k], state_given(from, k) * sizeof **to->columns);
    memcpy(to->sizes, from->sizes, (size_t)model.table_count * sizeof *to->sizes);
    memcpy(to->rows, from->rows, (size_t)model.port_count * sizeof *to->rows);
    memcpy(to->block, from->block, block_size() * sizeof *to->block);
    to->phase = from->phase;
    to->is_configuring = from->is_configuring;
    to->is_timed = from->is_timed;
    to->is_due = from->is_due;
    to->start_time = from->start_time;
    to->time = from->time;
    to->period = from->period;
    to->elapsed = from->elapsed;
    return 1;
}
