/* Models for loops between components, of FMI 2.0 or 3.0 (FMI), whose values are all real numbers:
 *
 * Node    y = bias + gain u + share v + bend sin(u + v), at once; `lazy` computes only in steps and at the end of the
 *         initialization; `least` refuses smaller inputs; `noise` adds what no repetition gives again
 * Mass    m a + d v + k x = force, from x0; the force is held in a step, or goes on along the slope that was set
 * Spring  the other mass, and between them a spring and a damper, whose force acts on the first one
 *         Both give means over the step too, of speed and force.
 * Circuit a capacitor, charged from a supply over a resistor and discharged by a current; its voltage, at the end of a
 *         step and mean over it
 *
 * Where the environment has COUPLED_CALLS, the steps that were done are added to that file at the end.
 *
 * Value references are places in `values`. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MOST = 24, STATES = 2 };

typedef struct {
    double values[MOST], slopes[MOST], z[STATES];
    double time;
    int is_running;
} State;

/* Where what is: the generator of the model descriptions has the same order. */
#if defined(NODE)
enum { U, V, Y, BIAS, GAIN, SHARE, BEND, LAZY, LEAST, NOISE };
static const double starts[] = {0, 0, 0, 0, 0, 0, 0, 0, -1e300, 0};
#elif defined(MASS)
enum { FORCE, X, SPEED, SPEED_MEAN, M, D, K, X0, PARTS };
static const double starts[] = {0, 0, 0, 0, 1, 0, 0, 0, 100};
#elif defined(CIRCUIT)
enum { CURRENT, VOLTAGE, VOLTAGE_MEAN, SUPPLY, R, C, PARTS };
static const double starts[] = {0, 0, 0, 24, 20, 1e-5, 100};
#else
enum { X, SPEED, FORCE, X2, SPEED2, FORCE_MEAN, M, D, K, X0, DC, KC, PARTS };
static const double starts[] = {0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 100};
#endif

static void start(State *s)
{
    memset(s, 0, sizeof *s);
    memcpy(s->values, starts, sizeof starts);
#if defined(STARTS) /* others, for hosts that set no parameters */
    static const double own[] = STARTS;
    memcpy(s->values, own, sizeof own);
#endif
}

/* Inputs at the end of a step are where their slopes have led. */
static void go_on(State *s, double h)
{
    for (int j = 0; j < MOST; j++)
        s->values[j] += h * s->slopes[j];
}

#if defined(NODE)
static unsigned calls; /* in no state */

static int compute(State *s)
{
    double *v = s->values;
    if (v[U] < v[LEAST])
        return 1;
    v[Y] = v[BIAS] + v[GAIN] * v[U] + v[SHARE] * v[V] + v[BEND] * sin(v[U] + v[V]);
    if (v[NOISE] != 0.0)
        v[Y] += v[NOISE] * (calls++ % 2);
    return 0;
}

static int is_lazy(const State *s) { return s->values[LAZY] != 0.0; }
static int begin(State *s) { return is_lazy(s) ? compute(s) : 0; }
static int advance(State *s, double h)
{
    go_on(s, h);
    return compute(s);
}
#else
static int is_lazy(const State *s)
{
    (void)s;
    return 0;
}

static void flow(const State *s, double t, const double z[], double dz[])
{
    const double *v = s->values, *g = s->slopes;
    dz[0] = z[1];
#if defined(CIRCUIT) /* the voltage and, before it, its integral */
    dz[1] = ((v[SUPPLY] - z[1]) / v[R] - v[CURRENT] - g[CURRENT] * t) / v[C];
#elif defined(MASS)
    dz[1] = (v[FORCE] + g[FORCE] * t - v[D] * z[1] - v[K] * z[0]) / v[M];
#else
    const double force = v[KC] * (z[0] - v[X] - g[X] * t) + v[DC] * (z[1] - v[SPEED] - g[SPEED] * t);
    dz[1] = (-force - v[D] * z[1] - v[K] * z[0]) / v[M];
#endif
}

