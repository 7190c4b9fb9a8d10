/* What an instance computes: its outputs at the start, and steps. */
#include <math.h>
#include <string.h>

#include "instance.h"
#include "arrays.h"
#include "sentences.h"
#include "values.h"

#define TOLERANCE 1e-9 /* relative, on sizes of steps: hosts round */
#define COARSEST 0.25  /* tolerance for steps that are hardly more than a rounding of their time */
#define MOST_SAMPLES 1e7
#define SHIFT 1e-6     /* of a step by which it may begin too early or too late, */
#define ROUNDINGS 8    /* and of its time */

static const double *kernel_inputs(State *s, double time, double dt)
{
    double *inputs = s->values - model.clock;
    if (model.clock)
        inputs[0] = time;
    if (model.clock > 1)
        inputs[1] = dt;
    return inputs;
}

static Status take_inputs(Instance *i)
{
    Text problem = {NULL, 0, 0};
    if (model.survives || are_inputs_taken(i->state, &problem))
        return FINE;
    refuse(i, "%s", text_of(&problem));
    text_free(&problem);
    return REFUSED;
}

static Status publish(Instance *i)
{
    const int count = model.signals - model.inputs;
    double odd = 0.0; /* NaN as soon as one is not finite */
    for (int k = 0; k < count; k++)
        odd += i->outputs[k] - i->outputs[k];
    if (odd == 0.0) {
        memcpy(i->state->values + model.inputs, i->outputs, (size_t)count * sizeof *i->outputs);
        motion_note(i->state);
        return FINE;
    }
    Text names = {NULL, 0, 0};
    for (int k = 0; k < count; k++)
        if (!(i->outputs[k] - i->outputs[k] == 0.0))
            text_join(&names, ", ", "`%s`", model.ports[model.inputs + k].name);
    refuse(i, SAY_OUTPUTS_NOT_FINITE, text_of(&names));
    text_free(&names);
    return REFUSED;
}

/* `par` is what the kernel takes: parameters, or what follows from them. */
static Status compute(Instance *i, Kernel *kernel, const double *par, double time, double dt)
{
    State *s = i->state;
    if (take_inputs(i))
        return REFUSED;
    kernel(s->kernel, s->memory, kernel_inputs(s, time, dt), par, (const double *const *)s->tables, s->sizes,
           i->outputs);
    return publish(i);
}

Status instance_initialize(Instance *i)
{
    State *s = i->state;
    Text problems = {NULL, 0, 0};
    if (!s->is_due)
        return FINE;
    judge(s, &problems);
    read_tables(s, i->resources, &problems);
    if (problems.length) {
        refuse(i, SAY_CORRECT_PARAMETERS, text_of(&problems));
        text_free(&problems);
        return REFUSED;
    }
    take_parameters(s);
    s->period = model.sample_time < 0 ? 0.0 : s->values[model.sample_time];
    s->elapsed = 0.0;
    if (compute(i, model.initial, s->par, s->start_time, 0.0))
        return REFUSED;
    s->is_due = 0;
    return FINE;
}

/* --- steps --- */

static double rounding(double x) { return nextafter(fabs(x), INFINITY) - fabs(x); }

/* A step begins where the one before ended, but for what hosts round. */
static Status is_next(Instance *i, double time, double step)
{
    const State *s = i->state;
    if (!s->is_timed || time == s->time)
        return FINE;
    if (fabs(time - s->time) <= SHIFT * step + ROUNDINGS * rounding(fmax(fabs(time), fabs(s->time))))
        return FINE;
    return refuse(i, SAY_JUMP, time - s->time, s->time);
}

/* How many samples fall due in this step, during which inputs are held, and the time from the last one to its end. */
static Status samples_due(Instance *i, double end, double step, double *count, double *elapsed)
{
    const double period = i->state->period;
    /* A step may be a difference of times. */
    const double tolerance = fmin(TOLERANCE + 2.0 * rounding(end) / step, COARSEST);
    const double ratio = step >= period ? step / period : period / step;
    if (!(fabs(ratio - rint(ratio)) <= tolerance * ratio))
        return refuse(i, SAY_NO_FRACTION, step, period);
    if (step / period > MOST_SAMPLES)
        return refuse(i, SAY_TOO_MANY_SAMPLES, step, step / period, period);
    *elapsed = i->state->elapsed + step;
    *count = floor(*elapsed / period * (1.0 + tolerance));
    if (*count > 0.0 && fabs(*elapsed - *count * period) > tolerance * *elapsed)
        return refuse(i, SAY_PAST_SAMPLE, step, *elapsed - *count * period, period);
    *elapsed = *count > 0.0 ? 0.0 : *elapsed;
    return FINE;
}

/* The outputs of all samples, or of none if one fails. */
static Status sample(Instance *i, double end, double step)
{
    State *s = i->state;
    const size_t size = (size_t)(model.signals - model.inputs) * sizeof *s->values;
    double count = 0.0, elapsed = 0.0;
    if (samples_due(i, end, step, &count, &elapsed))
        return REFUSED;
    memcpy(i->before, s->values + model.inputs, size);
    for (double k = count - 1.0; k >= 0.0; k -= 1.0)
        if (compute(i, model.advance, s->constants, end - k * s->period, s->period)) {
            memcpy(s->values + model.inputs, i->before, size);
            return REFUSED;
        }
    s->elapsed = elapsed;
    return FINE;
}

static Status advance(Instance *i, double end, double step)
{
    const State *s = i->state;
    if (s->period == 0.0)
        return compute(i, model.advance, s->constants, end, step);
    if (step == s->period && s->elapsed == 0.0)
        return compute(i, model.advance, s->constants, end, s->period);
    return sample(i, end, step);
}

static Status take_step(Instance *i, const char *name, double time, double step)
{
    char number[REPR];
    const double end = time + step;
    if (instance_may(i, CALL_DoStep, name))
        return REFUSED;
    if (!(step > 0.0) || !(end - end == 0.0))
        return refuse(i, SAY_STEP_SIZE, repr(step, number));
    if (is_next(i, time, step) || advance(i, end, step))
        return REFUSED;
    i->state->time = end;
    i->state->is_timed = 1;
    return FINE;
}

Status instance_step(Instance *i, const char *name, double time, double step)
{
    i->is_stepping = 1;
    i->step_time = time;
    i->step = step;
    const Status status = take_step(i, name, time, step);
    i->is_stepping = 0;
    return status;
}
