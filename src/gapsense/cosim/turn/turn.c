/* One component-step in one call from Python; three calls through ctypes cost 2.5 us more. The structures here are
 * those of __init__.py; `Part.python_stepper` does the same in Python and must give the same bits. */
#include <math.h>
#include <stddef.h>

#define EXPORT __attribute__((visibility("default")))

#ifndef TURN_FINGERPRINT
#define TURN_FINGERPRINT "unknown"
#endif
EXPORT const char gapsense_turn_fingerprint[] = "gapsense-turn:" TURN_FINGERPRINT;

typedef int Exchange(void *instance, const unsigned *references, size_t count, double *values);
typedef int DoStep(void *instance, double time, double step, int keep);

/* `factor` and `bias` count only if it converts: 1.0 * -0.0 + 0.0 is not -0.0. */
typedef struct {
    int target, source, converts;
    double factor, bias;
} Link;

typedef struct {
    void *instance;
    Exchange *set, *get;
    DoStep *step;
    const unsigned *inputs, *outputs; /* value references */
    double *input_values, *output_values; /* parts of `buffer` */
    size_t input_count, output_count; /* input_count is 0 where the inputs are not set before the step */
    double *buffer;
    const Link *links;
    size_t link_count;
    double duration;
    int status; /* of the last call to the FMU */
} Turn;

enum { FMI2_WARNING = 1 };
enum { DONE, SET, STEP, GET, NOT_FINITE };

/* Takes the inputs, does the step from `start`, reads the outputs; what failed, or DONE. */
EXPORT int turn(Turn *t, double start)
{
    for (const Link *l = t->links; l < t->links + t->link_count; l++) {
        double value = t->buffer[l->source];
        t->buffer[l->target] = l->converts ? l->factor * value + l->bias : value;
    }
    if (t->input_count) {
        t->status = t->set(t->instance, t->inputs, t->input_count, t->input_values);
        if (t->status > FMI2_WARNING)
            return SET;
    }
    t->status = t->step(t->instance, start, t->duration, 1);
    if (t->status > FMI2_WARNING)
        return STEP;
    if (t->output_count) {
        t->status = t->get(t->instance, t->outputs, t->output_count, t->output_values);
        if (t->status > FMI2_WARNING)
            return GET;
    }
    for (size_t i = 0; i < t->output_count; i++)
        if (!isfinite(t->output_values[i]))
            return NOT_FINITE;
    return DONE;
}
