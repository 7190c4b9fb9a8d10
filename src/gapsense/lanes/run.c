/* The calls of a plan, for all runs. FUNCTIONS, the names of all functions, are defined before. */
#include <stdint.h>

typedef void Function(V *v, const int *at, const double *k, const Block *block);

/* A number of each run from a column: at = column, row, place. */
static void take(V *v, const int *at, const double *k, const Block *block)
{
    const Column *c = &block->columns[at[0]];
    (void)k;
    for (int i = 0; i < W; i++) v[at[2]][i] = *number(c, at[1], i, block);
}

/* A number of each run into a column: at = column, row, place. */
static void keep(V *v, const int *at, const double *k, const Block *block)
{
    (void)k;
    put(&block->columns[at[0]], NONE + at[1], v[at[2]], ALL, block);
}

static Function *const functions[] = {take, keep, FUNCTIONS};

int width(void) { return W; }

/* Runs `first` to `last`, W at a time. A call is the number of its function, how many places follow, and these.
   `memory` has room for the values, and for one more. */
void run(const int *calls, ptrdiff_t length, const Column *columns, const double *const *constants, double *memory,
    ptrdiff_t first, ptrdiff_t last)
{
    V *values = (V *)(((uintptr_t)memory + sizeof(V) - 1) / sizeof(V) * sizeof(V));
    for (Block block = {columns, first, W}; block.first < last; block.first += W) {
        if (last - block.first < W) block.count = (int)(last - block.first);
        for (const int *call = calls; call < calls + length; call += 2 + call[1])
            functions[call[0]](values, call + 2, constants[call[0]], &block);
    }
}
