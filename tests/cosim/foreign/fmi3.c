/* The model as an FMU of FMI 3.0. Value references: those of model.xml. */
#include "model.h"

#include "fmi3Functions.h"

typedef struct {
    Model model; /* first, so that both have one address */
    fmi3LogMessageCallback log;
    fmi3InstanceEnvironment environment;
} Instance;

static fmi3Status fail(Instance *i, fmi3Status status, const char *text)
{
    if (i->log)
        i->log(i->environment, status, "logStatusError", text);
    return status;
}

const char *fmi3GetVersion(void) { return fmi3Version; }

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String path, fmi3Boolean visible,
                                         fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early,
                                         const fmi3ValueReference required[], size_t count,
                                         fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                         fmi3IntermediateUpdateCallback update)
{
    (void)name, (void)path, (void)visible, (void)logging, (void)required, (void)count, (void)update;
    Instance *i = calloc(1, sizeof *i);
    i->log = log;
    i->environment = environment;
    start(&i->model);
    if (!events && !early && !strcmp(token, GUID))
        return i;
    fail(i, fmi3Error, "the GUID is that of another model");
    free(i);
    return NULL;
}

void fmi3FreeInstance(fmi3Instance c) { free(c); }

fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean a, fmi3Float64 b, fmi3Float64 time, fmi3Boolean d,
                                       fmi3Float64 e)
{
    (void)a, (void)b, (void)d, (void)e;
    ((Model *)c)->time = time;
    return fmi3OK;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance c)
{
    compute(c);
    ((Model *)c)->initialized = 1;
    return fmi3OK;
}

fmi3Status fmi3Terminate(fmi3Instance c) { return c ? fmi3OK : fmi3Fatal; }

fmi3Status fmi3Reset(fmi3Instance c)
{
    start(c);
    return fmi3OK;
}

static double *real(Model *m, unsigned r)
{
    double *all[] = {&m->time, &m->u, &m->y, &m->gain, &m->level, &m->end, &m->deed};
    return r < sizeof all / sizeof *all ? all[r] : NULL;
}

static float *single(Model *m, unsigned r) { return r == 10 ? &m->single : r == 11 ? &m->single_out : NULL; }

static long long *whole(Model *m, unsigned r)
{
    if (r >= 20 && r < 20 + WHOLES)
        return &m->whole[r - 20];
    return r >= 30 && r < 30 + WHOLES ? &m->whole_out[r - 30] : NULL;
}

static int *number(Model *m, unsigned r)
{
    int *all[] = {&m->shift, &m->mode, &m->mode_out, &m->law, &m->flag, &m->flag_out, &m->on};
    return r >= 40 && r < 47 ? all[r - 40] : NULL;
}

static char *text(Model *m, unsigned r)
{
    char *all[] = {m->text, m->text_out, m->label};
    return r >= 50 && r < 53 ? all[r - 50] : NULL;
}

#define ARGUMENTS fmi3Instance c, const fmi3ValueReference r[], size_t n
#define FOR_ALL(find)                                            \
    if (n != count)                                              \
        return fail(c, fmi3Error, "arrays there are none");      \
    for (size_t k = 0; k < n; k++)                               \
        if (!(find))                                             \
            return fail(c, fmi3Error, "unknown value reference"); \
        else

fmi3Status fmi3GetFloat64(ARGUMENTS, fmi3Float64 v[], size_t count)
{
    FOR_ALL(real(c, r[k])) v[k] = *real(c, r[k]);
    return fmi3OK;
}

fmi3Status fmi3SetFloat64(ARGUMENTS, const fmi3Float64 v[], size_t count)
{
    FOR_ALL(real(c, r[k])) *real(c, r[k]) = v[k];
    return fmi3OK;
}

fmi3Status fmi3GetFloat32(ARGUMENTS, fmi3Float32 v[], size_t count)
{
    FOR_ALL(single(c, r[k])) v[k] = *single(c, r[k]);
    return fmi3OK;
}