static int compute(State *s)
{
    double *v = s->values;
#if defined(CIRCUIT)
    v[VOLTAGE] = s->z[1];
#elif defined(MASS)
    v[X] = s->z[0];
    v[SPEED] = s->z[1];
#else
    v[X2] = s->z[0];
    v[SPEED2] = s->z[1];
    v[FORCE] = v[KC] * (v[X2] - v[X]) + v[DC] * (v[SPEED2] - v[SPEED]);
#endif
    return 0;
}

static int begin(State *s)
{
#if defined(CIRCUIT)
    s->z[1] = s->values[SUPPLY];
    compute(s);
    s->values[VOLTAGE_MEAN] = s->values[VOLTAGE];
#else
    s->z[0] = s->values[X0];
    compute(s);
#endif
#if defined(SPRING)
    s->values[FORCE_MEAN] = s->values[FORCE];
#endif
    return 0;
}

/* Runge-Kutta of fourth order. */
static int advance(State *s, double h)
{
    const int n = (int)s->values[PARTS];
    const double step = h / n, before[STATES] = {s->z[0], s->z[1]};
    double mean = 0.0;
    for (int i = 0; i < n; i++) {
        double a[STATES], b[STATES], c[STATES], d[STATES], y[STATES], t = i * step;
        flow(s, t, s->z, a);
        for (int j = 0; j < STATES; j++)
            y[j] = s->z[j] + 0.5 * step * a[j];
        flow(s, t + 0.5 * step, y, b);
        for (int j = 0; j < STATES; j++)
            y[j] = s->z[j] + 0.5 * step * b[j];
        flow(s, t + 0.5 * step, y, c);
        for (int j = 0; j < STATES; j++)
            y[j] = s->z[j] + step * c[j];
        flow(s, t + step, y, d);
        mean += (s->z[0] + step / 6.0 * (a[0] + b[0] + c[0])) / n; /* over this part, as x'' = f says */
        for (int j = 0; j < STATES; j++)
            s->z[j] += step / 6.0 * (a[j] + 2.0 * b[j] + 2.0 * c[j] + d[j]);
    }
    go_on(s, h);
    (void)mean;
#if defined(CIRCUIT)
    s->values[VOLTAGE_MEAN] = (s->z[0] - before[0]) / h;
#elif defined(MASS)
    s->values[SPEED_MEAN] = (s->z[0] - before[0]) / h;
#else /* what the momentum of its mass says, and the mean position */
    s->values[FORCE_MEAN] = -s->values[M] * (s->z[1] - before[1]) / h - s->values[D] * (s->z[0] - before[0]) / h;
    s->values[FORCE_MEAN] -= s->values[K] * mean;
#endif
    return compute(s);
}
#endif

static unsigned long steps;

__attribute__((destructor)) static void tell(void)
{
    const char *path = getenv("COUPLED_CALLS");
    FILE *file = path ? fopen(path, "a") : NULL;
    if (file) {
        fprintf(file, "%lu\n", steps);
        fclose(file);
    }
}

static int step(State *s, double time, double h)
{
    const int failed = advance(s, h);
    steps++;
    memset(s->slopes, 0, sizeof s->slopes);
    s->time = time + h;
    return failed;
}

/* Outputs follow inputs at once, unless it is lazy. */
static int look(State *s) { return is_lazy(s) || (!s->is_running && begin(s)) ? 0 : compute(s); }

static int leave(State *s)
{
    const int failed = begin(s);
    s->is_running = 1;
    return failed;
}

#if FMI == 2
#include "fmi2Functions.h"
#define STATUS fmi2Status
#define OK fmi2OK
#define ERROR fmi2Error
#define NAME(name) fmi2##name
#define HANDLE fmi2Component
#define SAVED fmi2FMUstate
#define BYTE fmi2Byte
#define STATE(before, after) fmi2##before##FMUstate##after
#define DESERIALIZE fmi2DeSerializeFMUstate
typedef fmi2ValueReference Reference;
const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }

