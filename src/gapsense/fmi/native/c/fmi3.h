/* What the parts of FMI 3.0 share. */
#ifndef GAPSENSE_FMI3_H
#define GAPSENSE_FMI3_H

#include "fmi3Functions.h"
#include "instance.h"
#include "sentences.h"

/* What a host gave to be told of. */
typedef struct {
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
} Host;

/* Without an instance there is nobody to tell what is wrong. */
#define CALLED(condition, call) ((condition) ? (fmi3Status)(call) : fmi3Error)
#define GIVEN(what, address) (c && !instance_given(c, __func__, what, address, 1))

int is_configuring(const Instance *instance);
/* Refuse what has no place in the configuration mode, and what has its place only there. */
Status outside_configuration(Instance *instance, Call call, const char *name);
Status in_configuration(Instance *instance, const char *name);

#endif
