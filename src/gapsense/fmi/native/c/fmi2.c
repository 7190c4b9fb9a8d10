/* FMI 2.0 for co-simulation, over `instance.h`. */
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"
#include "instance.h"
#include "sentences.h"

/* --- messages --- */

/* The host reads a text as a format, without arguments: percent signs are doubled. A host that formats shows the text; one
 * that shows the format as it is shows all of it too, with two percent signs for one. */
static void tell(void *host, const char *name, Status status, const char *category, const char *text)
{
    const fmi2CallbackFunctions *functions = host;
    char *format = malloc(2 * strlen(text) + 1), *end = format;
    if (format && functions && functions->logger) {
        for (; *text; *end++ = *text++)
            if (*text == '%')
                *end++ = '%';
        *end = 0;
        functions->logger(functions->componentEnvironment, name, (fmi2Status)status, category, format);
    }
    free(format);
}

static unsigned category(const char *name)
{
    static const char *const names[] = {"logStatusWarning", "logStatusDiscard", "logStatusError", "logStatusFatal"};
    for (unsigned k = 0; k < 4; k++)
        if (!strcmp(names[k], name))
            return 1u << k;
    return strcmp(name, "logAll") ? 0 : ALL;
}

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t count, const fmi2String categories[])
{
    Instance *i = c;
    if (!i || instance_given(i, __func__, "categories", categories, count) ||
        instance_given_texts(i, __func__, categories, count))
        return fmi2Error;
    i->logged = on ? (count ? 0 : ALL) : ERRORS; /* a host has no other sign of an error than its message */
    for (size_t k = 0; on && k < count; k++)
        i->logged |= category(categories[k]);
    return fmi2OK;
}

/* --- birth and death --- */

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String location,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging)
{
    (void)visible;
    fmi2CallbackFunctions *host = calloc(1, sizeof *host);
    Instance *i = NULL;
    if (host && functions)
        memcpy(host, functions, sizeof *host);
    if (!host)
        say_to(tell, (void *)functions, name, SAY_NO_MEMORY);
    else if (type != fmi2CoSimulation)
        say_to(tell, host, name, SAY_MODEL_EXCHANGE);
    else
        i = instance_new(name, guid, location, tell, host);
    if (i)
        i->logged = logging ? ALL : ERRORS;
    else
        free(host);
    return i;
}

void fmi2FreeInstance(fmi2Component c)
{
    Instance *i = c;
    if (i)
        free(i->host);
    instance_free(i);
}

/* --- life: without an instance there is nobody to tell what is wrong --- */

#define CALLED(condition, call) ((condition) ? (fmi2Status)(call) : fmi2Error)
#define GIVEN(what, address) (c && !instance_given(c, __func__, what, address, 1))

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean has_tolerance, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean has_stop, fmi2Real stop)
{
    (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop;
    return CALLED(c, instance_set_start(c, "fmi2SetupExperiment", start));
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c)
{
    return CALLED(c, instance_enter_initialization(c, "fmi2EnterInitializationMode"));
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c)
{
    return CALLED(c, instance_exit_initialization(c, "fmi2ExitInitializationMode"));
}

fmi2Status fmi2Terminate(fmi2Component c) { return CALLED(c, instance_terminate(c, "fmi2Terminate")); }

fmi2Status fmi2Reset(fmi2Component c) { return CALLED(c, instance_reset(c)); }

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real step, fmi2Boolean no_setting_of_past_states)
{
    (void)no_setting_of_past_states;
    return CALLED(c, instance_step(c, "fmi2DoStep", time, step));
}

/* --- values --- */

