/* FMI 3.0 in WebAssembly, over the functions of FMI 3.0 in C: what the shell of a component by the draft FMI-LS-WASM calls
 * (wasm/fmi3.wit), as the Component Model's canonical ABI passes it. What a call allocates lives until its end. */
#ifdef GAPSENSE_COMPONENT
#include <stdlib.h>
#include <string.h>

#include "files.h"
#include "fmi3_places.h"

#define INTERFACE "fmi:fmi3/co-simulation"
#define IMPORTED(interface, name) __attribute__((import_module(interface "@3.0.0"), import_name(name)))
/* An export, and what the shell calls when it has taken the answer. */
#define EXPORTED(Type, name, id, ...)                                                                                  \
    __attribute__((export_name("cabi_post_" name))) void after_##id(int answer)                                        \
    {                                                                                                                  \
        (void)answer;                                                                                                  \
        release();                                                                                                     \
    }                                                                                                                  \
    __attribute__((export_name(name))) Type call_##id(__VA_ARGS__)
#define METHOD(Type, name, id, ...) EXPORTED(Type, INTERFACE "@3.0.0#[method]co-simulation-instance." name, id, __VA_ARGS__)

/* --- what the ABI passes --- */

typedef struct {
    char *text;
    size_t size;
} String;

typedef struct {
    void *items;
    size_t count;
} List;

typedef struct {
    unsigned char failed;
    union {
        List list;
        unsigned char status;
    };
} ListOrStatus;

typedef struct {
    unsigned char failed;
    union {
        struct {
            double last;
            unsigned char event, ends, early;
        };
        unsigned char status;
    };
} StepOrStatus; /* or of another record with a number of 64 bits, of which there never is one */

typedef struct {
    unsigned char is_there;
    int handle;
} MaybeHandle;

typedef struct {
    fmi3Instance instance;
    char *name;
} Own; /* what a resource is */

typedef unsigned References[];

/* --- memory until the end of a call --- */

typedef union Block {
    union Block *next;
    double aligned[2];
} Block;

static Block *blocks;

static void *room(size_t size)
{
    Block *block = malloc(sizeof *block + size);
    if (!block)
        __builtin_trap();
    block->next = blocks;
    blocks = block;
    return block + 1;
}

static void release(void)
{
    while (blocks) {
        Block *next = blocks->next;
        free(blocks);
        blocks = next;
    }
}

__attribute__((export_name("cabi_realloc"))) void *cabi_realloc(void *old, size_t old_size, size_t alignment, size_t size)
{
    (void)alignment;
    void *made = room(size);
    return old ? memcpy(made, old, old_size < size ? old_size : size) : made;
}

/* With a zero at its end. */
static char *ended(const char *text, size_t size)
{
    char *copy = room(size + 1);
    if (size)
        memcpy(copy, text, size);
    copy[size] = 0;
    return copy;
}

static const char **texts(const String *strings, size_t count)
{
    const char **made = room(count * sizeof *made);
    for (size_t k = 0; k < count; k++)
        made[k] = ended(strings[k].text, strings[k].size);
    return made;
}

/* --- what the host provides --- */

IMPORTED("fmi:fmi3/callbacks", "log-message")
void log_message(const char *name, size_t name_size, int status, const char *category, size_t category_size,
                 const char *text, size_t size);
IMPORTED("fmi:fmi3/resource-dir-callbacks", "read-file") void read_file(const char *path, size_t size, ListOrStatus *content);
IMPORTED("[export]" INTERFACE, "[resource-new]co-simulation-instance") int resource_new(Own *own);

static void log_to_host(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category, fmi3String text)
{
    const char *name = ((Own *)environment)->name;
    log_message(name, strlen(name), (int)status, category, strlen(category), text, strlen(text));
}

static const char FOLDER[] = "resources/";

/* Content of a file, as `file_content` gives it. Only components with resources know this function, so that only they
 * import what it calls. */
char *resource_content(const char *path, size_t *size)
{
    ListOrStatus found = {0};
    if (strncmp(path, FOLDER, sizeof FOLDER - 1) != 0)
        return NULL; /* the host lends the FMU no other files */
    path += sizeof FOLDER - 1;
    read_file(path, strlen(path), &found);
    char *content = found.failed ? NULL : malloc(found.list.count + 1);
    if (!content)
        return NULL;
    *size = found.list.count;
    if (*size)
        memcpy(content, found.list.items, *size);
    content[*size] = 0;
    return content;
}

char *file_content(const char *path, size_t *size) { return model.content ? model.content(path, size) : NULL; }

int is_file(const char *path)
{
    size_t size;
    char *content = file_content(path, &size);
    free(content);
    return content != NULL;
}

/* --- birth and death --- */

