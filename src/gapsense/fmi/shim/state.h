/* Saving the state of an instance. Part of shim.c. */

/* What the host gets as fmi2FMUstate. The handle stays the same when a state is saved into it again. */
typedef struct {
    PyObject *saved;
} State;

/* Takes the reference to what was saved, or NULL after an exception, and puts it into the old or a new handle. */
static fmi2Status leave_with_state(Call *call, fmi2FMUstate *handle, PyObject *saved)
{
    State *state = saved ? *handle : NULL;
    if (saved && !state)
        *handle = state = calloc(1, sizeof *state);
    PyObject *old = state ? state->saved : saved;
    if (state)
        state->saved = saved;
    py.Py_DecRef(old);
    return leave(call, state ? fmi2OK : fmi2Error);
}

FMI2_Export fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *handle)
{
    Call call;
    if (!enter(&call, c))
        return fmi2Fatal;
    if (!handle)
        return REFUSE(&call, "no_address", "ss", __func__, "state");
    return leave_with_state(&call, handle, py.PyObject_CallMethod(call.instance->slave, "_get_fmu_state", NULL));
}

FMI2_Export fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size,
                                               fmi2FMUstate *handle)
{
    Call call;
    if (!enter(&call, c))
        return fmi2Fatal;
    if (!bytes)
        return REFUSE(&call, "no_address", "ss", __func__, "bytes");
    if (!handle)
        return REFUSE(&call, "no_address", "ss", __func__, "state");
    PyObject *copy = py.PyBytes_FromStringAndSize(bytes, (ssize_t)size);
    return leave_with_state(&call, handle,
                            py.PyObject_CallMethod(call.instance->slave, "_fmu_state_from_bytes", "(N)", copy));
}

FMI2_Export fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate handle)
{
    Call call;
    if (!enter(&call, c))
        return fmi2Fatal;
    PyObject *saved = handle ? ((State *)handle)->saved : NULL;
    call.instance->lent.declined = 0.0;
    if (!saved)
        return REFUSE(&call, "no_state", "", NULL);
    return leave_with(&call, py.PyObject_CallMethod(call.instance->slave, "_set_fmu_state", "(O)", saved));
}

FMI2_Export fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *handle)
{
    Call call;
    if (!enter(&call, c))
        return fmi2Fatal;
    if (handle && *handle) {
        py.Py_DecRef(((State *)*handle)->saved);
        free(*handle);
        *handle = NULL;
    }
    return leave(&call, fmi2OK);
}

static PyObject *serialized(const Call *call, fmi2FMUstate handle)
{
    return py.PyObject_CallMethod(call->instance->slave, "_fmu_state_to_bytes", "(O)", ((State *)handle)->saved);
}

FMI2_Export fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate handle, size_t *size)
{
    Call call;
    if (!enter(&call, c))
        return fmi2Fatal;
    if (!handle)
        return REFUSE(&call, "no_state", "", NULL);
    if (!size)
        return REFUSE(&call, "no_address", "ss", __func__, "size");
    PyObject *bytes = serialized(&call, handle);
    *size = bytes ? (size_t)py.PyBytes_Size(bytes) : 0;
    return leave_with(&call, bytes);
}

FMI2_Export fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate handle, fmi2Byte bytes[], size_t size)
{
    Call call;
    if (!enter(&call, c))
        return fmi2Fatal;
    if (!handle)
        return REFUSE(&call, "no_state", "", NULL);
    if (!bytes)
        return REFUSE(&call, "no_address", "ss", __func__, "bytes");
    PyObject *saved = serialized(&call, handle);
    const char *from = saved ? py.PyBytes_AsString(saved) : NULL;
    size_t needed = from ? (size_t)py.PyBytes_Size(saved) : 0;
    if (from && size < needed) {
        py.Py_DecRef(saved);
        return REFUSE(&call, "small_buffer", "nn", (ssize_t)needed, (ssize_t)size);
    }
    if (from)
        memcpy(bytes, from, needed);
    return leave_with(&call, saved);
}
