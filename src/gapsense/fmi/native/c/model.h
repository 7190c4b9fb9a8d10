/* What a component is, as data. `model.c`, which is generated from the port table, holds it; all else is the same for
 * every component. A variable's value reference is its place among the ports: inputs, outputs, parameters. */
#ifndef GAPSENSE_MODEL_H
#define GAPSENSE_MODEL_H

#include <stddef.h>

typedef enum { REAL, INTEGER, BOOLEAN, STRING } Kind;
typedef enum { INPUT, OUTPUT, PARAMETER } Causality;
typedef enum {
    PLAIN,
    INTEGRAL,
    SPLINE,
    AXIS, /* from here on of a grid */
    BEND,
    ENERGY,
    CURRENT_CURVE,
    BEND_CURVE,
    ENERGY_CURVE
} ColumnKind;
enum { SPLINE_ROWS = 4, GRID_ROWS = 3 }; /* at least */

/* A column that the file of a table must have. */
typedef struct {
    const char *name, *unit; /* the unit may be empty, then any will do */
    const char *text;        /* as the file writes it: `name [unit]` */
    int is_rising;           /* must increase from row to row */
} Head;

/* What the kernel gets of a table. */
typedef struct {
    ColumnKind kind;
    int head;  /* the column that it is made from; in an integral over the first, in a spline through it */
    int place; /* among the kernel's tables */
} Column;

typedef struct {
    const char *name, *unit; /* the unit with a space before it, as in a message; empty for 1 */
    Causality causality;
    Kind kind;
    int is_tunable;
    int place;               /* of a number or a choice: among the kernel's parameters */
    double start, low, high; /* of a number; infinite where there is no limit */
    const char *text;        /* of a String: its start */
    const char *const *choices;
    int choice_count;
    const Head *heads; /* of a String that names a file */
    int head_count;
    const Column *columns;
    int column_count, fewest_rows;
} Port;

/* Parameters of which the second must be larger, by value reference. */
typedef struct {
    int lower, upper;
} Rising;

typedef struct {
    int port, power;
} Factor;

/* The product of powers of parameters stays below a limit. */
typedef struct {
    const Factor *factors;
    int count;
    double below;
    const char *text, *reason;
} Limit;

/* Numbers of the kernel's state that are whole, because indices are made of them: `first`, and each `every` after it in
 * that memory; without one, -1, it is a single one among the others. */
typedef struct {
    int memory, first, every;
    double least, most;
} Wholes;

typedef void Kernel(double *restrict state, double *const *memory, const double *restrict inputs,
                    const double *restrict par, const double *const *tables, const int *table_sizes,
                    double *restrict outputs);

typedef struct {
    const char *name, *guid, *build;
    const Port *ports;
    int inputs, signals, port_count; /* signals are inputs and outputs */
    const Rising *rising;
    int rising_count;
    const Limit *limits;
    int limit_count;
    const char *const *resources; /* files that travel with the component */
    int resource_count;
#ifdef GAPSENSE_COMPONENT /* fmi3_wasm.c */
    char *(*content)(const char *path, size_t *size); /* of such a file; NULL without any */
#endif
    int survives;    /* the kernel copes with any input */
    int clock;       /* how many of time and dt it takes before the inputs */
    int sample_time; /* value reference; -1: it is not sampled */
    int par_count, state_count, table_count;
    const int *memory_sizes;
    int memory_count;
    const Wholes *wholes;
    int whole_count;
    int constant_count;
    Kernel *initial, *constants, *advance; /* what follows from parameters alone is computed once, and stands for them */
} Model;

extern const Model model;

#ifdef GAPSENSE_COMPONENT
char *resource_content(const char *path, size_t *size);
#endif

int kernel_is_exact(void);

#endif
