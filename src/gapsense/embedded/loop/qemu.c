/* The line and the counter of a board that QEMU emulates; for a board of yours write this file again.

   The line is two files of the computer, opened through semihosting; for a program on this computer it is its input and
   output.  QEMU has no cycles: with -icount shift=5 each instruction takes 32 ns, which are 0.8 ticks of the timer at
   25 MHz, so instructions are counted, and on this computer nothing. */
#include <fcntl.h>
#include <stdint.h>
#include <unistd.h>

#include "loop.h"

const char *const gapsense_unit = "instructions";

static int line(int is_out)
{
#ifdef __arm__
    static int files[2];
    if (files[is_out] == 0) files[is_out] = is_out ? open("line.out", O_WRONLY) : open("line.in", O_RDONLY);
    return files[is_out];
#else
    return is_out;
#endif
}

int gapsense_get(void)
{
    static uint8_t kept[512];
    static int count, at;
    if (at >= count) {
        at = 0;
        count = (int)read(line(0), kept, sizeof kept);
    }
    return count > 0 ? kept[at++] : -1;
}

void gapsense_put(uint8_t byte)
{
    static uint8_t kept[512];
    static uint32_t count;
    kept[count++] = byte;
    if (byte != 0 && count < sizeof kept) return;
    for (uint32_t done = 0; done < count;) {
        const int now = (int)write(line(1), kept + done, count - done);
        if (now <= 0) break;
        done += (uint32_t)now;
    }
    count = 0;
}

uint32_t gapsense_count(void)
{
#ifdef __arm__
    volatile uint32_t *const systick = (volatile uint32_t *)0xE000E010; /* control, reload, value: counts down */
    static uint64_t ticks;
    static uint32_t last;
    if (systick[0] == 0) {
        systick[1] = 0xFFFFFFu;
        systick[2] = 0;
        systick[0] = 5;
    }
    const uint32_t now = systick[2];
    ticks += (last - now) & 0xFFFFFFu;
    last = now;
    return (uint32_t)(ticks * 5 / 4);
#else
    return 0;
#endif
}
