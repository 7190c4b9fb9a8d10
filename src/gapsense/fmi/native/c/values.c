#include "values.h"

#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "arrays.h"
#include "sentences.h"
#include "table.h"

static int choice_of(const Port *port, const char *text)
{
    for (int k = 0; k < port->choice_count; k++)
        if (!strcmp(port->choices[k], text))
            return k;
    return -1;
}

static int is_in_range(const Port *port, double value)
{
    return value - value == 0.0 && port->low <= value && value <= port->high;
}

static int is_right(const State *s, int k)
{
    const Port *port = model.ports + k;
    if (port->choices)
        return choice_of(port, s->texts[k]) >= 0;
    return port->kind == STRING || port->kind == BOOLEAN || is_in_range(port, s->values[k]);
}

static void add_range(Text *text, const Port *port)
{
    if (isinf(port->low) && isinf(port->high))
        text_add(text, SAY_FINITE);
    else if (isinf(port->low))
        text_add(text, SAY_AT_MOST, port->high, port->unit);
    else if (isinf(port->high))
        text_add(text, SAY_AT_LEAST, port->low, port->unit);
    else
        text_add(text, SAY_FROM_TO, port->low, port->high, port->unit);
}

static void add_choices(Text *text, const Port *port)
{
    Text names = {NULL, 0, 0};
    for (int k = 0; k < port->choice_count; k++)
        text_join(&names, ", ", "%s", port->choices[k]);
    text_add(text, SAY_CHOICE, text_of(&names));
    text_free(&names);
}

/* A value as a message shows it. */
static void add_value(Text *text, const State *s, int k)
{
    char number[REPR];
    if (model.ports[k].kind == STRING)
        text_add(text, "`%s`", s->texts[k]);
    else if (model.ports[k].kind == INTEGER)
        text_add(text, "%d", (int)s->values[k]);
    else
        text_add(text, "%s", repr(s->values[k], number));
}

static void add_wrong(Text *problems, const State *s, int k)
{
    Text shown = {NULL, 0, 0}, expected = {NULL, 0, 0};
    add_value(&shown, s, k);
    if (model.ports[k].choices)
        add_choices(&expected, model.ports + k);
    else
        add_range(&expected, model.ports + k);
    text_join(problems, " ", SAY_IS_WRONG, model.ports[k].name, text_of(&shown), text_of(&expected));
    text_free(&shown);
    text_free(&expected);
}

static void add_falling(Text *problems, const State *s, int lower, int upper)
{
    Text small = {NULL, 0, 0}, large = {NULL, 0, 0}, expected = {NULL, 0, 0};
    add_value(&small, s, lower);
    add_value(&large, s, upper);
    text_add(&expected, SAY_LESS_THAN, model.ports[upper].name, text_of(&large));
    text_join(problems, " ", SAY_IS_WRONG, model.ports[lower].name, text_of(&small), text_of(&expected));
    text_free(&small);
    text_free(&large);
    text_free(&expected);
}

static void judge_limit(const State *s, const Limit *limit, Text *problems)
{
    double product = 1.0;
    for (int f = 0; f < limit->count; f++) {
        const double x = s->values[limit->factors[f].port];
        const int power = limit->factors[f].power;
        for (int k = 0; k < abs(power); k++)
            product *= power > 0 ? x : 1.0 / x;
    }
    if (!(product < limit->below))
        text_join(problems, " ", SAY_BEYOND_LIMIT, limit->text, product, limit->below, limit->reason);
}

void judge(const State *s, Text *problems)
{
    for (int k = model.signals; k < model.port_count; k++)
        if (!is_right(s, k))
            add_wrong(problems, s, k);
    for (int k = 0; k < model.rising_count; k++) {
        const int lower = model.rising[k].lower, upper = model.rising[k].upper;
        if (is_right(s, lower) && is_right(s, upper) && !(s->values[lower] < s->values[upper]))
            add_falling(problems, s, lower, upper);
    }
    if (!problems->length) /* a limit is for parameters in their ranges */
        for (int k = 0; k < model.limit_count; k++)
            judge_limit(s, model.limits + k, problems);
}

/* From the file, or from arrays if these are others than those that are shipped. */
static int take_table(State *s, int port, const char *folder, Text *problem)
{
    if (!is_table_changed(s, table_of(port)))
        return read_table(s, model.ports + port, folder, s->texts[port], problem);
    if (!strcmp(s->texts[port], model.ports[port].text))
        return read_columns(s, port, problem);
    text_add(problem, SAY_BOTH_TABLES);
    return 0;
}

