/* What is made of two columns of a table. The order of the operations is that of `tables.py`. */
#include <stdlib.h>

#include "table.h"

void integrate(const double *xs, const double *ys, int rows, double *to)
{
    to[0] = 0.0;
    for (int k = 1; k < rows; k++)
        to[k] = to[k - 1] + (xs[k] - xs[k - 1]) * (ys[k - 1] + ys[k]) / 2.0;
}

/* A tridiagonal system for the second derivatives at the inner rows. */
typedef struct {
    int count;
    double *h, *lower, *main, *upper, *right;
} System;

static void set_up(System *s, const double *xs, const double *ys)
{
    const double *h = s->h;
    for (int k = 0; k <= s->count; k++)
        s->h[k] = xs[k + 1] - xs[k];
    for (int k = 0; k < s->count; k++) {
        s->lower[k] = h[k];
        s->main[k] = 2.0 * (h[k] + h[k + 1]);
        s->upper[k] = h[k + 1];
        s->right[k] = 6.0 * ((ys[k + 2] - ys[k + 1]) / h[k + 1] - (ys[k + 1] - ys[k]) / h[k]);
    }
    const int last = s->count;
    s->main[0] += h[0] * (h[0] + h[1]) / h[1]; /* the end values follow from their neighbours */
    s->upper[0] -= h[0] * h[0] / h[1];
    s->main[last - 1] += h[last] * (h[last] + h[last - 1]) / h[last - 1];
    s->lower[last - 1] -= h[last] * h[last] / h[last - 1];
}

static void solve(const System *s, double *inner)
{
    const int last = s->count - 1;
    for (int k = 1; k <= last; k++) {
        const double factor = s->lower[k] / s->main[k - 1];
        s->main[k] -= factor * s->upper[k - 1];
        s->right[k] -= factor * s->right[k - 1];
    }
    inner[last] = s->right[last] / s->main[last];
    for (int k = last - 1; k >= 0; k--)
        inner[k] = (s->right[k] - s->upper[k] * inner[k + 1]) / s->main[k];
}

int spline(const double *xs, const double *ys, int rows, double *to)
{
    double *room = malloc(5 * (size_t)rows * sizeof *room), *inner = to + 1;
    if (!room)
        return 0;
    System s = {rows - 2, room, room + rows, room + 2 * rows, room + 3 * rows, room + 4 * rows};
    const double *h = s.h;
    const int n = s.count;
    set_up(&s, xs, ys);
    solve(&s, inner);
    to[0] = inner[0] + (inner[0] - inner[1]) * h[0] / h[1];
    to[rows - 1] = inner[n - 1] + (inner[n - 1] - inner[n - 2]) * h[n] / h[n - 1];
    free(room);
    return 1;
}
