/* Many base steps of a run in one call from Python; three calls through ctypes per component-step cost 3 us more.
 * The structures here are those of library.py; reference.py does the same in Python and must give the same bits. */
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <time.h>

#define EXPORT __attribute__((visibility("default")))

#ifndef LOOP_FINGERPRINT
#define LOOP_FINGERPRINT "unknown"
#endif
EXPORT const char gapsense_loop_fingerprint[] = "gapsense-loop:" LOOP_FINGERPRINT;

typedef int Exchange2(void *instance, const unsigned *references, size_t count, double *values);
typedef int Exchange3(void *instance, const unsigned *references, size_t count, double *values, size_t same_count);
typedef int DoStep2(void *instance, double time, double step, int keep);
typedef int DoStep3(void *instance, double time, double step, bool keep, bool *event, bool *ends, bool *early, double *last);

/* `factor` and `bias` count only if it converts: 1.0 * -0.0 + 0.0 is not -0.0. */
typedef struct {
    int target, source, converts;
    double factor, bias;
} Link;

/* One call that moves values between the buffer and an FMU. */
typedef struct {
    void *entry;
    const unsigned *references;
    size_t count;   /* of them; an array has one for all its elements */
    double *values; /* in the buffer */
    size_t value_count;
} Exchange;

typedef struct {
    int fmi; /* its version; 0 if not C but Python steps it */
    void *instance;
    Exchange inputs, outputs;
    void *do_step;
    double duration;
    const Link *links;
    size_t link_count;
    int follows; /* it takes inputs before each step */
    int64_t every, steps_at, takes_at; /* base steps: between two of its steps, of the next one, of the next inputs */
    int64_t calls, warnings;
    double seconds, counted, longest; /* in all, when a step was last counted, of one step */
    int64_t *spread; /* steps by how long they took, as in durations.py */
    int (*python_step)(double start);
    int (*python_take)(void);
} Part;

/* A condition on a value in the buffer, and whether it held when Python last looked. */
typedef struct {
    int place, is_above, is_on, holds;
    double level;
} Watch;

typedef struct {
    Part *parts;
    size_t part_count;
    double *buffer;
    double start, base_step; /* the time of base step k is start + k * base_step */
    int is_jacobi;
    int64_t decimation;
    const int64_t *columns; /* places in the buffer that are recorded */
    size_t column_count;
    double *data;
    int64_t rows;
    const int64_t *places; /* in the buffer, of the signals that are played */
    size_t place_count;
    const double *played; /* a row for each base step from `played_from` on */
    int64_t played_from;
    int64_t *marks; /* as in recording.py */
    double patience; /* seconds after which Python wants to look up */
    const Watch *watches;
    size_t watch_count;
    int64_t next; /* base step to be done */
    double clock; /* when somebody's time began to count */
    size_t part; /* the one that acts */
    double time; /* at which it does */
    int status; /* of the last call to an FMU */
    double last; /* time that the last step is said to have reached */
} Loop;

enum { PHASE, COMPONENT, STEP, ROWS, STOP }; /* marks */
enum { MASTER = 0 };
enum { WARNING = 1, ENDS = 1001, ENDS_WITHIN, ASTRAY }; /* as in instance.py */
enum { BINS = 512, FIRST_BIN = (1023 - 26) * 16 }; /* as in durations.py */
enum { DONE, AT_SET, AT_STEP, AT_GET, NOT_FINITE, IN_PYTHON };

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* Whoever reads it, in another process or after a crash, finds done what was done before. */
static void mark(Loop *l, int which, int64_t value)
{
    __atomic_store_n(l->marks + which, value, __ATOMIC_RELEASE);
}

static bool is_bad(Loop *l, int status)
{
    l->status = status;
    return status > WARNING;
}

static int move(const Part *p, const Exchange *e)
{
    if (p->fmi == 3)
        return ((Exchange3 *)e->entry)(p->instance, e->references, e->count, e->values, e->value_count);
    return ((Exchange2 *)e->entry)(p->instance, e->references, e->count, e->values);
}

/* What the time means that a step of FMI 3.0 has reached: as `reached` in instance.py. */
static int reached(double start, double duration, double last, bool ends, bool early)
{
    double end = start + duration, slack = 1e-2 * duration + 1e-15 * fabs(end);
    if (!(last >= start - slack && last <= end + slack))
        return ASTRAY;
    bool is_short = last < end - slack;
    if (ends)
        return is_short ? ENDS_WITHIN : ENDS;
    return early || is_short ? ASTRAY : 0;
}

static int do_step(Loop *l, Part *p, double start)
{
    bool event = false, ends = false, early = false;
    l->last = start + p->duration; /* where an FMU does not tell it */
    int status;
    if (p->fmi == 3)
        status = ((DoStep3 *)p->do_step)(p->instance, start, p->duration, true, &event, &ends, &early, &l->last);
    else
        status = ((DoStep2 *)p->do_step)(p->instance, start, p->duration, 1);
    p->warnings += status == WARNING;
    return status <= WARNING ? reached(start, p->duration, l->last, ends, early) : status;
}