void read_tables(State *s, const char *folder, Text *problems)
{
    for (int k = model.signals; k < model.port_count; k++) {
        Text problem = {NULL, 0, 0};
        if (model.ports[k].columns && !take_table(s, k, folder, &problem))
            text_join(problems, " ", SAY_OF_PARAMETER, model.ports[k].name, text_of(&problem));
        text_free(&problem);
    }
}

void take_parameters(State *s)
{
    for (int k = model.signals; k < model.port_count; k++) {
        const Port *port = model.ports + k;
        if (!port->columns)
            s->par[port->place] = port->choices ? (double)choice_of(port, s->texts[k]) : s->values[k];
    }
    model.constants(NULL, NULL, NULL, s->par, (const double *const *)s->tables, s->sizes, s->constants);
}

/* The kernel looks into all tables of a port at the places of the first, which does not decrease. */
static int are_tables_even(const State *s)
{
    for (int k = model.signals; k < model.port_count; k++) {
        const Port *port = model.ports + k;
        for (int c = 0; c < port->column_count; c++) {
            const int size = s->sizes[port->columns[c].place];
            if (size < 2 || size != s->sizes[port->columns[0].place])
                return 0;
        }
        const double *first = port->column_count ? s->tables[port->columns[0].place] : NULL;
        for (int row = 1; first && row < s->sizes[port->columns[0].place]; row++)
            if (first[row] < first[row - 1])
                return 0;
    }
    return 1;
}

/* Hosts are given these as whole numbers and truth values. */
static int are_typed(const State *s)
{
    for (int k = 0; k < model.port_count; k++) {
        const double x = s->values[k];
        if (model.ports[k].kind == INTEGER && !(x >= INT_MIN && x <= INT_MAX && x == floor(x)))
            return 0;
        if (model.ports[k].kind == BOOLEAN && x != 0.0 && x != 1.0)
            return 0;
    }
    return 1;
}

static int are_parameters_right(State *s)
{
    Text problems = {NULL, 0, 0};
    judge(s, &problems);
    const int is_right = problems.length == 0;
    text_free(&problems);
    if (!is_right || !are_tables_even(s))
        return 0;
    take_parameters(s);
    return s->period == (model.sample_time < 0 ? 0.0 : s->values[model.sample_time]);
}

static int are_finite(const double *x, int count)
{
    int finite = 1;
    for (int k = 0; k < count; k++)
        finite &= x[k] - x[k] == 0.0;
    return finite;
}

static int are_whole(const State *s, const Wholes *w)
{
    const double *x = w->memory < 0 ? s->kernel : s->memory[w->memory];
    const int end = w->memory < 0 ? w->first + 1 : model.memory_sizes[w->memory], every = w->every ? w->every : 1;
    for (int k = w->first; k < end; k += every)
        if (!(x[k] >= w->least && x[k] <= w->most && x[k] == floor(x[k])))
            return 0;
    return 1;
}

/* The numbers that a step begins with. */
static int is_kernel_right(const State *s)
{
    int right = are_finite(s->values + model.inputs, model.signals - model.inputs);
    if (!model.survives) {
        right &= are_finite(s->kernel, model.state_count);
        for (int k = 0; k < model.memory_count; k++)
            right &= are_finite(s->memory[k], model.memory_sizes[k]);
    }
    for (int k = 0; k < model.whole_count; k++)
        right &= are_whole(s, model.wholes + k);
    return right;
}

const char *unsound(State *s)
{
    const int can_step = s->phase == RUNNING || (s->phase < RUNNING && !s->is_due);
    if (!are_typed(s) || (can_step && !are_parameters_right(s)))
        return "parameters";
    if (can_step && s->elapsed > 0.0 && !(s->elapsed < s->period))
        return "time";
    return can_step && !is_kernel_right(s) ? "values" : NULL;
}

static int is_finite(const State *s, Text *problem)
{
    Text names = {NULL, 0, 0};
    for (int k = 0; k < model.inputs; k++)
        if (!(s->values[k] - s->values[k] == 0.0))
            text_join(&names, ", ", "`%s`", model.ports[k].name);
    const int finite = names.length == 0;
    if (!finite)
        text_add(problem, SAY_INPUTS_NOT_FINITE, text_of(&names));
    text_free(&names);
    return finite;
}

int are_inputs_taken(const State *s, Text *problem)
{
    int taken = 1;
    for (int k = 0; k < model.inputs; k++)
        taken &= is_in_range(model.ports + k, s->values[k]);
    if (taken || !is_finite(s, problem))
        return taken;
    Text wrong = {NULL, 0, 0};
    for (int k = 0; k < model.inputs; k++)
        if (!is_in_range(model.ports + k, s->values[k]))
            add_wrong(&wrong, s, k);
    text_add(problem, SAY_CORRECT_INPUTS, text_of(&wrong));
    text_free(&wrong);
    return 0;
}
