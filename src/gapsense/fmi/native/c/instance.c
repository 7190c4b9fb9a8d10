#include "instance.h"

#include <stdlib.h>
#include <string.h>

#include "files.h"
#include "sentences.h"

static const char *const PHASE_NAMES[] = PHASES;
static const Rule RULES[] = {CALLS(RULE)};

/* --- messages --- */

static void send(Instance *i, const char *format, va_list values)
{
    Text sentence = {NULL, 0, 0}, message = {NULL, 0, 0};
    text_add_list(&sentence, format, values);
    if (i->is_stepping)
        text_add(&message, SAY_SAID_IN_STEP, i->name, model.name, i->step_time, i->step, text_of(&sentence));
    else
        text_add(&message, SAY_SAID, i->name, model.name, text_of(&sentence));
    if (i->logged & ERRORS)
        i->tell(i->host, i->name, REFUSED, "logStatusError", text_of(&message));
    text_free(&sentence);
    text_free(&message);
}

Status refuse(Instance *i, const char *format, ...)
{
    va_list values;
    va_start(values, format);
    send(i, format, values);
    va_end(values);
    i->state->phase = FAILED;
    return REFUSED;
}

Status report(Instance *i, const char *format, ...)
{
    va_list values;
    va_start(values, format);
    send(i, format, values);
    va_end(values);
    return REFUSED;
}

void say_to(Tell *tell, void *host, const char *name, const char *format, ...)
{
    Instance stub = {.name = (char *)(name ? name : ""), .tell = tell, .host = host, .logged = ALL};
    va_list values;
    va_start(values, format);
    send(&stub, format, values);
    va_end(values);
}

const char *instance_phases(Call call) { return RULES[call].text; }

Status instance_may(Instance *i, Call call, const char *name)
{
    if (RULES[call].phases >> i->state->phase & 1u)
        return FINE;
    return refuse(i, SAY_WRONG_PHASE, name, PHASE_NAMES[i->state->phase], RULES[call].text);
}

/* --- birth and death --- */

static int fill(Instance *i, const char *name, const char *location)
{
    i->name = text_copy(name ? name : "");
    i->resources = folder_of(location ? location : "");
    i->state = state_new();
    i->outputs = malloc(((size_t)model.signals + 1) * sizeof *i->outputs);
    i->before = malloc(((size_t)model.port_count + 1) * sizeof *i->before);
    return i->name && i->resources && i->state && i->outputs && i->before;
}

/* The first of the component's files that is not in the folder, as a path to be freed; NULL if all are. */
static char *missing_file(const char *folder)
{
    for (int k = 0; k < model.resource_count; k++) {
        char *path = path_in(folder, model.resources[k]);
        if (!path || !is_file(path))
            return path;
        free(path);
    }
    return NULL;
}

static int has_files(const Instance *i, const char *location)
{
    char *missing = missing_file(i->resources);
    if (missing)
        say_to(i->tell, i->host, i->name, SAY_NO_RESOURCES, missing, location ? location : "");
    free(missing);
    return !missing;
}

Instance *instance_new(const char *name, const char *guid, const char *location, Tell *tell, void *host)
{
    if (!guid || strcmp(guid, model.guid) != 0) {
        say_to(tell, host, name, SAY_WRONG_GUID, guid ? guid : "", model.guid);
        return NULL;
    }
    if (!kernel_is_exact()) {
        say_to(tell, host, name, SAY_NOT_EXACT);
        return NULL;
    }
    Instance *i = calloc(1, sizeof *i);
    if (!i || !fill(i, name, location)) {
        say_to(tell, host, name, SAY_NO_MEMORY);
        instance_free(i);
        return NULL;
    }
    i->tell = tell;
    i->host = host;
    if (!has_files(i, location)) {
        instance_free(i);
        return NULL;
    }
    return i;
}

void instance_free(Instance *i)
{
    if (!i)
        return;
    state_free(i->state);
    free(i->name);
    free(i->resources);
    free(i->outputs);
    free(i->before);
    free(i);
}

/* --- life --- */

Status instance_set_start(Instance *i, const char *name, double time)
{
    char number[REPR];
    if (instance_may(i, CALL_SetupExperiment, name))
        return REFUSED;
    if (!(time - time == 0.0))
        return refuse(i, SAY_START_TIME, repr(time, number));
    i->state->start_time = i->state->time = time;
    i->state->is_timed = 1;
    return FINE;
}

Status instance_enter_initialization(Instance *i, const char *name)
{
    if (instance_may(i, CALL_EnterInitializationMode, name))
        return REFUSED;
    i->state->phase = INITIALIZING;
    return FINE;
}

Status instance_exit_initialization(Instance *i, const char *name)
{
    if (instance_may(i, CALL_ExitInitializationMode, name) || instance_initialize(i))
        return REFUSED;
    i->state->phase = RUNNING;
    return FINE;
}

Status instance_terminate(Instance *i, const char *name)
{
    if (instance_may(i, CALL_Terminate, name))
        return REFUSED;
    i->state->phase = TERMINATED;
    return FINE;
}

Status instance_reset(Instance *i) { return state_reset(i->state) ? FINE : refuse(i, SAY_NO_MEMORY); }
