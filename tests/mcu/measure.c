/* Counts the instructions of each step of a component on a Cortex-M under QEMU, and how deep its stack gets.
   `data.h` is made by board.py: the component's calls, its record, and what double gives on the same inputs. */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#include "data.h"

#define SYSTICK ((volatile uint32_t *)0xE000E010) /* control, reload, value: counts down */
#define LIMIT 0xFFFFFFu
enum { NOPS = 1000, PAINTED = 4096, ROUNDS = ROWS - 1 };
static const uint32_t PAINT = 0xC0FFEE11u;

static uint32_t now(void)
{
    return SYSTICK[2];
}

static uint32_t since(uint32_t before)
{
    return (before - now()) & LIMIT;
}

/* Ticks of the timer per thousand instructions. */
static double ticks_of_nops(void)
{
    const uint32_t before = now();
    __asm volatile(".rept 1000\n nop\n .endr");
    return (double)since(before);
}

static uint32_t *below_the_stack(void)
{
    uint32_t *sp;
    __asm volatile("mov %0, sp" : "=r"(sp));
    return sp - 16 - PAINTED;
}

static void paint(void)
{
    uint32_t *from = below_the_stack();
    for (int k = 0; k < PAINTED; k++) from[k] = PAINT;
}

static unsigned bytes_used(void)
{
    const uint32_t *from = below_the_stack();
    int k = 0;
    while (k < PAINTED && from[k] == PAINT) k++;
    return (unsigned)(4 * (PAINTED - k + 16));
}

static uint32_t timed_step(int row)
{
    uint32_t before;
    read_row(row);
    before = now();
    step();
    return since(before);
}

static uint32_t ticks[ROWS];
static double worst[OUTPUTS], largest[OUTPUTS];

static void compare(int row)
{
    for (int k = 0; k < OUTPUTS; k++) {
        const double expected = EXPECTED[row][k], error = output(k) - expected;
        if (error > worst[k]) worst[k] = error;
        if (-error > worst[k]) worst[k] = -error;
        if (expected > largest[k]) largest[k] = expected;
        if (-expected > largest[k]) largest[k] = -expected;
    }
}

static void run(void)
{
    read_row(0);
    start();
    compare(0);
    for (int row = 1; row < ROWS; row++) {
        ticks[row] = timed_step(row);
        compare(row);
    }
}

static int by_size(const void *a, const void *b)
{
    const uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;
    return (x > y) - (x < y);
}

int main(void)
{
    double per, sum = 0.0, most = 0.0, empty;
    uint32_t before;
    SYSTICK[1] = LIMIT;
    SYSTICK[2] = 0;
    SYSTICK[0] = 5;
    per = ticks_of_nops() / NOPS;
    before = now();
    empty = (double)since(before);
    paint();
    run();
    printf("stack %u\n", bytes_used());
    for (int row = 1; row < ROWS; row++) {
        const double count = ((double)ticks[row] - empty) / per;
        sum += count;
        if (count > most) most = count;
    }
    qsort(ticks + 1, ROUNDS, sizeof ticks[0], by_size);
    printf("median %.1f\n", ((double)ticks[1 + ROUNDS / 2] - empty) / per);
    printf("mean %.1f\nmost %.1f\nmemory %u\n", sum / ROUNDS, most, (unsigned)MEMORY);
    for (int k = 0; k < OUTPUTS; k++) printf("output %s %.9g %.9g\n", NAMES[k], worst[k], largest[k]);
    return 0;
}
