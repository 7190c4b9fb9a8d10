/* The bytes of a state: magic word, build, length and checksum, then what `state.h` lists, little-endian. */
#include <limits.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "arrays.h"
#include "sentences.h"
#include "state.h"
#include "values.h"

#define MAGIC "GAPSENSE"

enum { WORD = 8, BUILD = 32, HEAD = WORD + BUILD + 2 * WORD }; /* bytes */

static uint64_t checksum(const unsigned char *bytes, size_t size)
{
    uint64_t sum = 14695981039346656037u; /* FNV-1a */
    for (size_t k = 0; k < size; k++)
        sum = (sum ^ bytes[k]) * 1099511628211u;
    return sum;
}

static size_t numbers(const State *s)
{
    size_t count = (size_t)(s->kernel - s->block) + (size_t)model.state_count;
    for (int k = 0; k < model.memory_count; k++)
        count += (size_t)model.memory_sizes[k];
    return count + motion_size();
}

size_t state_size(const State *s)
{
    size_t size = HEAD + (4 + 4 + numbers(s)) * WORD;
    for (int k = 0; k < model.port_count; k++)
        size += s->texts[k] ? WORD + strlen(s->texts[k]) : 0;
    for (int k = 0; k < model.table_count; k++)
        size += WORD + (size_t)s->sizes[k] * WORD;
    for (int k = 0; k < model.port_count; k++)
        size += model.ports[k].head_count ? WORD + state_given(s, k) * WORD : 0;
    return size;
}

static unsigned char *put(unsigned char *to, const void *from, size_t size)
{
    memcpy(to, from, size);
    return to + size;
}

static unsigned char *put_word(unsigned char *to, uint64_t word) { return put(to, &word, WORD); }

static void put_content(const State *s, unsigned char *to)
{
    to = put_word(to, (uint64_t)s->phase);
    to = put_word(to, (uint64_t)(s->phase == INSTANTIATED && s->is_configuring));
    to = put_word(to, (uint64_t)s->is_timed);
    to = put_word(to, (uint64_t)s->is_due);
    const double times[] = {s->start_time, s->time, s->period, s->elapsed};
    to = put(to, times, sizeof times);
    to = put(to, s->block, numbers(s) * WORD);
    for (int k = 0; k < model.port_count; k++)
        if (s->texts[k]) {
            to = put_word(to, strlen(s->texts[k]));
            to = put(to, s->texts[k], strlen(s->texts[k]));
        }
    for (int k = 0; k < model.table_count; k++) {
        to = put_word(to, (uint64_t)s->sizes[k]);
        to = s->sizes[k] ? put(to, s->tables[k], (size_t)s->sizes[k] * WORD) : to;
    }
    for (int k = 0; k < model.port_count; k++)
        if (model.ports[k].head_count) {
            to = put_word(to, (uint64_t)s->rows[k]);
            to = s->rows[k] ? put(to, s->columns[k], state_given(s, k) * WORD) : to;
        }
}

void state_write(const State *s, unsigned char *bytes)
{
    const size_t size = state_size(s);
    unsigned char *to = put(bytes, MAGIC, WORD);
    to = put(to, model.build, BUILD);
    to = put_word(to, size);
    put_content(s, bytes + HEAD);
    put_word(to, checksum(bytes + HEAD, size - HEAD));
}

/* Where reading has come to; `left` bytes follow. */
typedef struct {
    const unsigned char *at;
    size_t left;
} Reader;

static int take(Reader *from, void *to, size_t size)
{
    if (from->left < size)
        return 0;
    if (size)
        memcpy(to, from->at, size);
    from->at += size;
    from->left -= size;
    return 1;
}

static int take_word(Reader *from, uint64_t most, uint64_t *word) { return take(from, word, WORD) && *word <= most; }

static int take_flags(Reader *from, State *s)
{
    uint64_t phase, is_configuring, is_timed, is_due;
    if (!take_word(from, FAILED, &phase) || !take_word(from, phase == INSTANTIATED, &is_configuring))
        return 0;
    if (!take_word(from, 1, &is_timed) || !take_word(from, 1, &is_due))
        return 0;
    s->phase = (Phase)phase;
    s->is_configuring = (int)is_configuring;
    s->is_timed = (int)is_timed;
    s->is_due = (int)is_due;
    return 1;
}

