/* A scenario over a few runs at once, W in a block, as ../cosim/run/loop/loop.c does it for one run through FMUs: the same copies,
   the same order, the same bits. This stands behind lanes.h; library.py reads the structures from here.

   All numbers of a block are vectors in one array: the common buffer of inputs and outputs, and behind it for each
   component its inputs, its state, its parameters, and what its steps need of these. */
#include <stdbool.h>
#include <stdint.h>

#define EXPORT __attribute__((visibility("default")))

typedef void Function(V *v, const int *at, const double *k, const Block *block);

/* A function of a kernel, the places of all that it takes and makes, and the constants in its text. */
typedef struct {
    Function *function;
    const int *at;
    const double *k;
} Call;

/* `factor` and `bias` count only if it converts: 1.0 * -0.0 + 0.0 is not -0.0. */
typedef struct {
    int target, source, converts;
    double factor, bias;
} Link;

/* What an event does to a value on its way to an input: places of the value, of one that it holds instead, of the
   target; and of what differs between runs: whether it holds, whether it converts, and how. */
typedef struct {
    int before, held, after, holds, converts, factor, bias;
} Stage;

typedef struct {
    int place;
    double low, high;
} Range;

typedef struct {
    Call constants, initial, advance;
    const Link *links;
    ptrdiff_t link_count;
    const Stage *stages;
    ptrdiff_t stage_count;
    const Range *ranges; /* of its inputs */
    ptrdiff_t range_count;
    int survives; /* it takes inputs that are not finite */
    int follows;  /* it takes inputs before each step */
    int buffered, own; /* first place of its inputs in the buffer, and of those that it has taken */
    int input_count, output, output_count;
    int time, dt; /* places */
    double duration, period; /* of a step, and of the samples in it */
    const int *samples; /* of each step; none: one */
    int64_t every, offset;
} Part;

/* A condition; whether it is looked at, whether it held when Python last looked, and its level are places. */
typedef struct {
    int place, is_above, is_on, holds, level;
} Watch;

typedef struct {
    const Part *parts;
    ptrdiff_t part_count;
    double start, base_step; /* the time of base step k is start + k * base_step */
    int is_jacobi;
    int64_t decimation, rows; /* rows of a run in all */
    const int *columns; /* places that are recorded */
    ptrdiff_t column_count;
    const int *places; /* of the signals that are played */
    ptrdiff_t place_count;
    const Watch *watches;
    ptrdiff_t watch_count;
    int failed; /* place: whether the run is lost */
} Loop;

typedef struct {
    Block block;
    V *v;
    double *data; /* of all runs: (runs, columns, rows) */
    const double *played; /* a row for each base step from `played_from` on */
    int64_t played_from, next; /* base step to be done */
} Runs;

/* The runs of which one number is neither infinite nor NaN. */
static M is_finite(V x) { return x - x == (V){0}; }

static void lose(const Loop *l, Runs *r, M which) { r->v[l->failed] = choose(which, every(1.0), r->v[l->failed]); }

/* Loses the runs of which a value is not finite: their sum is not, and then each is looked at. */
static void refuse_non_finite(const Loop *l, Runs *r, int first, int count)
{
    V sum = {0};
    for (int i = first; i < first + count; i++) sum += r->v[i];
    if (!any(~is_finite(sum))) return;
    for (int i = first; i < first + count; i++) lose(l, r, ~is_finite(r->v[i]));
}

/* Copies connected outputs into the inputs of a part, and lets it have these. */
static void take(Runs *r, const Part *p)
{
    V *v = r->v;
    for (const Link *link = p->links; link < p->links + p->link_count; link++)
        v[link->target] = link->converts ? every(link->factor) * v[link->source] + every(link->bias) : v[link->source];
    for (const Stage *s = p->stages; s < p->stages + p->stage_count; s++) {
        V value = choose(v[s->holds] != (V){0}, v[s->held], v[s->before]);
        v[s->after] = choose(v[s->converts] != (V){0}, v[s->factor] * value + v[s->bias], value);
    }
    if (p->own != p->buffered)
        for (int i = 0; i < p->input_count; i++) v[p->own + i] = v[p->buffered + i];
}

static void call(const Loop *l, Runs *r, const Part *p, const Call *c, double time, double dt)
{
    r->v[p->time] = every(time);
    r->v[p->dt] = every(dt);
    if (!p->survives) refuse_non_finite(l, r, p->own, p->input_count);
    for (const Range *range = p->ranges; range < p->ranges + p->range_count; range++) {
        V x = r->v[range->place];
        lose(l, r, ~((x >= every(range->low)) & (x <= every(range->high))));
    }
    c->function(r->v, c->at, c->k, &r->block);
    refuse_non_finite(l, r, p->output, p->output_count);
}