HANDLE fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String location,
                       const fmi2CallbackFunctions *host, fmi2Boolean visible, fmi2Boolean logging)
{
    (void)name, (void)type, (void)guid, (void)location, (void)host, (void)visible, (void)logging;
    State *s = malloc(sizeof *s);
    start(s);
    return s;
}

STATUS fmi2SetupExperiment(HANDLE c, fmi2Boolean a, fmi2Real b, fmi2Real time, fmi2Boolean d, fmi2Real e)
{
    (void)a, (void)b, (void)d, (void)e;
    ((State *)c)->time = time;
    return OK;
}

STATUS fmi2EnterInitializationMode(HANDLE c) { return c ? OK : ERROR; }

STATUS fmi2SetRealInputDerivatives(HANDLE c, const Reference r[], size_t n, const fmi2Integer order[],
                                   const fmi2Real v[])
{
    for (size_t k = 0; k < n; k++) {
        if (order[k] != 1)
            return ERROR;
        ((State *)c)->slopes[r[k]] = v[k];
    }
    return OK;
}

/* What other hosts want a library to have: there are no such variables, and nothing to cancel. */
STATUS fmi2SetDebugLogging(HANDLE c, fmi2Boolean on, size_t n, const fmi2String names[])
{
    (void)on, (void)n, (void)names;
    return c ? OK : ERROR;
}

STATUS fmi2CancelStep(HANDLE c) { return c ? fmi2Discard : ERROR; }

#define NONE(name, type)                                                 \
    STATUS fmi2Get##name(HANDLE c, const Reference r[], size_t n, type v[]) \
    {                                                                    \
        (void)r, (void)v;                                                \
        return c && !n ? OK : ERROR;                                     \
    }                                                                    \
    STATUS fmi2Set##name(HANDLE c, const Reference r[], size_t n, const type v[]) \
    {                                                                    \
        (void)r, (void)v;                                                \
        return c && !n ? OK : ERROR;                                     \
    }
NONE(Integer, fmi2Integer)
NONE(Boolean, fmi2Boolean)
NONE(String, fmi2String)

#define ASKED(name, type)                                                  \
    STATUS fmi2Get##name(HANDLE c, const fmi2StatusKind kind, type *value) \
    {                                                                      \
        (void)kind, (void)value;                                           \
        return c ? fmi2Discard : ERROR;                                    \
    }
ASKED(Status, fmi2Status)
ASKED(RealStatus, fmi2Real)
ASKED(IntegerStatus, fmi2Integer)
ASKED(BooleanStatus, fmi2Boolean)
ASKED(StringStatus, fmi2String)

STATUS fmi2GetRealOutputDerivatives(HANDLE c, const Reference r[], size_t n, const fmi2Integer order[], fmi2Real v[])
{
    (void)r, (void)order, (void)v;
    return c && !n ? OK : ERROR;
}

STATUS fmi2GetDirectionalDerivative(HANDLE c, const Reference a[], size_t n, const Reference b[], size_t m,
                                    const fmi2Real x[], fmi2Real y[])
{
    (void)a, (void)n, (void)b, (void)m, (void)x, (void)y;
    return c ? ERROR : ERROR;
}

STATUS fmi2DoStep(HANDLE c, fmi2Real time, fmi2Real h, fmi2Boolean keep)
{
    (void)keep;
    return step(c, time, h) ? ERROR : OK;
}
#else
#include "fmi3Functions.h"
#define STATUS fmi3Status
#define OK fmi3OK
#define ERROR fmi3Error
#define NAME(name) fmi3##name
#define HANDLE fmi3Instance
#define SAVED fmi3FMUState
#define BYTE fmi3Byte
#define STATE(before, after) fmi3##before##FMUState##after
#define DESERIALIZE fmi3DeserializeFMUState
typedef fmi3ValueReference Reference;
const char *fmi3GetVersion(void) { return fmi3Version; }

