/* The smallest Gauss-Seidel master there can be: what it needs is the time of the FMUs themselves. */
#define _POSIX_C_SOURCE 199309L
#include <stddef.h>
#include <string.h>
#include <time.h>

typedef int Exchange(void *instance, const unsigned *references, size_t count, double *values);
typedef int DoStep(void *instance, double time, double step, int keep);

typedef struct {
    void *instance;
    Exchange *set;
    DoStep *step;
    Exchange *get;
    const unsigned *inputs, *outputs; /* value references */
    size_t input_count, output_count;
    double *input_values, *output_values; /* their places in the common buffer */
    const int *links;                     /* pairs: target and source in the buffer */
    int link_count;
    int every, offset; /* base steps */
    double seconds[3]; /* spent in set, step and get */
} Part;

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec + 1e-9 * t.tv_nsec;
}

static int turn(Part *p, double *buffer, double start, double duration, int is_timed)
{
    for (int i = 0; i < p->link_count; i++)
        buffer[p->links[2 * i]] = buffer[p->links[2 * i + 1]];
    double t[4] = {0.0};
    int status = 0;
    if (is_timed) t[0] = now();
    if (p->input_count) status |= p->set(p->instance, p->inputs, p->input_count, p->input_values);
    if (is_timed) t[1] = now();
    status |= p->step(p->instance, start, duration, 1);
    if (is_timed) t[2] = now();
    if (p->output_count) status |= p->get(p->instance, p->outputs, p->output_count, p->output_values);
    if (is_timed) t[3] = now();
    for (int i = 0; i < 3; i++) p->seconds[i] += t[i + 1] - t[i];
    return status;
}

/* One component by itself on given inputs, row by row, and the seconds of each step.  0, or the status of the failure. */
int replay(Part *p, const double *rows, double start, double base, long count, double *steps)
{
    for (long k = 0; k < count; k++) {
        memcpy(p->input_values, rows + k * p->input_count, p->input_count * sizeof *rows);
        const double before = p->seconds[1];
        int status = turn(p, NULL, start + k * base, base, 1);
        if (status) return status;
        steps[k] = p->seconds[1] - before;
    }
    return 0;
}

/* Seconds of the whole loop, or a negative number after a failure. */
double run(Part *parts, int part_count, double *buffer, double start, double base, long count)
{
    double begin = now();
    for (long k = 1; k <= count; k++)
        for (Part *p = parts; p < parts + part_count; p++)
            if (k > p->offset && (k - p->offset) % p->every == 0
                && turn(p, buffer, start + (k - p->every) * base, p->every * base, 0))
                return -1.0;
    return now() - begin;
}
