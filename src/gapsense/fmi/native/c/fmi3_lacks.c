/* Functions of FMI 3.0 that no component provides; their arguments do not matter. */
#include "fmi3.h"

#ifdef __GNUC__
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif

#define LACKS(name, ...)                                                  \
    fmi3Status name(fmi3Instance c, __VA_ARGS__)                          \
    {                                                                     \
        return CALLED(c, report(c, SAY_NOT_PROVIDED, #name));             \
    }
#define LACKS_PLAIN(name)                                                 \
    fmi3Status name(fmi3Instance c)                                       \
    {                                                                     \
        return CALLED(c, report(c, SAY_NOT_PROVIDED, #name));             \
    }
#define REFERENCES const fmi3ValueReference references[], size_t count

LACKS(fmi3GetBinary, REFERENCES, size_t sizes[], fmi3Binary values[], size_t value_count)
LACKS(fmi3SetBinary, REFERENCES, const size_t sizes[], const fmi3Binary values[], size_t value_count)
LACKS(fmi3GetClock, REFERENCES, fmi3Clock values[])
LACKS(fmi3SetClock, REFERENCES, const fmi3Clock values[])

LACKS(fmi3GetNumberOfVariableDependencies, fmi3ValueReference reference, size_t *count)
LACKS(fmi3GetVariableDependencies, fmi3ValueReference dependent, size_t elements[], fmi3ValueReference independents[],
      size_t elements_of_independents[], fmi3DependencyKind kinds[], size_t count)
LACKS(fmi3GetDirectionalDerivative, const fmi3ValueReference unknowns[], size_t unknown_count,
      const fmi3ValueReference knowns[], size_t known_count, const fmi3Float64 seed[], size_t seed_count,
      fmi3Float64 sensitivity[], size_t sensitivity_count)
LACKS(fmi3GetAdjointDerivative, const fmi3ValueReference unknowns[], size_t unknown_count,
      const fmi3ValueReference knowns[], size_t known_count, const fmi3Float64 seed[], size_t seed_count,
      fmi3Float64 sensitivity[], size_t sensitivity_count)
LACKS(fmi3GetOutputDerivatives, REFERENCES, const fmi3Int32 orders[], fmi3Float64 values[], size_t value_count)

LACKS_PLAIN(fmi3EnterEventMode)
LACKS_PLAIN(fmi3EnterStepMode)
LACKS_PLAIN(fmi3EvaluateDiscreteStates)
LACKS(fmi3UpdateDiscreteStates, fmi3Boolean *again, fmi3Boolean *ends, fmi3Boolean *nominals, fmi3Boolean *states,
      fmi3Boolean *has_next, fmi3Float64 *next)

LACKS(fmi3GetIntervalDecimal, REFERENCES, fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[])
LACKS(fmi3GetIntervalFraction, REFERENCES, fmi3UInt64 counters[], fmi3UInt64 resolutions[],
      fmi3IntervalQualifier qualifiers[])
LACKS(fmi3GetShiftDecimal, REFERENCES, fmi3Float64 shifts[])
LACKS(fmi3GetShiftFraction, REFERENCES, fmi3UInt64 counters[], fmi3UInt64 resolutions[])
LACKS(fmi3SetIntervalDecimal, REFERENCES, const fmi3Float64 intervals[])
LACKS(fmi3SetIntervalFraction, REFERENCES, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
LACKS(fmi3SetShiftDecimal, REFERENCES, const fmi3Float64 shifts[])
LACKS(fmi3SetShiftFraction, REFERENCES, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
LACKS(fmi3ActivateModelPartition, fmi3ValueReference clock, fmi3Float64 time)

LACKS_PLAIN(fmi3EnterContinuousTimeMode)
LACKS(fmi3CompletedIntegratorStep, fmi3Boolean no_setting_of_past_states, fmi3Boolean *event, fmi3Boolean *ends)
LACKS(fmi3SetTime, fmi3Float64 time)
LACKS(fmi3SetContinuousStates, const fmi3Float64 states[], size_t count)
LACKS(fmi3GetContinuousStateDerivatives, fmi3Float64 derivatives[], size_t count)
LACKS(fmi3GetEventIndicators, fmi3Float64 indicators[], size_t count)
LACKS(fmi3GetContinuousStates, fmi3Float64 states[], size_t count)
LACKS(fmi3GetNominalsOfContinuousStates, fmi3Float64 nominals[], size_t count)
LACKS(fmi3GetNumberOfEventIndicators, size_t *count)
LACKS(fmi3GetNumberOfContinuousStates, size_t *count)

/* --- types that no component has --- */

static fmi3Status lacks_type(Instance *i, const char *name, const char *type, const fmi3ValueReference references[],
                             size_t count, const void *values, size_t value_count)
{
    if (!i || instance_given_values(i, name, references, count, values, value_count))
        return fmi3Error;
    return count ? (fmi3Status)refuse(i, SAY_NO_VARIABLE, type, references[0]) : fmi3OK;
}

#define LACKING(Name, Type)                                                                                            \
    fmi3Status fmi3Get##Name(fmi3Instance c, const fmi3ValueReference references[], size_t count, Type values[],        \
                             size_t value_count)                                                                       \
    {                                                                                                                  \
        return lacks_type(c, __func__, #Name, references, count, values, value_count);                                 \
    }                                                                                                                  \
    fmi3Status fmi3Set##Name(fmi3Instance c, const fmi3ValueReference references[], size_t count, const Type values[],  \
                             size_t value_count)                                                                       \
    {                                                                                                                  \
        return lacks_type(c, __func__, #Name, references, count, values, value_count);                                 \
    }

LACKING(Float32, fmi3Float32)
LACKING(Int8, fmi3Int8)
LACKING(UInt8, fmi3UInt8)
LACKING(Int16, fmi3Int16)
LACKING(UInt16, fmi3UInt16)
LACKING(UInt32, fmi3UInt32)