EXPORTED(String *, "fmi:fmi3/common@3.0.0#get-version", version, void)
{
    static String answer;
    answer.text = (char *)fmi3GetVersion();
    answer.size = strlen(answer.text);
    return &answer;
}

static void own_free(Own *own)
{
    fmi3FreeInstance(own->instance);
    free(own->name);
    free(own);
}

static Own *own_new(const char *name, size_t size)
{
    Own *own = calloc(1, sizeof *own);
    char *copy = malloc(size + 1);
    if (!own || !copy)
        __builtin_trap();
    memcpy(copy, ended(name, size), size + 1);
    own->name = copy;
    return own;
}

EXPORTED(MaybeHandle *, INTERFACE "@3.0.0#[static]co-simulation-instance.instantiate-co-simulation", instantiate,
         const char *name, size_t name_size, const char *token, size_t token_size, int visible, int logging,
         int event_mode, int early_return, const References intermediate, size_t count)
{
    static MaybeHandle answer;
    Own *own = own_new(name, name_size);
    own->instance = fmi3InstantiateCoSimulation(own->name, ended(token, token_size), "resources", visible != 0, logging != 0,
                                                event_mode != 0, early_return != 0, intermediate, count, own, log_to_host,
                                                NULL);
    answer.is_there = own->instance != NULL;
    if (own->instance)
        answer.handle = resource_new(own);
    else
        own_free(own);
    return &answer;
}

__attribute__((export_name(INTERFACE "@3.0.0#[dtor]co-simulation-instance"))) void call_drop(Own *own) { own_free(own); }

/* --- life --- */

METHOD(int, "set-debug-logging", log, const Own *own, int on, const String *categories, size_t count)
{
    return fmi3SetDebugLogging(own->instance, on != 0, count, texts(categories, count));
}

METHOD(int, "enter-initialization-mode", initialize, const Own *own, int has_tolerance, double tolerance, double start,
       int has_stop, double stop)
{
    return fmi3EnterInitializationMode(own->instance, has_tolerance != 0, tolerance, start, has_stop != 0, stop);
}