static int take_times(Reader *from, State *s)
{
    double times[4];
    if (!take(from, times, sizeof times))
        return 0;
    for (int k = 0; k < 4; k++)
        if (!(times[k] - times[k] == 0.0) || (k > 1 && times[k] < 0.0))
            return 0;
    s->start_time = times[0];
    s->time = times[1];
    s->period = times[2];
    s->elapsed = times[3];
    return 1;
}

static int take_texts(Reader *from, State *s)
{
    for (int k = 0; k < model.port_count; k++) {
        uint64_t length;
        if (!s->texts[k])
            continue;
        if (!take_word(from, from->left, &length) || length > from->left)
            return 0;
        char *text = realloc(s->texts[k], (size_t)length + 1);
        if (!text)
            return 0;
        s->texts[k] = text;
        take(from, text, (size_t)length);
        text[length] = 0;
        if (strlen(text) != length)
            return 0;
    }
    return 1;
}

static int take_tables(Reader *from, State *s)
{
    for (int k = 0; k < model.table_count; k++) {
        uint64_t size;
        if (!take_word(from, INT_MAX, &size) || size > from->left / WORD || size == 1)
            return 0;
        if (size && !(s->tables[k] = malloc((size_t)size * WORD)))
            return 0;
        take(from, s->tables[k], (size_t)size * WORD);
        s->sizes[k] = (int)size;
        for (int row = 0; row < s->sizes[k]; row++)
            if (!(s->tables[k][row] - s->tables[k][row] == 0.0))
                return 0;
    }
    return 1;
}

/* Arrays may hold anything before they are judged. */
static int take_columns(Reader *from, State *s)
{
    for (int k = 0; k < model.port_count; k++) {
        const size_t heads = (size_t)model.ports[k].head_count;
        uint64_t rows;
        if (!heads)
            continue;
        if (!take_word(from, INT_MAX, &rows) || rows > from->left / WORD / heads)
            return 0;
        if (rows && !(s->columns[k] = malloc(heads * (size_t)rows * WORD)))
            return 0;
        take(from, s->columns[k], heads * (size_t)rows * WORD);
        s->rows[k] = (int)rows;
    }
    return from->left == 0;
}

/* What is wrong with the content, or NULL. */
static const char *take_content(Reader *from, State *s)
{
    if (!take_flags(from, s))
        return "phase";
    if (!take_times(from, s))
        return "time";
    if (!take(from, s->block, numbers(s) * WORD))
        return "length";
    if (!take_texts(from, s))
        return "text";
    if (!take_tables(from, s) || !take_columns(from, s))
        return "table";
    if (!motion_is_sound(s))
        return "motion";
    return unsound(s);
}

static const char *damage(const unsigned char *bytes, size_t size)
{
    uint64_t said[2];
    if (size < HEAD || memcmp(bytes, MAGIC, WORD) != 0)
        return "checksum";
    memcpy(said, bytes + WORD + BUILD, sizeof said);
    return said[0] == size && said[1] == checksum(bytes + HEAD, size - HEAD) ? NULL : "checksum";
}

static int is_own(const unsigned char *bytes, Text *problem)
{
    char build[BUILD + 1] = {0};
    memcpy(build, bytes + WORD, BUILD);
    if (!strcmp(build, model.build))
        return 1;
    for (int k = 0; k < BUILD; k++) /* a message is UTF-8, whatever the bytes are */
        build[k] = build[k] > ' ' && build[k] < 127 ? build[k] : '?';
    text_add(problem, SAY_OTHER_BUILD, build, model.build);
    return 0;
}

State *state_read(const unsigned char *bytes, size_t size, Text *problem)
{
    const char *wrong = damage(bytes, size);
    if (!wrong && !is_own(bytes, problem))
        return NULL;
    State *s = wrong ? NULL : state_new();
    if (s) {
        Reader reader = {bytes + HEAD, size - HEAD};
        wrong = take_content(&reader, s);
        if (!wrong)
            return s;
    }
    if (wrong)
        text_add(problem, SAY_DAMAGED_STATE, wrong);
    else
        text_add(problem, SAY_NO_MEMORY);
    state_free(s);
    return NULL;
}
