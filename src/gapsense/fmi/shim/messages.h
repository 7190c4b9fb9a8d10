/* What the host is told. Part of shim.c. */

/* `text` may hold anything, also `%n`, and the host reads it as a format: the percent signs are doubled. A host that
 * ignores the arguments after the format, and would lose the text behind a "%s", then still shows it. */
static void tell(const fmi2CallbackFunctions *host, fmi2String instance, fmi2Status status, fmi2String category,
                 fmi2String text)
{
    if (!host->logger)
        return;
    char *format = malloc(2 * strlen(text) + 1), *end = format;
    if (!format)
        return;
    for (; *text; *end++ = *text++)
        if (*text == '%')
            *end++ = '%';
    *end = 0;
    host->logger(host->componentEnvironment, instance, status, category, format);
    free(format);
}

/* Messages as loader.py writes them: for each a digit for the status, category, zero, text, zero. */
typedef struct {
    char *records;
    size_t size;
} Messages;

/* Copies them, so that the host can be told without the GIL: it may wait for another thread that needs Python. */
static Messages copied(PyObject *bytes)
{
    Messages messages = {NULL, 0};
    const char *records = bytes ? py.PyBytes_AsString(bytes) : NULL;
    if (records)
        messages.size = (size_t)py.PyBytes_Size(bytes);
    if (messages.size && (messages.records = malloc(messages.size)))
        memcpy(messages.records, records, messages.size);
    return messages;
}

static void tell_all(const fmi2CallbackFunctions *host, fmi2String instance, Messages messages)
{
    const char *next = messages.records, *end = next ? next + messages.size : NULL;
    while (next < end) {
        const char *category = next + 1, *text = category + strlen(category) + 1;
        tell(host, instance, (fmi2Status)(*next - '0'), category, text);
        next = text + strlen(text) + 1;
    }
    free(messages.records);
}