fmi3Status fmi3SetFloat32(ARGUMENTS, const fmi3Float32 v[], size_t count)
{
    FOR_ALL(single(c, r[k])) *single(c, r[k]) = v[k];
    return fmi3OK;
}

/* Each integer type has its own input and output, and only through its own functions. */
#define INTEGERS(type, place)                                                                                       \
    fmi3Status fmi3Get##type(ARGUMENTS, fmi3##type v[], size_t count)                                               \
    {                                                                                                               \
        FOR_ALL((r[k] == 20 + place || r[k] == 30 + place || (place == 4 && number(c, r[k]))))                      \
        v[k] = (fmi3##type)(whole(c, r[k]) ? *whole(c, r[k]) : *number(c, r[k]));                                   \
        return fmi3OK;                                                                                              \
    }                                                                                                               \
    fmi3Status fmi3Set##type(ARGUMENTS, const fmi3##type v[], size_t count)                                         \
    {                                                                                                               \
        FOR_ALL((r[k] == 20 + place || (place == 4 && number(c, r[k])) || (place == 6 && number(c, r[k]))))         \
        if (whole(c, r[k]))                                                                                         \
            *whole(c, r[k]) = (long long)v[k];                                                                      \
        else                                                                                                        \
            *number(c, r[k]) = (int)v[k];                                                                           \
        return fmi3OK;                                                                                              \
    }
INTEGERS(Int8, 0)
INTEGERS(UInt8, 1)
INTEGERS(Int16, 2)
INTEGERS(UInt16, 3)
INTEGERS(Int32, 4)
INTEGERS(UInt32, 5)
INTEGERS(UInt64, 7)

fmi3Status fmi3GetInt64(ARGUMENTS, fmi3Int64 v[], size_t count) /* enumerations too */
{
    FOR_ALL(r[k] == 26 || r[k] == 36 || number(c, r[k])) v[k] = whole(c, r[k]) ? *whole(c, r[k]) : *number(c, r[k]);
    return fmi3OK;
}

fmi3Status fmi3SetInt64(ARGUMENTS, const fmi3Int64 v[], size_t count)
{
    FOR_ALL(r[k] == 26 || number(c, r[k]))
    if (r[k] == 26)
        *whole(c, r[k]) = v[k];
    else
        *number(c, r[k]) = (int)v[k];
    return fmi3OK;
}

fmi3Status fmi3GetBoolean(ARGUMENTS, fmi3Boolean v[], size_t count)
{
    FOR_ALL(number(c, r[k])) v[k] = *number(c, r[k]) != 0;
    return fmi3OK;
}

fmi3Status fmi3SetBoolean(ARGUMENTS, const fmi3Boolean v[], size_t count)
{
    FOR_ALL(number(c, r[k])) *number(c, r[k]) = v[k];
    return fmi3OK;
}

fmi3Status fmi3GetString(ARGUMENTS, fmi3String v[], size_t count)
{
    FOR_ALL(text(c, r[k])) v[k] = text(c, r[k]);
    return fmi3OK;
}

fmi3Status fmi3SetString(ARGUMENTS, const fmi3String v[], size_t count)
{
    FOR_ALL(text(c, r[k])) copy(text(c, r[k]), v[k]);
    return fmi3OK;
}

fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 time, fmi3Float64 step, fmi3Boolean keep, fmi3Boolean *event,
                      fmi3Boolean *over, fmi3Boolean *early, fmi3Float64 *last)
{
    (void)keep;
    Model *m = c;
    if (!m->initialized)
        return fail(c, fmi3Error, "not initialized");
    if (m->deed == NOTHING && time + step > m->end)
        return fail(c, fmi3Discard, "100 % of the time is over");
    *over = ends(m, time, step);
    *event = fmi3False;
    *early = m->deed == EARLY;
    const double odd[] = {time + 0.5 * step, NAN, time - step, time + 2.0 * step};
    if (m->deed >= EARLY && m->deed <= BEYOND)
        *last = odd[(int)m->deed - EARLY];
    else if (m->deed != ENDS_SILENTLY)
        *last = m->last;
    return m->deed == WARNS ? fail(c, fmi3Warning, "careful") : fmi3OK;
}
