/* A plain host: runs one library of FMI 2.0 over a table of inputs, with LoadLibrary on Windows and dlopen elsewhere.
 *
 * host LIBRARY GUID RESOURCES TABLE INPUTS OUTPUTS [TIMES]
 *
 * TABLE is a CSV file with a header; its columns are the time, then so many inputs, which are the first variables, as the
 * outputs are the next ones. The first row is set during initialization, each other one before a step that ends at its
 * time. Without TIMES the outputs are printed, a line for each row. With it the rows but the first are gone through so
 * often, without initializing again, and what one set, step and get together took is printed, in microseconds. */
#define _POSIX_C_SOURCE 200809L
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "fmi2Functions.h"

#ifdef _WIN32
#include <windows.h>
#define OPEN(path) ((void *)LoadLibraryA(path))
#define FIND(library, name) ((void *)(size_t)GetProcAddress((HMODULE)(library), name))
#else
#include <dlfcn.h>
#define OPEN(path) dlopen(path, RTLD_LAZY | RTLD_LOCAL)
#define FIND(library, name) dlsym(library, name)
#endif

#define CALL(name) ((name##TYPE *)(size_t)FIND(library, #name))

enum { MOST = 256, LINE = 65536 };

typedef struct {
    int inputs, outputs, rows;
    double *times, *values; /* of the inputs, row by row */
    unsigned input[MOST], output[MOST];
} Table;

static void *library;

static void fail(const char *what)
{
    fprintf(stderr, "%s\n", what);
    exit(2);
}

static void logger(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                   fmi2String message, ...)
{
    va_list values;
    (void)environment, (void)name;
    fprintf(stderr, "%d %s ", (int)status, category);
    va_start(values, message);
    vfprintf(stderr, message, values);
    va_end(values);
    fputc('\n', stderr);
}

static void read_row(Table *t, char *line)
{
    const size_t row = (size_t)t->rows++, width = (size_t)t->inputs;
    t->times = realloc(t->times, (row + 1) * sizeof *t->times);
    t->values = realloc(t->values, ((row + 1) * width + 1) * sizeof *t->values);
    if (!t->times || !t->values)
        fail("out of memory");
    t->times[row] = strtod(line, &line);
    for (size_t k = 0; k < width; k++)
        t->values[row * width + k] = strtod(line + 1, &line);
}

static Table read_table(const char *path, int inputs, int outputs)
{
    static char line[LINE];
    Table t = {inputs, outputs, 0, NULL, NULL, {0}, {0}};
    FILE *file = fopen(path, "r");
    if (!file || !fgets(line, LINE, file) || inputs > MOST || outputs > MOST)
        fail("no table");
    while (fgets(line, LINE, file))
        read_row(&t, line);
    fclose(file);
    for (int k = 0; k < inputs; k++)
        t.input[k] = (unsigned)k;
    for (int k = 0; k < outputs; k++)
        t.output[k] = (unsigned)(inputs + k);
    return t;
}

static void free_table(const Table *t)
{
    free(t->times);
    free(t->values);
}

static void check(fmi2Status status, const char *call)
{
    if (status != fmi2OK)
        fail(call);
}

static fmi2Component start(const Table *t, const char *guid, const char *resources)
{
    static fmi2CallbackFunctions functions = {logger, calloc, free, NULL, NULL};
    fmi2Component c = CALL(fmi2Instantiate)("one", fmi2CoSimulation, guid, resources, &functions, 0, 1);
    if (!c)
        fail("fmi2Instantiate");
    check(CALL(fmi2SetupExperiment)(c, 0, 0.0, t->times[0], 0, 0.0), "fmi2SetupExperiment");
    check(CALL(fmi2EnterInitializationMode)(c), "fmi2EnterInitializationMode");
    check(CALL(fmi2SetReal)(c, t->input, (size_t)t->inputs, t->values), "fmi2SetReal");
    check(CALL(fmi2ExitInitializationMode)(c), "fmi2ExitInitializationMode");
    return c;
}

static void print(fmi2Component c, const Table *t)
{
    double values[MOST];
    check(CALL(fmi2GetReal)(c, t->output, (size_t)t->outputs, values), "fmi2GetReal");
    for (int k = 0; k < t->outputs; k++)
        printf("%.17g%c", values[k], k + 1 < t->outputs ? ' ' : '\n');
}

static void run(fmi2Component c, const Table *t)
{
    const double step = t->times[1] - t->times[0];
    print(c, t);
    for (int row = 1; row < t->rows; row++) {
        check(CALL(fmi2SetReal)(c, t->input, (size_t)t->inputs, t->values + row * t->inputs), "fmi2SetReal");
        check(CALL(fmi2DoStep)(c, (row - 1) * step, step, fmi2True), "fmi2DoStep");
        print(c, t);
    }
}

static double now(void)
{
#ifdef _WIN32
    return (double)clock() / CLOCKS_PER_SEC;
#else
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
#endif
}

static void measure(fmi2Component c, const Table *t, long times)
{
    double values[MOST], step = t->times[1] - t->times[0];
    fmi2SetRealTYPE *set = CALL(fmi2SetReal);
    fmi2GetRealTYPE *get = CALL(fmi2GetReal);
    fmi2DoStepTYPE *go = CALL(fmi2DoStep);
    fmi2Status status = fmi2OK;
    const double begin = now();
    long count = 0;
    for (long k = 0; k < times; k++)
        for (int row = 1; row < t->rows && status == fmi2OK; row++, count++) {
            status |= set(c, t->input, (size_t)t->inputs, t->values + row * t->inputs);
            status |= go(c, (double)count * step, step, fmi2True);
            status |= get(c, t->output, (size_t)t->outputs, values);
        }
    check(status, "a step");
    printf("%.4f\n", 1e6 * (now() - begin) / (double)count);
}

int main(int count, char **words)
{
    if (count < 7 || !(library = OPEN(words[1])))
        fail("cannot open the library");
    const Table t = read_table(words[4], atoi(words[5]), atoi(words[6]));
    fmi2Component c = start(&t, words[2], words[3]);
    if (count > 7)
        measure(c, &t, atol(words[7]));
    else
        run(c, &t);
    check(CALL(fmi2Terminate)(c), "fmi2Terminate");
    CALL(fmi2FreeInstance)(c);
    free_table(&t);
    return 0;
}
