/* Stands in front of pythonfmu's Linux binary ("the wrapper"), so that the FMU runs in any FMI 2.0 host.
 *
 * The wrapper alone loads only into a process that already has Python in it, and even there several faults end the
 * host. This library exports the FMI functions, brings Python into the process, opens the wrapper (a file beside it)
 * and passes each call on. It links to nothing but the C library. What is done beyond passing on:
 *
 *   Python       found, loaded and started if the host has none, and then never stopped (find_python.h)
 *   threads      their Python thread states are kept between calls (keep_thread_state)
 *   messages     reach the host as data, never as a printf format, and with a category (tell)
 *   resources    any file URI is understood, not only %20 (local_path)
 *   failures     an instance that answered fmi2Fatal is never touched again (leave)
 *   end          the wrapper is told before the process takes it apart (at_exit)
 *   memory       copies of one FMU, unpacked anew for each run, share one wrapper (open_shared)
 *
 * What stays in memory after dlclose is the wrapper, because neither Python nor extension modules such as NumPy can be
 * loaded a second time, and the copy of this library that opened it or that the wrapper may still call (pin). Rebuild
 * with `python -m gapsense.fmi.shim.build`.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <limits.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "fmi2Functions.h"

#define WRAPPER_FILE "pythonfmu-export.bin"

#include "find_python.h"

/* Lets `build --check` see, without a compiler, that the committed binary belongs to these sources. */
#ifndef SHIM_FINGERPRINT
#define SHIM_FINGERPRINT "unknown"
#endif
FMI2_Export const char gapsense_shim_fingerprint[] = "gapsense-shim:" SHIM_FINGERPRINT;

/* One lock for the whole process, not one per FMU: each FMU brings its own copy of this library, and two copies must
 * not start Python at the same time. The dynamic linker gives all copies the same address for a symbol of type
 * gnu_unique_object, even under RTLD_LOCAL. C has no syntax for that, hence assembler. All zero is unlocked. */
#define ONE_IN_THE_PROCESS(name)                         \
    __asm__(".pushsection .bss." #name ", \"aw\", %nobits\n" \
            ".balign 16\n"                               \
            ".globl " #name "\n"                         \
            ".type " #name ", %gnu_unique_object\n"      \
            ".size " #name ", 64\n"                      \
            #name ": .zero 64\n"                         \
            ".popsection\n")
ONE_IN_THE_PROCESS(gapsense_shim_lock);
ONE_IN_THE_PROCESS(gapsense_shim_wrappers);
extern pthread_mutex_t gapsense_shim_lock;
_Static_assert(sizeof(pthread_mutex_t) <= 64, "enlarge gapsense_shim_lock");

/* What the host gets as fmi2Component. Holding the flag here rather than in a list of dead instances needs no lock and
 * no search. A dead instance is never freed, so its address cannot come back as that of a new one. */
typedef struct {
    fmi2Component inner;           /* the wrapper's instance */
    fmi2CallbackFunctions host;    /* copied: some hosts pass a struct that does not live as long as the instance */
    fmi2CallbackFunctions relayed; /* what the wrapper gets, and keeps a pointer to */
    int quiet;                     /* pass on errors only */
    int dead;                      /* answered fmi2Fatal */
} Instance;

typedef struct {
    void *library; /* NULL until everything is loaded */
    fmi2InstantiateTYPE *fmi2Instantiate;
    fmi2FreeInstanceTYPE *fmi2FreeInstance;
    void (*finalize)(void);
#define CALL(name, parameters, arguments) name##TYPE *name;
#include "calls.h"
#undef CALL
} Wrapper;

static Wrapper wrapper;

/* A wrapper that one copy of this library has opened, for the other copies: those with the same key. What comes after
 * the key may differ from one version of this library to the next, so the key tells the version too. */
typedef struct Shared {
    struct Shared *next;
    char key[512]; /* fingerprint of this library, name of the FMU's module (which has a hash), size of the wrapper */
    Wrapper wrapper;
} Shared;
extern Shared *gapsense_shim_wrappers;

/* --- Loading the wrapper --- */

static char own_folder[PATH_MAX]; /* with a slash at the end */
static char own_path[PATH_MAX];   /* as the dynamic linker knows it */

/* Done while the library is being loaded: the path may be relative, and later the host may change its directory. */
__attribute__((constructor)) static void remember_own_folder(void)
{
    Dl_info self;
    char path[PATH_MAX];
    if (!dladdr(own_folder, &self) || !realpath(self.dli_fname, path))
        return;
    snprintf(own_path, sizeof own_path, "%s", self.dli_fname);
    char *slash = strrchr(path, '/');
    slash[1] = '\0';
    strcpy(own_folder, path);
}

/* Keeps this copy of the library in memory for good: its functions may be called after the host has closed it. */
static void pin(void)
{
    dlopen(own_path, RTLD_NOW | RTLD_LOCAL | RTLD_NOLOAD | RTLD_NODELETE);
}

