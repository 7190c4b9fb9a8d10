/* Calls an instance when the process ends, after Python. Prints the stati of setting an input, getting it, a step and
 * saving the state, and what was got. */
#include <stdio.h>
#include <stdlib.h>

#include "fmi2Functions.h"

static fmi2Component c;
static fmi2SetRealTYPE *set;
static fmi2GetRealTYPE *get;
static fmi2DoStepTYPE *step;
static fmi2GetFMUstateTYPE *save;
static fmi2FreeInstanceTYPE *release;

static void last(void)
{
    const fmi2ValueReference input = 0;
    const fmi2Real given = 0.5;
    fmi2Real got = 0.0;
    fmi2FMUstate state = NULL;
    int is_set = set(c, &input, 1, &given), is_got = get(c, &input, 1, &got);
    int is_stepped = step(c, 50e-6, 50e-6, fmi2True), is_saved = save(c, &state);
    release(c);
    printf("[%d, %d, %d, %d, %g]\n", is_set, is_got, is_stepped, is_saved, got);
    fflush(stdout);
}

void after_python(fmi2Component instance, fmi2SetRealTYPE *s, fmi2GetRealTYPE *g, fmi2DoStepTYPE *d,
                  fmi2GetFMUstateTYPE *f, fmi2FreeInstanceTYPE *r)
{
    c = instance, set = s, get = g, step = d, save = f, release = r;
    atexit(last);
}
