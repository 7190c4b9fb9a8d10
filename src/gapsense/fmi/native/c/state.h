/* All that an instance has to remember: who copies it has saved everything. */
#ifndef GAPSENSE_STATE_H
#define GAPSENSE_STATE_H

#include <stddef.h>

#include "life.h"
#include "model.h"
#include "text.h"

typedef struct {
    Phase phase;
    int is_timed; /* the next step has to begin at `time` */
    int is_due;   /* in initialization: the outputs do not follow the values yet */
    double start_time, time, period, elapsed;
    double *block;   /* holds all numbers of fixed count: */
    double *values;  /* of the ports by value reference, texts apart; two places before, for time and dt */
    double *par;     /* parameters of the kernel */
    double *kernel;  /* its state, */
    double **memory; /* and its array memory */
    char **texts;    /* of the ports that are a String, by value reference */
    double **tables;
    int *sizes; /* rows of the tables */
    double **columns; /* as arrays give them, by value reference of what else names a file, column after column, */
    int *rows; /* and how many of these; 0: they were not given */
    int is_configuring; /* FMI 3.0: an instantiated one in the configuration mode */
    double *motion;     /* in the block: what `motion.c` keeps, */
    double *constants;  /* and what the kernel makes of parameters and tables */
} State;

State *state_new(void); /* as at instantiation; NULL without memory */
void state_free(State *state);
int state_copy(State *to, const State *from); /* all or, without memory, nothing: then 0 */
int state_reset(State *state);
size_t state_given(const State *state, int port); /* how many numbers arrays give for the table of this port */
int state_set_text(State *state, int port, const char *text);

size_t state_size(const State *state); /* of its bytes */
void state_write(const State *state, unsigned char *bytes);
/* A state from bytes, which must be whole and unharmed; else NULL, and `problem` says why. */
State *state_read(const unsigned char *bytes, size_t size, Text *problem);

#endif