HANDLE fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String path, fmi3Boolean visible,
                                   fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early,
                                   const fmi3ValueReference required[], size_t count,
                                   fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                   fmi3IntermediateUpdateCallback update)
{
    (void)name, (void)token, (void)path, (void)visible, (void)logging, (void)events, (void)early, (void)required;
    (void)count, (void)environment, (void)log, (void)update;
    State *s = malloc(sizeof *s);
    start(s);
    return s;
}

STATUS fmi3EnterInitializationMode(HANDLE c, fmi3Boolean a, fmi3Float64 b, fmi3Float64 time, fmi3Boolean d,
                                   fmi3Float64 e)
{
    (void)a, (void)b, (void)d, (void)e;
    ((State *)c)->time = time;
    return OK;
}

STATUS fmi3DoStep(HANDLE c, fmi3Float64 time, fmi3Float64 h, fmi3Boolean keep, fmi3Boolean *event, fmi3Boolean *over,
                  fmi3Boolean *early, fmi3Float64 *last)
{
    (void)keep;
    *event = *over = *early = fmi3False;
    *last = time + h;
    return step(c, time, h) ? ERROR : OK;
}
#endif

void NAME(FreeInstance)(HANDLE c) { free(c); }
STATUS NAME(ExitInitializationMode)(HANDLE c) { return leave(c) ? ERROR : OK; }
STATUS NAME(Terminate)(HANDLE c) { return c ? OK : ERROR; }

STATUS NAME(Reset)(HANDLE c)
{
    start(c);
    return OK;
}

static STATUS get(HANDLE c, const Reference r[], size_t n, double v[])
{
    if (look(c))
        return ERROR;
    for (size_t k = 0; k < n; k++)
        v[k] = ((State *)c)->values[r[k]];
    return OK;
}

static STATUS set(HANDLE c, const Reference r[], size_t n, const double v[])
{
    for (size_t k = 0; k < n; k++)
        ((State *)c)->values[r[k]] = v[k];
    return OK;
}

#if FMI == 2
STATUS fmi2GetReal(HANDLE c, const Reference r[], size_t n, fmi2Real v[]) { return get(c, r, n, v); }
STATUS fmi2SetReal(HANDLE c, const Reference r[], size_t n, const fmi2Real v[]) { return set(c, r, n, v); }
#else
STATUS fmi3GetFloat64(HANDLE c, const Reference r[], size_t n, fmi3Float64 v[], size_t m) { return m == n ? get(c, r, n, v) : ERROR; }
STATUS fmi3SetFloat64(HANDLE c, const Reference r[], size_t n, const fmi3Float64 v[], size_t m) { return m == n ? set(c, r, n, v) : ERROR; }
#endif

STATUS STATE(Get, )(HANDLE c, SAVED *saved)
{
    *saved = *saved ? *saved : malloc(sizeof(State));
    memcpy(*saved, c, sizeof(State));
    return OK;
}

STATUS STATE(Set, )(HANDLE c, SAVED saved)
{
    memcpy(c, saved, sizeof(State));
    return OK;
}

STATUS STATE(Free, )(HANDLE c, SAVED *saved)
{
    free(*saved);
    *saved = NULL;
    return c ? OK : ERROR;
}

#if FMI == 2
STATUS fmi2SerializedFMUstateSize(HANDLE c, SAVED saved, size_t *size)
#else
STATUS fmi3SerializedFMUStateSize(HANDLE c, SAVED saved, size_t *size)
#endif
{
    *size = sizeof(State);
    return c && saved ? OK : ERROR;
}

#if FMI == 2
STATUS fmi2SerializeFMUstate(HANDLE c, SAVED saved, BYTE bytes[], size_t size)
#else
STATUS fmi3SerializeFMUState(HANDLE c, SAVED saved, BYTE bytes[], size_t size)
#endif
{
    memcpy(bytes, saved, size);
    return c ? OK : ERROR;
}

STATUS DESERIALIZE(HANDLE c, const BYTE bytes[], size_t size, SAVED *saved)
{
    *saved = malloc(sizeof(State));
    memcpy(*saved, bytes, size);
    return c ? OK : ERROR;
}
