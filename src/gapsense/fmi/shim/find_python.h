/* Brings Python into the process: finds its library, loads it, starts it. Part of shim.c, which includes it once. */
#include <dlfcn.h>
#include <limits.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define LIBPYTHON_VARIABLE "GAPSENSE_LIBPYTHON"
#define OLDEST_PYTHON 9 /* minor versions of Python 3 that pythonfmu runs on (oldest) and that we look for (newest) */
#define NEWEST_PYTHON 16

typedef struct {
    char text[3 * PATH_MAX];
} Reason; /* why the FMU cannot run, for the user; truncated if need be */

__attribute__((format(printf, 2, 3))) static void explain(Reason *why, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(why->text, sizeof why->text, format, arguments);
    va_end(arguments);
}

static struct {
    int (*is_initialized)(void);
    const char *(*version)(void);
    void (*initialize)(int);
    int (*run)(const char *, void *);
    void *(*save_thread)(void);
    int (*ensure)(void);
    void *(*this_thread)(void);
} python;

static int find(void *library, const char *name, void *slot, Reason *why)
{
    void *symbol = dlsym(library, name);
    memcpy(slot, &symbol, sizeof symbol); /* ISO C has no cast from an object to a function pointer */
    if (!symbol && library == RTLD_DEFAULT)
        explain(why, "This FMU needs Python, and the library loaded as such has no `%s`. Set the environment "
                     "variable " LIBPYTHON_VARIABLE " to the full path of a libpython3.x.so.1.0, or unset it, and "
                     "start the tool again.",
                     name);
    else if (!symbol)
        explain(why, "This FMU was packaged wrongly: its `" WRAPPER_FILE "` has no `%s`. Build it again with pythonfmu "
                     "0.7.0.",
                     name);
    return symbol != NULL;
}

/* Extension modules expect Python's symbols in the global scope, so a library opened with RTLD_LOCAL is of no use. */
static int open_globally(const char *libpython, int flags)
{
    return dlopen(libpython, RTLD_NOW | RTLD_GLOBAL | flags) != NULL;
}

/* Tries the usual names, newest first. With RTLD_NOLOAD: only what is in the process already, out of sight. */
static int open_by_name(int flags)
{
    char name[32];
    for (int minor = NEWEST_PYTHON; minor >= OLDEST_PYTHON; minor--) {
        snprintf(name, sizeof name, "libpython3.%d.so.1.0", minor);
        if (open_globally(name, flags))
            return 1;
    }
    return 0;
}

/* Asks the python3 on PATH, which is also where an active virtual environment and its packages are found.
 * Two folders and two names, since LIBDIR is wrong in relocated builds and INSTSONAME is empty in static ones. */
static int open_like_python3(void)
{
    static const char command[] =
        "python3 -c \"import os, sys, sysconfig; v = sysconfig.get_config_var;"
        " names = [v('INSTSONAME'), 'libpython%s.so.1.0' % v('LDVERSION')];"
        " paths = [os.path.join(d or '', n or '') for d in (v('LIBDIR'), sys.base_prefix + '/lib') for n in names];"
        " print(next((p for p in paths if '.so' in p and os.path.isfile(p)), ''))\" 2>/dev/null";
    char path[PATH_MAX] = "";
    FILE *answer = popen(command, "re");
    if (!answer)
        return 0;
    if (!fgets(path, sizeof path, answer))
        path[0] = '\0';
    pclose(answer);
    path[strcspn(path, "\n")] = '\0';
    return path[0] && open_globally(path, 0);
}

static int open_python(Reason *why)
{
    if (dlsym(RTLD_DEFAULT, "Py_IsInitialized") || open_by_name(RTLD_NOLOAD))
        return 1; /* the host is Python, or something in it uses Python, or libpython was preloaded */
    const char *given = getenv(LIBPYTHON_VARIABLE);
    if (given && *given) { /* said explicitly, so nothing else is tried */
        if (open_globally(given, 0))
            return 1;
        const char *error = dlerror();
        explain(why, "This FMU needs Python, and the library named by the environment variable " LIBPYTHON_VARIABLE " "
                     "cannot be loaded (%s). Set it to the full path of a libpython3.x.so.1.0, or unset it, and "
                     "start the tool again.",
                     error ? error : given);
        return 0;
    }
    if (open_like_python3() || open_by_name(0))
        return 1;
    explain(why, "This FMU needs Python 3.%d or newer, and no shared Python library (libpython3.x.so.1.0) was found, "
                 "neither that of `python3` on PATH nor one installed in the system. Install one (Debian, Ubuntu: "
                 "`apt install libpython3-dev`), or set the environment variable " LIBPYTHON_VARIABLE " to its full "
                 "path, and start the tool again.",
                 OLDEST_PYTHON);
    return 0;
}

static int bind_python(Reason *why)
{
    return find(RTLD_DEFAULT, "Py_IsInitialized", &python.is_initialized, why)
           && find(RTLD_DEFAULT, "Py_GetVersion", &python.version, why)
           && find(RTLD_DEFAULT, "Py_InitializeEx", &python.initialize, why)
           && find(RTLD_DEFAULT, "PyRun_SimpleStringFlags", &python.run, why)
           && find(RTLD_DEFAULT, "PyEval_SaveThread", &python.save_thread, why)
           && find(RTLD_DEFAULT, "PyGILState_Ensure", &python.ensure, why)
           && find(RTLD_DEFAULT, "PyGILState_GetThisThreadState", &python.this_thread, why);
}

static int check_version(Reason *why)
{
    int major = 0, minor = 0;
    if (sscanf(python.version(), "%d.%d", &major, &minor) == 2 && major == 3 && minor >= OLDEST_PYTHON)
        return 1;
    explain(why, "This FMU needs Python 3.%d or newer and found %d.%d in this process. Set the environment variable "
                 LIBPYTHON_VARIABLE " to a newer library, unless the tool itself brings this one.",
                 OLDEST_PYTHON, major, minor);
    return 0;
}

/* Runs in a thread of its own: the thread that starts Python becomes its main thread and holds the GIL, and none of the
 * host's threads should. `threading` is imported here because it takes the importing thread for the main one. */
static void *interpreter_thread(void *unused)
{
    python.initialize(0); /* 0: the signal handlers stay the host's */
    python.run("import threading", NULL);
    python.save_thread();
    return unused;
}

/* An interpreter started here is never finalised. Finalising would wait for ever for the thread states that are kept,
 * and NumPy could not be imported again by the next FMU. The wrapper sees a running interpreter and leaves it alone. */
static int start_python(Reason *why)
{
    pthread_t thread;
    if (python.is_initialized())
        return 1;
    if (pthread_create(&thread, NULL, interpreter_thread, NULL) == 0) {
        pthread_join(thread, NULL);
        if (python.is_initialized())
            return 1;
    }
    explain(why, "This FMU could not start Python %s.", python.version());
    return 0;
}

/* To be called under the process-wide lock. */
static int ensure_python(Reason *why)
{
    return open_python(why) && bind_python(why) && check_version(why) && start_python(why);
}
