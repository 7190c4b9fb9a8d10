/* Saved states of an instance. */
#include "instance.h"
#include "sentences.h"

Status instance_save(Instance *i, State **saved)
{
    const int is_new = !*saved;
    if (is_new)
        *saved = state_new();
    if (*saved && state_copy(*saved, i->state))
        return FINE;
    if (is_new) {
        state_free(*saved);
        *saved = NULL;
    }
    return refuse(i, SAY_NO_MEMORY);
}

Status instance_restore(Instance *i, const State *saved)
{
    if (!saved)
        return refuse(i, SAY_NO_STATE);
    return state_copy(i->state, saved) ? FINE : refuse(i, SAY_NO_MEMORY);
}

Status instance_state_size(Instance *i, const State *saved, size_t *size)
{
    if (!saved)
        return refuse(i, SAY_NO_STATE);
    *size = state_size(saved);
    return FINE;
}

Status instance_serialize(Instance *i, const State *saved, unsigned char *bytes, size_t size)
{
    if (!saved)
        return refuse(i, SAY_NO_STATE);
    if (size < state_size(saved))
        return refuse(i, SAY_SMALL_BUFFER, (unsigned)state_size(saved), (unsigned)size);
    state_write(saved, bytes);
    return FINE;
}

Status instance_deserialize(Instance *i, const unsigned char *bytes, size_t size, State **saved)
{
    Text problem = {NULL, 0, 0};
    State *s = state_read(bytes, size, &problem);
    if (!s) {
        refuse(i, "%s", text_of(&problem));
        text_free(&problem);
        return REFUSED;
    }
    state_free(*saved);
    *saved = s;
    return FINE;
}
