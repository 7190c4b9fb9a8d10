/* Part of kernel.c: whether that was compiled so that every operation is rounded once, in the order in which it is written. */
#include "model.h"

int kernel_is_exact(void)
{
    volatile double tenth = 0.1, three = 3.0, large = 6755399441055744.0, zero = 0.0;
    const double a = tenth, b = three, c = large, none = zero / zero;
    return a * b - 0.30000000000000004 == 0.0 /* not so if product and difference are one operation */
           && (a + c) - c == 0.0              /* nor if sums are reordered */
           && b / 10.0 == 0.3                 /* nor if a product stands for a quotient */
           && !(none == none);                /* nor if all is thought to be finite */
}
