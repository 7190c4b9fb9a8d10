/* The model as an FMU of FMI 2.0. */
#include "model.h"

#include "fmi2Functions.h"

typedef struct {
    Model model; /* first, so that both have one address */
    fmi2CallbackFunctions host;
    char name[LENGTH];
} Instance;

static fmi2Status fail(Instance *i, fmi2Status status, const char *text)
{
    if (i->host.logger)
        i->host.logger(i->host.componentEnvironment, i->name, status, "logStatusError", text);
    return status;
}

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String location,
                              const fmi2CallbackFunctions *host, fmi2Boolean visible, fmi2Boolean logging)
{
    (void)location, (void)visible, (void)logging;
    Instance *i = calloc(1, sizeof *i);
    i->host = *host;
    copy(i->name, name);
    start(&i->model);
    if (type == fmi2CoSimulation && !strcmp(guid, GUID))
        return i;
    fail(i, fmi2Error, "the GUID is that of another model");
    free(i);
    return NULL;
}

void fmi2FreeInstance(fmi2Component c) { free(c); }

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean a, fmi2Real b, fmi2Real time, fmi2Boolean d, fmi2Real e)
{
    (void)a, (void)b, (void)d, (void)e;
    ((Model *)c)->time = time;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) { return c ? fmi2OK : fmi2Fatal; }

fmi2Status fmi2ExitInitializationMode(fmi2Component c)
{
    compute(c);
    ((Model *)c)->initialized = 1;
    return fmi2OK;
}

fmi2Status fmi2Terminate(fmi2Component c) { return c ? fmi2OK : fmi2Fatal; }

fmi2Status fmi2Reset(fmi2Component c)
{
    start(c);
    return fmi2OK;
}

static double *real(Model *m, unsigned k)
{
    double *all[] = {&m->u, &m->y, &m->gain, &m->level, &m->end, &m->deed};
    return k < sizeof all / sizeof *all ? all[k] : NULL;
}

static int *boolean(Model *m, unsigned k)
{
    int *all[] = {&m->flag, &m->flag_out, &m->on};
    return k < sizeof all / sizeof *all ? all[k] : NULL;
}

static char *text(Model *m, unsigned k)
{
    char *all[] = {m->text, m->text_out, m->label};
    return k < sizeof all / sizeof *all ? all[k] : NULL;
}

static fmi2Status integer(Model *m, unsigned k, int *value, int sets)
{
    int *all[] = {&m->shift, &m->mode, &m->mode_out, &m->law};
    if (k == 0 && sets)
        m->whole[0] = *value;
    else if (k <= 1 && !sets)
        *value = (int)(k ? m->whole_out[0] : m->whole[0]);
    else if (k >= 2 && k < 6)
        *(sets ? all[k - 2] : value) = sets ? *value : *all[k - 2];
    else
        return fmi2Error;
    return fmi2OK;
}

#define FOR_ALL(get)                                             \
    for (size_t k = 0; k < n; k++) {                             \
        if (!(get))                                              \
            return fail(c, fmi2Error, "unknown value reference"); \
    }                                                            \
    for (size_t k = 0; k < n; k++)
#define ARGUMENTS fmi2Component c, const fmi2ValueReference r[], size_t n

fmi2Status fmi2GetReal(ARGUMENTS, fmi2Real v[])
{
    FOR_ALL(real(c, r[k])) v[k] = *real(c, r[k]);
    return fmi2OK;
}

fmi2Status fmi2SetReal(ARGUMENTS, const fmi2Real v[])
{
    FOR_ALL(real(c, r[k])) *real(c, r[k]) = v[k];
    return fmi2OK;
}

fmi2Status fmi2GetBoolean(ARGUMENTS, fmi2Boolean v[])
{
    FOR_ALL(boolean(c, r[k])) v[k] = *boolean(c, r[k]);
    return fmi2OK;
}

fmi2Status fmi2SetBoolean(ARGUMENTS, const fmi2Boolean v[])
{
    FOR_ALL(boolean(c, r[k]) && (v[k] == 0 || v[k] == 1)) *boolean(c, r[k]) = v[k];
    return fmi2OK;
}

fmi2Status fmi2GetString(ARGUMENTS, fmi2String v[])
{
    FOR_ALL(text(c, r[k])) v[k] = text(c, r[k]);
    return fmi2OK;
}

fmi2Status fmi2SetString(ARGUMENTS, const fmi2String v[])
{
    FOR_ALL(text(c, r[k])) copy(text(c, r[k]), v[k]);
    return fmi2OK;
}

fmi2Status fmi2GetInteger(ARGUMENTS, fmi2Integer v[])
{
    for (size_t k = 0; k < n; k++)
        if (integer(c, r[k], &v[k], 0))
            return fail(c, fmi2Error, "unknown value reference");
    return fmi2OK;
}

fmi2Status fmi2SetInteger(ARGUMENTS, const fmi2Integer v[])
{
    for (size_t k = 0; k < n; k++) {
        int value = v[k];
        if (integer(c, r[k], &value, 1))
            return fail(c, fmi2Error, "unknown value reference");
    }
    return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real step, fmi2Boolean keep)
{
    (void)keep;
    Model *m = c;
    if (!m->initialized || (m->deed == NOTHING && time + step > m->end))
        return fail(c, fmi2Discard, "100 % of the time is over");
    if (ends(m, time, step))
        return fmi2Discard;
    return m->deed == WARNS ? fail(c, fmi2Warning, "careful") : fmi2OK;
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value)
{
    *value = ((Model *)c)->has_ended;
    return kind == fmi2Terminated ? fmi2OK : fmi2Error;
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value)
{
    Model *m = c;
    if (m->deed == ENDS_SILENTLY)
        return fail(c, fmi2Error, "not now");
    *value = m->last;
    return kind == fmi2LastSuccessfulTime ? fmi2OK : fmi2Error;
}
