/* What a running slave lends, so that setting, stepping and getting need next to no Python. Part of shim.c.
 *
 * From a step on, inputs and outputs are doubles here, and a step is one call of the kernel. Whatever is not the usual
 * way is the slave's business, which then gets its values back first: `enter` in instance.h sees to that. */

typedef struct {
    PyObject *advance;           /* the kernel: state, inputs and constants give state and outputs */
    PyObject *state, *constants;
    double *signals;             /* inputs, then outputs; behind them room for new outputs, then the limits */
    ssize_t clock;               /* how many of time and step size the kernel takes before the inputs */
    ssize_t inputs, outputs;     /* how many */
    ssize_t limits;              /* of inputs, a least and a greatest value each; 0 if any will do */
    double period, end, shift;   /* see slave.py */
    int is_lent;                 /* the values here are those that count, not the slave's */
    double declined;             /* size of steps for which the slave lends nothing, as far as is known */
} Lent;

static void put(PyObject **slot, PyObject *object)
{
    PyObject *old = *slot;
    *slot = object;
    py.Py_DecRef(old);
}

static void put_borrowed(PyObject **slot, PyObject *object)
{
    py.Py_IncRef(object);
    put(slot, object);
}

static PyObject *boxed_real(const void *values, size_t k)
{
    return py.PyFloat_FromDouble(((const fmi2Real *)values)[k]);
}

static PyObject *list_of(size_t n, const void *values, PyObject *(*boxed)(const void *, size_t))
{
    PyObject *list = py.PyList_New((ssize_t)n);
    for (size_t k = 0; list && k < n; k++)
        py.PyList_SetItem(list, (ssize_t)k, boxed(values, k));
    return list;
}

static int take_doubles(PyObject *list, double *values, ssize_t n)
{
    for (ssize_t k = 0; k < n; k++) {
        PyObject *object = py.PyList_GetItem(list, k);
        values[k] = object ? py.PyFloat_AsDouble(object) : -1.0;
    }
    return !py.PyErr_Occurred();
}

/* The sizes are those of the slave's class, so that an instance needs this once. */
static int has_room(Lent *lent)
{
    size_t size = (size_t)(lent->inputs + 2 * lent->outputs + lent->limits) * sizeof(double);
    if (!lent->signals)
        lent->signals = malloc(size);
    return lent->signals != NULL;
}

/* Takes what the slave lends for steps like this one, nothing perhaps. False also after an exception. */
static int borrow(Lent *lent, PyObject *slave, double time, double step)
{
    PyObject *advance, *state, *constants, *signals, *limits;
    if (step == lent->declined)
        return 0;
    PyObject *loan = py.PyObject_CallMethod(slave, "lend", "(dd)", time, step);
    int is_given = loan && py.PyTuple_Size(loan) > 0 &&
                   py.PyArg_ParseTuple(loan, "OOOOOnnddd", &advance, &state, &constants, &signals, &limits,
                                       &lent->clock, &lent->inputs, &lent->period, &lent->end, &lent->shift);
    if (is_given) {
        lent->outputs = py.PyList_Size(signals) - lent->inputs;
        lent->limits = py.PyList_Size(limits);
        put_borrowed(&lent->advance, advance);
        put_borrowed(&lent->state, state);
        put_borrowed(&lent->constants, constants);
        lent->is_lent = has_room(lent) && take_doubles(signals, lent->signals, lent->inputs + lent->outputs) &&
                        take_doubles(limits, lent->signals + lent->inputs + 2 * lent->outputs, lent->limits);
    }
    lent->declined = is_given ? 0.0 : step;
    py.Py_DecRef(loan);
    return lent->is_lent;
}

static int put_attribute(PyObject *slave, const char *name, PyObject *value)
{
    int is_put = value && py.PyObject_SetAttrString(slave, name, value) == 0;
    py.Py_DecRef(value);
    return is_put;
}

/* No code of Python runs, so that only want of memory can make this fail. */
static int give_back(Lent *lent, PyObject *slave)
{
    if (!lent->is_lent)
        return 1;
    py.Py_IncRef(lent->state);
    lent->is_lent =
        !(put_attribute(slave, "state", lent->state) && put_attribute(slave, "end", py.PyFloat_FromDouble(lent->end)) &&
          put_attribute(slave, "signals",
                        list_of((size_t)(lent->inputs + lent->outputs), lent->signals, boxed_real)));
    return !lent->is_lent;
}

static int are_below(const fmi2ValueReference vr[], size_t nvr, ssize_t limit)
{
    for (size_t k = 0; k < nvr; k++)
        if (vr[k] >= limit)
            return 0;
    return 1;
}

/* False for whatever the slave may refuse, or does in another way. */
static int is_usual(const Lent *lent, double time, double step)
{
    const double *limits = lent->signals + lent->inputs + 2 * lent->outputs, gap = time - lent->end, end = time + step;
    const double shift = lent->shift * step;
    for (ssize_t k = 0; 2 * k < lent->limits; k++)
        if (!(limits[2 * k] <= lent->signals[k] && lent->signals[k] <= limits[2 * k + 1]))
            return 0;
    return step > 0.0 && end - end == 0.0 && -shift <= gap && gap <= shift && (!lent->period || step == lent->period);
}

/* The inputs as the kernel takes them. */
static PyObject *inputs_of(const Lent *lent, double end, double step)
{
    const double clock[2] = {end, step};
    PyObject *inputs = py.PyTuple_New(lent->clock + lent->inputs);
    for (ssize_t k = 0; inputs && k < lent->clock + lent->inputs; k++)
        py.PyTuple_SetItem(
            inputs, k, py.PyFloat_FromDouble(k < lent->clock ? clock[k] : lent->signals[k - lent->clock]));
    return inputs;
}

/* Takes state and outputs, if all outputs are finite; else nothing. */
static int take_result(Lent *lent, PyObject *result)
{
    PyObject *state = py.PyTuple_GetItem(result, 0), *outputs = py.PyTuple_GetItem(result, 1);
    double *now = lent->signals + lent->inputs, *next = now + lent->outputs, spread = 0.0;
    for (ssize_t k = 0; outputs && k < lent->outputs; k++) {
        PyObject *object = py.PyTuple_GetItem(outputs, k);
        next[k] = object ? py.PyFloat_AsDouble(object) : NAN;
        spread += next[k] - next[k];
    }
    if (!outputs || spread != 0.0 || py.PyErr_Occurred())
        return 0;
    put_borrowed(&lent->state, state);
    memcpy(now, next, (size_t)lent->outputs * sizeof *now);
    return 1;
}

/* A usual step. False after an exception, or if the slave has to look at it; then nothing has changed. */
static int step_kernel(Lent *lent, double time, double step)
{
    PyObject *inputs = inputs_of(lent, time + step, step);
    PyObject *result =
        inputs ? py.PyObject_CallFunctionObjArgs(lent->advance, lent->state, inputs, lent->constants, NULL) : NULL;
    int is_taken = result && take_result(lent, result);
    if (is_taken)
        lent->end = time + step;
    else if (result)
        py.PyErr_Clear(); /* a result of no use: the slave says so in its own words */
    py.Py_DecRef(result);
    py.Py_DecRef(inputs);
    return is_taken;
}
