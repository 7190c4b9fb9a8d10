/* Many base steps of a run in one call from Python; three calls through ctypes per component-step cost 3 us more.
 * The structures here are those of compiled.py; reference.py does the same in Python and must give the same bits. */
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <time.h>

#define EXPORT __attribute__((visibility("default")))

#ifndef LOOP_FINGERPRINT
#define LOOP_FINGERPRINT "unknown"
#endif
EXPORT const char gapsense_loop_fingerprint[] = "gapsense-loop:" LOOP_FINGERPRINT;

typedef int Exchange2(void *instance, const unsigned *references, size_t count, double *values);
typedef int Exchange3(void *instance, const unsigned *references, size_t count, double *values, size_t same_count);
typedef int SetSlopes2(void *instance, const unsigned *references, size_t count, const int *orders, const double *slopes);
typedef int GetState(void *instance, void **state);
typedef int SetState(void *instance, void *state);
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

/* Inputs of a part of a loop that go in a straight line, as Ramp in turns.py. */
typedef struct {
    void *entry;
    const unsigned *references;
    size_t count;
    const int *orders;
    double *slopes;
    const int64_t *places, *are_late;
    double *values; /* the last ones, and the new ones */
    double before;  /* how long the last step was [s] */
} Ramp;

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
    int64_t number;           /* among all parts of the run, if this is one of a loop */
    double begins;            /* the step, or the piece of it that is due [s] */
    int64_t warned;           /* warnings before it */
    void *get_state, *set_state;
    void **held; /* state at the beginning of the step */
    Ramp *ramp;  /* if it has one */
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

/* A loop of parts that repeat a step until their values agree. Unknowns (n,), the inverse of their Jacobian (n, n). */
typedef struct {
    Loop *loop; /* with its parts only */
    const int64_t *unknowns; /* places in the buffer */
    size_t unknown_count;
    const double *nominals;
    double tolerance, parallel, rounding; /* as in iterate.py */
    int64_t patience, most; /* steps of secants, evaluations */
    double *inverse, *space; /* n (n + 7) numbers for what is computed */
    double *before; /* the buffer as it was */
    size_t size;
    int64_t count; /* evaluations */
    size_t begun; /* parts of which the state is held */
} Cycle;

enum { PHASE, COMPONENT, STEP, ROWS, STOP }; /* marks */
enum { MASTER = 0 };
enum { WARNING = 1, ENDS = 1001, ENDS_WITHIN, ASTRAY }; /* as in instance.py */
enum { BINS = 512, FIRST_BIN = (1023 - 26) * 16 }; /* as in durations.py */
enum { DONE, AT_SET, AT_STEP, AT_GET, NOT_FINITE, IN_PYTHON, AT_SLOPE, AT_HOLD, AT_BACK, UNSOLVED };

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

/* Slopes of inputs, and in the buffer what they begin with. */
static void rise(Loop *l, const Part *p)
{
    const Ramp *ramp = p->ramp;
    double *old = ramp->values, *new = old + ramp->count;
    for (size_t i = 0; i < ramp->count; i++) {
        new[i] = l->buffer[ramp->places[i]];
        double slope = (new[i] - old[i]) / (ramp->are_late[i] ? ramp->before : p->duration);
        bool has_line = isfinite(slope);
        ramp->slopes[i] = has_line ? slope : 0.0;
        l->buffer[ramp->places[i]] = has_line && !ramp->are_late[i] ? old[i] : new[i];
    }
}

