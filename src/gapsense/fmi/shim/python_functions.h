/* The functions of Python that are used: FUNCTION(type of the result, name, parameters).
 *
 * Included several times, each time with another meaning of FUNCTION. Declared here rather than by Python.h, so that
 * one binary serves Python 3.9 and all later ones. All belong to the stable ABI, besides those that start Python
 * (PyConfig, PyPreConfig: see find_python.h) and PyObject_VectorcallMethod, which is public since 3.9.
 */
FUNCTION(int, Py_IsInitialized, (void))
FUNCTION(const char *, Py_GetVersion, (void))
FUNCTION(void, PyPreConfig_InitIsolatedConfig, (int *))
FUNCTION(PyStatus, Py_PreInitialize, (const int *))
FUNCTION(void, PyConfig_InitIsolatedConfig, (void *))
FUNCTION(PyStatus, Py_InitializeFromConfig, (const void *))
FUNCTION(void, PyConfig_Clear, (void *))

FUNCTION(int, PyGILState_Ensure, (void))
FUNCTION(void, PyGILState_Release, (int))
FUNCTION(void *, PyGILState_GetThisThreadState, (void))
FUNCTION(void *, PyEval_SaveThread, (void))

FUNCTION(void, Py_IncRef, (PyObject *))
FUNCTION(void, Py_DecRef, (PyObject *)) /* takes NULL */
FUNCTION(PyObject *, PyErr_Occurred, (void))
FUNCTION(void, PyErr_Clear, (void))
FUNCTION(void, PyErr_Fetch, (PyObject **, PyObject **, PyObject **))
FUNCTION(void, PyErr_NormalizeException, (PyObject **, PyObject **, PyObject **))
FUNCTION(int, PyException_SetTraceback, (PyObject *, PyObject *))

FUNCTION(PyObject *, Py_CompileString, (const char *, const char *, int))
FUNCTION(PyObject *, PyImport_GetModule, (PyObject *))
FUNCTION(PyObject *, PyImport_ExecCodeModule, (const char *, PyObject *))
FUNCTION(PyObject *, PyObject_CallObject, (PyObject *, PyObject *))
FUNCTION(PyObject *, PyObject_CallFunctionObjArgs, (PyObject *, ...)) /* the last is NULL */
FUNCTION(int, PyObject_HasAttrString, (PyObject *, const char *))
FUNCTION(int, PyObject_SetAttrString, (PyObject *, const char *, PyObject *))
FUNCTION(PyObject *, PyObject_CallMethod, (PyObject *, const char *, const char *, ...))
FUNCTION(PyObject *, PyObject_VectorcallMethod, (PyObject *, PyObject *const *, size_t, PyObject *))
FUNCTION(int, PyObject_IsTrue, (PyObject *))
FUNCTION(PyObject *, Py_BuildValue, (const char *, ...))
FUNCTION(PyObject *, PyCFunction_NewEx, (void *, PyObject *, PyObject *))
FUNCTION(int, PyArg_ParseTuple, (PyObject *, const char *, ...))

FUNCTION(PyObject *, PyBool_FromLong, (long))
FUNCTION(PyObject *, PyLong_FromLong, (long))
FUNCTION(PyObject *, PyLong_FromUnsignedLong, (unsigned long))
FUNCTION(long, PyLong_AsLong, (PyObject *))
FUNCTION(PyObject *, PyFloat_FromDouble, (double))
FUNCTION(double, PyFloat_AsDouble, (PyObject *))
FUNCTION(PyObject *, PyUnicode_InternFromString, (const char *))
FUNCTION(PyObject *, PyUnicode_DecodeUTF8, (const char *, ssize_t, const char *))
FUNCTION(PyObject *, PyUnicode_DecodeFSDefault, (const char *))
FUNCTION(PyObject *, PyBytes_FromStringAndSize, (const char *, ssize_t))
FUNCTION(char *, PyBytes_AsString, (PyObject *))
FUNCTION(ssize_t, PyBytes_Size, (PyObject *))
FUNCTION(PyObject *, PyList_New, (ssize_t))
FUNCTION(ssize_t, PyList_Size, (PyObject *))
FUNCTION(PyObject *, PyList_GetItem, (PyObject *, ssize_t)) /* gives no reference; refuses what is no list */
FUNCTION(int, PyList_SetItem, (PyObject *, ssize_t, PyObject *))
FUNCTION(PyObject *, PyTuple_New, (ssize_t))
FUNCTION(ssize_t, PyTuple_Size, (PyObject *))
FUNCTION(PyObject *, PyTuple_GetItem, (PyObject *, ssize_t)) /* as of a list */
FUNCTION(int, PyTuple_SetItem, (PyObject *, ssize_t, PyObject *))
