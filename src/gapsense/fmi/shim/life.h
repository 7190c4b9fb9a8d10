/* Making, making anew and freeing instances. Part of shim.c. */

/* One lock for the whole process, not one per FMU: each FMU brings its own copy of this library, and two copies must
 * not start Python at the same time. The dynamic linker gives all copies the same address for a symbol of type
 * gnu_unique_object, even under RTLD_LOCAL. C has no syntax for that, hence assembler. All zero is unlocked. */
__asm__(".pushsection .bss.gapsense_shim_lock, \"aw\", %nobits\n"
        ".balign 16\n"
        ".globl gapsense_shim_lock\n"
        ".type gapsense_shim_lock, %gnu_unique_object\n"
        ".size gapsense_shim_lock, 64\n"
        "gapsense_shim_lock: .zero 64\n"
        ".popsection\n");
extern pthread_mutex_t gapsense_shim_lock;
_Static_assert(sizeof(pthread_mutex_t) <= 64, "enlarge gapsense_shim_lock");

/* A failure is not remembered: the user may put it right and try again in the same process. */
static int load(Reason *why)
{
    pthread_mutex_lock(&gapsense_shim_lock);
    int ok = ensure_python(why);
    pthread_mutex_unlock(&gapsense_shim_lock);
    return ok;
}

/* All copies of this library with the same loader share its module: a host may unpack an FMU anew for each run. While
 * another thread still runs it, the module is there but not complete; then it is run twice, which does no harm. */
static int find_loader(void)
{
    static const char name[] = "_gapsense_loader_" SHIM_FINGERPRINT;
    if (loader)
        return 1;
    PyObject *key = py.PyUnicode_InternFromString(name), *found = py.PyImport_GetModule(key);
    if (!found || !py.PyObject_HasAttrString(found, "IS_COMPLETE")) {
        PyObject *code = py.Py_CompileString(gapsense_shim_loader, "loader.py in the binary of the FMU", FILE_INPUT);
        put(&found, code ? py.PyImport_ExecCodeModule(name, code) : NULL);
        py.Py_DecRef(code);
        if (found)
            lend_functions(found);
    }
    py.Py_DecRef(key);
    loader = found;
    return loader != NULL;
}

/* A slave in place of the one there may be; nothing changes when it cannot be made. */
static int make_slave(Instance *instance)
{
    PyObject *slave = py.PyObject_CallObject(instance->make, NULL);
    PyObject *queue = slave ? py.PyObject_CallMethod(slave, "_get_log_queue", NULL) : NULL;
    if (!queue || py.PyList_Size(queue) < 0) {
        py.Py_DecRef(queue);
        py.Py_DecRef(slave);
        return 0;
    }
    put(&instance->queue, queue);
    put(&instance->slave, slave);
    instance->lent.declined = 0.0;
    instance->can_lend = py.PyObject_HasAttrString(slave, "lend");
    return 1;
}

static void release(Instance *instance)
{
    PyObject **objects[] = {
        &instance->make,         &instance->queue,      &instance->slave,          &instance->wanted, &instance->texts,
        &instance->lent.advance, &instance->lent.state, &instance->lent.constants,
    };
    for (size_t k = 0; k < sizeof objects / sizeof *objects; k++)
        put(objects[k], NULL);
}

static void drop(Instance *instance)
{
    free(instance->name);
    free(instance->lent.signals);
    free(instance);
}

static Instance *new_instance(fmi2String name, const fmi2CallbackFunctions *host)
{
    Instance *instance = calloc(1, sizeof *instance);
    if (!instance)
        return NULL;
    if (host)
        instance->host = *host;
    instance->name = strdup(name ? name : "");
    return instance;
}

static void set_wanted(Instance *instance, fmi2Boolean on, size_t n, const fmi2String categories[])
{
    put(&instance->wanted, on && n == 0 ? py.Py_BuildValue("") : list_of(on ? n : 0, categories, boxed_string));
}

/* Like `leave`, when there is no slave. Told also with logging off: the host gets no other sign. */
static void give_up(Call *call)
{
    Instance *instance = call->instance;
    PyObject *error = caught(), *records = NULL;
    if (loader)
        records = py.PyObject_CallMethod(loader, "not_made", "(NO)", decoded(instance->name), error);
    Messages messages = copied(records);
    py.Py_DecRef(records);
    py.Py_DecRef(error);
    release(instance);
    py.PyErr_Clear();
    py.PyGILState_Release(call->gil);
    if (!messages.records)
        tell(&instance->host, instance->name, fmi2Error, "logStatusError",
             "This FMU cannot start, and Python cannot say why: its standard library is not whole.");
    tell_all(&instance->host, instance->name, messages);
    drop(instance);
}

FMI2_Export fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String location,
                                          const fmi2CallbackFunctions *host, fmi2Boolean visible, fmi2Boolean logging)
{
    Reason why;
    Call call;
    char resources[PATH_MAX];
    Instance *instance = new_instance(name, host);
    if (!instance)
        return NULL;
    explain(&why, "This FMU needs Python, which has ended in this process. Start the tool again.");
    if (!local_path(location, resources, sizeof resources, &why) || !load(&why) || !enter(&call, instance)) {
        tell(&instance->host, instance->name, fmi2Error, "logStatusError", why.text);
        drop(instance);
        return NULL;
    }
    set_wanted(instance, logging, 0, NULL);
    if (find_loader())
        instance->make = py.PyObject_CallMethod(
            loader, "maker", "(NNNii)", decoded(instance->name), py.PyUnicode_DecodeFSDefault(resources),
            guid ? decoded(guid) : py.Py_BuildValue(""), type == fmi2ModelExchange, visible);
    if (!instance->make || !make_slave(instance)) {
        give_up(&call);
        return NULL;
    }
    leave(&call, fmi2OK);
    return instance;
}

/* A fresh slave has no memory of the old one, whatever that has gone through. */
FMI2_Export fmi2Status fmi2Reset(fmi2Component c)
{
    Call call;
    if (!enter(&call, c))
        return fmi2Fatal;
    make_slave(call.instance);
    return leave(&call, fmi2OK);
}

FMI2_Export void fmi2FreeInstance(fmi2Component c)
{
    Call call;
    if (!c)
        return;
    if (enter_python(&call, c)) {
        release(call.instance);
        py.PyGILState_Release(call.gil);
    }
    drop(c);
}

FMI2_Export fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[])
{
    Call call;
    if (!enter(&call, c))
        return fmi2Fatal;
    const char *what = n && !categories ? "categories" : lacking_text(n, categories);
    if (what)
        return REFUSE(&call, "no_address", "ss", __func__, what);
    set_wanted(call.instance, on, n, categories);
    return leave(&call, fmi2OK);
}