/* The step of a part that ends at base step k, or its samples in it. */
static void step(const Loop *l, Runs *r, const Part *p, int64_t k)
{
    double end = l->start + (double)(k - p->every) * l->base_step + p->duration;
    int count = p->samples ? p->samples[(k - p->offset) / p->every - 1] : 1;
    for (int i = count - 1; i >= 0; i--)
        call(l, r, p, &p->advance, p->samples ? end - (double)i * p->period : end, p->period);
}

static void play(const Loop *l, Runs *r, int64_t k)
{
    const double *row = r->played + (k - r->played_from) * l->place_count;
    for (ptrdiff_t i = 0; i < l->place_count; i++) r->v[l->places[i]] = every(row[i]);
}

static void record(const Loop *l, Runs *r, int64_t k)
{
    for (int i = 0; i < r->block.count; i++) {
        double *data = r->data + (r->block.first + i) * l->column_count * l->rows + k / l->decimation;
        for (ptrdiff_t c = 0; c < l->column_count; c++) data[c * l->rows] = r->v[l->columns[c]][i];
    }
}

static bool has_news(const Loop *l, const Runs *r)
{
    const V *v = r->v;
    M news = NONE;
    for (const Watch *w = l->watches; w < l->watches + l->watch_count; w++) {
        M holds = w->is_above ? v[w->place] > v[w->level] : v[w->place] < v[w->level];
        news |= (v[w->is_on] != (V){0}) & (holds ^ (v[w->holds] != (V){0}));
    }
    return any(news & (v[l->failed] == (V){0}));
}

EXPORT int width(void) { return W; }

EXPORT void prepare(const Part *p, Runs *r) { p->constants.function(r->v, p->constants.at, p->constants.k, &r->block); }

/* Outputs of a part at the start, of the inputs that it has, or of those that it is to take. */
EXPORT void begin(const Loop *l, Runs *r, const Part *p, int takes)
{
    if (takes) take(r, p);
    call(l, r, p, &p->initial, l->start + (double)p->offset * l->base_step, 0.0);
}

EXPORT void play_first(const Loop *l, Runs *r) { play(l, r, 0); }

/* Does base steps up to `until`, fewer at news of a condition; the next one to do is in `r`. */
EXPORT void advance(const Loop *l, Runs *r, int64_t until)
{
    int64_t steps_at[l->part_count], takes_at[l->part_count];
    for (ptrdiff_t i = 0; i < l->part_count; i++) {
        const Part *p = l->parts + i;
        int64_t done = r->next - 1 - p->offset;
        steps_at[i] = p->offset + p->every * ((done > 0 ? done : 0) / p->every + 1);
        takes_at[i] = r->next <= p->offset ? p->offset : steps_at[i];
    }
    do {
        int64_t k = r->next++;
        play(l, r, k);
        for (ptrdiff_t i = 0; i < l->part_count; i++)
            if (steps_at[i] == k) {
                if (!l->is_jacobi && l->parts[i].follows) take(r, l->parts + i);
                step(l, r, l->parts + i, k);
                steps_at[i] += l->parts[i].every;
            }
        for (ptrdiff_t i = 0; l->is_jacobi && i < l->part_count; i++)
            if (takes_at[i] == k) {
                take(r, l->parts + i);
                takes_at[i] += l->parts[i].every;
            }
        if (k % l->decimation == 0) record(l, r, k);
    } while (r->next <= until && !has_news(l, r));
}

/* Values of an input: bytes from one run to the next, and from one sample to the next; 0 if they share it. */
typedef struct {
    const char *address;
    ptrdiff_t run, sample;
} Signal;

/* One component alone over some samples of each run; `first` is that of the block among all runs. The outputs that are
   `chosen` go to `data`: (runs, outputs, samples). */
EXPORT void filter(const Loop *l, Runs *r, const Part *p, const Signal *inputs, ptrdiff_t first, const int *chosen,
    ptrdiff_t chosen_count, int64_t samples)
{
    for (int64_t k = 0; k < samples; k++) {
        for (int i = 0; i < p->input_count; i++)
            for (int lane = 0; lane < W; lane++) {
                ptrdiff_t run = first + (lane < r->block.count ? lane : 0);
                r->v[p->own + i][lane] = *(const double *)(inputs[i].address + run * inputs[i].run + k * inputs[i].sample);
            }
        double time = k ? l->start + (double)(k - 1) * l->base_step + l->base_step : l->start;
        call(l, r, p, k ? &p->advance : &p->initial, time, k ? p->period : 0.0);
        for (int lane = 0; lane < r->block.count; lane++)
            for (ptrdiff_t c = 0; c < chosen_count; c++)
                r->data[((first + lane) * chosen_count + c) * samples + k] = r->v[chosen[c]][lane];
    }
}
