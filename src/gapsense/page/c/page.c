/* A scenario as one WebAssembly module: its components, which are those of the native FMUs, and the loop of the runner.
 *
 * plan.h, which is generated, has the scenario.  The page opens the module, sets values, starts it and lets it advance; for
 * another run it makes another instance of the module, so nothing has to be reset. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "arrays.h"
#include "files.h"
#include "fmi2Functions.h"
#include "loop.c"

#define FOR_PAGE(type, name) __attribute__((export_name(#name))) type page_##name

__attribute__((import_module("page"), import_name("say"))) void page_say(const char *text);

/* --- what the shell of an FMU takes from outside --- */

/* A component of the scenario. */
typedef struct {
    const Model *model;
    const Arrays *arrays;
    int (*is_exact)(void);
    const char *name, *folder; /* of its files */
    double begin;              /* of its first step */
    fmi2Component component;
} Slot;

/* There is one shell for all of them: the component that acts is what it takes for the only one. */
const Model *acting_model;
const Arrays *acting_arrays;
static int (*acting_is_exact)(void);

int kernel_is_exact(void) { return acting_is_exact(); }

static fmi2Component act(const Slot *slot)
{
    acting_model = slot->model;
    acting_arrays = slot->arrays;
    acting_is_exact = slot->is_exact;
    return slot->component;
}

/* Files are what the page has given. */
typedef struct {
    char *path, *content;
    size_t size;
} File;
enum { MOST_FILES = 64 };
static File files[MOST_FILES];
static int file_count;

FOR_PAGE(void, give_file)(char *path, char *content, size_t size)
{
    if (file_count < MOST_FILES)
        files[file_count++] = (File){path, content, size};
}

static const File *file_at(const char *path)
{
    for (int k = 0; k < file_count; k++)
        if (!strcmp(files[k].path, path))
            return files + k;
    return NULL;
}

int is_file(const char *path) { return file_at(path) != NULL; }

char *file_content(const char *path, size_t *size)
{
    const File *file = file_at(path);
    char *copy = file ? malloc(file->size + 1) : NULL;
    if (!copy)
        return NULL;
    memcpy(copy, file->content, *size = file->size);
    copy[file->size] = 0;
    return copy;
}

/* The loop asks for the time after every step, and nobody here wants to know it. */
int clock_gettime(clockid_t clock, struct timespec *time)
{
    (void)clock;
    *time = (struct timespec){0};
    return 0;
}

/* --- what the loop calls --- */

static int set_inputs(void *slot, const unsigned *references, size_t count, double *values)
{
    return fmi2SetReal(act(slot), references, count, values);
}

static int get_outputs(void *slot, const unsigned *references, size_t count, double *values)
{
    return fmi2GetReal(act(slot), references, count, values);
}

static int step_component(void *slot, double time, double duration, int keep)
{
    return fmi2DoStep(act(slot), time, duration, keep);
}

static int64_t marks[8], spread[BINS]; /* the loop counts how long steps take, which is not shown */

#include "plan.h"

static void tell(fmi2ComponentEnvironment host, fmi2String name, fmi2Status status, fmi2String category, fmi2String text, ...)
{
    (void)host, (void)name, (void)category;
    if (status > fmi2Warning)
        page_say(text);
}

/* --- what the page calls: each returns whether a component refused, which has then said why --- */

FOR_PAGE(void *, room)(size_t size) { return malloc(size); }
FOR_PAGE(double *, inputs)(void) { return buffer; }
FOR_PAGE(double *, record)(void) { return data; }
FOR_PAGE(int, done)(void) { return (int)plan.next - 1; }
FOR_PAGE(int, rows)(void) { return (int)plan.rows; }
FOR_PAGE(int, acting)(void) { return (int)plan.part; }

FOR_PAGE(int, open)(void)
{
    static const fmi2CallbackFunctions functions = {tell, NULL, NULL, NULL, NULL};
    for (size_t i = 0; i < plan.part_count; i++) {
        Slot *s = slots + i;
        act(s);
        s->component = fmi2Instantiate(s->name, fmi2CoSimulation, s->model->guid, s->folder, &functions, 0, 1);
        if (!s->component || fmi2SetupExperiment(s->component, 0, 0.0, s->begin, 1, STOP_TIME) > fmi2Warning)
            return 1;
    }
    return 0;
}

FOR_PAGE(int, set_number)(int part, int kind, unsigned reference, double value)
{
    const fmi2Component c = act(slots + part);
    const int whole = (int)value;
    const fmi2Status status = kind == INTEGER   ? fmi2SetInteger(c, &reference, 1, &whole)
                              : kind == BOOLEAN ? fmi2SetBoolean(c, &reference, 1, &whole)
                                                : fmi2SetReal(c, &reference, 1, &value);
    return status > fmi2Warning;
}

FOR_PAGE(int, set_text)(int part, unsigned reference, const char *text)
{
    return fmi2SetString(act(slots + part), &reference, 1, &text) > fmi2Warning;
}

/* The value of a parameter that is a number; NaN for any other. */
FOR_PAGE(double, number)(int part, unsigned reference)
{
    double value = NAN;
    int whole;
    const fmi2Component c = act(slots + part);
    const Kind kind = slots[part].model->ports[reference].kind;
    if (kind == REAL)
        fmi2GetReal(c, &reference, 1, &value);
    else if (kind == INTEGER && fmi2GetInteger(c, &reference, 1, &whole) == fmi2OK)
        value = whole;
    else if (kind == BOOLEAN && fmi2GetBoolean(c, &reference, 1, &whole) == fmi2OK)
        value = whole;
    return value;
}

/* As `Master.initialize`: all components enter, then take their inputs one after the other. */
FOR_PAGE(int, start)(void)
{
    for (size_t i = 0; i < plan.part_count; i++) {
        Part *p = parts + i;
        if (fmi2EnterInitializationMode(act(slots + i)) > fmi2Warning || (p->outputs.count && move(p, &p->outputs) > WARNING))
            return 1;
    }
    play(&plan, 0);
    for (size_t i = 0; i < plan.part_count; i++) {
        Part *p = parts + i;
        if (take(&plan, p) != DONE || fmi2ExitInitializationMode(act(slots + i)) > fmi2Warning ||
            (p->outputs.count && move(p, &p->outputs) > WARNING))
            return 1;
    }
    return 0;
}

/* Events: numbers of noise, whether a condition holds, what the loop is to tell of it, and what an input gets. */
FOR_PAGE(const double *, noise)(void) { return noise; }

FOR_PAGE(int, holds)(int of)
{
    const Watch *w = watches + of;
    return w->is_above ? buffer[w->place] > w->level : buffer[w->place] < w->level;
}

FOR_PAGE(void, watch)(int of, int is_on, int holds)
{
    watches[of].is_on = is_on;
    watches[of].holds = holds;
}

FOR_PAGE(void, stage)(int part, int link, int source, int converts, double factor, double bias)
{
    Link *l = (Link *)parts[part].links + link;
    *l = (Link){l->target, source, converts, factor, bias};
}

FOR_PAGE(int, advance)(int until) { return loop(&plan, until) != DONE; }
