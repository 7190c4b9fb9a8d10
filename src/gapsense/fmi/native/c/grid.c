/* What is made of the three columns of a grid. The order of the operations is that of `tables.py`. */
#include <stdlib.h>
#include <string.h>

#include "table.h"

typedef struct {
    const double *xs, *ys;
    int rows, width;
    double *room; /* for six lines */
} Grid;

int grid_width(const double *xs, int rows)
{
    int width = 0;
    for (int k = 0; k < rows; k++)
        width += xs[k] == xs[0];
    return width;
}

/* Second derivatives by y, of a function that is odd in y. */
static int bend(const Grid *g, const double *zs, double *to)
{
    const int n = g->width, all = 2 * n - 1;
    double *y = g->room, *z = y + all, *found = z + all;
    for (int first = 0; first < g->rows; first += n) {
        for (int k = 0; k < n; k++) {
            y[n - 1 - k] = -g->ys[first + k];
            z[n - 1 - k] = -zs[first + k];
        }
        memcpy(y + n - 1, g->ys + first, (size_t)n * sizeof *y);
        memcpy(z + n - 1, zs + first, (size_t)n * sizeof *z);
        if (!spline(y, z, all, found))
            return 0;
        memcpy(to + first, found + n - 1, (size_t)n * sizeof *to);
    }
    return 1;
}

/* Integral over y, in place of its second derivatives. */
static void integral(const Grid *g, const double *zs, double *bends)
{
    for (int first = 0; first < g->rows; first += g->width) {
        double before = bends[first];
        bends[first] = 0.0;
        for (int k = first + 1; k < first + g->width; k++) {
            const double width = g->ys[k] - g->ys[k - 1], b = bends[k];
            bends[k] = bends[k - 1] + width * ((zs[k - 1] + zs[k]) / 2.0 - width * width * (before + b) / 24.0);
            before = b;
        }
    }
}

/* Second derivatives by x, in place of the values. */
static int curve(const Grid *g, double *values)
{
    const int count = g->rows / g->width;
    double *x = g->room, *y = x + count, *found = y + count;
    for (int column = 0; column < g->width; column++) {
        for (int k = 0; k < count; k++) {
            x[k] = g->xs[k * g->width];
            y[k] = values[k * g->width + column];
        }
        if (!spline(x, y, count, found))
            return 0;
        for (int k = 0; k < count; k++)
            values[k * g->width + column] = found[k];
    }
    return 1;
}

static int make_column(const Grid *g, ColumnKind kind, const double *zs, double *to)
{
    const size_t size = (size_t)g->rows * sizeof *to;
    if (kind == AXIS) {
        for (int k = 0; k < g->rows; k++)
            to[k] = g->ys[k < g->width ? k : g->width - 1];
        return 1;
    }
    if (kind == CURRENT_CURVE)
        memcpy(to, zs, size);
    else if (!bend(g, zs, to))
        return 0;
    if (kind == ENERGY || kind == ENERGY_CURVE)
        integral(g, zs, to);
    return kind == BEND || kind == ENERGY || curve(g, to);
}

int grid(ColumnKind kind, const double *xs, const double *ys, const double *zs, int rows, double *to)
{
    Grid g = {xs, ys, rows, grid_width(xs, rows), malloc(6 * (size_t)rows * sizeof(double))};
    const int is_made = g.room && make_column(&g, kind, zs, to);
    free(g.room);
    return is_made;
}
