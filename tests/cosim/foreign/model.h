/* A model with variables of all types, for tests of the runner: what an FMU of somebody else may be. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define GUID "types"
/* Ends in an orderly way; the same, without telling when; warns; returns early; tells a time that is none, too early,
 * too late; ends when asked for more. */
enum { NOTHING, ENDS, ENDS_SILENTLY, WARNS, EARLY, NO_TIME, BEFORE, BEYOND, ENDS_AFTER };
#define EXPORT __attribute__((visibility("default")))
enum { LENGTH = 64, WHOLES = 8 };

typedef struct {
    double time, u, y, gain, level; /* y = gain * u if on; level decays by 1/s, from a start value */
    float single, single_out; /* the double of the input */
    long long whole[WHOLES], whole_out[WHOLES]; /* input + shift, one for each integer type */
    int shift, mode, mode_out, law;             /* mode_out is the next of three modes */
    int flag, flag_out, on;                     /* the opposite */
    char text[LENGTH], text_out[LENGTH], label[LENGTH]; /* label and input */
    double end; /* when it asks to end, or fails */
    double deed; /* what it does apart from the model, see `enum` */
    double last; /* time that it has reached */
    int has_ended;
    int initialized;
} Model;

static void start(Model *m)
{
    memset(m, 0, sizeof *m);
    m->gain = 2.0;
    m->level = 1.0;
    m->on = 1;
    m->mode = m->law = 1;
    m->end = INFINITY;
    strcpy(m->label, "<");
}

static void compute(Model *m)
{
    m->y = m->on ? m->gain * m->u : 0.0;
    m->single_out = 2.0f * m->single;
    for (int k = 0; k < WHOLES; k++)
        m->whole_out[k] = m->whole[k] + m->shift;
    m->mode_out = m->mode % 3 + 1;
    m->flag_out = !m->flag;
    snprintf(m->text_out, sizeof m->text_out, "%.20s%.40s", m->label, m->text);
}

static void advance(Model *m, double time, double step)
{
    m->level -= step * m->level;
    m->time = time + step;
    compute(m);
}

/* A step, up to the end if it ends before; true if that is so. */
static int ends(Model *m, double time, double step)
{
    int orderly = m->deed == ENDS || m->deed == ENDS_SILENTLY || m->deed == ENDS_AFTER;
    m->has_ended = orderly && (m->deed == ENDS_AFTER ? time : time + step) > m->end - 1e-9;
    m->last = m->has_ended ? fmin(time + step, m->deed == ENDS_AFTER ? time : m->end) : time + step;
    if (m->last > time)
        advance(m, time, m->last < time + step - 1e-9 ? m->last - time : step);
    return m->has_ended;
}

static void copy(char *to, const char *from)
{
    snprintf(to, LENGTH, "%s", from ? from : "");
}