/* Left to itself, the wrapper destroys a static object and then assigns to it: the heap is damaged at exit, visibly or
 * not. Registered after the wrapper was loaded, this runs before its destructors and leaves them nothing to do. */
static void at_exit(void)
{
    wrapper.finalize();
}

static int open_wrapper(Reason *why)
{
    char path[PATH_MAX + sizeof WRAPPER_FILE];
    snprintf(path, sizeof path, "%s" WRAPPER_FILE, own_folder);
    void *library = dlopen(path, RTLD_NOW | RTLD_LOCAL); /* local: each FMU's wrapper exports the same names */
    if (!library) {
        const char *error = dlerror();
        explain(why, "This FMU could not load pythonfmu's library (%s). Extract the whole FMU again; if the message "
                     "speaks of GLIBC or GLIBCXX, this system or the tool's own C++ library is too old.",
                     error ? error : path);
        return 0;
    }
    int ok = find(library, "fmi2Instantiate", &wrapper.fmi2Instantiate, why)
             && find(library, "fmi2FreeInstance", &wrapper.fmi2FreeInstance, why)
             && find(library, "finalizePythonInterpreter", &wrapper.finalize, why)
#define CALL(name, parameters, arguments) &&find(library, #name, &wrapper.name, why)
#include "calls.h"
#undef CALL
        ;
    if (!ok)
        return 0;
    pin();
    atexit(at_exit);
    wrapper.library = library;
    return 1;
}

static int make_key(const char *resources, char *key, size_t size)
{
    char path[PATH_MAX + sizeof WRAPPER_FILE + 32], module[256] = "";
    snprintf(path, sizeof path, "%s" WRAPPER_FILE, own_folder);
    struct stat about;
    if (stat(path, &about))
        return 0;
    snprintf(path, sizeof path, "%s/slavemodule.txt", resources);
    FILE *file = fopen(path, "re");
    if (!file)
        return 0;
    int found = fgets(module, sizeof module, file) != NULL;
    fclose(file);
    module[strcspn(module, "\n")] = '\0';
    int length = snprintf(key, size, "%s:%s:%lld", gapsense_shim_fingerprint, module, (long long)about.st_size);
    return found && (size_t)length < size;
}

/* Some hosts unpack an FMU anew for each run, and a wrapper takes 0.3 MB that are never given back. */
static int open_shared(const char *resources, Reason *why)
{
    Shared *shared = calloc(1, sizeof *shared);
    if (!shared || !make_key(resources, shared->key, sizeof shared->key)) {
        free(shared);
        return open_wrapper(why);
    }
    for (Shared *other = gapsense_shim_wrappers; other; other = other->next)
        if (strcmp(other->key, shared->key) == 0) {
            wrapper = other->wrapper;
            free(shared);
            return 1;
        }
    if (!open_wrapper(why)) {
        free(shared);
        return 0;
    }
    shared->wrapper = wrapper;
    shared->next = gapsense_shim_wrappers;
    gapsense_shim_wrappers = shared;
    return 1;
}

/* A failure is not remembered: the user may put it right and try again in the same process. */
static int load(const char *resources, Reason *why)
{
    pthread_mutex_lock(&gapsense_shim_lock);
    int ok = wrapper.library || (ensure_python(why) && open_shared(resources, why));
    pthread_mutex_unlock(&gapsense_shim_lock);
    return ok;
}

/* --- Resources --- */

static void percent_decode(char *text)
{
    char *out = text;
    for (const char *in = text; *in; in++) {
        unsigned code;
        char digits[3] = {in[0] == '%' ? in[1] : '\0', in[1] ? in[2] : '\0', '\0'};
        if (strspn(digits, "0123456789abcdefABCDEF") == 2 && sscanf(digits, "%x", &code) == 1 && code) {
            *out++ = (char)code;
            in += 2;
        } else {
            *out++ = *in;
        }
    }
    *out = '\0';
}

/* The wrapper only removes `file://` and turns %20 into a space, and crashes when the folder then does not exist.
 * Without a scheme, `location` is taken for a plain path, as some hosts pass one. */
static int local_path(const char *location, char *path, size_t size, Reason *why)
{
    const char *start = location ? location : "";
    int is_uri = strncmp(start, "file:", 5) == 0;
    if (is_uri)
        start += 5;
    if (is_uri && strncmp(start, "//", 2) == 0)
        start += 2 + strcspn(start + 2, "/"); /* the authority: empty or `localhost` */
    char file[PATH_MAX + 32];
    int fits = (size_t)snprintf(path, size, "%s", start) < size;
    if (is_uri)
        percent_decode(path);
    snprintf(file, sizeof file, "%s/slavemodule.txt", path);
    if (fits && access(file, R_OK) == 0 && !strstr(path, "%20"))
        return 1;
    explain(why, "This FMU does not find its resources: `%s` cannot be read (the tool gave the location `%s`). "
                 "Extract the FMU again, into a folder with a short and plain name without `%%20`.",
                 file, location ? location : "");
    return 0;
}

