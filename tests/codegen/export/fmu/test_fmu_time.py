"""FMUs in time: they count from the start time, wherever that is, and hold samples and steps to their grid."""

from __future__ import annotations

import ctypes
import itertools
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from fmi_client import (
    CONTINUOUS,
    DURATION,
    EVERY,
    PERIOD,
    SAMPLED,
    STEP,
    Build,
    Client,
    Open,
    Values,
    columns,
    driven,
    own_run,
    refused,
)
from numpy.typing import NDArray

from springline.codegen.export.fmu import fmu
from springline.codegen.program import Program, SignalTable, program
from springline.model.structure import SignalShape, Structure

UNIX = 1.7e9  # s; doubles there are 2.4e-7 s apart
STARTS = (0.25, -3.0, 1e6, UNIX, UNIX + 0.3)
STEPS = round(DURATION / PERIOD)


def grid(start: float) -> list[tuple[float, float]]:
    """Communication steps as fmpy and others make them: the k-th begins at start + k h."""
    return [(start + k * PERIOD, PERIOD) for k in range(STEPS)]


def differences(start: float) -> list[tuple[float, float]]:
    """Lengths that are differences of absolute times, each with the rounding of both."""
    return [(a, b - a) for a, b in itertools.pairwise(start + k * PERIOD for k in range(STEPS + 1))]


def sums(start: float) -> list[tuple[float, float]]:
    """t += h: at Unix times every sum is rounded, the same way, and after 150 ms they are 1 % of a millisecond off."""
    return [(t, PERIOD) for t in itertools.islice(itertools.accumulate(itertools.repeat(PERIOD), initial=start), STEPS)]


IMPORTERS = (grid, differences, sums)


def through(client: Client, steps: list[tuple[float, float]], names: list[str]) -> NDArray[np.float64]:
    rows = [client.get(names)]
    for time, length in steps:
        client.step(time, length)
        assert client.get(["time"]) == [time + length]
        rows.append(client.get(names))
    return np.array(rows)


@pytest.mark.parametrize("start", STARTS)
@pytest.mark.parametrize("importer", IMPORTERS)
@pytest.mark.parametrize("settings", [SAMPLED, CONTINUOUS], ids=["sampled", "continuous"])
def test_loop_runs_as_if_it_had_started_at_zero(
    build: Build, open_fmu: Open, shaken: Program, values_of: Values, settings: object, importer: object, start: float
) -> None:
    version = 2 if settings is CONTINUOUS else 3
    client = open_fmu(build("loop", version, settings)).start(start)
    assert callable(importer)
    rows = through(client, importer(start), columns(shaken))
    np.testing.assert_array_equal(rows, own_run(shaken, values_of(shaken), settings is SAMPLED))


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("importer", IMPORTERS)
def test_plant_at_unix_time_moves_as_at_zero(build: Build, open_fmu: Open, importer: object, version: int) -> None:
    assert callable(importer)
    names = ["q1_lift", "dq1_lift", "q2_rotation", "dq2_rotation", "y_r1", "dd_y_r1", "theta_1x"]
    rows = []
    for start in (0.0, UNIX):
        client = open_fmu(build("plant", version)).start(start)
        client.set(["U_lift", "U_rotation"], [600.0, 100.0])
        rows.append(through(client, importer(start)[:40], names))
    np.testing.assert_array_equal(rows[1], rows[0])
    assert rows[0][-1, 1] != rows[0][0, 1]


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("start", [0.0, UNIX])
@pytest.mark.parametrize("importer", IMPORTERS)
def test_sampled_controller_samples_at_every_millisecond_of_an_importer(
    build: Build, open_fmu: Open, importer: object, start: float, version: int
) -> None:
    """Every communication point is a sample: the command answers to the inputs that are set there, at the last too."""
    assert callable(importer)
    client, other = (open_fmu(build("controller", version)).start(start) for _ in range(2))
    for k, (time, length) in enumerate(importer(start)):
        client.step(time, length)
        other.set(["q1_lift"], [0.001 * k])  # `other` is always at its first sample
        client.set(["q1_lift"], [0.001 * k])
        assert client.get(["U_lift"]) == other.get(["U_lift"]), k


