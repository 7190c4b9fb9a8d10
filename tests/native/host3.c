/* The host of `host.c` for a library of FMI 3.0: the same words, with a path for RESOURCES and a token for GUID. */
#define main main_of_fmi_2
#include "host.c"
#undef main

#include "fmi3Functions.h"

static void log3(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category, fmi3String message)
{
    (void)environment;
    fprintf(stderr, "%d %s %s\n", (int)status, category, message);
}

static void check3(fmi3Status status, const char *call)
{
    if (status != fmi3OK)
        fail(call);
}

static fmi3Instance start3(const Table *t, const char *token, const char *resources)
{
    const size_t count = (size_t)t->inputs;
    fmi3Instance c = CALL(fmi3InstantiateCoSimulation)("one", token, resources, fmi3False, fmi3True, fmi3False,
                                                       fmi3False, NULL, 0, NULL, log3, NULL);
    if (!c)
        fail("fmi3InstantiateCoSimulation");
    check3(CALL(fmi3EnterInitializationMode)(c, fmi3False, 0.0, t->times[0], fmi3False, 0.0),
           "fmi3EnterInitializationMode");
    check3(CALL(fmi3SetFloat64)(c, t->input, count, t->values, count), "fmi3SetFloat64");
    check3(CALL(fmi3ExitInitializationMode)(c), "fmi3ExitInitializationMode");
    return c;
}

static void print3(fmi3Instance c, const Table *t)
{
    double values[MOST];
    const size_t count = (size_t)t->outputs;
    check3(CALL(fmi3GetFloat64)(c, t->output, count, values, count), "fmi3GetFloat64");
    for (int k = 0; k < t->outputs; k++)
        printf("%.17g%c", values[k], k + 1 < t->outputs ? ' ' : '\n');
}

static fmi3Status step3(fmi3DoStepTYPE *go, fmi3Instance c, double time, double step)
{
    fmi3Boolean event = fmi3True, ends = fmi3True, early = fmi3True;
    double last = -1.0;
    const fmi3Status status = go(c, time, step, fmi3True, &event, &ends, &early, &last);
    return status == fmi3OK && (event || ends || early || last != time + step) ? fmi3Error : status;
}

static void run3(fmi3Instance c, const Table *t)
{
    const double step = t->times[1] - t->times[0];
    const size_t count = (size_t)t->inputs;
    print3(c, t);
    for (int row = 1; row < t->rows; row++) {
        check3(CALL(fmi3SetFloat64)(c, t->input, count, t->values + row * t->inputs, count), "fmi3SetFloat64");
        check3(step3(CALL(fmi3DoStep), c, (row - 1) * step, step), "fmi3DoStep");
        print3(c, t);
    }
}

static void measure3(fmi3Instance c, const Table *t, long times)
{
    double values[MOST], step = t->times[1] - t->times[0];
    fmi3SetFloat64TYPE *set = CALL(fmi3SetFloat64);
    fmi3GetFloat64TYPE *get = CALL(fmi3GetFloat64);
    fmi3DoStepTYPE *go = CALL(fmi3DoStep);
    const size_t inputs = (size_t)t->inputs, outputs = (size_t)t->outputs;
    fmi3Status status = fmi3OK;
    const double begin = now();
    long count = 0;
    for (long k = 0; k < times; k++)
        for (int row = 1; row < t->rows && status == fmi3OK; row++, count++) {
            status |= set(c, t->input, inputs, t->values + row * t->inputs, inputs);
            status |= step3(go, c, (double)count * step, step);
            status |= get(c, t->output, outputs, values, outputs);
        }
    check3(status, "a step");
    printf("%.4f\n", 1e6 * (now() - begin) / (double)count);
}

int main(int count, char **words)
{
    if (count < 7 || !(library = OPEN(words[1])))
        fail("cannot open the library");
    const Table t = read_table(words[4], atoi(words[5]), atoi(words[6]));
    fmi3Instance c = start3(&t, words[2], words[3]);
    if (count > 7)
        measure3(c, &t, atol(words[7]));
    else
        run3(c, &t);
    check3(CALL(fmi3Terminate)(c), "fmi3Terminate");
    CALL(fmi3FreeInstance)(c);
    free_table(&t);
    return 0;
}
