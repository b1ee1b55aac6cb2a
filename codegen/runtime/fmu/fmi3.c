/*
 * fmi3.c - the functions of FMI 3.0 for Co-Simulation; those for other interface types, clocks and
 * derivatives are there and say that they are not offered.
 *
 * Built as a shared library the functions have their plain names. For static linking define
 * FMI3_FUNCTION_PREFIX as the model identifier followed by an underscore, as the standard asks.
 */
#include "fmi3Functions.h"

typedef fmi3LogMessageCallback fmu_logger;

#include "instance.h"

static void fmu_log(const fmu_instance *fmu, const char *message) {
  if (fmu->logger != NULL) fmu->logger(fmu->environment, fmi3Error, "logStatusError", message);
}

static fmi3Status result_of(int result) { return result == FMU_OK ? fmi3OK : fmi3Error; }

static fmi3Status not_offered(fmi3Instance instance, const char *function) {
  return result_of(fmu_unsupported(instance, function));
}

/* ---- life ---------------------------------------------- */

const char *fmi3GetVersion(void) { return fmi3Version; }

fmi3Status fmi3SetDebugLogging(fmi3Instance instance, fmi3Boolean loggingOn, size_t nCategories,
                               const fmi3String categories[]) {
  size_t i;
  (void)loggingOn; /* errors are all there is to log, and they always are */
  if (!fmu_allowed(instance, "fmi3SetDebugLogging", FMU_ANY)) return fmi3Error;
  if (!fmu_given(instance, "fmi3SetDebugLogging", categories, nCategories)) return fmi3Error;
  for (i = 0; i < nCategories; i++) {
    if (categories[i] == NULL || strcmp(categories[i], "logStatusError") != 0) {
      return result_of(
          fmu_refuse(instance, "fmi3SetDebugLogging: the only log category is logStatusError"));
    }
  }
  return fmi3OK;
}

fmi3Instance fmi3InstantiateCoSimulation(
    fmi3String instanceName, fmi3String instantiationToken, fmi3String resourcePath,
    fmi3Boolean visible, fmi3Boolean loggingOn, fmi3Boolean eventModeUsed,
    fmi3Boolean earlyReturnAllowed, const fmi3ValueReference requiredIntermediateVariables[],
    size_t nRequiredIntermediateVariables, fmi3InstanceEnvironment instanceEnvironment,
    fmi3LogMessageCallback logMessage, fmi3IntermediateUpdateCallback intermediateUpdate) {
  fmu_instance *fmu = fmu_new("fmi3InstantiateCoSimulation", instanceName, instantiationToken,
                              logMessage, instanceEnvironment);
  (void)resourcePath, (void)visible, (void)loggingOn, (void)earlyReturnAllowed,
      (void)intermediateUpdate;
  (void)requiredIntermediateVariables;
  if (fmu != NULL && (eventModeUsed || nRequiredIntermediateVariables > 0)) {
    (void)fmu_unsupported(fmu,
                          "fmi3InstantiateCoSimulation with event mode or intermediate variables");
    free(fmu);
    return NULL;
  }
  return fmu;
}

/* An instance that lives just long enough to say that there is none of its kind. */
static fmi3Instance no_instance(const char *function, fmi3String name, fmi3String token,
                                fmi3LogMessageCallback logger,
                                fmi3InstanceEnvironment environment) {
  fmu_instance *fmu = fmu_new(function, name, token, logger, environment);
  if (fmu != NULL) (void)fmu_unsupported(fmu, function);
  free(fmu);
  return NULL;
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String instanceName, fmi3String instantiationToken,
                                          fmi3String resourcePath, fmi3Boolean visible,
                                          fmi3Boolean loggingOn,
                                          fmi3InstanceEnvironment instanceEnvironment,
                                          fmi3LogMessageCallback logMessage) {
  (void)resourcePath, (void)visible, (void)loggingOn;
  return no_instance("fmi3InstantiateModelExchange", instanceName, instantiationToken, logMessage,
                     instanceEnvironment);
}

