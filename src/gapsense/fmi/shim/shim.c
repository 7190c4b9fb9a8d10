/* The Linux binary of a Python FMU: FMI 2.0 co-simulation for any host, around a slave written with pythonfmu.
 *
 * It takes the place of pythonfmu's own Linux binary, which loads only into a process that already has Python in it,
 * needs a new C++ library and ends the host in many ways. This one links to nothing but an old C library, brings Python
 * into the process itself and calls it through functions found there. In the order of the calls:
 *
 *   find_python.h  Python found, loaded and started if the host has none, and then never stopped
 *   resources.h    the folder with the slave's script, from any file URI
 *   messages.h     what the host is told, as data and never as a printf format
 *   lent.h         values of a running slave, with which the usual calls need next to no Python
 *   functions.h    exp, log and tanh for the kernel
 *   instance.h     an instance, the way into Python and out again, calls that fail
 *   values.h       getting and setting variables
 *   state.h        saving the state
 *   life.h         making, making anew and freeing instances
 *   loader.py      what is easier to say in Python: the slave's class, words of failures. The binary has its text in it
 *
 * A call that fails is told in one message, returns fmi2Error, and leaves an instance that can be reset; fmi2Fatal is
 * for a process that has no Python any more. But for functions.h nothing of this library is held by Python, so that a host may close it.
 * Rebuild with `python -m gapsense.fmi.shim.build`.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <limits.h>
#include <math.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "fmi2Functions.h"

/* Lets `build --check` see, without a compiler, that the committed binary belongs to these sources. */
#ifndef SHIM_FINGERPRINT
#define SHIM_FINGERPRINT "unknown"
#endif
FMI2_Export const char gapsense_shim_fingerprint[] = "gapsense-shim:" SHIM_FINGERPRINT;

#include "find_python.h"
#include "resources.h"
#include "messages.h"
#include "lent.h"
#include "functions.h"
#include "instance.h"
#include "values.h"
#include "state.h"
#include "life.h"

FMI2_Export const char *fmi2GetVersion(void)
{
    return "2.0";
}

FMI2_Export const char *fmi2GetTypesPlatform(void)
{
    return fmi2TypesPlatform;
}

static PyObject *if_given(fmi2Boolean is_given, fmi2Real value)
{
    return is_given ? py.PyFloat_FromDouble(value) : py.Py_BuildValue("");
}

FMI2_Export fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean has_tolerance, fmi2Real tolerance,
                                           fmi2Real start, fmi2Boolean has_stop, fmi2Real stop)
{
    Call call;
    if (!enter(&call, c))
        return fmi2Fatal;
    return leave_with(&call, py.PyObject_CallMethod(call.instance->slave, "setup_experiment", "(dNN)", start,
                                                    if_given(has_stop, stop), if_given(has_tolerance, tolerance)));
}

FMI2_Export fmi2Status fmi2EnterInitializationMode(fmi2Component c)
{
    return plain_call(c, "enter_initialization_mode");
}

FMI2_Export fmi2Status fmi2ExitInitializationMode(fmi2Component c)
{
    return plain_call(c, "exit_initialization_mode");
}

FMI2_Export fmi2Status fmi2Terminate(fmi2Component c)
{
    return plain_call(c, "terminate");
}

static fmi2Status slow_step(Call *call, fmi2Real time, fmi2Real step)
{
    static Method do_step = {"do_step", NULL};
    PyObject *done = call_slave(call->instance, &do_step, py.PyFloat_FromDouble(time), py.PyFloat_FromDouble(step));
    int is_complete = done && py.PyObject_IsTrue(done);
    py.Py_DecRef(done);
    return leave(call, is_complete ? fmi2OK : fmi2Discard);
}

/* The slave says what happened in a step that raised. */
static fmi2Status failed_step(Call *call, fmi2Real time, fmi2Real step)
{
    PyObject *error = caught(), *slave = call->instance->slave;
    give_back(&call->instance->lent, slave);
    return leave_with(call, py.PyObject_CallMethod(slave, "_fail", "(Ndd)", error, time, step));
}

FMI2_Export fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real step, fmi2Boolean no_rollback)
{
    (void)no_rollback;
    Call call;
    if (!enter_python(&call, c))
        return fmi2Fatal;
    Lent *lent = &call.instance->lent;
    PyObject *slave = call.instance->slave;
    if ((lent->is_lent || (call.instance->can_lend && borrow(lent, slave, time, step))) &&
        is_usual(lent, time, step) && step_kernel(lent, time, step))
        return leave(&call, fmi2OK);
    if (py.PyErr_Occurred() || !give_back(lent, slave))
        return failed_step(&call, time, step);
    return slow_step(&call, time, step);
}

/* --- What pythonfmu's slaves do not have --- */

static fmi2Status not_provided(fmi2Component c, const char *function)
{
    Call call;
    if (!enter(&call, c))
        return fmi2Fatal;
    return REFUSE(&call, "not_provided", "s", function);
}

FMI2_Export fmi2Status fmi2CancelStep(fmi2Component c)
{
    return not_provided(c, "fmi2CancelStep");
}

FMI2_Export fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknown[],
                                                    size_t n_unknown, const fmi2ValueReference known[], size_t n_known,
                                                    const fmi2Real d_known[], fmi2Real d_unknown[])
{
    (void)unknown, (void)n_unknown, (void)known, (void)n_known, (void)d_known, (void)d_unknown;
    return not_provided(c, "fmi2GetDirectionalDerivative");
}

FMI2_Export fmi2Status fmi2SetRealInputDerivatives(REFERENCES, const fmi2Integer order[], const fmi2Real value[])
{
    (void)vr, (void)nvr, (void)order, (void)value;
    return not_provided(c, "fmi2SetRealInputDerivatives");
}

FMI2_Export fmi2Status fmi2GetRealOutputDerivatives(REFERENCES, const fmi2Integer order[], fmi2Real value[])
{
    (void)vr, (void)nvr, (void)order, (void)value;
    return not_provided(c, "fmi2GetRealOutputDerivatives");
}

/* A step ends before fmi2DoStep returns, so there never is a status to ask for. */
#define STATUS(name, type)                                                          \
    FMI2_Export fmi2Status name(fmi2Component c, const fmi2StatusKind kind, type *value) \
    {                                                                               \
        (void)c, (void)kind, (void)value;                                           \
        return fmi2Discard;                                                         \
    }
STATUS(fmi2GetStatus, fmi2Status)
STATUS(fmi2GetRealStatus, fmi2Real)
STATUS(fmi2GetIntegerStatus, fmi2Integer)
STATUS(fmi2GetBooleanStatus, fmi2Boolean)
STATUS(fmi2GetStringStatus, fmi2String)
