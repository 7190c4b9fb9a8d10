/* The FMI 2.0 functions that are passed on unchanged: CALL(name, parameters, arguments).
 *
 * Included several times by shim.c, each time with another meaning of CALL. The first parameter is always the
 * instance. fmi2Instantiate and fmi2FreeInstance need more than that and are written out in shim.c. The types are
 * checked by the compiler against fmi2Functions.h.
 */
#define REFERENCES fmi2Component c, const fmi2ValueReference vr[], size_t nvr

CALL(fmi2SetDebugLogging, (fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[]),
     (c, on, n, categories))

CALL(fmi2SetupExperiment,
     (fmi2Component c, fmi2Boolean has_tolerance, fmi2Real tolerance, fmi2Real start, fmi2Boolean has_stop,
      fmi2Real stop),
     (c, has_tolerance, tolerance, start, has_stop, stop))
CALL(fmi2EnterInitializationMode, (fmi2Component c), (c))
CALL(fmi2ExitInitializationMode, (fmi2Component c), (c))
CALL(fmi2Terminate, (fmi2Component c), (c))
CALL(fmi2Reset, (fmi2Component c), (c))

CALL(fmi2GetReal, (REFERENCES, fmi2Real value[]), (c, vr, nvr, value))
CALL(fmi2GetInteger, (REFERENCES, fmi2Integer value[]), (c, vr, nvr, value))
CALL(fmi2GetBoolean, (REFERENCES, fmi2Boolean value[]), (c, vr, nvr, value))
CALL(fmi2GetString, (REFERENCES, fmi2String value[]), (c, vr, nvr, value))
CALL(fmi2SetReal, (REFERENCES, const fmi2Real value[]), (c, vr, nvr, value))
CALL(fmi2SetInteger, (REFERENCES, const fmi2Integer value[]), (c, vr, nvr, value))
CALL(fmi2SetBoolean, (REFERENCES, const fmi2Boolean value[]), (c, vr, nvr, value))
CALL(fmi2SetString, (REFERENCES, const fmi2String value[]), (c, vr, nvr, value))

CALL(fmi2GetFMUstate, (fmi2Component c, fmi2FMUstate *state), (c, state))
CALL(fmi2SetFMUstate, (fmi2Component c, fmi2FMUstate state), (c, state))
CALL(fmi2FreeFMUstate, (fmi2Component c, fmi2FMUstate *state), (c, state))
CALL(fmi2SerializedFMUstateSize, (fmi2Component c, fmi2FMUstate state, size_t *size), (c, state, size))
CALL(fmi2SerializeFMUstate, (fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size),
     (c, state, bytes, size))
CALL(fmi2DeSerializeFMUstate, (fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state),
     (c, bytes, size, state))

CALL(fmi2GetDirectionalDerivative,
     (fmi2Component c, const fmi2ValueReference unknown[], size_t n_unknown, const fmi2ValueReference known[],
      size_t n_known, const fmi2Real d_known[], fmi2Real d_unknown[]),
     (c, unknown, n_unknown, known, n_known, d_known, d_unknown))
CALL(fmi2SetRealInputDerivatives, (REFERENCES, const fmi2Integer order[], const fmi2Real value[]),
     (c, vr, nvr, order, value))
CALL(fmi2GetRealOutputDerivatives, (REFERENCES, const fmi2Integer order[], fmi2Real value[]),
     (c, vr, nvr, order, value))

CALL(fmi2DoStep, (fmi2Component c, fmi2Real time, fmi2Real step, fmi2Boolean no_rollback), (c, time, step, no_rollback))
CALL(fmi2CancelStep, (fmi2Component c), (c))
CALL(fmi2GetStatus, (fmi2Component c, const fmi2StatusKind kind, fmi2Status *value), (c, kind, value))
CALL(fmi2GetRealStatus, (fmi2Component c, const fmi2StatusKind kind, fmi2Real *value), (c, kind, value))
CALL(fmi2GetIntegerStatus, (fmi2Component c, const fmi2StatusKind kind, fmi2Integer *value), (c, kind, value))
CALL(fmi2GetBooleanStatus, (fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value), (c, kind, value))
CALL(fmi2GetStringStatus, (fmi2Component c, const fmi2StatusKind kind, fmi2String *value), (c, kind, value))

#undef REFERENCES
