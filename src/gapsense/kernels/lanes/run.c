/* The calls of a plan, for all runs. */
#include <stdint.h>
#include <string.h>

typedef void Function(V *v, const int *at, const double *k, const Block *block);

/* A number of each run from a column: at = column, row, place. */
void take(V *v, const int *at, const double *k, const Block *block)
{
    const Column *c = &block->columns[at[0]];
    const double *first = number(c, at[1], 0, block);
    (void)k;
    if (c->run == 0)
        v[at[2]] = every(*first);
    else if (c->run == sizeof(double) && block->count == W)
        memcpy(&v[at[2]], first, sizeof(V));
    else
        v[at[2]] = element(c, NONE + at[1], block);
}

/* A number of each run into a column, in which runs are neighbours: at = column, row, place. */
void keep(V *v, const int *at, const double *k, const Block *block)
{
    (void)k;
    memcpy(number(&block->columns[at[0]], at[1], 0, block), &v[at[2]], sizeof(double) * (size_t)block->count);
}

int width(void) { return W; }

/* Runs `first` to `last`, W at a time. A call is the number of its function, how many places follow, and these.
   `memory` has room for the values, and for one more. */
void run(const int *calls, ptrdiff_t length, const Column *columns, Function *const *functions,
    const double *const *constants, double *memory, ptrdiff_t first, ptrdiff_t last)
{
    V *values = (V *)(((uintptr_t)memory + sizeof(V) - 1) / sizeof(V) * sizeof(V));
    for (Block block = {columns, first, W}; block.first < last; block.first += W) {
        if (last - block.first < W) block.count = (int)(last - block.first);
        for (const int *call = calls; call < calls + length; call += 2 + call[1])
            functions[call[0]](values, call + 2, constants[call[0]], &block);
    }
}
