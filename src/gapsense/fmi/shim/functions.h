/* exp, log and tanh for a slave's kernel, which has the same in Python, ten times slower. Part of shim.c.
 *
 * Python holds these functions, so the library that it got them from stays loaded; it is one for the whole process, as
 * the loader is. */
#include "same.h"

typedef struct {
    const char *name;
    PyObject *(*call)(PyObject *self, PyObject *arguments);
    int flags;
    const char *text;
} Builtin; /* PyMethodDef */

enum { ARGUMENTS = 1, ONE_ARGUMENT = 8 }; /* METH_VARARGS, METH_O */

/* What is not finite is left to the function in Python, which knows the errors. */
#define IN_C(name)                                                                              \
    static PyObject *name##_in_c(PyObject *in_python, PyObject *x)                              \
    {                                                                                           \
        double value = py.PyFloat_AsDouble(x), result = same_##name(value);                     \
        if (value == -1.0 && py.PyErr_Occurred())                                               \
            return NULL;                                                                        \
        return result - result == 0.0 ? py.PyFloat_FromDouble(result)                           \
                                      : py.PyObject_CallFunctionObjArgs(in_python, x, NULL);    \
    }
IN_C(exp)
IN_C(log)
IN_C(tanh)

/* The function of this name in C, in place of one in Python. */
static PyObject *function_in_c(PyObject *self, PyObject *arguments)
{
    static Builtin methods[] = {
        {"exp", exp_in_c, ONE_ARGUMENT, NULL}, {"log", log_in_c, ONE_ARGUMENT, NULL}, {"tanh", tanh_in_c, ONE_ARGUMENT, NULL}};
    const char *name;
    PyObject *in_python;
    (void)self;
    if (!py.PyArg_ParseTuple(arguments, "sO", &name, &in_python))
        return NULL;
    for (size_t k = 0; k < sizeof methods / sizeof *methods; k++)
        if (!strcmp(name, methods[k].name))
            return py.PyCFunction_NewEx(&methods[k], in_python, NULL);
    return py.Py_BuildValue("O", in_python);
}

static void lend_functions(PyObject *module)
{
    static Builtin method = {"in_c", function_in_c, ARGUMENTS, NULL};
    Dl_info here;
    if (!dladdr((void *)&method, &here) || !dlopen(here.dli_fname, RTLD_LAZY | RTLD_NOLOAD | RTLD_NODELETE))
        return;
    PyObject *function = py.PyCFunction_NewEx(&method, NULL, NULL);
    if (function)
        py.PyObject_SetAttrString(module, "in_c", function);
    py.Py_DecRef(function);
}
