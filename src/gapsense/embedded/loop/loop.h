/* A board in the loop: what its components are, and what the board itself has to do.  See loop.c for the protocol.
   Exported by Gapsense; do not edit it. */
#ifndef GAPSENSE_LOOP_H
#define GAPSENSE_LOOP_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Three functions and a word that the program for a board provides. */
int gapsense_get(void);                /* waits for the next byte; negative: the line is closed, and the loop ends */
void gapsense_put(uint8_t byte);       /* sends a byte; 0 ends a message, so what is kept back goes out now */
uint32_t gapsense_count(void);         /* a counter that rises, and begins again at 2^32 */
extern const char *const gapsense_unit; /* what it counts: "cycles", or "instructions" */

/* A component on the board; components.c has them. */
typedef struct {
    const char *about; /* its name, inputs, outputs, parameters */
    uint32_t inputs, outputs, parameters; /* bytes */
    uint32_t fixed;                       /* CRC-32 of the numbers that are part of the code */
    uint32_t state, memory;               /* bytes of the state, and of all records */
    void *at_inputs, *at_outputs, *at_state;
    void (*set)(const uint8_t *parameters);
    void (*start)(void);
    void (*step)(void);
} gapsense_component;

extern const gapsense_component gapsense_components[];
extern const uint32_t gapsense_components_count;

#ifdef __cplusplus
}
#endif

#endif
