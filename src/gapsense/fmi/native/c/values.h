/* Whether values of parameters and inputs are taken, and what they are to the kernel. */
#ifndef GAPSENSE_VALUES_H
#define GAPSENSE_VALUES_H

#include "state.h"

void judge(const State *state, Text *problems);                     /* all parameters, tables apart */
void read_tables(State *state, const char *folder, Text *problems); /* those that files give */
void take_parameters(State *state);                                 /* once they are judged, and tables read */
/* The part of a restored state that cannot be right, or NULL: everything, if it can be stepped. */
const char *unsound(State *state);
int are_inputs_taken(const State *state, Text *problem);            /* else the sentence about all of them */

#endif
