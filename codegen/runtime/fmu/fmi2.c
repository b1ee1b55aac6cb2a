/*
 * fmi2.c - the functions of FMI 2.0 for Co-Simulation; those for Model Exchange are there and say
 * that they are not offered.
 *
 * Built as a shared library the functions have their plain names. For static linking define
 * FMI2_FUNCTION_PREFIX as the model identifier followed by an underscore, as the standard asks.
 */
#include "fmi2Functions.h"

typedef fmi2CallbackLogger fmu_logger;

#include "instance.h"

/* The standard's message is a format. Clients without variadic callbacks take it as it is: it holds
 * the text itself. */
static void fmu_log(const fmu_instance *fmu, const char *message) {
  char format[2 * FMU_MESSAGE];
  size_t n = 0;
  if (fmu->logger == NULL) return;
  for (; *message != '\0' && n + 2 < sizeof format; message++) {
    if (*message == '%') format[n++] = '%';
    format[n++] = *message;
  }
  format[n] = '\0';
  fmu->logger(fmu->environment, fmu->name, fmi2Error, "logStatusError", format);
}

static fmi2Status result_of(int result) { return result == FMU_OK ? fmi2OK : fmi2Error; }

static fmi2Status not_offered(fmi2Component c, const char *function) {
  return result_of(fmu_unsupported(c, function));
}

/* ---- life ---------------------------------------------- */

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }

const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean loggingOn, size_t nCategories,
                               const fmi2String categories[]) {
  size_t i;
  (void)loggingOn; /* errors are all there is to log, and they always are */
  if (!fmu_allowed(c, "fmi2SetDebugLogging", FMU_ANY)) return fmi2Error;
  if (!fmu_given(c, "fmi2SetDebugLogging", categories, nCategories)) return fmi2Error;
  for (i = 0; i < nCategories; i++) {
    if (categories[i] == NULL || strcmp(categories[i], "logStatusError") != 0) {
      return result_of(
          fmu_refuse(c, "fmi2SetDebugLogging: the only log category is logStatusError"));
    }
  }
  return fmi2OK;
}

fmi2Component fmi2Instantiate(fmi2String instanceName, fmi2Type fmuType, fmi2String fmuGUID,
                              fmi2String fmuResourceLocation,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible,
                              fmi2Boolean loggingOn) {
  fmu_instance *fmu;
  (void)fmuResourceLocation, (void)visible, (void)loggingOn;
  if (functions == NULL) return NULL;
  fmu = fmu_new("fmi2Instantiate", instanceName, fmuGUID, functions->logger,
                functions->componentEnvironment);
  if (fmu != NULL && fmuType != fmi2CoSimulation) {
    (void)fmu_unsupported(fmu, "fmi2Instantiate for Model Exchange");
    free(fmu);
    return NULL;
  }
  return fmu;
}

void fmi2FreeInstance(fmi2Component c) { free(c); }

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean toleranceDefined, fmi2Real tolerance,
                               fmi2Real startTime, fmi2Boolean stopTimeDefined, fmi2Real stopTime) {
  (void)toleranceDefined, (void)tolerance;
  if (!fmu_allowed(c, "fmi2SetupExperiment", FMU_INSTANTIATED)) return fmi2Error;
  return result_of(fmu_set_experiment(c, "fmi2SetupExperiment", startTime,
                                      stopTimeDefined != fmi2False, stopTime));
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
  fmu_instance *fmu = c;
  if (!fmu_allowed(fmu, "fmi2EnterInitializationMode", FMU_INSTANTIATED)) return fmi2Error;
  fmu->core.now.mode = FMU_INITIALIZING;
  return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
  if (!fmu_allowed(c, "fmi2ExitInitializationMode", FMU_INITIALIZING)) return fmi2Error;
  return result_of(fmu_exit_initialization(c, "fmi2ExitInitializationMode"));
}

fmi2Status fmi2Terminate(fmi2Component c) {
  fmu_instance *fmu = c;
  if (!fmu_allowed(fmu, "fmi2Terminate", FMU_STEPPING)) return fmi2Error;
  if (fmu_refresh(fmu, "fmi2Terminate") != FMU_OK) return fmi2Error;
  fmu->core.now.mode = FMU_TERMINATED;
  return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component c) {
  if (!fmu_allowed(c, "fmi2Reset", FMU_ANY)) return fmi2Error;
  return result_of(fmu_reset(c, "fmi2Reset"));
}

/* ---- values ---------------------------------------------- */

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                       fmi2Real value[]) {
  size_t i;
  if (!fmu_allowed(c, "fmi2GetReal", FMU_ANY)) return fmi2Error;
  if (!fmu_given(c, "fmi2GetReal", vr, nvr) || !fmu_given(c, "fmi2GetReal", value, nvr))
    return fmi2Error;
  for (i = 0; i < nvr; i++) {
    if (fmu_get(c, "fmi2GetReal", vr[i], 0, &value[i]) != FMU_OK) return fmi2Error;
  }
  return fmi2OK;
}

fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                          fmi2Boolean value[]) {
  size_t i;
  if (!fmu_allowed(c, "fmi2GetBoolean", FMU_ANY)) return fmi2Error;
  if (!fmu_given(c, "fmi2GetBoolean", vr, nvr) || !fmu_given(c, "fmi2GetBoolean", value, nvr))
    return fmi2Error;
  for (i = 0; i < nvr; i++) {
    double number;
    if (fmu_get(c, "fmi2GetBoolean", vr[i], 1, &number) != FMU_OK) return fmi2Error;
    value[i] = number > 0.0 ? fmi2True : fmi2False;
  }
  return fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                       const fmi2Real value[]) {
  if (!fmu_allowed(c, "fmi2SetReal", FMU_SETTABLE)) return fmi2Error;
  if (!fmu_given(c, "fmi2SetReal", vr, nvr) || !fmu_given(c, "fmi2SetReal", value, nvr))
    return fmi2Error;
  return result_of(fmu_set(c, "fmi2SetReal", vr, nvr, value));
}

/* There is no variable of these types, and no Boolean that could be set; asking for none of them is
 * no mistake. */
static fmi2Status none_of(fmi2Component c, const char *function, size_t nvr) {
  if (!fmu_allowed(c, function, FMU_ANY)) return fmi2Error;
  return nvr == 0 ? fmi2OK
                  : result_of(fmu_refuse(c, "%s: this FMU has no such variable", function));
}

fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                          fmi2Integer value[]) {
  (void)vr, (void)value;
  return none_of(c, "fmi2GetInteger", nvr);
}

fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                         fmi2String value[]) {
  (void)vr, (void)value;
  return none_of(c, "fmi2GetString", nvr);
}

fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                          const fmi2Integer value[]) {
  (void)vr, (void)value;
  return none_of(c, "fmi2SetInteger", nvr);
}

fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                          const fmi2Boolean value[]) {
  (void)vr, (void)value;
  return none_of(c, "fmi2SetBoolean", nvr);
}

fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                         const fmi2String value[]) {
  (void)vr, (void)value;
  return none_of(c, "fmi2SetString", nvr);
}

/* ---- saved states ---------------------------------------------- */

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *FMUstate) {
  if (!fmu_allowed(c, "fmi2GetFMUstate", FMU_ANY)) return fmi2Error;
  if (!fmu_given(c, "fmi2GetFMUstate", FMUstate, 1)) return fmi2Error;
  return result_of(fmu_save(c, "fmi2GetFMUstate", FMUstate));
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate FMUstate) {
  if (!fmu_allowed(c, "fmi2SetFMUstate", FMU_ANY)) return fmi2Error;
  if (!fmu_given(c, "fmi2SetFMUstate", FMUstate, 1)) return fmi2Error;
  return result_of(fmu_restore(c, "fmi2SetFMUstate", FMUstate));
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *FMUstate) {
  if (!fmu_allowed(c, "fmi2FreeFMUstate", FMU_ANY)) return fmi2Error;
  if (FMUstate == NULL) return fmi2OK;
  free(*FMUstate);
  *FMUstate = NULL;
  return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate FMUstate, size_t *size) {
  if (!fmu_allowed(c, "fmi2SerializedFMUstateSize", FMU_ANY)) return fmi2Error;
  if (!fmu_given(c, "fmi2SerializedFMUstateSize", FMUstate, 1)) return fmi2Error;
  if (!fmu_given(c, "fmi2SerializedFMUstateSize", size, 1)) return fmi2Error;
  *size = sizeof(fmu_saved);
  return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate FMUstate, fmi2Byte serializedState[],
                                 size_t size) {
  if (!fmu_allowed(c, "fmi2SerializeFMUstate", FMU_ANY)) return fmi2Error;
  if (!fmu_given(c, "fmi2SerializeFMUstate", FMUstate, 1)) return fmi2Error;
  if (!fmu_given(c, "fmi2SerializeFMUstate", serializedState, 1)) return fmi2Error;
  return result_of(fmu_serialize(c, "fmi2SerializeFMUstate", FMUstate, serializedState, size));
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte serializedState[], size_t size,
                                   fmi2FMUstate *FMUstate) {
  if (!fmu_allowed(c, "fmi2DeSerializeFMUstate", FMU_ANY)) return fmi2Error;
  if (!fmu_given(c, "fmi2DeSerializeFMUstate", serializedState, 1)) return fmi2Error;
  if (!fmu_given(c, "fmi2DeSerializeFMUstate", FMUstate, 1)) return fmi2Error;
  return result_of(fmu_deserialize(c, "fmi2DeSerializeFMUstate", serializedState, size, FMUstate));
}

