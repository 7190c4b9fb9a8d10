/* An instance, whatever the version of FMI: its life, its values, its steps, its messages. `fmi2.c` and others are thin
 * layers over this. Every function with a status either does all that it says, or refuses: one message, no effect, and
 * the instance has failed until it is reset or a saved state is set. No function allocates memory in a step. */
#ifndef GAPSENSE_INSTANCE_H
#define GAPSENSE_INSTANCE_H

#include "state.h"

typedef enum { FINE = 0, REFUSED = 3 } Status; /* as FMI numbers OK and Error */
enum { WARNINGS = 1, DISCARDS = 2, ERRORS = 4, FATALS = 8, ALL = 15 };

/* How a message reaches the host: `host` is what it gave. */
typedef void Tell(void *host, const char *instance, Status status, const char *category, const char *text);

typedef struct {
    State *state;
    char *name, *resources; /* the folder */
    Tell *tell;
    void *host;
    unsigned logged; /* categories */
    /* For the message of a refusal in a step. */
    int is_stepping;
    double step_time, step;
    /* Room that steps and settings need. */
    double *outputs, *before;
    int is_tuning;
} Instance;

/* NULL, after one message, if there is no such component, folder or memory. `location` is an URI or a path. */
Instance *instance_new(const char *name, const char *guid, const char *location, Tell *tell, void *host);
void instance_free(Instance *instance);
/* The message of what cannot even be instantiated. */
void say_to(Tell *tell, void *host, const char *name, const char *format, ...) FORMAT(4, 5);
/* One message; the phase becomes `failed`. `report` does not change it. */
Status refuse(Instance *instance, const char *format, ...) FORMAT(2, 3);
Status report(Instance *instance, const char *format, ...) FORMAT(2, 3);

/* `name` is what the host called, for the message. */
const char *instance_phases(Call call); /* those in which it is allowed, as a sentence names them */
Status instance_may(Instance *instance, Call call, const char *name);
Status instance_set_start(Instance *instance, const char *name, double time);
Status instance_enter_initialization(Instance *instance, const char *name);
Status instance_exit_initialization(Instance *instance, const char *name);
Status instance_terminate(Instance *instance, const char *name);
Status instance_reset(Instance *instance);
Status instance_step(Instance *instance, const char *name, double time, double step);

/* Outputs at the start, from the parameters and inputs as they are now; nothing if they are current. */
Status instance_initialize(Instance *instance);

/* Before values are read: may they be, are there such variables, are the outputs current? The values then are
 * `state->values[reference]` and `state->texts[reference]`. */
Status instance_begin_get(Instance *instance, const char *name, Kind kind, const unsigned *references, size_t count);
/* Before and after values are written there; the second call judges what is tuned while the instance runs. */
Status instance_begin_set(Instance *instance, const char *name, Kind kind, const unsigned *references, size_t count);
Status instance_end_set(Instance *instance);
Status instance_set_text(Instance *instance, unsigned reference, const char *text); /* between them */

/* Refuses NULL where there must be so many of something. */
Status instance_given(Instance *instance, const char *name, const char *what, const void *address, size_t count);
Status instance_given_texts(Instance *instance, const char *name, const char *const *texts, size_t count);
static inline Status instance_given_values(Instance *instance, const char *name, const unsigned *references, size_t count,
                                           const void *values, size_t value_count)
{
    if ((references || !count) && (values || !value_count))
        return FINE;
    return references || !count ? instance_given(instance, name, "values", values, value_count)
                                : instance_given(instance, name, "value references", references, count);
}

/* Saved states; an existing one is used again. */
Status instance_save(Instance *instance, State **saved);
Status instance_restore(Instance *instance, const State *saved);
Status instance_state_size(Instance *instance, const State *saved, size_t *size);
Status instance_serialize(Instance *instance, const State *saved, unsigned char *bytes, size_t size);
Status instance_deserialize(Instance *instance, const unsigned char *bytes, size_t size, State **saved);

#endif
