/* A small FMI 2.0 co-simulation host in plain C, as a tool vendor would write it; for test_shim.py.
 *
 *     host [-n steps] [-h step] [-c cycles] [-t threads] [-i name] [-q] [-f]
 *          library resources guid [library resources guid ...] -- vr [vr ...]
 *
 * Each thread makes an instance of each FMU, steps them in turn, and prints FMU, time and the real outputs vr after
 * each step; every second thread makes them in reverse order, so that different FMUs load Python at the same time.
 * A cycle is dlopen, run, dlclose. -q turns the FMU's logging off. With -f a child process
 * forked after the first cycle's runs makes one more run. Exit code: 0, or 2 when a library does not load,
 * 3 when an instance is NULL, 10 + status when a call is not OK. After a failure it still frees the instance.
 */
#include <dlfcn.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "fmi2Functions.h"

enum { MOST = 8 };
static struct { const char *library, *resources, *guid; void *handle; } fmus[MOST];
static const char *name = "model";
static int n_fmus, steps = 10, cycles = 1, threads = 1, logging = 1, forks = 0;
static double step = 0.01;
static fmi2ValueReference outputs[MOST];
static size_t n_outputs;

static void logger(fmi2ComponentEnvironment environment, fmi2String instance, fmi2Status status, fmi2String category,
                   fmi2String message, ...)
{
    char text[4096];
    va_list arguments;
    va_start(arguments, message);
    vsnprintf(text, sizeof text, message, arguments);
    va_end(arguments);
    printf("LOG %s %d %s %s%s\n", instance, status, category, text, environment == fmus ? "" : " (WRONG ENVIRONMENT)");
}

#define FUNCTION(fmu, name) ((name##TYPE *)dlsym(fmus[fmu].handle, #name))
#define CHECK(call) if (worst == fmi2OK) worst = (call)

static fmi2Component instantiate(int fmu)
{
    /* On the stack and gone when this returns, as in some hosts. */
    fmi2CallbackFunctions callbacks = {logger, calloc, free, NULL, fmus};
    return FUNCTION(fmu, fmi2Instantiate)
        (name, fmi2CoSimulation, fmus[fmu].guid, fmus[fmu].resources, &callbacks, fmi2False, logging);
}

static fmi2Status advance(int fmu, fmi2Component c, int k)
{
    fmi2Real values[MOST];
    fmi2Status worst = FUNCTION(fmu, fmi2DoStep)(c, k * step, step, fmi2True);
    CHECK(FUNCTION(fmu, fmi2GetReal)(c, outputs, n_outputs, values));
    char line[512];
    int length = snprintf(line, sizeof line, "%d %.6g", fmu, (k + 1) * step);
    for (size_t i = 0; i < n_outputs && worst == fmi2OK; i++)
        length += snprintf(line + length, sizeof line - (size_t)length, " %.17g", values[i]);
    if (worst == fmi2OK)
        puts(line);
    return worst;
}

static void *run(void *backwards)
{
    fmi2Component c[MOST] = {NULL};
    fmi2Status worst = fmi2OK;
    long code = 0;
    for (int i = 0; i < n_fmus && !code; i++) {
        int fmu = backwards ? n_fmus - 1 - i : i;
        code = (c[fmu] = instantiate(fmu)) ? 0 : 3;
    }
    for (int i = 0; i < n_fmus && !code; i++) {
        CHECK(FUNCTION(i, fmi2SetupExperiment)(c[i], fmi2False, 0, 0, fmi2False, 0));
        CHECK(FUNCTION(i, fmi2EnterInitializationMode)(c[i]));
        CHECK(FUNCTION(i, fmi2ExitInitializationMode)(c[i]));
    }
    for (int k = 0; k < steps && !code; k++)
        for (int i = 0; i < n_fmus; i++)
            CHECK(advance(i, c[i], k));
    for (int i = 0; i < n_fmus; i++) {
        if (!c[i])
            continue;
        fmi2Status last = FUNCTION(i, fmi2Terminate)(c[i]);
        CHECK(last);
        FUNCTION(i, fmi2FreeInstance)(c[i]);
    }
    return (void *)(code || worst == fmi2OK ? code : 10 + worst);
}

/* Exit code of a child process that makes one more run. */
static long run_in_child(void)
{
    int status = 0;
    fflush(stdout);
    if (fork() == 0)
        exit((int)(long)run(NULL));
    wait(&status);
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

int main(int argc, char **argv)
{
    setvbuf(stdout, NULL, _IOLBF, BUFSIZ); /* whole lines: what an FMU prints comes between them */
    for (int option; (option = getopt(argc, argv, "+n:h:c:t:i:qf")) != -1;) {
        if (option == 'n') steps = atoi(optarg);
        if (option == 'h') step = atof(optarg);
        if (option == 'c') cycles = atoi(optarg);
        if (option == 't') threads = atoi(optarg);
        if (option == 'i') name = optarg;
        if (option == 'q') logging = 0;
        if (option == 'f') forks = 1;
    }
    for (; optind + 2 < argc && strcmp(argv[optind], "--") != 0; optind += 3, n_fmus++) {
        fmus[n_fmus].library = argv[optind];
        fmus[n_fmus].resources = argv[optind + 1];
        fmus[n_fmus].guid = argv[optind + 2];
    }
    while (++optind < argc)
        outputs[n_outputs++] = (fmi2ValueReference)atoi(argv[optind]);
    long worst = 0;
    for (int cycle = 0; cycle < cycles; cycle++) {
        pthread_t thread[MOST];
        for (int i = 0; i < n_fmus; i++)
            if (!(fmus[i].handle = dlopen(fmus[i].library, RTLD_LAZY | RTLD_LOCAL)))
                return fprintf(stderr, "%s\n", dlerror()), 2;
        for (int t = 1; t < threads; t++)
            pthread_create(&thread[t], NULL, run, t % 2 ? &thread[t] : NULL);
        worst = worst ? worst : (long)run(NULL);
        for (int t = 1; t < threads; t++) {
            void *code;
            pthread_join(thread[t], &code);
            worst = worst ? worst : (long)code;
        }
        if (forks && !worst)
            worst = run_in_child();
        for (int i = 0; i < n_fmus; i++)
            dlclose(fmus[i].handle);
    }
    return (int)worst;
}