#define GETTER(Name, KIND, Type, VALUE)                                                                              \
    fmi2Status fmi2Get##Name(fmi2Component c, const fmi2ValueReference references[], size_t count, Type values[])     \
    {                                                                                                                \
        if (!c || instance_given_values(c, "fmi2Get" #Name, references, count, values, count) ||                      \
            instance_begin_get(c, "fmi2Get" #Name, KIND, references, count))                                          \
            return fmi2Error;                                                                                        \
        const State *s = ((Instance *)c)->state;                                                                     \
        for (size_t k = 0; k < count; k++)                                                                           \
            values[k] = VALUE[references[k]];                                                                        \
        return fmi2OK;                                                                                               \
    }

GETTER(Real, REAL, fmi2Real, s->values)
GETTER(Integer, INTEGER, fmi2Integer, (fmi2Integer)s->values)
GETTER(Boolean, BOOLEAN, fmi2Boolean, (fmi2Boolean)s->values)
GETTER(String, STRING, fmi2String, s->texts)

#define SETTER(Name, KIND, Type, VALUE)                                                                              \
    fmi2Status fmi2Set##Name(fmi2Component c, const fmi2ValueReference references[], size_t count,                    \
                             const Type values[])                                                                    \
    {                                                                                                                \
        if (!c || instance_given_values(c, "fmi2Set" #Name, references, count, values, count) ||                      \
            instance_begin_set(c, "fmi2Set" #Name, KIND, references, count))                                          \
            return fmi2Error;                                                                                        \
        double *const to = ((Instance *)c)->state->values;                                                           \
        for (size_t k = 0; k < count; k++)                                                                           \
            to[references[k]] = VALUE;                                                                               \
        return (fmi2Status)instance_end_set(c);                                                                      \
    }

SETTER(Real, REAL, fmi2Real, values[k])
SETTER(Integer, INTEGER, fmi2Integer, values[k])
SETTER(Boolean, BOOLEAN, fmi2Boolean, values[k] != fmi2False)

fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference references[], size_t count,
                         const fmi2String values[])
{
    if (!c || instance_given_values(c, __func__, references, count, values, count) ||
        instance_given_texts(c, __func__, values, count) || instance_begin_set(c, __func__, STRING, references, count))
        return fmi2Error;
    for (size_t k = 0; k < count; k++)
        if (instance_set_text(c, references[k], values[k]))
            return fmi2Error;
    return (fmi2Status)instance_end_set(c);
}

/* --- saved states --- */

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *saved)
{
    return CALLED(GIVEN("state", saved), instance_save(c, (State **)saved));
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate saved) { return CALLED(c, instance_restore(c, saved)); }

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *saved)
{
    if (saved) {
        state_free(*saved);
        *saved = NULL;
    }
    return c ? fmi2OK : fmi2Error;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate saved, size_t *size)
{
    return CALLED(GIVEN("size", size), instance_state_size(c, saved, size));
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate saved, fmi2Byte bytes[], size_t size)
{
    return CALLED(GIVEN("bytes", bytes), instance_serialize(c, saved, (unsigned char *)bytes, size));
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *saved)
{
    return CALLED(GIVEN("bytes", bytes) && GIVEN("state", saved),
                  instance_deserialize(c, (const unsigned char *)bytes, size, (State **)saved));
}

/* --- what is not provided --- */

static fmi2Status lacks(fmi2Component c, const char *name)
{
    return CALLED(c, report(c, SAY_NOT_PROVIDED, name));
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknown[], size_t unknown_count,
                                        const fmi2ValueReference known[], size_t known_count,
                                        const fmi2Real known_changes[], fmi2Real unknown_changes[])
{
    (void)unknown, (void)unknown_count, (void)known, (void)known_count, (void)known_changes, (void)unknown_changes;
    return lacks(c, "fmi2GetDirectionalDerivative");
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference references[], size_t count,
                                       const fmi2Integer order[], const fmi2Real values[])
{
    (void)references, (void)count, (void)order, (void)values;
    return lacks(c, "fmi2SetRealInputDerivatives");
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference references[], size_t count,
                                        const fmi2Integer order[], fmi2Real values[])
{
    (void)references, (void)count, (void)order, (void)values;
    return lacks(c, "fmi2GetRealOutputDerivatives");
}

fmi2Status fmi2CancelStep(fmi2Component c) { return lacks(c, "fmi2CancelStep"); }

#define STATUS(Name, Type)                                                            \
    fmi2Status fmi2Get##Name(fmi2Component c, const fmi2StatusKind kind, Type *value) \
    {                                                                                 \
        (void)c, (void)kind, (void)value;                                             \
        return fmi2Discard;                                                           \
    }

STATUS(Status, fmi2Status)
STATUS(RealStatus, fmi2Real)
STATUS(IntegerStatus, fmi2Integer)
STATUS(BooleanStatus, fmi2Boolean)
STATUS(StringStatus, fmi2String)
