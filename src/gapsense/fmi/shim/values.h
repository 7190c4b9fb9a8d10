/* Getting and setting variables of the four kinds. Part of shim.c. */

/* Inputs and outputs that are lent need no Python, not even its lock. */
static const Lent *lent_by(fmi2Component c)
{
    const Instance *instance = c;
    return instance && instance->lent.is_lent ? &instance->lent : NULL;
}

#define REFERENCES fmi2Component c, const fmi2ValueReference vr[], size_t nvr

/* A kind: the slave's methods, and how its values become objects of Python and come back; 0 if they do not fit. */
typedef struct {
    Method get, set;
    PyObject *(*boxed)(const void *values, size_t k);
    int (*unboxed)(PyObject *object, void *values, size_t k);
} Kind;

/* Bytes that are not UTF-8 are themselves again when they come back, see `encode` in loader.py. */
static PyObject *decoded(fmi2String text)
{
    return py.PyUnicode_DecodeUTF8(text, (ssize_t)strlen(text), "surrogateescape");
}

static PyObject *boxed_integer(const void *values, size_t k)
{
    return py.PyLong_FromLong(((const fmi2Integer *)values)[k]);
}

static PyObject *boxed_boolean(const void *values, size_t k)
{
    return py.PyBool_FromLong(((const fmi2Boolean *)values)[k] != fmi2False);
}

static PyObject *boxed_string(const void *values, size_t k)
{
    return decoded(((const fmi2String *)values)[k]);
}

static int unboxed_real(PyObject *object, void *values, size_t k)
{
    fmi2Real value = py.PyFloat_AsDouble(object);
    ((fmi2Real *)values)[k] = value;
    return value != -1.0 || !py.PyErr_Occurred();
}

static int unboxed_integer(PyObject *object, void *values, size_t k)
{
    long value = py.PyLong_AsLong(object);
    ((fmi2Integer *)values)[k] = (fmi2Integer)value;
    return value != -1 || !py.PyErr_Occurred();
}

static int unboxed_boolean(PyObject *object, void *values, size_t k)
{
    int value = py.PyObject_IsTrue(object);
    ((fmi2Boolean *)values)[k] = value > 0;
    return value >= 0;
}

/* From bytes, which have to live on while the host reads them. */
static int unboxed_string(PyObject *object, void *values, size_t k)
{
    fmi2String value = py.PyBytes_AsString(object);
    ((fmi2String *)values)[k] = value;
    return value != NULL;
}

static Kind REAL = {{"get_real", NULL}, {"set_real", NULL}, boxed_real, unboxed_real};
static Kind INTEGER = {{"get_integer", NULL}, {"set_integer", NULL}, boxed_integer, unboxed_integer};
static Kind BOOLEAN = {{"get_boolean", NULL}, {"set_boolean", NULL}, boxed_boolean, unboxed_boolean};
static Kind STRING = {{"get_string", NULL}, {"set_string", NULL}, boxed_string, unboxed_string};

static PyObject *boxed_reference(const void *vr, size_t k)
{
    return py.PyLong_FromUnsignedLong(((const fmi2ValueReference *)vr)[k]);
}

/* What a call for variables lacks that must have an address, or NULL. */
static const char *lacking(const fmi2ValueReference vr[], size_t nvr, const void *values)
{
    return !nvr || (vr && values) ? NULL : vr ? "values" : "value references";
}

static const char *lacking_text(size_t n, const fmi2String texts[])
{
    for (size_t k = 0; k < n; k++)
        if (!texts[k])
            return "texts";
    return NULL;
}

static fmi2Status set(REFERENCES, Kind *kind, const char *function, const void *values)
{
    Call call;
    if (!enter(&call, c))
        return fmi2Fatal;
    const char *what = lacking(vr, nvr, values);
    if (!what && kind == &STRING)
        what = lacking_text(nvr, values);
    if (what)
        return REFUSE(&call, "no_address", "ss", function, what);
    return leave_with(&call, call_slave(call.instance, &kind->set, list_of(nvr, vr, boxed_reference),
                                        list_of(nvr, values, kind->boxed)));
}

static PyObject *gotten(Instance *instance, Kind *kind, const fmi2ValueReference vr[], size_t nvr)
{
    PyObject *found = call_slave(instance, &kind->get, list_of(nvr, vr, boxed_reference), NULL);
    if (kind != &STRING || !found)
        return found;
    PyObject *texts = py.PyObject_CallMethod(loader, "encode", "(N)", found);
    py.Py_DecRef(instance->texts);
    instance->texts = texts;
    py.Py_IncRef(texts);
    return texts;
}

static fmi2Status get(REFERENCES, Kind *kind, const char *function, void *values)
{
    Call call;
    if (!enter(&call, c))
        return fmi2Fatal;
    const char *what = lacking(vr, nvr, values);
    if (what)
        return REFUSE(&call, "no_address", "ss", function, what);
    PyObject *found = gotten(call.instance, kind, vr, nvr);
    for (size_t k = 0; found && k < nvr; k++) {
        PyObject *object = py.PyList_GetItem(found, (ssize_t)k);
        if (!object || !kind->unboxed(object, values, k))
            break; /* an exception says why */
    }
    return leave_with(&call, found);
}

FMI2_Export fmi2Status fmi2GetReal(REFERENCES, fmi2Real value[])
{
    const Lent *lent = lent_by(c);
    if (lent && !lacking(vr, nvr, value) && are_below(vr, nvr, lent->inputs + lent->outputs)) {
        for (size_t k = 0; k < nvr; k++)
            value[k] = lent->signals[vr[k]];
        return fmi2OK;
    }
    return get(c, vr, nvr, &REAL, __func__, value);
}

FMI2_Export fmi2Status fmi2GetInteger(REFERENCES, fmi2Integer value[])
{
    return get(c, vr, nvr, &INTEGER, __func__, value);
}

FMI2_Export fmi2Status fmi2GetBoolean(REFERENCES, fmi2Boolean value[])
{
    return get(c, vr, nvr, &BOOLEAN, __func__, value);
}

FMI2_Export fmi2Status fmi2GetString(REFERENCES, fmi2String value[])
{
    return get(c, vr, nvr, &STRING, __func__, value);
}

FMI2_Export fmi2Status fmi2SetReal(REFERENCES, const fmi2Real value[])
{
    const Lent *lent = lent_by(c);
    if (lent && !lacking(vr, nvr, value) && are_below(vr, nvr, lent->inputs)) {
        for (size_t k = 0; k < nvr; k++)
            lent->signals[vr[k]] = value[k];
        return fmi2OK;
    }
    return set(c, vr, nvr, &REAL, __func__, value);
}

FMI2_Export fmi2Status fmi2SetInteger(REFERENCES, const fmi2Integer value[])
{
    return set(c, vr, nvr, &INTEGER, __func__, value);
}

FMI2_Export fmi2Status fmi2SetBoolean(REFERENCES, const fmi2Boolean value[])
{
    return set(c, vr, nvr, &BOOLEAN, __func__, value);
}

FMI2_Export fmi2Status fmi2SetString(REFERENCES, const fmi2String value[])
{
    return set(c, vr, nvr, &STRING, __func__, value);
}
