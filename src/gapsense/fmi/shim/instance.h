/* One instance: its slave, an object of Python, and the way into Python and out again. Part of shim.c. */

typedef struct {
    fmi2CallbackFunctions host; /* copied: some hosts pass a struct that does not live as long as the instance */
    char *name;                 /* as the host wrote it */
    PyObject *make;             /* called, it gives a fresh slave */
    PyObject *slave;            /* derived from pythonfmu's Fmi2Slave */
    PyObject *queue;            /* the slave's log, a list */
    PyObject *wanted;           /* list of the categories that the host wants to hear of, or None for all */
    PyObject *texts;            /* what fmi2GetString gave last, which the host may still read */
    Lent lent;
    int can_lend; /* the slave is one of ours */
} Instance;

/* One call of the host. */
typedef struct {
    Instance *instance;
    int gil;
} Call;

static PyObject *loader; /* the module of loader.py, once loaded */

__asm__(".pushsection .rodata\n"
        "gapsense_shim_loader: .incbin \"loader.py\"\n"
        ".byte 0\n"
        ".popsection\n");
extern const char gapsense_shim_loader[] __attribute__((visibility("hidden")));

/* --- Into Python and out again --- */

/* From Python 3.11 on, entering Python from a foreign thread costs 6 to 10 us, because its thread state is made and
 * destroyed each time. Holding one reference from here on makes that 0.5 us. Not from the first call on: the state of a
 * thread that has ended stays in memory (17 kB), and some hosts start a new thread for every step. */
static void keep_thread_state(void)
{
    enum { WORTH_KEEPING = 32 };
    static __thread int calls;
    if (calls > WORTH_KEEPING || ++calls <= WORTH_KEEPING || py.PyGILState_GetThisThreadState())
        return;
    py.PyGILState_Ensure();
    py.PyEval_SaveThread();
}

/* After a host has finalised its own Python, any call into it would crash. While it is finalising (destructors of the
 * host's objects), the thread that does so still has a thread state, and calls still work. */
static int enter_python(Call *call, fmi2Component component)
{
    call->instance = component;
    if (!component || !(py.Py_IsInitialized() || py.PyGILState_GetThisThreadState()))
        return 0;
    keep_thread_state();
    call->gil = py.PyGILState_Ensure();
    return 1;
}

/* The first thing of every call but the most usual ones; the slave then has all its values. */
static int enter(Call *call, fmi2Component component)
{
    if (!enter_python(call, component))
        return 0;
    if (give_back(&call->instance->lent, call->instance->slave))
        return 1;
    py.PyErr_Clear();
    py.PyGILState_Release(call->gil);
    return 0;
}

/* The exception that is on its way, with its traceback; it is no longer on its way. */
static PyObject *caught(void)
{
    PyObject *type, *error, *traceback;
    py.PyErr_Fetch(&type, &error, &traceback);
    py.PyErr_NormalizeException(&type, &error, &traceback);
    if (traceback)
        py.PyException_SetTraceback(error, traceback);
    py.Py_DecRef(type);
    py.Py_DecRef(traceback);
    return error;
}

/* The last thing of every call. Whatever raised has failed it, and is told to the host in one message. */
static fmi2Status leave(Call *call, fmi2Status status)
{
    const Instance *instance = call->instance;
    Messages messages = {NULL, 0};
    if (py.PyErr_Occurred()) {
        status = fmi2Error;
        py.Py_DecRef(py.PyObject_CallMethod(loader, "log_failure", "(ON)", instance->slave, caught()));
    }
    if (py.PyList_Size(instance->queue) != 0) {
        PyObject *records = py.PyObject_CallMethod(loader, "take", "(OO)", instance->queue, instance->wanted);
        messages = copied(records);
        py.Py_DecRef(records);
    }
    py.PyErr_Clear();
    py.PyGILState_Release(call->gil);
    tell_all(&instance->host, instance->name, messages);
    return status;
}

/* Takes the reference to what Python gave, or NULL after an exception. */
static fmi2Status leave_with(Call *call, PyObject *result)
{
    py.Py_DecRef(result);
    return leave(call, fmi2OK);
}

/* Refuses a call in the words that the FMU has for `reason`; `format` and what follows are values for Py_BuildValue. */
#define REFUSE(call, reason, format, ...)                                                                      \
    leave_with(call, py.PyObject_CallMethod(loader, "refuse", "(Os" format ")", (call)->instance->slave, reason, \
                                            __VA_ARGS__))

static fmi2Status plain_call(fmi2Component c, const char *method)
{
    Call call;
    if (!enter(&call, c))
        return fmi2Fatal;
    return leave_with(&call, py.PyObject_CallMethod(call.instance->slave, method, NULL));
}

/* A method that is called often: its name becomes an object of Python once. */
typedef struct {
    const char *name;
    PyObject *object;
} Method;

/* Calls a method of the slave; takes the references to the arguments, of which the last may be NULL. */
static PyObject *call_slave(const Instance *instance, Method *method, PyObject *one, PyObject *two)
{
    const size_t may_write_before = (size_t)1 << (8 * sizeof(size_t) - 1); /* PY_VECTORCALL_ARGUMENTS_OFFSET */
    PyObject *room[4] = {NULL, instance->slave, one, two};
    if (!method->object)
        method->object = py.PyUnicode_InternFromString(method->name);
    PyObject *result = py.PyObject_VectorcallMethod(method->object, room + 1, (two ? 3 : 2) | may_write_before, NULL);
    py.Py_DecRef(one);
    py.Py_DecRef(two);
    return result;
}