static bool are_finite(const Exchange *e)
{
    for (size_t i = 0; i < e->value_count; i++)
        if (!isfinite(e->values[i]))
            return false;
    return true;
}

/* Copies connected outputs into the inputs and sets these. */
static int take(Loop *l, const Part *p)
{
    if (!p->fmi)
        return p->python_take() ? IN_PYTHON : DONE;
    for (const Link *link = p->links; link < p->links + p->link_count; link++) {
        double value = l->buffer[link->source];
        l->buffer[link->target] = link->converts ? link->factor * value + link->bias : value;
    }
    return p->inputs.count && is_bad(l, move(p, &p->inputs)) ? AT_SET : DONE;
}

static int step(Loop *l, Part *p)
{
    if (!p->fmi)
        return p->python_step(l->time) ? IN_PYTHON : DONE;
    int failed = p->follows ? take(l, p) : DONE;
    if (failed)
        return failed;
    if (is_bad(l, do_step(l, p, l->time)))
        return AT_STEP;
    if (p->outputs.count && is_bad(l, move(p, &p->outputs)))
        return AT_GET;
    return are_finite(&p->outputs) ? DONE : NOT_FINITE;
}

/* From now on part `i` acts, at the time of base step `k`. */
static void begin(Loop *l, size_t i, int64_t k)
{
    mark(l, COMPONENT, (int64_t)i + 1);
    l->part = i;
    l->time = l->start + (double)k * l->base_step;
}

/* The time since somebody's began to count was that of this part. */
static void end(Loop *l, Part *p)
{
    double then = l->clock;
    l->clock = now();
    p->seconds += l->clock - then;
}

/* Bin of a duration: its exponent and the first four bits of its mantissa. */
static size_t bin(double seconds)
{
    union { double value; uint64_t bits; } of = {seconds};
    int64_t k = (int64_t)(of.bits >> 48) - FIRST_BIN;
    return (size_t)(k < 0 ? 0 : k < BINS ? k : BINS - 1);
}

/* A step of this part has ended; with Jacobi its inputs took their time before. */
static void count(Part *p)
{
    double seconds = p->seconds - p->counted;
    p->counted = p->seconds;
    if (seconds > p->longest)
        p->longest = seconds;
    p->spread[bin(seconds)]++;
    p->calls++;
}

/* Lets every part step that is due, in order. */
static int all_step(Loop *l, int64_t k)
{
    for (size_t i = 0; i < l->part_count; i++) {
        Part *p = l->parts + i;
        if (p->steps_at != k)
            continue;
        begin(l, i, k - p->every);
        int failed = step(l, p);
        if (failed)
            return failed;
        p->steps_at = k + p->every;
        end(l, p);
        count(p);
    }
    return DONE;
}

/* Gives its inputs to every part that begins a step. */
static int all_take(Loop *l, int64_t k)
{
    for (size_t i = 0; i < l->part_count; i++) {
        Part *p = l->parts + i;
        if (p->takes_at != k)
            continue;
        begin(l, i, k);
        int failed = take(l, p);
        if (failed)
            return failed;
        p->takes_at = k + p->every;
        end(l, p);
    }
    return DONE;
}

static void play(Loop *l, int64_t k)
{
    const double *row = l->played + (k - l->played_from) * (int64_t)l->place_count;
    for (size_t i = 0; i < l->place_count; i++)
        l->buffer[l->places[i]] = row[i];
}

static void record(Loop *l)
{
    double *row = l->data + l->rows * (int64_t)l->column_count;
    for (size_t i = 0; i < l->column_count; i++)
        row[i] = l->buffer[l->columns[i]];
    l->rows++;
    mark(l, ROWS, l->rows);
}

static int base_step(Loop *l, int64_t k)
{
    mark(l, STEP, k);
    play(l, k);
    l->clock = now();
    int failed = all_step(l, k);
    if (!failed && l->is_jacobi)
        failed = all_take(l, k);
    if (failed)
        return failed;
    mark(l, COMPONENT, MASTER);
    if (k % l->decimation == 0)
        record(l);
    return DONE;
}

/* True if a condition begins or ends to hold; NaN is neither above nor below. */
static bool has_news(const Loop *l)
{
    for (const Watch *w = l->watches; w < l->watches + l->watch_count; w++) {
        double value = l->buffer[w->place];
        if (w->is_on && (w->is_above ? value > w->level : value < w->level) != w->holds)
            return true;
    }
    return false;
}

/* True if Python wants to do something before the next base step. */
static bool is_called(const Loop *l)
{
    return __atomic_load_n(l->marks + STOP, __ATOMIC_ACQUIRE) || has_news(l);
}

/* Does base steps up to `until`, at least one; fewer if told to stop, out of patience, or at news. What failed, or DONE. */
EXPORT int loop(Loop *l, int64_t until)
{
    double limit = now() + l->patience;
    do {
        int failed = base_step(l, l->next);
        if (failed)
            return failed;
        l->next++;
    } while (l->next <= until && l->clock < limit && !is_called(l));
    return DONE;
}
