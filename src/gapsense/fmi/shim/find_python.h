/* Brings Python into the process: finds its library, loads it, starts it. Part of shim.c. */
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

typedef struct PyObject PyObject; /* what is in it is Python's affair */
typedef struct {
    int type; /* 0: it went well */
    const char *function, *message;
    int exit_code;
} PyStatus;

enum { FILE_INPUT = 257 }; /* Py_file_input: a whole file */

static struct {
#define FUNCTION(type, name, parameters) type(*name) parameters;
#include "python_functions.h"
#undef FUNCTION
} py;

static int find(void *library, const char *name, void *slot)
{
    void *symbol = dlsym(library, name);
    memcpy(slot, &symbol, sizeof symbol); /* ISO C has no cast from an object to a function pointer */
    return symbol != NULL;
}

static int is_recent(const char *version)
{
    int major = 0, minor = 0;
    return sscanf(version, "%d.%d", &major, &minor) == 2 && (major > 3 || (major == 3 && minor >= OLDEST_PYTHON));
}

/* Extension modules expect Python's symbols in the global scope, so a library opened with RTLD_LOCAL is of no use. Only
 * to ask for the version: one that is too old would stay in the process and hide any other. */
static int open_globally(const char *libpython, int flags, Reason *why)
{
    const char *(*version)(void);
    void *library = dlopen(libpython, RTLD_LAZY | RTLD_LOCAL | flags);
    const char *error = library ? NULL : dlerror();
    if (!library) {
        explain(why, "%s", error ? error : libpython);
    } else if (!find(library, "Py_GetVersion", &version) || !is_recent(version())) {
        explain(why, "`%s` is not of Python 3.%d or newer", libpython, OLDEST_PYTHON);
        dlclose(library);
        library = NULL;
    }
    return library && dlopen(libpython, RTLD_NOW | RTLD_GLOBAL | flags);
}

/* Tries the usual names, newest first. With RTLD_NOLOAD: only what is in the process already, out of sight. */
static int open_by_name(int flags)
{
    Reason ignored;
    char name[32];
    for (int minor = NEWEST_PYTHON; minor >= OLDEST_PYTHON; minor--) {
        snprintf(name, sizeof name, "libpython3.%d.so.1.0", minor);
        if (open_globally(name, flags, &ignored))
            return 1;
    }
    return 0;
}

/* Asks the python3 on PATH, which is also where an active virtual environment and its packages are found. Isolated
 * (-I), so that no variable made for another Python spoils the answer. Two folders and two names, since LIBDIR is
 * wrong in relocated builds and INSTSONAME is empty in static ones. */
static int open_like_python3(void)
{
    static const char command[] =
        "python3 -I -c \"import os, sys, sysconfig; v = sysconfig.get_config_var;"
        " names = [v('INSTSONAME'), 'libpython%s.so.1.0' % v('LDVERSION')];"
        " paths = [os.path.join(d or '', n or '') for d in (v('LIBDIR'), sys.base_prefix + '/lib') for n in names];"
        " print(next((p for p in paths if '.so' in p and os.path.isfile(p)), ''))\" 2>/dev/null";
    Reason ignored;
    char path[PATH_MAX] = "";
    FILE *answer = popen(command, "re");
    if (!answer)
        return 0;
    if (!fgets(path, sizeof path, answer))
        path[0] = '\0';
    pclose(answer);
    path[strcspn(path, "\n")] = '\0';
    return path[0] && open_globally(path, 0, &ignored);
}

