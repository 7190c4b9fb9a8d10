/* An FMU of FMI 3.0 with arrays, whose sizes follow from the structural parameter n: y = K u + bias, in each step. */
#include <stdlib.h>
#include <string.h>

#include "fmi3Functions.h"

enum { N, K, BIAS, U, Y, TOTAL, COUNT, COUNT_OUT, FLAG, FLAG_OUT, SINGLE, SINGLE_OUT };
enum { MOST = 4, WIDTH = 2, FIXED = 3 };
enum { INSTANTIATED, CONFIGURING, INITIALIZED };

typedef struct {
    fmi3UInt64 n;
    double k[MOST * WIDTH], bias[MOST], u[WIDTH], y[MOST], total;
    fmi3Int32 count[FIXED], count_out[FIXED];
    fmi3Boolean flag[WIDTH], flag_out[WIDTH];
    float single[WIDTH], single_out[WIDTH];
    int state;
} Model;

static void start(Model *m)
{
    static const double k[] = {1, 2, 3, 4};
    memset(m, 0, sizeof *m);
    m->n = 2;
    memcpy(m->k, k, sizeof k);
    for (int i = 0; i < MOST; i++)
        m->bias[i] = 0.5;
}

static void compute(Model *m)
{
    m->total = 0.0;
    for (size_t i = 0; i < m->n; i++) {
        m->y[i] = m->bias[i];
        for (size_t j = 0; j < WIDTH; j++)
            m->y[i] += m->k[WIDTH * i + j] * m->u[j];
        m->total += m->y[i];
    }
    for (int i = 0; i < FIXED; i++)
        m->count_out[i] = m->count[i] + i;
    for (int i = 0; i < WIDTH; i++) {
        m->flag_out[i] = !m->flag[i];
        m->single_out[i] = 2.0f * m->single[i];
    }
}

/* Where a variable is, and how many numbers it has. */
static void *found(Model *m, fmi3ValueReference r, size_t *size)
{
    void *places[] = {&m->n, m->k, m->bias, m->u, m->y, &m->total, m->count, m->count_out, m->flag, m->flag_out,
                      m->single, m->single_out};
    size_t sizes[] = {1, WIDTH * m->n, m->n, WIDTH, m->n, 1, FIXED, FIXED, WIDTH, WIDTH, WIDTH, WIDTH};
    *size = r <= SINGLE_OUT ? sizes[r] : 0;
    return r <= SINGLE_OUT ? places[r] : NULL;
}

/* Values in the order of the references; their number must be that of all elements. */
static fmi3Status moved(Model *m, const fmi3ValueReference r[], size_t n, char *v, size_t count, size_t width, int sets)
{
    size_t done = 0;
    for (size_t i = 0; i < n; i++) {
        size_t size;
        void *place = found(m, r[i], &size);
        if (!place || done + size > count || (sets && (r[i] == N) != (m->state == CONFIGURING)))
            return fmi3Error;
        memcpy(sets ? place : v + width * done, sets ? v + width * done : place, width * size);
        done += size;
    }
    return done == count && m->n <= MOST ? fmi3OK : fmi3Error;
}

#define MOVER(type)                                                                                                \
    fmi3Status fmi3Get##type(fmi3Instance c, const fmi3ValueReference r[], size_t n, fmi3##type v[], size_t count) \
    {                                                                                                              \
        compute(c);                                                                                                \
        return moved(c, r, n, (char *)v, count, sizeof *v, 0);                                                     \
    }                                                                                                              \
    fmi3Status fmi3Set##type(fmi3Instance c, const fmi3ValueReference r[], size_t n, const fmi3##type v[],         \
                             size_t count)                                                                         \
    {                                                                                                              \
        return moved(c, r, n, (char *)v, count, sizeof *v, 1);                                                     \
    }
MOVER(Float64)
MOVER(Float32)
MOVER(Int32)
MOVER(UInt64)
MOVER(Boolean)

const char *fmi3GetVersion(void) { return fmi3Version; }

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String path, fmi3Boolean visible,
                                         fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early,
                                         const fmi3ValueReference required[], size_t count,
                                         fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                         fmi3IntermediateUpdateCallback update)
{
    (void)name, (void)token, (void)path, (void)visible, (void)logging, (void)events, (void)early, (void)required;
    (void)count, (void)environment, (void)log, (void)update;
    Model *m = malloc(sizeof *m);
    start(m);
    return m;
}

void fmi3FreeInstance(fmi3Instance c) { free(c); }

static fmi3Status entered(Model *m, int from, int to)
{
    fmi3Status status = m->state == from ? fmi3OK : fmi3Error;
    m->state = to;
    return status;
}

fmi3Status fmi3EnterConfigurationMode(fmi3Instance c) { return entered(c, INSTANTIATED, CONFIGURING); }

fmi3Status fmi3ExitConfigurationMode(fmi3Instance c) { return entered(c, CONFIGURING, INSTANTIATED); }

fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean a, fmi3Float64 b, fmi3Float64 time, fmi3Boolean d,
                                       fmi3Float64 e)
{
    (void)a, (void)b, (void)time, (void)d, (void)e;
    return entered(c, INSTANTIATED, INITIALIZED);
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance c)
{
    compute(c);
    return fmi3OK;
}

fmi3Status fmi3Terminate(fmi3Instance c) { return c ? fmi3OK : fmi3Fatal; }

fmi3Status fmi3Reset(fmi3Instance c)
{
    start(c);
    return fmi3OK;
}

fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 time, fmi3Float64 step, fmi3Boolean keep, fmi3Boolean *event,
                      fmi3Boolean *over, fmi3Boolean *early, fmi3Float64 *last)
{
    (void)keep;
    compute(c);
    *event = *over = *early = fmi3False;
    *last = time + step;
    return fmi3OK;
}
