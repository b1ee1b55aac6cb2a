"""What the tests of FMUs share: an arm to export, a client to drive it, and our own loop to compare with."""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from springline.codegen.export.fmu import Settings, fmu
from springline.codegen.kernel import KernelOptions, KernelSpec, LoopSettings, kernel
from springline.codegen.program import Program, SignalTable

STEP, PERIOD, DURATION = 1e-4, 1e-3, 0.3
SAMPLED = Settings(duration=DURATION, step=STEP, period=PERIOD)
CONTINUOUS = Settings(duration=DURATION, step=STEP)
EVERY = 10  # steps per communication step

Values = Callable[..., NDArray[np.float64]]
TIMING = "Largest delay: about 1 < 2 ms."

Build = Callable[..., Path]


def client_library(module: str) -> Any:
    """A client that the tests need; without it they are skipped, in CI they fail."""
    if importlib.util.find_spec(module) is not None:
        return importlib.import_module(module)
    reason = f"{module} is not installed: pip install 'springline[fmu,dev]'"
    if os.environ.get("CI") == "true":
        pytest.fail(reason)
    pytest.skip(reason)


def arm(of: Program, values: NDArray[np.float64], part: Any, version: Any, settings: Settings, name: str) -> bytes:
    told: dict[str, Any] = {"identifier": name, "name": name, "timing": [TIMING]}
    return fmu(of.system.structure, values, settings, part=part, version=version, **told)


class Client:
    """An FMU instance in fmpy: variables by name, messages kept."""

    def __init__(self, path: Path, folder: Path) -> None:
        fmpy = client_library("fmpy")
        self.description = fmpy.read_model_description(str(path))
        self.two = self.description.fmiVersion == "2.0"
        self.references = {v.name: v.valueReference for v in self.description.modelVariables}
        self.messages: list[str] = []
        unzipped = folder / path.stem
        if not unzipped.exists():
            fmpy.extract(str(path), unzipdir=str(unzipped))
        module = importlib.import_module("fmpy.fmi2" if self.two else "fmpy.fmi3")
        self.slave = (module.FMU2Slave if self.two else module.FMU3Slave)(
            guid=self.description.guid,
            unzipDirectory=str(unzipped),
            modelIdentifier=self.description.coSimulation.modelIdentifier,
            instanceName="under test",
        )
        if self.two:
            callbacks = module.fmi2CallbackFunctions()
            callbacks.logger = module.fmi2CallbackLoggerTYPE(
                lambda _e, _n, _s, _c, message: self.messages.append(message.decode())
            )
            self.slave.instantiate(callbacks=callbacks)
        else:
            self.slave.instantiate(logMessage=lambda _e, _s, _c, message: self.messages.append(message.decode()))

    def start(self, time: float = 0.0, stop: float | None = None) -> Client:
        if self.two:
            self.slave.setupExperiment(startTime=time, stopTime=stop)
            self.slave.enterInitializationMode()
        else:
            self.slave.enterInitializationMode(startTime=time, stopTime=stop)
        self.slave.exitInitializationMode()
        return self

    def get(self, names: Sequence[str]) -> list[float]:
        read = self.slave.getReal if self.two else self.slave.getFloat64
        return list(read([self.references[name] for name in names]))

    def set(self, names: Sequence[str], values: Sequence[float]) -> None:
        write = self.slave.setReal if self.two else self.slave.setFloat64
        write([self.references[name] for name in names], list(values))

    def step(self, time: float, length: float = PERIOD) -> None:
        self.slave.doStep(currentCommunicationPoint=time, communicationStepSize=length)

    def names(self, causality: str) -> list[str]:
        return [
            v.name
            for v in self.description.modelVariables
            if v.causality == causality and v.type in ("Real", "Float64")
        ]


def refused(client: Client, action: Callable[[], object], text: str) -> None:
    """The action is an FMI error, and its message says `text`."""
    before = len(client.messages)
    with pytest.raises(Exception, match="fmi"):
        action()
    assert len(client.messages) == before + 1, client.messages
    assert text in client.messages[-1]


Open = Callable[[Path], Client]


def columns(of: Program) -> list[str]:
    """Names of a trajectory's columns after t."""
    return [entry.name for entry in of.system.trajectory[1:]]


def own_run(
    of: Program,
    values: NDArray[np.float64],
    sampled: bool,
    *,
    steps: int = round(DURATION / STEP),
    every: int = EVERY,
    start: float = 0.0,
    tables: Sequence[SignalTable] = (),
) -> NDArray[np.float64]:
    """Our own loop's rows, without t."""
    loop = kernel(KernelSpec(of.system.structure, sampled, options=KernelOptions(width=1, groups=1)))
    settings = LoopSettings(steps=steps, step=STEP, hold=round(PERIOD / STEP), output_every=every, start_time=start)
    trajectory = loop.run(values[None, :], settings, tables).trajectory
    assert trajectory is not None
    return trajectory[0, :, 1:]


def driven(client: Client, names: Sequence[str], start: float = 0.0) -> NDArray[np.float64]:
    """The same rows from an FMU."""
    rows = [client.get(names)]
    for k in range(round(DURATION / STEP) // EVERY):
        client.step(start + k * EVERY * STEP, EVERY * STEP)
        rows.append(client.get(names))
    return np.array(rows)


def check_restored(path: Path, folder: Path, names: Sequence[str], step: float, first: int, last: int) -> None:
    """What an FMU shows from step `first` to `last` has the same bits again from a state that was saved at `first`.

    In the instance that was saved, and in another one to which the state came as bytes. All names must move meanwhile.
    """

    def onwards(client: Client) -> NDArray[np.float64]:
        rows = [client.get(names)]
        for k in range(first, last):
            client.step(k * step, step)
            rows.append(client.get(names))
        return np.array(rows)

    client = Client(path, folder).start()
    for k in range(first):
        client.step(k * step, step)
    saved = client.slave.getFMUState()
    data = client.slave.serializeFMUState(saved)
    seen = onwards(client)
    assert (np.ptp(seen, axis=0) > 0.0).all()
    client.slave.setFMUState(saved)
    np.testing.assert_array_equal(onwards(client), seen)
    other = Client(path, folder)
    foreign = other.slave.deserializeFMUState(data)
    other.slave.setFMUState(foreign)
    np.testing.assert_array_equal(onwards(other), seen)
    for instance, state in ((client, saved), (other, foreign)):
        instance.slave.freeFMUState(state)
        instance.slave.freeInstance()