@pytest.mark.parametrize("start", [0.0, UNIX])
def test_sampled_controller_holds_between_samples(build: Build, open_fmu: Open, start: float) -> None:
    client, other = (open_fmu(build("controller", 3)).start(start) for _ in range(2))

    def step(time: float, length: float) -> None:
        client.step(start + time * PERIOD, length * PERIOD)

    def command(of: Client, q1: float, mu: float = 12.0) -> list[float]:
        of.set(["q1_lift", "q1d_lift", "control.mu.0"], [q1, 0.3, mu])
        return of.get(["U_lift", "U_rotation", "e_lift"])

    def sample(q1: float, mu: float = 12.0) -> list[float]:
        return command(other, q1, mu)  # at time 0, a sample

    assert command(client, 0.1) == sample(0.1)
    assert command(client, 0.2) == sample(0.2) != sample(0.1)  # at a sample the command belongs to its inputs
    step(0.0, 0.4)
    assert command(client, 0.7) == sample(0.2)  # between them it is held
    step(0.4, 0.6)
    assert command(client, 0.25) == sample(0.25)
    step(1.0, 0.5)
    command(client, 0.7)
    step(1.5, 1.0)  # the sample inside this step sees the inputs that are held during it
    assert command(client, 0.1) == sample(0.7)
    step(2.5, 2.75)  # two samples inside
    assert command(client, 0.6, 20.0) == sample(0.1)
    step(5.25, 1.0)  # with another parameter too
    assert command(client, 0.1) == sample(0.6, 20.0)
    step(6.25, 0.75)
    command(client, 0.45)
    client.set(["q1_lift"], [0.5])
    step(7.0, 0.5)  # the sample at its beginning, which nobody asked for
    assert command(client, 0.1) == sample(0.5)


def test_uneven_communication_steps(build: Build, open_fmu: Open, shaken: Program, values_of: Values) -> None:
    names = columns(shaken)
    expected = own_run(shaken, values_of(shaken), False)
    for start in (0.0, 0.25, UNIX):
        uneven = open_fmu(build("loop", 2, CONTINUOUS)).start(start)
        times = start + DURATION * np.array([0.0, 0.1001, 0.33333, 0.5, 0.50001, 1.0])
        for time, after in itertools.pairwise(times):
            uneven.step(time, after - time)
        np.testing.assert_allclose(uneven.get(names[:8]), expected[-1, :8], rtol=0, atol=1e-7)  # RK4 at other steps
        assert uneven.get(["time"]) == [times[-1]]


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("start", [0.0, UNIX])
def test_the_stop_time_is_reached_by_sums_and_not_passed(
    build: Build, open_fmu: Open, shaken: Program, values_of: Values, start: float, version: int
) -> None:
    """At Unix times sums of 1.1 ms run ahead, by 14 us in 200 steps."""
    settings, length, steps = CONTINUOUS if version == 2 else SAMPLED, 11 * STEP, 200
    client = open_fmu(build("loop", version, settings)).start(start, stop=start + steps * length)
    time = start
    for _ in range(steps):
        refused(client, lambda time=time: client.step(time - 0.5 * length, length), "but the instance is at")
        client.step(time, length)
        time += length
    assert (time > start + steps * length + 1e-5) == (start == UNIX)
    refused(client, lambda: client.step(time, length), "but the experiment stops at")
    expected = own_run(shaken, values_of(shaken), settings is SAMPLED, steps=11 * steps, every=11 * steps)
    assert client.get(columns(shaken)) == list(expected[-1])


@pytest.mark.parametrize("factor", [1.004, 0.9995, 1.0008])
def test_a_step_that_is_nearly_the_integrators_keeps_the_importers_time(
    build: Build, open_fmu: Open, factor: float
) -> None:
    """What rounding does not explain is meant: the instance's time never leaves the importer's by more than a bit."""
    near, right = (open_fmu(build("plant", 3)).start() for _ in range(2))
    for client in (near, right):
        client.set(["U_lift", "U_rotation"], [600.0, 100.0])
    length, steps = factor * STEP, 1000
    for k in range(steps):
        near.step(k * length, length)
    right.step(0.0, steps * length)
    state = ["q1_lift", "q1_rotation", "y_r1"]
    # 3e-3 of a step late at the most, at rates of 10 per second
    np.testing.assert_allclose(near.get(state), right.get(state), rtol=0, atol=10 * 3e-3 * STEP)


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("part", ["plant", "loop", "controller"])
def test_start_times_too_coarse_for_the_step_are_errors(build: Build, open_fmu: Open, part: str, version: int) -> None:
    """Spacings of doubles on both sides of 1 % of the step, and times at which t + h = t."""
    settings = SAMPLED if part == "controller" else CONTINUOUS
    unit = PERIOD if part == "controller" else STEP
    most = 2.0 ** math.floor(math.log2(0.01 * unit)) * 2.0**53  # the first time at which the spacing is too much
    for start in (1e16, -1e16, most, -most, 1e300):
        client = open_fmu(build(part, version, settings))
        refused(client, lambda start=start, client=client: client.start(start), "more than a hundredth of a step of")
    edge = math.nextafter(most, 0.0)
    client = open_fmu(build(part, version, settings)).start(edge - 1.0)
    client.step(edge - 1.0, 0.5)
    refused(client, lambda: client.step(edge - 0.5, 1.0), "more than a hundredth of a step of")
    client.step(edge - 0.5, 0.25)