/* Tells the slopes, and has in the buffer again what the inputs end with. */
static int tell_slopes(Loop *l, const Part *p)
{
    const Ramp *ramp = p->ramp;
    for (size_t i = 0; i < ramp->count; i++)
        l->buffer[ramp->places[i]] = ramp->values[ramp->count + i];
    if (!ramp->count)
        return DONE;
    int status = ((SetSlopes2 *)ramp->entry)(p->instance, ramp->references, ramp->count, ramp->orders, ramp->slopes);
    return is_bad(l, status) ? AT_SLOPE : DONE;
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
    if (p->ramp)
        rise(l, p);
    if (p->inputs.count && is_bad(l, move(p, &p->inputs)))
        return AT_SET;
    return p->ramp ? tell_slopes(l, p) : DONE;
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

/* What iterate.py does in a step of a loop, as far as secants solve it; what is more than that is done again there. */

static double dot(const double *a, const double *b, size_t n)
{
    double sum = 0.0;
    for (size_t i = 0; i < n; i++)
        sum += a[i] * b[i];
    return sum;
}

/* into = a + factor * b */
static void add(double *into, const double *a, const double *b, double factor, size_t n)
{
    for (size_t i = 0; i < n; i++)
        into[i] = a[i] + factor * b[i];
}

/* Keeps the state of a part, or brings it back to that. */
static int renew(Loop *l, Part *p, bool is_again)
{
    if (is_again)
        return is_bad(l, ((SetState *)p->set_state)(p->instance, *p->held)) ? AT_BACK : DONE;
    return is_bad(l, ((GetState *)p->get_state)(p->instance, p->held)) ? AT_HOLD : DONE;
}

/* Lets all parts step with these unknowns; what they then are off by, in units of their nominal values. */
static int evaluate(Cycle *c, const double *x, double *r)
{
    Loop *l = c->loop;
    if (c->count >= c->most)
        return UNSOLVED;
    for (size_t i = 0; i < c->unknown_count; i++)
        l->buffer[c->unknowns[i]] = x[i];
    for (size_t i = 0; i < l->part_count; i++) {
        Part *p = l->parts + i;
        mark(l, COMPONENT, p->number + 1);
        l->part = i;
        l->time = p->begins;
        int failed = renew(l, p, c->count > 0);
        if (failed)
            return failed;
        c->begun += c->count == 0;
        p->warnings = p->warned;
        failed = step(l, p);
        end(l, p);
        if (failed)
            return failed;
    }
    c->count++;
    for (size_t i = 0; i < c->unknown_count; i++)
        r[i] = (l->buffer[c->unknowns[i]] - x[i]) / c->nominals[i];
    return DONE;
}

static bool is_solved(const Cycle *c, const double *x, const double *r, const double *limits)
{
    for (size_t i = 0; i < c->unknown_count; i++)
        if (!(fabs(r[i]) <= limits[i] && fabs(x[i] / c->nominals[i]) * c->rounding <= limits[i]))
            return false;
    return true;
}

/* Knows from now on that r changes by dr where x changes by dx; `known` are `count` directions of dr. */
static void learn(Cycle *c, double *known, size_t *count, const double *dx, const double *dr)
{
    size_t n = c->unknown_count;
    if (*count >= n)
        *count = 0;
    double *one = known + *count * n;
    memcpy(one, dr, n * sizeof *one);
    for (const double *old = known; old < one; old += n)
        add(one, one, old, -dot(old, one, n) / dot(old, old, n), n);
    if (dot(one, one, n) <= c->parallel * dot(dr, dr, n)) {
        *count = 0;
        memcpy(one = known, dr, n * sizeof *one);
    }
    double size = dot(one, one, n);
    if (!(size > 0.0 && isfinite(size)))
        return;
    ++*count;
    for (size_t i = 0; i < n; i++) {
        double *row = c->inverse + i * n;
        add(row, row, one, (dx[i] - dot(row, dr, n)) / size, n);
    }
}

static int search(Cycle *c)
{
    size_t n = c->unknown_count, count = 0;
    double *x = c->space, *r = x + n, *next = r + n, *found = next + n, *dx = found + n, *dr = dx + n, *limits = dr + n;
    for (size_t i = 0; i < n; i++) {
        x[i] = c->loop->buffer[c->unknowns[i]];
        double value = fabs(x[i] / c->nominals[i]);
        limits[i] = c->tolerance * (value > 1.0 ? value : 1.0);
    }
    int failed = evaluate(c, x, r);
    for (int64_t since = 0; !failed && !is_solved(c, x, r, limits); since++) {
        if (since > c->patience)
            return UNSOLVED;
        for (size_t i = 0; i < n; i++)
            next[i] = x[i] + c->nominals[i] * -dot(c->inverse + i * n, r, n);
        failed = evaluate(c, next, found);
        if (failed)
            break;
        for (size_t i = 0; i < n; i++)
            dx[i] = (next[i] - x[i]) / c->nominals[i];
        add(dr, found, r, -1.0, n);
        learn(c, limits + n, &count, dx, dr);
        memcpy(x, next, n * sizeof *x);
        memcpy(r, found, n * sizeof *r);
    }
    return failed;
}

/* Lets a loop step until it is solved. What failed, or DONE; what failed leaves the buffer as it was. */
EXPORT int solve(Cycle *c)
{
    memcpy(c->before, c->loop->buffer, c->size * sizeof *c->before);
    c->count = 0;
    c->begun = 0;
    c->loop->clock = now();
    int failed = search(c);
    if (failed)
        memcpy(c->loop->buffer, c->before, c->size * sizeof *c->before);
    return failed;
}