fmi3Instance fmi3InstantiateScheduledExecution(
    fmi3String instanceName, fmi3String instantiationToken, fmi3String resourcePath,
    fmi3Boolean visible, fmi3Boolean loggingOn, fmi3InstanceEnvironment instanceEnvironment,
    fmi3LogMessageCallback logMessage, fmi3ClockUpdateCallback clockUpdate,
    fmi3LockPreemptionCallback lockPreemption, fmi3UnlockPreemptionCallback unlockPreemption) {
  (void)resourcePath, (void)visible, (void)loggingOn, (void)clockUpdate, (void)lockPreemption,
      (void)unlockPreemption;
  return no_instance("fmi3InstantiateScheduledExecution", instanceName, instantiationToken,
                     logMessage, instanceEnvironment);
}

void fmi3FreeInstance(fmi3Instance instance) { free(instance); }

fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean toleranceDefined,
                                       fmi3Float64 tolerance, fmi3Float64 startTime,
                                       fmi3Boolean stopTimeDefined, fmi3Float64 stopTime) {
  fmu_instance *fmu = instance;
  (void)toleranceDefined, (void)tolerance;
  if (!fmu_allowed(fmu, "fmi3EnterInitializationMode", FMU_INSTANTIATED)) return fmi3Error;
  if (fmu_set_experiment(fmu, "fmi3EnterInitializationMode", startTime, stopTimeDefined,
                         stopTime) != FMU_OK) {
    return fmi3Error;
  }
  fmu->core.now.mode = FMU_INITIALIZING;
  return fmi3OK;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance instance) {
  if (!fmu_allowed(instance, "fmi3ExitInitializationMode", FMU_INITIALIZING)) return fmi3Error;
  return result_of(fmu_exit_initialization(instance, "fmi3ExitInitializationMode"));
}

fmi3Status fmi3Terminate(fmi3Instance instance) {
  fmu_instance *fmu = instance;
  if (!fmu_allowed(fmu, "fmi3Terminate", FMU_STEPPING)) return fmi3Error;
  if (fmu_refresh(fmu, "fmi3Terminate") != FMU_OK) return fmi3Error;
  fmu->core.now.mode = FMU_TERMINATED;
  return fmi3OK;
}

fmi3Status fmi3Reset(fmi3Instance instance) {
  if (!fmu_allowed(instance, "fmi3Reset", FMU_ANY)) return fmi3Error;
  return result_of(fmu_reset(instance, "fmi3Reset"));
}

/* ---- values ---------------------------------------------- */

static int listed(const fmu_instance *fmu, const char *function, const void *references, size_t n,
                  const void *values, size_t values_n) {
  if (!fmu_given(fmu, function, references, n) || !fmu_given(fmu, function, values, n)) return 0;
  if (n == values_n) return 1;
  (void)fmu_refuse(fmu, "%s: %lu values for %lu variables, all of which are scalars", function,
                   (unsigned long)values_n, (unsigned long)n);
  return 0;
}

fmi3Status fmi3GetFloat64(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                          size_t nValueReferences, fmi3Float64 values[], size_t nValues) {
  size_t i;
  if (!fmu_allowed(instance, "fmi3GetFloat64", FMU_ANY)) return fmi3Error;
  if (!listed(instance, "fmi3GetFloat64", valueReferences, nValueReferences, values, nValues))
    return fmi3Error;
  for (i = 0; i < nValueReferences; i++) {
    if (fmu_get(instance, "fmi3GetFloat64", valueReferences[i], 0, &values[i]) != FMU_OK)
      return fmi3Error;
  }
  return fmi3OK;
}

fmi3Status fmi3GetBoolean(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                          size_t nValueReferences, fmi3Boolean values[], size_t nValues) {
  size_t i;
  if (!fmu_allowed(instance, "fmi3GetBoolean", FMU_ANY)) return fmi3Error;
  if (!listed(instance, "fmi3GetBoolean", valueReferences, nValueReferences, values, nValues))
    return fmi3Error;
  for (i = 0; i < nValueReferences; i++) {
    double number;
    if (fmu_get(instance, "fmi3GetBoolean", valueReferences[i], 1, &number) != FMU_OK)
      return fmi3Error;
    values[i] = number > 0.0 ? fmi3True : fmi3False;
  }
  return fmi3OK;
}

