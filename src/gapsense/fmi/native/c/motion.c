/* The smoothed motion that was published last: how many samples it has so far, then signal after signal. */
#include <math.h>
#include <string.h>

#include "arrays.h"

static const double GAP = 1.5; /* sampling periods: what comes later is another motion */

size_t motion_size(void)
{
    return arrays.motion ? 1 + (size_t)arrays.motion->signal_count * MOTION_ROWS : 0;
}

int motion_count(const State *s) { return (int)s->motion[0]; }

static double *column(const State *s, int signal) { return s->motion + 1 + (size_t)signal * MOTION_ROWS; }

void motion_note(State *s)
{
    const Motion *m = arrays.motion;
    if (!m || !(s->values[m->flag] > 0.5))
        return;
    int count = motion_count(s);
    const double since = count ? s->values[m->signals[0]] - column(s, 0)[count - 1] : 0.0;
    if (count && !(since > 0.0 && since < GAP * s->period))
        count = 0;
    if (count == MOTION_ROWS)
        return;
    for (int k = 0; k < m->signal_count; k++)
        column(s, k)[count] = s->values[m->signals[k]];
    s->motion[0] = count + 1;
}

void motion_column(const State *s, int signal, double *to)
{
    const size_t count = (size_t)motion_count(s);
    memcpy(to, column(s, signal), count * sizeof *to);
    memset(to + count, 0, (MOTION_ROWS - count) * sizeof *to);
}

int motion_is_sound(const State *s)
{
    return !arrays.motion || (s->motion[0] >= 0.0 && s->motion[0] <= MOTION_ROWS && s->motion[0] == floor(s->motion[0]));
}