/* ---- steps ---------------------------------------------- */

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real currentCommunicationPoint,
                      fmi2Real communicationStepSize,
                      fmi2Boolean noSetFMUStatePriorToCurrentPoint) {
  (void)noSetFMUStatePriorToCurrentPoint;
  if (!fmu_allowed(c, "fmi2DoStep", FMU_STEPPING)) return fmi2Error;
  return result_of(fmu_do_step(c, "fmi2DoStep", currentCommunicationPoint, communicationStepSize));
}

fmi2Status fmi2CancelStep(fmi2Component c) { return not_offered(c, "fmi2CancelStep"); }

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                       const fmi2Integer order[], const fmi2Real value[]) {
  (void)vr, (void)nvr, (void)order, (void)value;
  return not_offered(c, "fmi2SetRealInputDerivatives");
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                        const fmi2Integer order[], fmi2Real value[]) {
  (void)vr, (void)nvr, (void)order, (void)value;
  return not_offered(c, "fmi2GetRealOutputDerivatives");
}

/* Steps are done when fmi2DoStep returns, so of the statuses there are the last time and whether it
 * ended. */
fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind s, fmi2Status *value) {
  (void)s, (void)value;
  (void)fmu_unsupported(c, "fmi2GetStatus");
  return fmi2Discard;
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind s, fmi2Real *value) {
  const fmu_instance *fmu = c;
  if (!fmu_allowed(c, "fmi2GetRealStatus", FMU_ANY)) return fmi2Error;
  if (!fmu_given(c, "fmi2GetRealStatus", value, 1)) return fmi2Error;
  if (s != fmi2LastSuccessfulTime) return fmi2Discard;
  *value = fmu->core.now.clock;
  return fmi2OK;
}

fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind s, fmi2Integer *value) {
  (void)s, (void)value;
  (void)fmu_unsupported(c, "fmi2GetIntegerStatus");
  return fmi2Discard;
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind s, fmi2Boolean *value) {
  if (!fmu_allowed(c, "fmi2GetBooleanStatus", FMU_ANY)) return fmi2Error;
  if (!fmu_given(c, "fmi2GetBooleanStatus", value, 1)) return fmi2Error;
  if (s != fmi2Terminated) return fmi2Discard;
  *value = fmi2False;
  return fmi2OK;
}

fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind s, fmi2String *value) {
  (void)s, (void)value;
  (void)fmu_unsupported(c, "fmi2GetStringStatus");
  return fmi2Discard;
}

/* ---- what this FMU does not offer ---------------------------------------------- */

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference vUnknown_ref[],
                                        size_t nUnknown, const fmi2ValueReference vKnown_ref[],
                                        size_t nKnown, const fmi2Real dvKnown[],
                                        fmi2Real dvUnknown[]) {
  (void)vUnknown_ref, (void)nUnknown, (void)vKnown_ref, (void)nKnown, (void)dvKnown,
      (void)dvUnknown;
  return not_offered(c, "fmi2GetDirectionalDerivative");
}

fmi2Status fmi2EnterEventMode(fmi2Component c) { return not_offered(c, "fmi2EnterEventMode"); }

fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *eventInfo) {
  (void)eventInfo;
  return not_offered(c, "fmi2NewDiscreteStates");
}

fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c) {
  return not_offered(c, "fmi2EnterContinuousTimeMode");
}

fmi2Status fmi2CompletedIntegratorStep(fmi2Component c,
                                       fmi2Boolean noSetFMUStatePriorToCurrentPoint,
                                       fmi2Boolean *enterEventMode,
                                       fmi2Boolean *terminateSimulation) {
  (void)noSetFMUStatePriorToCurrentPoint, (void)enterEventMode, (void)terminateSimulation;
  return not_offered(c, "fmi2CompletedIntegratorStep");
}

fmi2Status fmi2SetTime(fmi2Component c, fmi2Real time) {
  (void)time;
  return not_offered(c, "fmi2SetTime");
}

fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t nx) {
  (void)x, (void)nx;
  return not_offered(c, "fmi2SetContinuousStates");
}

fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real derivatives[], size_t nx) {
  (void)derivatives, (void)nx;
  return not_offered(c, "fmi2GetDerivatives");
}

fmi2Status fmi2GetEventIndicators(fmi2Component c, fmi2Real eventIndicators[], size_t ni) {
  (void)eventIndicators, (void)ni;
  return not_offered(c, "fmi2GetEventIndicators");
}

fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real x[], size_t nx) {
  (void)x, (void)nx;
  return not_offered(c, "fmi2GetContinuousStates");
}

fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component c, fmi2Real x_nominal[], size_t nx) {
  (void)x_nominal, (void)nx;
  return not_offered(c, "fmi2GetNominalsOfContinuousStates");
}