fmi3Status fmi3SetFloat64(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                          size_t nValueReferences, const fmi3Float64 values[], size_t nValues) {
  if (!fmu_allowed(instance, "fmi3SetFloat64", FMU_SETTABLE)) return fmi3Error;
  if (!listed(instance, "fmi3SetFloat64", valueReferences, nValueReferences, values, nValues))
    return fmi3Error;
  return result_of(fmu_set(instance, "fmi3SetFloat64", valueReferences, nValueReferences, values));
}

/* There is no variable of the other types, and no Boolean that could be set; asking for none of
 * them is no mistake. */
static fmi3Status none_of(fmi3Instance instance, const char *function, size_t n) {
  if (!fmu_allowed(instance, function, FMU_ANY)) return fmi3Error;
  return n == 0 ? fmi3OK
                : result_of(fmu_refuse(instance, "%s: this FMU has no such variable", function));
}

#define GET_NONE(type)                                                                        \
  fmi3Status fmi3Get##type(fmi3Instance instance, const fmi3ValueReference valueReferences[], \
                           size_t nValueReferences, fmi3##type values[], size_t nValues) {    \
    (void)valueReferences, (void)values, (void)nValues;                                       \
    return none_of(instance, "fmi3Get" #type, nValueReferences);                              \
  }
#define SET_NONE(type)                                                                           \
  fmi3Status fmi3Set##type(fmi3Instance instance, const fmi3ValueReference valueReferences[],    \
                           size_t nValueReferences, const fmi3##type values[], size_t nValues) { \
    (void)valueReferences, (void)values, (void)nValues;                                          \
    return none_of(instance, "fmi3Set" #type, nValueReferences);                                 \
  }

GET_NONE(Float32)
GET_NONE(Int8)
GET_NONE(UInt8)
GET_NONE(Int16)
GET_NONE(UInt16)
GET_NONE(Int32)
GET_NONE(UInt32)
GET_NONE(Int64)
GET_NONE(UInt64)
GET_NONE(String)
SET_NONE(Float32)
SET_NONE(Int8)
SET_NONE(UInt8)
SET_NONE(Int16)
SET_NONE(UInt16)
SET_NONE(Int32)
SET_NONE(UInt32)
SET_NONE(Int64)
SET_NONE(UInt64)
SET_NONE(Boolean)
SET_NONE(String)

fmi3Status fmi3GetBinary(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                         size_t nValueReferences, size_t valueSizes[], fmi3Binary values[],
                         size_t nValues) {
  (void)valueReferences, (void)valueSizes, (void)values, (void)nValues;
  return none_of(instance, "fmi3GetBinary", nValueReferences);
}

fmi3Status fmi3SetBinary(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                         size_t nValueReferences, const size_t valueSizes[],
                         const fmi3Binary values[], size_t nValues) {
  (void)valueReferences, (void)valueSizes, (void)values, (void)nValues;
  return none_of(instance, "fmi3SetBinary", nValueReferences);
}

fmi3Status fmi3GetClock(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                        size_t nValueReferences, fmi3Clock values[]) {
  (void)valueReferences, (void)values;
  return none_of(instance, "fmi3GetClock", nValueReferences);
}

fmi3Status fmi3SetClock(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                        size_t nValueReferences, const fmi3Clock values[]) {
  (void)valueReferences, (void)values;
  return none_of(instance, "fmi3SetClock", nValueReferences);
}

/* ---- saved states ---------------------------------------------- */

fmi3Status fmi3GetFMUState(fmi3Instance instance, fmi3FMUState *FMUState) {
  if (!fmu_allowed(instance, "fmi3GetFMUState", FMU_ANY)) return fmi3Error;
  if (!fmu_given(instance, "fmi3GetFMUState", FMUState, 1)) return fmi3Error;
  return result_of(fmu_save(instance, "fmi3GetFMUState", FMUState));
}

fmi3Status fmi3SetFMUState(fmi3Instance instance, fmi3FMUState FMUState) {
  if (!fmu_allowed(instance, "fmi3SetFMUState", FMU_ANY)) return fmi3Error;
  if (!fmu_given(instance, "fmi3SetFMUState", FMUState, 1)) return fmi3Error;
  return result_of(fmu_restore(instance, "fmi3SetFMUState", FMUState));
}

