/* What a Cortex-M runs before main: the vector table, memory, the floating-point unit if there is one.
   Text that is printed, and the exit code, go to the debugger or to QEMU (semihosting of newlib); a board that is
   ALONE has neither. */
#include <stdint.h>
#include <stdlib.h>

extern uint32_t stack_top[], data_start[], data_end[], data_load[], bss_start[], bss_end[]; /* of link.ld */
extern void initialise_monitor_handles(void); /* of newlib */
extern int main(void);
void reset(void);
void fault(void);
void _init(void);
void _fini(void);

void _init(void) {}
void _fini(void) {}

void fault(void)
{
    _Exit(1);
}

void reset(void)
{
    const uint32_t *from = data_load;
#ifdef __ARM_FP
    *(volatile uint32_t *)0xE000ED88u |= 0xFu << 20; /* full access to the floating-point unit */
    __asm volatile("dsb\n isb");
#endif
    for (uint32_t *to = data_start; to < data_end; to++) *to = *from++;
    for (uint32_t *to = bss_start; to < bss_end; to++) *to = 0;
#ifndef ALONE
    initialise_monitor_handles();
#endif
    exit(main());
}

__attribute__((section(".vectors"), used)) const uintptr_t vectors[16] = {
    (uintptr_t)stack_top, (uintptr_t)reset, (uintptr_t)fault, (uintptr_t)fault,
    (uintptr_t)fault,     (uintptr_t)fault, (uintptr_t)fault, (uintptr_t)fault,
    (uintptr_t)fault,     (uintptr_t)fault, (uintptr_t)fault, (uintptr_t)fault,
    (uintptr_t)fault,     (uintptr_t)fault, (uintptr_t)fault, (uintptr_t)fault,
};
