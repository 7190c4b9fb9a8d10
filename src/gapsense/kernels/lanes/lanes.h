/* W runs at once: a vector of doubles, and the operations of gapsense.kernels.emit.lanes on it.

   A vector is as wide as the registers of the processor that this is compiled for. All operations give each run the
   bits that C gives for one double. */
#include <math.h>
#include <stddef.h>
#ifdef __has_builtin /* immintrin.h takes longer to read than most functions to compile */
#define KNOWS(function) __has_builtin(function)
#else
#define KNOWS(function) 0
#endif
#if defined(__AVX512F__)
#define W 8
#elif defined(__AVX__)
#define W 4
#else
#define W 2
#endif
#define SMALL static inline __attribute__((always_inline, unused))
#define CALLED static __attribute__((noinline, unused)) /* else kernels take long to compile */

typedef double V __attribute__((vector_size(W * sizeof(double))));
typedef __INT64_TYPE__ M __attribute__((vector_size(W * sizeof(double)))); /* truth values, all bits or none; whole numbers */
#define NONE ((M){0})
#define ALL (~(M){0})

/* An array of some numbers for each run. */
typedef struct {
    char *address;
    ptrdiff_t row, run; /* bytes from one number to the next, and from one run to the next: 0 if runs share them */
    ptrdiff_t size;     /* how many numbers there are */
} Column;

/* The runs that are computed together, `first` and those after it. */
typedef struct {
    const Column *columns;
    ptrdiff_t first;
    int count; /* at most W; what is computed for more is not kept */
} Block;

SMALL V every(double x) { return x - (V){0}; }
SMALL V choose(M c, V a, V b) { return (V)((c & (M)a) | (~c & (M)b)); }
SMALL M choose_truth(M c, M a, M b) { return (c & a) | (~c & b); }
SMALL M whole(V x) { return __builtin_convertvector(x, M); }
SMALL V numbers(M x) { return __builtin_convertvector(x, V); }
SMALL V each_fabs(V x) { return (V)((M)x & ~(M)every(-0.0)); }

SMALL int any(M c)
{
#if defined(__AVX512DQ__) && KNOWS(__builtin_ia32_cvtq2mask512)
    return __builtin_ia32_cvtq2mask512(c) != 0;
#elif defined(__AVX__) && !defined(__AVX512F__) && KNOWS(__builtin_ia32_movmskpd256)
    return __builtin_ia32_movmskpd256((V)c) != 0;
#else
    int found = 0;
    for (int i = 0; i < W; i++) found |= c[i] != 0;
    return found;
#endif
}

#define ONE_BY_ONE(name)                               \
    SMALL V each_##name(V x)                           \
    {                                                  \
        V y;                                           \
        for (int i = 0; i < W; i++) y[i] = name(x[i]); \
        return y;                                      \
    }
ONE_BY_ONE(sqrt)
ONE_BY_ONE(floor)

/* As gapsense.kernels.emit.c has them for one double. */
SMALL V scaled(V x, V n) { return x * (V)((M)(n + (0x1.8p52 + 1023.0)) << 52); }
SMALL V exponent(V x) { return (V)((M)x >> 52 | (M)every(0x1p52)) - (0x1p52 + 1023.0); }
SMALL V mantissa(V x) { return (V)(((M)x & 0x000fffffffffffff) | (M)every(1.0)); }

/* Number `row` of a run; one that does not exist, asked for by a run that does not take this branch, is the nearest. */
SMALL double *number(const Column *c, ptrdiff_t row, int i, const Block *block)
{
    row = row < 0 ? 0 : row < c->size ? row : c->size - 1;
    return (double *)(c->address + row * c->row + (block->first + (i < block->count ? i : 0)) * c->run);
}

CALLED V element(const Column *c, M row, const Block *block)
{
    V found;
    for (int i = 0; i < W; i++) found[i] = *number(c, row[i], i, block);
    return found;
}

CALLED void put(const Column *c, M row, V x, M taken, const Block *block)
{
    for (int i = 0; i < block->count; i++)
        if (taken[i]) *number(c, row[i], i, block) = x[i];
}

/* Index k with table[k] < x <= table[k + 1], from 0 to the last but one: both ends extrapolate. */
CALLED M located(const Column *c, V x, const Block *block)
{
    M found;
    for (int i = 0; i < W; i++) {
        ptrdiff_t low = 0, high = c->size; /* the first number that is not below x */
        while (low < high) {
            const ptrdiff_t middle = (low + high) / 2;
            if (*number(c, middle, i, block) < x[i]) low = middle + 1; else high = middle;
        }
        low -= 1;
        found[i] = low < 0 ? 0 : low > c->size - 2 ? c->size - 2 : low;
    }
    return found;
}