fmi3Status fmi3FreeFMUState(fmi3Instance instance, fmi3FMUState *FMUState) {
  if (!fmu_allowed(instance, "fmi3FreeFMUState", FMU_ANY)) return fmi3Error;
  if (FMUState == NULL) return fmi3OK;
  free(*FMUState);
  *FMUState = NULL;
  return fmi3OK;
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance instance, fmi3FMUState FMUState, size_t *size) {
  if (!fmu_allowed(instance, "fmi3SerializedFMUStateSize", FMU_ANY)) return fmi3Error;
  if (!fmu_given(instance, "fmi3SerializedFMUStateSize", FMUState, 1)) return fmi3Error;
  if (!fmu_given(instance, "fmi3SerializedFMUStateSize", size, 1)) return fmi3Error;
  *size = sizeof(fmu_saved);
  return fmi3OK;
}

fmi3Status fmi3SerializeFMUState(fmi3Instance instance, fmi3FMUState FMUState,
                                 fmi3Byte serializedState[], size_t size) {
  if (!fmu_allowed(instance, "fmi3SerializeFMUState", FMU_ANY)) return fmi3Error;
  if (!fmu_given(instance, "fmi3SerializeFMUState", FMUState, 1)) return fmi3Error;
  if (!fmu_given(instance, "fmi3SerializeFMUState", serializedState, 1)) return fmi3Error;
  return result_of(
      fmu_serialize(instance, "fmi3SerializeFMUState", FMUState, serializedState, size));
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance instance, const fmi3Byte serializedState[],
                                   size_t size, fmi3FMUState *FMUState) {
  if (!fmu_allowed(instance, "fmi3DeserializeFMUState", FMU_ANY)) return fmi3Error;
  if (!fmu_given(instance, "fmi3DeserializeFMUState", serializedState, 1)) return fmi3Error;
  if (!fmu_given(instance, "fmi3DeserializeFMUState", FMUState, 1)) return fmi3Error;
  return result_of(
      fmu_deserialize(instance, "fmi3DeserializeFMUState", serializedState, size, FMUState));
}

/* ---- steps ---------------------------------------------- */

fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 currentCommunicationPoint,
                      fmi3Float64 communicationStepSize,
                      fmi3Boolean noSetFMUStatePriorToCurrentPoint,
                      fmi3Boolean *eventHandlingNeeded, fmi3Boolean *terminateSimulation,
                      fmi3Boolean *earlyReturn, fmi3Float64 *lastSuccessfulTime) {
  fmu_instance *fmu = instance;
  int result;
  (void)noSetFMUStatePriorToCurrentPoint;
  if (!fmu_allowed(fmu, "fmi3DoStep", FMU_STEPPING)) return fmi3Error;
  if (!fmu_given(fmu, "fmi3DoStep", eventHandlingNeeded, 1) ||
      !fmu_given(fmu, "fmi3DoStep", terminateSimulation, 1) ||
      !fmu_given(fmu, "fmi3DoStep", earlyReturn, 1) ||
      !fmu_given(fmu, "fmi3DoStep", lastSuccessfulTime, 1)) {
    return fmi3Error;
  }
  result = fmu_do_step(fmu, "fmi3DoStep", currentCommunicationPoint, communicationStepSize);
  *eventHandlingNeeded = *terminateSimulation = *earlyReturn = fmi3False;
  *lastSuccessfulTime = fmu->core.now.clock;
  return result_of(result);
}

fmi3Status fmi3EnterStepMode(fmi3Instance instance) {
  return not_offered(instance, "fmi3EnterStepMode");
}

fmi3Status fmi3GetOutputDerivatives(fmi3Instance instance,
                                    const fmi3ValueReference valueReferences[],
                                    size_t nValueReferences, const fmi3Int32 orders[],
                                    fmi3Float64 values[], size_t nValues) {
  (void)valueReferences, (void)nValueReferences, (void)orders, (void)values, (void)nValues;
  return not_offered(instance, "fmi3GetOutputDerivatives");
}

/* ---- what this FMU does not offer: structure, derivatives
 * ---------------------------------------------------- */

fmi3Status fmi3EnterConfigurationMode(fmi3Instance instance) {
  return not_offered(instance, "fmi3EnterConfigurationMode");
}

