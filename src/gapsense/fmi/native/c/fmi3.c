/* FMI 3.0 for co-simulation, over `instance.h`: birth, life, steps and saved states. */
#include "fmi3.h"

#include <stdlib.h>
#include <string.h>

/* --- messages --- */

static void tell(void *given, const char *name, Status status, const char *category, const char *text)
{
    const Host *host = given;
    (void)name;
    if (host && host->log)
        host->log(host->environment, (fmi3Status)status, category, text);
}

fmi3Status fmi3SetDebugLogging(fmi3Instance c, fmi3Boolean on, size_t count, const fmi3String categories[])
{
    Instance *i = c;
    if (!i || instance_given(i, __func__, "categories", categories, count) ||
        instance_given_texts(i, __func__, categories, count))
        return fmi3Error;
    i->logged = on ? (count ? 0 : ALL) : ERRORS; /* a host has no other sign of an error than its message */
    for (size_t k = 0; on && k < count; k++)
        i->logged |= !strcmp(categories[k], "logStatusError") ? ERRORS : 0;
    return fmi3OK;
}

/* --- birth and death --- */

const char *fmi3GetVersion(void) { return fmi3Version; }

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                         fmi3Boolean logging, fmi3Boolean event_mode, fmi3Boolean early_return,
                                         const fmi3ValueReference intermediate[], size_t intermediate_count,
                                         fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                         fmi3IntermediateUpdateCallback update)
{
    (void)visible, (void)early_return, (void)intermediate, (void)intermediate_count, (void)update;
    Host told = {environment, log}, *host = malloc(sizeof *host);
    Instance *i = NULL;
    if (host)
        *host = told;
    if (!host)
        say_to(tell, &told, name, SAY_NO_MEMORY);
    else if (event_mode)
        say_to(tell, &told, name, SAY_NOT_PROVIDED, "the event mode");
    else
        i = instance_new(name, token, resources, tell, host);
    if (i)
        i->logged = logging ? ALL : ERRORS;
    else
        free(host);
    return i;
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                          fmi3Boolean logging, fmi3InstanceEnvironment environment,
                                          fmi3LogMessageCallback log)
{
    Host host = {environment, log};
    (void)token, (void)resources, (void)visible, (void)logging;
    say_to(tell, &host, name, SAY_MODEL_EXCHANGE);
    return NULL;
}

fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources,
                                               fmi3Boolean visible, fmi3Boolean logging,
                                               fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                               fmi3ClockUpdateCallback update, fmi3LockPreemptionCallback lock,
                                               fmi3UnlockPreemptionCallback unlock)
{
    Host host = {environment, log};
    (void)token, (void)resources, (void)visible, (void)logging, (void)update, (void)lock, (void)unlock;
    say_to(tell, &host, name, SAY_NOT_PROVIDED, "scheduled execution");
    return NULL;
}

void fmi3FreeInstance(fmi3Instance c)
{
    Instance *i = c;
    if (i)
        free(i->host);
    instance_free(i);
}

/* --- life --- */

int is_configuring(const Instance *i) { return i->state->is_configuring && i->state->phase == INSTANTIATED; }

Status outside_configuration(Instance *i, Call call, const char *name)
{
    return is_configuring(i) ? refuse(i, SAY_WRONG_PHASE, name, "configuring", instance_phases(call)) : FINE;
}

Status in_configuration(Instance *i, const char *name)
{
    static const char *const names[] = PHASES;
    return is_configuring(i) ? FINE : refuse(i, SAY_WRONG_PHASE, name, names[i->state->phase], "`configuring`");
}

fmi3Status fmi3EnterConfigurationMode(fmi3Instance c)
{
    Instance *i = c;
    if (!i || outside_configuration(i, CALL_EnterInitializationMode, __func__) ||
        instance_may(i, CALL_EnterInitializationMode, __func__))
        return fmi3Error;
    i->state->is_configuring = 1;
    return fmi3OK;
}

fmi3Status fmi3ExitConfigurationMode(fmi3Instance c)
{
    Instance *i = c;
    if (!i || in_configuration(i, __func__))
        return fmi3Error;
    i->state->is_configuring = 0;
    return fmi3OK;
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean has_tolerance, fmi3Float64 tolerance,
                                       fmi3Float64 start, fmi3Boolean has_stop, fmi3Float64 stop)
{
    (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop;
    if (!c || outside_configuration(c, CALL_EnterInitializationMode, __func__) || instance_set_start(c, __func__, start))
        return fmi3Error;
    return (fmi3Status)instance_enter_initialization(c, __func__);
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance c)
{
    return CALLED(c && !outside_configuration(c, CALL_ExitInitializationMode, __func__), instance_exit_initialization(c, __func__));
}

fmi3Status fmi3Terminate(fmi3Instance c)
{
    return CALLED(c && !outside_configuration(c, CALL_Terminate, __func__), instance_terminate(c, __func__));
}

fmi3Status fmi3Reset(fmi3Instance c) { return CALLED(c, instance_reset(c)); }

fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 time, fmi3Float64 step, fmi3Boolean no_setting_of_past_states,
                      fmi3Boolean *event, fmi3Boolean *ends, fmi3Boolean *early, fmi3Float64 *last)
{
    (void)no_setting_of_past_states;
    const fmi3Status status = CALLED(c && !outside_configuration(c, CALL_DoStep, __func__), instance_step(c, __func__, time, step));
    if (event)
        *event = fmi3False;
    if (ends)
        *ends = fmi3False;
    if (early)
        *early = fmi3False;
    if (last)
        *last = status == fmi3OK ? time + step : time;
    return status;
}

/* --- saved states --- */

fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *saved)
{
    return CALLED(GIVEN("state", saved), instance_save(c, (State **)saved));
}

fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState saved) { return CALLED(c, instance_restore(c, saved)); }

fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *saved)
{
    if (saved) {
        state_free(*saved);
        *saved = NULL;
    }
    return c ? fmi3OK : fmi3Error;
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c, fmi3FMUState saved, size_t *size)
{
    return CALLED(GIVEN("size", size), instance_state_size(c, saved, size));
}

fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState saved, fmi3Byte bytes[], size_t size)
{
    return CALLED(GIVEN("bytes", bytes), instance_serialize(c, saved, bytes, size));
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const fmi3Byte bytes[], size_t size, fmi3FMUState *saved)
{
    return CALLED(GIVEN("bytes", bytes) && GIVEN("state", saved), instance_deserialize(c, bytes, size, (State **)saved));
}