static int open_python(Reason *why)
{
    if (dlsym(RTLD_DEFAULT, "Py_IsInitialized") || open_by_name(RTLD_NOLOAD))
        return 1; /* the host is Python, or something in it uses Python, or libpython was preloaded */
    const char *given = getenv(LIBPYTHON_VARIABLE);
    if (given && *given) { /* said explicitly, so nothing else is tried */
        Reason cause;
        if (open_globally(given, 0, &cause))
            return 1;
        explain(why, "This FMU needs Python, and the library named by the environment variable " LIBPYTHON_VARIABLE
                     " cannot be used (%.*s). Set it to the full path of a libpython3.x.so.1.0, or unset it, and "
                     "start the tool again.",
                PATH_MAX, cause.text);
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
    const char *(*version)(void), *found = find(RTLD_DEFAULT, "Py_GetVersion", &version) ? version() : "of no version";
    const char *missing = NULL;
#define FUNCTION(type, name, parameters) missing = find(RTLD_DEFAULT, #name, &py.name) ? missing : #name;
#include "python_functions.h"
#undef FUNCTION
    if (!missing && is_recent(found))
        return 1;
    explain(why, "This FMU needs Python 3.%d or newer, and the Python in this process is %.*s%s%s. Set the environment "
                 "variable " LIBPYTHON_VARIABLE " to a newer library, unless the tool itself brings this one.",
            OLDEST_PYTHON, (int)strcspn(found, " "), found, missing ? ", without " : "", missing ? missing : "");
    return 0;
}

/* Isolated: neither PYTHONHOME and PYTHONPATH, which may be meant for another Python, nor the working folder decide
 * what is imported; the `python3` on PATH still tells where the packages of a virtual environment are. The signal
 * handlers, the locale and the streams stay the host's, and a Python that cannot start says why instead of ending the
 * process. Texts and file names are UTF-8 in FMI, whatever the locale. */
static PyStatus initialize(void)
{
    enum { UTF8_MODE = 7, ROOM = 1 << 16 }; /* PyPreConfig is 10 ints, the same in all versions; PyConfig is 0.5 kB */
    int before[64] = {0};
    void *config = calloc(1, ROOM);
    PyStatus status = {config ? 0 : 1, NULL, "memory is short", 0};
    if (!status.type) {
        py.PyPreConfig_InitIsolatedConfig(before);
        before[UTF8_MODE] = 1;
        status = py.Py_PreInitialize(before);
    }
    if (!status.type) {
        py.PyConfig_InitIsolatedConfig(config);
        status = py.Py_InitializeFromConfig(config);
        py.PyConfig_Clear(config);
    }
    free(config);
    return status;
}

/* Runs in a thread of its own: the thread that starts Python becomes its main thread and holds the GIL, and none of the
 * host's threads should. `threading` is imported here because it takes the importing thread for the main one. What
 * is printed must not wait for the end of Python, which never comes. */
static void *interpreter_thread(void *status)
{
    static const char first[] = "import sys, threading\nif sys.stdout: sys.stdout.reconfigure(line_buffering=True)\n";
    *(PyStatus *)status = initialize();
    if (py.Py_IsInitialized()) {
        PyObject *code = py.Py_CompileString(first, "first of all", FILE_INPUT);
        py.Py_DecRef(code ? py.PyImport_ExecCodeModule("_gapsense_first", code) : NULL);
        py.Py_DecRef(code);
        py.PyErr_Clear();
        py.PyEval_SaveThread();
    }
    return NULL;
}

/* An interpreter started here is never finalised. Finalising would wait for ever for the thread states that are kept,
 * and NumPy could not be imported again by the next FMU. */
static int start_python(Reason *why)
{
    pthread_t thread;
    PyStatus status = {1, NULL, "no thread could be started", 0};
    if (py.Py_IsInitialized())
        return 1;
    if (pthread_create(&thread, NULL, interpreter_thread, &status) == 0)
        pthread_join(thread, NULL);
    if (py.Py_IsInitialized())
        return 1;
    const char *version = py.Py_GetVersion();
    explain(why, "This FMU could not start Python %.*s: %s. Install it again with its standard library, or set the "
                 "environment variable " LIBPYTHON_VARIABLE " to the full path of another libpython3.x.so.1.0, and "
                 "start the tool again.",
            (int)strcspn(version, " "), version, status.message ? status.message : "it gives no reason");
    return 0;
}

/* To be called under the process-wide lock. */
static int ensure_python(Reason *why)
{
    return open_python(why) && bind_python(why) && start_python(why);
}