fmi3Status fmi3ExitConfigurationMode(fmi3Instance instance) {
  return not_offered(instance, "fmi3ExitConfigurationMode");
}

fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance instance,
                                               fmi3ValueReference valueReference,
                                               size_t *nDependencies) {
  (void)valueReference, (void)nDependencies;
  return not_offered(instance, "fmi3GetNumberOfVariableDependencies");
}

fmi3Status fmi3GetVariableDependencies(fmi3Instance instance, fmi3ValueReference dependent,
                                       size_t elementIndicesOfDependent[],
                                       fmi3ValueReference independents[],
                                       size_t elementIndicesOfIndependents[],
                                       fmi3DependencyKind dependencyKinds[], size_t nDependencies) {
  (void)dependent, (void)elementIndicesOfDependent, (void)independents,
      (void)elementIndicesOfIndependents;
  (void)dependencyKinds, (void)nDependencies;
  return not_offered(instance, "fmi3GetVariableDependencies");
}

fmi3Status fmi3GetDirectionalDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[],
                                        size_t nUnknowns, const fmi3ValueReference knowns[],
                                        size_t nKnowns, const fmi3Float64 seed[], size_t nSeed,
                                        fmi3Float64 sensitivity[], size_t nSensitivity) {
  (void)unknowns, (void)nUnknowns, (void)knowns, (void)nKnowns, (void)seed, (void)nSeed;
  (void)sensitivity, (void)nSensitivity;
  return not_offered(instance, "fmi3GetDirectionalDerivative");
}

fmi3Status fmi3GetAdjointDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[],
                                    size_t nUnknowns, const fmi3ValueReference knowns[],
                                    size_t nKnowns, const fmi3Float64 seed[], size_t nSeed,
                                    fmi3Float64 sensitivity[], size_t nSensitivity) {
  (void)unknowns, (void)nUnknowns, (void)knowns, (void)nKnowns, (void)seed, (void)nSeed;
  (void)sensitivity, (void)nSensitivity;
  return not_offered(instance, "fmi3GetAdjointDerivative");
}

/* ---- events and clocks ---------------------------------------------- */

fmi3Status fmi3EnterEventMode(fmi3Instance instance) {
  return not_offered(instance, "fmi3EnterEventMode");
}

fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance instance) {
  return not_offered(instance, "fmi3EvaluateDiscreteStates");
}

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance instance, fmi3Boolean *discreteStatesNeedUpdate,
                                    fmi3Boolean *terminateSimulation,
                                    fmi3Boolean *nominalsOfContinuousStatesChanged,
                                    fmi3Boolean *valuesOfContinuousStatesChanged,
                                    fmi3Boolean *nextEventTimeDefined, fmi3Float64 *nextEventTime) {
  (void)discreteStatesNeedUpdate, (void)terminateSimulation,
      (void)nominalsOfContinuousStatesChanged;
  (void)valuesOfContinuousStatesChanged, (void)nextEventTimeDefined, (void)nextEventTime;
  return not_offered(instance, "fmi3UpdateDiscreteStates");
}

fmi3Status fmi3GetIntervalDecimal(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                  size_t nValueReferences, fmi3Float64 intervals[],
                                  fmi3IntervalQualifier qualifiers[]) {
  (void)valueReferences, (void)nValueReferences, (void)intervals, (void)qualifiers;
  return not_offered(instance, "fmi3GetIntervalDecimal");
}

fmi3Status fmi3GetIntervalFraction(fmi3Instance instance,
                                   const fmi3ValueReference valueReferences[],
                                   size_t nValueReferences, fmi3UInt64 counters[],
                                   fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[]) {
  (void)valueReferences, (void)nValueReferences, (void)counters, (void)resolutions,
      (void)qualifiers;
  return not_offered(instance, "fmi3GetIntervalFraction");
}

fmi3Status fmi3GetShiftDecimal(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                               size_t nValueReferences, fmi3Float64 shifts[]) {
  (void)valueReferences, (void)nValueReferences, (void)shifts;
  return not_offered(instance, "fmi3GetShiftDecimal");
}