#define PLAIN(name, Name)                                                                                              \
    METHOD(int, name, Name, const Own *own) { return fmi3##Name(own->instance); }

PLAIN("exit-initialization-mode", ExitInitializationMode)
PLAIN("enter-event-mode", EnterEventMode)
PLAIN("enter-step-mode", EnterStepMode)
PLAIN("evaluate-discrete-states", EvaluateDiscreteStates)
PLAIN("terminate", Terminate)
PLAIN("reset", Reset)
PLAIN("enter-configuration-mode", EnterConfigurationMode)
PLAIN("exit-configuration-mode", ExitConfigurationMode)

METHOD(StepOrStatus *, "do-step", step, const Own *own, double time, double step, int no_setting_of_past_states)
{
    static StepOrStatus answer;
    fmi3Boolean event, ends, early;
    double last;
    const fmi3Status status =
        fmi3DoStep(own->instance, time, step, no_setting_of_past_states != 0, &event, &ends, &early, &last);
    answer.failed = status != fmi3OK;
    if (answer.failed) {
        answer.status = (unsigned char)status;
    } else {
        answer.last = last;
        answer.event = event, answer.ends = ends, answer.early = early;
    }
    return &answer;
}

/* --- values --- */

static ListOrStatus *answered(fmi3Status status, void *items, size_t count)
{
    static ListOrStatus answer;
    answer.failed = status != fmi3OK;
    answer.list = (List){items, count};
    if (answer.failed)
        answer.status = (unsigned char)status;
    return &answer;
}

/* Of the values behind some references. */
static size_t total(const Own *own, const References references, size_t count)
{
    const Instance *i = own->instance;
    size_t sum = 0;
    for (size_t k = 0; k < count; k++) {
        const Place place = place_of(references[k]);
        sum += size_of(i->state, &place);
    }
    return sum;
}

#define VALUES(name, Name)                                                                                             \
    METHOD(ListOrStatus *, "get-" name, Get##Name, const Own *own, const References references, size_t count)          \
    {                                                                                                                  \
        const size_t size = total(own, references, count);                                                             \
        fmi3##Name *values = room(size * sizeof *values);                                                              \
        return answered(fmi3Get##Name(own->instance, references, count, values, size), values, size);                  \
    }                                                                                                                  \
    METHOD(int, "set-" name, Set##Name, const Own *own, const References references, size_t count,                     \
           const fmi3##Name values[], size_t size)                                                                     \
    {                                                                                                                  \
        return fmi3Set##Name(own->instance, references, count, values, size);                                          \
    }

VALUES("float32", Float32)
VALUES("float64", Float64)
VALUES("int8", Int8)
VALUES("int16", Int16)
VALUES("int32", Int32)
VALUES("int64", Int64)
VALUES("uint8", UInt8)
VALUES("uint16", UInt16)
VALUES("uint32", UInt32)
VALUES("uint64", UInt64)
VALUES("boolean", Boolean)

METHOD(ListOrStatus *, "get-string", GetString, const Own *own, const References references, size_t count)
{
    const char **found = room(count * sizeof *found);
    String *values = room(count * sizeof *values);
    const fmi3Status status = fmi3GetString(own->instance, references, count, found, count);
    for (size_t k = 0; status == fmi3OK && k < count; k++)
        values[k] = (String){(char *)found[k], strlen(found[k])};
    return answered(status, values, count);
}

METHOD(int, "set-string", SetString, const Own *own, const References references, size_t count, const String *values,
       size_t size)
{
    return fmi3SetString(own->instance, references, count, texts(values, size), size);
}

/* --- saved states --- */

METHOD(ListOrStatus *, "get-fmu-state", save, const Own *own)
{
    fmi3FMUState saved = NULL;
    size_t size = 0;
    unsigned char *bytes = NULL;
    fmi3Status status = fmi3GetFMUState(own->instance, &saved);
    if (status == fmi3OK)
        status = fmi3SerializedFMUStateSize(own->instance, saved, &size);
    if (status == fmi3OK) {
        bytes = room(size);
        status = fmi3SerializeFMUState(own->instance, saved, bytes, size);
    }
    fmi3FreeFMUState(own->instance, &saved);
    return answered(status, bytes, size);
}

METHOD(int, "set-fmu-state", restore, const Own *own, const unsigned char *bytes, size_t size)
{
    fmi3FMUState saved = NULL;
    fmi3Status status = fmi3DeserializeFMUState(own->instance, bytes, size, &saved);
    if (status == fmi3OK)
        status = fmi3SetFMUState(own->instance, saved);
    fmi3FreeFMUState(own->instance, &saved);
    return status;
}

/* --- what no component provides --- */

#pragma clang diagnostic ignored "-Wunused-parameter"

static fmi3Status lacking(const Own *own, const char *name)
{
    return (fmi3Status)report(own->instance, SAY_NOT_PROVIDED, name);
}

#define LACKS_LIST(name, Name, ...)                                                                                    \
    METHOD(ListOrStatus *, name, Name, const Own *own, __VA_ARGS__) { return answered(lacking(own, "fmi3" #Name), NULL, 0); }
#define LACKS_STATUS(name, Name, ...)                                                                                  \
    METHOD(int, name, Name, const Own *own, __VA_ARGS__) { return lacking(own, "fmi3" #Name); }
#define LIST const void *items, size_t count
#define LISTS LIST, const void *more, size_t more_count

LACKS_LIST("get-binary", GetBinary, LIST)
LACKS_LIST("get-clock", GetClock, LIST)
LACKS_LIST("get-variable-dependencies", GetVariableDependencies, unsigned reference)
LACKS_LIST("get-directional-derivative", GetDirectionalDerivative, LISTS, const double *seed, size_t seed_count)
LACKS_LIST("get-adjoint-derivative", GetAdjointDerivative, LISTS, const double *seed, size_t seed_count)
LACKS_LIST("get-interval-decimal", GetIntervalDecimal, LIST)
LACKS_LIST("get-interval-fraction", GetIntervalFraction, LIST)
LACKS_LIST("get-shift-decimal", GetShiftDecimal, LIST)
LACKS_LIST("get-shift-fraction", GetShiftFraction, LIST)
LACKS_LIST("get-output-derivatives", GetOutputDerivatives, LIST)
LACKS_STATUS("set-binary", SetBinary, LISTS)
LACKS_STATUS("set-clock", SetClock, LISTS)
LACKS_STATUS("set-interval-decimal", SetIntervalDecimal, LISTS)
LACKS_STATUS("set-interval-fraction", SetIntervalFraction, LISTS)
LACKS_STATUS("set-shift-decimal", SetShiftDecimal, LISTS)
LACKS_STATUS("set-shift-fraction", SetShiftFraction, LISTS)
LACKS_STATUS("set-input-derivatives", SetInputDerivatives, LISTS)

static StepOrStatus *lacking_wide(const Own *own, const char *name)
{
    static StepOrStatus answer;
    answer.failed = 1;
    answer.status = (unsigned char)lacking(own, name);
    return &answer;
}

METHOD(StepOrStatus *, "update-discrete-states", update, const Own *own)
{
    return lacking_wide(own, "fmi3UpdateDiscreteStates");
}

METHOD(StepOrStatus *, "get-number-of-variable-dependencies", dependencies, const Own *own, unsigned reference)
{
    return lacking_wide(own, "fmi3GetNumberOfVariableDependencies");
}
#else
typedef int not_a_component; /* C does not allow an empty file */
#endif