def test_a_step_that_would_take_hours_is_refused(build: Build, open_fmu: Open) -> None:
    client = open_fmu(build("loop", 3)).start()
    refused(client, lambda: client.step(0.0, 1.1e9 * STEP), "more than 1000000000 steps of 0.0001 s")
    client.step(0.0)
    idle = open_fmu(build("controller", 3)).start()  # counting samples takes no time, and still has an end
    refused(idle, lambda: idle.step(0.0, 1.1e9 * PERIOD), "more than 1000000000 steps of 0.001 s")


@pytest.mark.parametrize("version", [2, 3])
def test_a_continuous_controller_takes_any_step_that_moves_the_clock(
    build: Build, open_fmu: Open, version: int
) -> None:
    """It has no grid that could be missed, but a step that ends where it begins is none."""
    client = open_fmu(build("controller", version, CONTINUOUS)).start(UNIX)
    client.step(UNIX, 1e-3)
    client.step(UNIX + 1e-3, 1e-6)
    refused(client, lambda: client.step(UNIX + 1e-3 + 1e-6, 1e-8), "is impossible")
    far = open_fmu(build("controller", version, CONTINUOUS)).start(1e16)
    refused(far, lambda: far.step(1e16, 1e-3), "is impossible")


@pytest.mark.parametrize("version", [2, 3])
def test_called_as_c_calls_it(build: Build, open_fmu: Open, version: int) -> None:
    """The same without fmpy's conversions: double arguments, and what comes back beside the status."""
    client = open_fmu(build("plant", version)).start(UNIX)
    dll, instance = client.slave.dll, ctypes.c_void_p(client.slave.component)
    point = ctypes.c_double()
    for k in range(20):
        at, length = ctypes.c_double(UNIX + k * PERIOD), ctypes.c_double(PERIOD)
        if version == 2:
            assert dll.fmi2DoStep(instance, at, length, ctypes.c_int(1)) == 0
            assert dll.fmi2GetRealStatus(instance, ctypes.c_int(2), ctypes.byref(point)) == 0
        else:
            flags = [ctypes.byref(ctypes.c_bool()) for _ in range(3)]
            assert dll.fmi3DoStep(instance, at, length, ctypes.c_bool(True), *flags, ctypes.byref(point)) == 0
        assert point.value == at.value + PERIOD
    reference = open_fmu(build("plant", version)).start()
    for k in range(20):
        reference.step(k * PERIOD)
    names = client.names("output")
    assert client.get(names) == reference.get(names)


@pytest.mark.parametrize("start", [0.0, UNIX])
def test_tables_count_from_the_start(open_fmu: Open, values_of: Values, tmp_path: Path, start: float) -> None:
    moved = program(Structure(base_motion=SignalShape("table", (1, 0, 1))))
    table = SignalTable(0.0, 0.0625, False, np.random.default_rng(474).normal(0.0, 0.1, (5, 2, 4)))
    values = values_of(moved)
    path = tmp_path / "tabled.fmu"
    path.write_bytes(
        fmu(
            moved.system.structure,
            values,
            replace(SAMPLED, until=DURATION),
            part="loop",
            version=2,
            identifier="tabled",
            name="tabled",
            tables=[table],
        )
    )
    client = open_fmu(path).start(start)
    rows = driven(client, columns(moved), start)
    np.testing.assert_array_equal(rows, own_run(moved, values, True, tables=[table]))
    last = start + EVERY * STEP * STEPS
    refused(client, lambda: client.step(last), "the scenario's tables end at 0.29999999999999999 s")
    refused(client, lambda: client.step(last), "a step to 0.30099999999999999 s after the start")