fmi3Status fmi3GetShiftFraction(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                size_t nValueReferences, fmi3UInt64 counters[],
                                fmi3UInt64 resolutions[]) {
  (void)valueReferences, (void)nValueReferences, (void)counters, (void)resolutions;
  return not_offered(instance, "fmi3GetShiftFraction");
}

fmi3Status fmi3SetIntervalDecimal(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                  size_t nValueReferences, const fmi3Float64 intervals[]) {
  (void)valueReferences, (void)nValueReferences, (void)intervals;
  return not_offered(instance, "fmi3SetIntervalDecimal");
}

fmi3Status fmi3SetIntervalFraction(fmi3Instance instance,
                                   const fmi3ValueReference valueReferences[],
                                   size_t nValueReferences, const fmi3UInt64 counters[],
                                   const fmi3UInt64 resolutions[]) {
  (void)valueReferences, (void)nValueReferences, (void)counters, (void)resolutions;
  return not_offered(instance, "fmi3SetIntervalFraction");
}

fmi3Status fmi3SetShiftDecimal(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                               size_t nValueReferences, const fmi3Float64 shifts[]) {
  (void)valueReferences, (void)nValueReferences, (void)shifts;
  return not_offered(instance, "fmi3SetShiftDecimal");
}

fmi3Status fmi3SetShiftFraction(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                size_t nValueReferences, const fmi3UInt64 counters[],
                                const fmi3UInt64 resolutions[]) {
  (void)valueReferences, (void)nValueReferences, (void)counters, (void)resolutions;
  return not_offered(instance, "fmi3SetShiftFraction");
}

fmi3Status fmi3ActivateModelPartition(fmi3Instance instance, fmi3ValueReference clockReference,
                                      fmi3Float64 activationTime) {
  (void)clockReference, (void)activationTime;
  return not_offered(instance, "fmi3ActivateModelPartition");
}

/* ---- Model Exchange ---------------------------------------------- */

fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance instance) {
  return not_offered(instance, "fmi3EnterContinuousTimeMode");
}

fmi3Status fmi3CompletedIntegratorStep(fmi3Instance instance,
                                       fmi3Boolean noSetFMUStatePriorToCurrentPoint,
                                       fmi3Boolean *enterEventMode,
                                       fmi3Boolean *terminateSimulation) {
  (void)noSetFMUStatePriorToCurrentPoint, (void)enterEventMode, (void)terminateSimulation;
  return not_offered(instance, "fmi3CompletedIntegratorStep");
}

fmi3Status fmi3SetTime(fmi3Instance instance, fmi3Float64 time) {
  (void)time;
  return not_offered(instance, "fmi3SetTime");
}

fmi3Status fmi3SetContinuousStates(fmi3Instance instance, const fmi3Float64 continuousStates[],
                                   size_t nContinuousStates) {
  (void)continuousStates, (void)nContinuousStates;
  return not_offered(instance, "fmi3SetContinuousStates");
}

fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance instance, fmi3Float64 derivatives[],
                                             size_t nContinuousStates) {
  (void)derivatives, (void)nContinuousStates;
  return not_offered(instance, "fmi3GetContinuousStateDerivatives");
}

fmi3Status fmi3GetEventIndicators(fmi3Instance instance, fmi3Float64 eventIndicators[],
                                  size_t nEventIndicators) {
  (void)eventIndicators, (void)nEventIndicators;
  return not_offered(instance, "fmi3GetEventIndicators");
}

fmi3Status fmi3GetContinuousStates(fmi3Instance instance, fmi3Float64 continuousStates[],
                                   size_t nContinuousStates) {
  (void)continuousStates, (void)nContinuousStates;
  return not_offered(instance, "fmi3GetContinuousStates");
}

fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance instance, fmi3Float64 nominals[],
                                             size_t nContinuousStates) {
  (void)nominals, (void)nContinuousStates;
  return not_offered(instance, "fmi3GetNominalsOfContinuousStates");
}

fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance instance, size_t *nEventIndicators) {
  (void)nEventIndicators;
  return not_offered(instance, "fmi3GetNumberOfEventIndicators");
}

fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance instance, size_t *nContinuousStates) {
  (void)nContinuousStates;
  return not_offered(instance, "fmi3GetNumberOfContinuousStates");
}