/* --- Messages --- */

/* `text` may hold anything, also `%n`, and the host reads it as a format: the percent signs are doubled. A host that
 * ignores the arguments after the format, and would lose the text behind a "%s", then still shows it. */
static void tell(const fmi2CallbackFunctions *host, fmi2String instance, fmi2Status status, fmi2String category,
                 fmi2String text)
{
    static const char *const categories[] = {"logAll", "logStatusWarning", "logStatusDiscard", "logStatusError",
                                             "logStatusFatal"};
    if (!host->logger)
        return;
    if (!category) /* exceptions come without one, and some hosts make a std::string of it */
        category = categories[status >= fmi2OK && status <= fmi2Fatal ? status : fmi2OK];
    char *format = malloc(2 * strlen(text) + 1), *end = format;
    if (!format)
        return;
    for (; *text; *end++ = *text++)
        if (*text == '%')
            *end++ = '%';
    *end = 0;
    host->logger(host->componentEnvironment, instance, status, category, format);
    free(format);
}

static void relay(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                  fmi2String text, ...)
{
    const Instance *instance = environment;
    if (!instance->quiet || status == fmi2Error || status == fmi2Fatal)
        tell(&instance->host, name, status, category, text ? text : "");
}

/* --- Calls --- */

/* From Python 3.11 on, entering Python from a foreign thread costs 6 to 10 us, because its thread state is made and
 * destroyed each time. Holding one reference from here on makes that 0.5 us. Not from the first call on: the state of a
 * thread that has ended stays in memory (17 kB), and some hosts start a new thread for every step. */
static void keep_thread_state(void)
{
    enum { WORTH_KEEPING = 32 };
    static __thread int calls;
    if (calls > WORTH_KEEPING || ++calls <= WORTH_KEEPING || python.this_thread())
        return;
    python.ensure();
    python.save_thread();
}

/* After a host has finalised its own Python, any call into it would crash. While it is finalising (destructors of the
 * host's objects), the thread that does so still has a thread state, and calls still work. */
static int python_is_alive(void)
{
    return python.is_initialized() || python.this_thread();
}

static Instance *enter(fmi2Component component)
{
    Instance *instance = component;
    if (!instance || instance->dead || !python_is_alive())
        return NULL;
    keep_thread_state();
    return instance;
}

/* After an exception the wrapper has released its Python objects, and would do so again at the next occasion, at the
 * latest in fmi2FreeInstance. So from here on this library answers alone, and the instance stays in memory. */
static fmi2Status leave(Instance *instance, fmi2Status status)
{
    if (status == fmi2Fatal && !instance->dead) {
        instance->dead = 1;
        pin();
    }
    return status;
}

#define CALL(name, parameters, arguments)               \
    FMI2_Export fmi2Status name parameters              \
    {                                                   \
        Instance *instance = enter(c);                  \
        if (!instance)                                  \
            return fmi2Fatal;                           \
        c = instance->inner;                            \
        return leave(instance, wrapper.name arguments); \
    }
#include "calls.h"
#undef CALL

FMI2_Export const char *fmi2GetVersion(void)
{
    return "2.0";
}

FMI2_Export const char *fmi2GetTypesPlatform(void)
{
    return fmi2TypesPlatform;
}

static Instance *new_instance(const fmi2CallbackFunctions *host)
{
    Instance *instance = calloc(1, sizeof *instance);
    if (!instance)
        return NULL;
    if (host)
        instance->host = *host;
    instance->relayed = instance->host;
    instance->relayed.logger = relay;
    instance->relayed.componentEnvironment = instance;
    return instance;
}

FMI2_Export fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String location,
                                          const fmi2CallbackFunctions *host, fmi2Boolean visible, fmi2Boolean logging)
{
    Reason why = {""};
    char resources[PATH_MAX];
    Instance *instance = new_instance(host);
    if (!instance)
        return NULL;
    name = name ? name : "";
    if (!local_path(location, resources, sizeof resources, &why) || !load(resources, &why)) {
        /* Also with logging off: the host gets no other sign. */
        tell(&instance->host, name, fmi2Fatal, "logStatusFatal", why.text);
        free(instance);
        return NULL;
    }
    keep_thread_state();
    instance->quiet = !logging; /* the reason of a failure, for example a missing package, is told in any case */
    instance->inner = wrapper.fmi2Instantiate(name, type, guid, resources, &instance->relayed, visible, fmi2True);
    instance->quiet = 0;
    if (!instance->inner) {
        pin();
        return NULL; /* `instance` is left in memory: parts of the failed one may still point to it */
    }
    if (!logging)
        wrapper.fmi2SetDebugLogging(instance->inner, fmi2False, 0, NULL);
    return instance;
}

FMI2_Export void fmi2FreeInstance(fmi2Component component)
{
    Instance *instance = enter(component);
    if (!instance)
        return;
    wrapper.fmi2FreeInstance(instance->inner);
    free(instance);
}
