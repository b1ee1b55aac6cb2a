"""FMUs' values and states: what is set is set whole or not at all, what is restored is what was saved and can be."""

from __future__ import annotations

import ctypes
import math
import struct
from collections.abc import Callable

import numpy as np
import pytest
from fmi_client import CONTINUOUS, PERIOD, SAMPLED, STEP, Build, Client, Open, driven, refused

# --- set: all or nothing ---------------------------------------------------------------------------------


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("part", ["controller", "plant", "loop"])
def test_one_bad_value_sets_none(build: Build, open_fmu: Open, part: str, version: int) -> None:
    """Before, during and after initialization; the bad one first, in the middle or last; by value, name or type."""
    client = open_fmu(build(part, version, CONTINUOUS if part == "loop" else SAMPLED))
    parameters = client.names("parameter")
    tunable = [name for name in parameters if not name.startswith("initial.")]
    good = [*tunable[:2], *client.names("input")[:2]]
    client.references["nobody"] = 100_000
    everything = [*parameters, *client.names("input"), "time"]

    def attempts() -> None:
        before = client.get(everything)
        values = [1.1 * value + 0.01 for value in client.get(good)]
        outputs = client.get(client.names("output"))
        for bad, value in ((good[0], math.nan), (good[-1], math.nan), (good[0], -1.0), ("nobody", 0.0), ("time", 1.0)):
            for place in (0, 1, len(good)):
                names = [*good[:place], bad, *good[place:]]
                numbers = [*values[:place], value, *values[place:]]
                with pytest.raises(Exception, match="fmi"):
                    client.set(names, numbers)
                assert client.get(everything) == before
                assert client.get(client.names("output")) == outputs

    attempts()
    client.start()
    attempts()
    client.step(0.0)
    attempts()
    client.set(good, [1.1 * value + 0.01 for value in client.get(good)])
    assert client.get(client.names("output")) != [0.0] * len(client.names("output"))


@pytest.mark.parametrize("version", [2, 3])
def test_a_fixed_parameter_among_others_sets_none(build: Build, open_fmu: Open, version: int) -> None:
    client = open_fmu(build("loop", version, CONTINUOUS if version == 2 else SAMPLED)).start()
    names = ["control.delta", "initial.q.0"]
    before = client.get([*names, "U_lift"])
    refused(client, lambda: client.set(names, [0.3, 0.1]), "initial.q.0 is fixed after initialization")
    assert client.get([*names, "U_lift"]) == before


def test_a_tunable_parameter_counts_from_where_it_is_set(build: Build, open_fmu: Open) -> None:
    tuned, fresh = (open_fmu(build("loop", 3)) for _ in range(2))
    tuned.start()
    before = tuned.get(["U_lift"])
    tuned.set(["control.mu.0"], [20.0])
    fresh.set(["control.mu.0"], [20.0])
    fresh.start()
    assert tuned.get(["U_lift"]) == fresh.get(["U_lift"]) != before
    np.testing.assert_array_equal(driven(tuned, ["q1_lift"]), driven(fresh, ["q1_lift"]))


@pytest.mark.parametrize("version", [2, 3])
def test_retuned_between_samples_the_command_is_held_until_the_next(build: Build, open_fmu: Open, version: int) -> None:
    client = open_fmu(build("controller", version)).start()
    client.set(["q1d_lift", "dq1_lift"], [0.2, 0.5])
    held = client.get(["U_lift", "sigma_lift"])
    client.step(0.0, 0.5 * PERIOD)
    client.set(["control.mu.0", "control.delta"], [25.0, 0.01])
    assert client.get(["U_lift", "sigma_lift"]) == held
    client.step(0.5 * PERIOD, 0.5 * PERIOD)
    new = client.get(["U_lift", "sigma_lift"])
    other = open_fmu(build("controller", version)).start()
    other.set(["q1d_lift", "dq1_lift", "control.mu.0", "control.delta"], [0.2, 0.5, 25.0, 0.01])
    assert new == other.get(["U_lift", "sigma_lift"]) != held


@pytest.mark.parametrize("version", [2, 3])
def test_no_limit_is_1e300_or_more(build: Build, open_fmu: Open, version: int) -> None:
    """Read as written, scaled by a display unit's factor, or as infinity; and a limit below it limits."""
    client = open_fmu(build("controller", version)).start()
    client.set(["q1d_lift", "ddq1d_lift"], [0.3, 50.0])
    limits = ["control.U_max.0", "control.a_max"]
    limits = [name for name in limits if name in client.references]
    assert client.get(limits[:1]) == [1e300]
    free = client.get(["U_lift"])
    assert abs(free[0]) > 1000.0
    for value in (1e300, 1e303, 1.7e308, math.inf, 1e299):
        client.set(limits[:1], [value])
        assert client.get(["U_lift"]) == free
        assert client.get(limits[:1]) == [min(value, 1e300)]
    client.set(limits[:1], [500.0])
    assert client.get(["U_lift"]) == [math.copysign(500.0, free[0])]
    client.set(["q1d_lift"], [1e305])  # an input may be as great, and is no limit
    assert client.get(["q1d_lift"]) == [1e305]


# --- saved states ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("version", [2, 3])
def test_state_is_saved_restored_and_serialised(build: Build, open_fmu: Open, version: int) -> None:
    path = build("loop", version, CONTINUOUS if version == 2 else SAMPLED)
    client = open_fmu(path).start()
    outputs = client.names("output")
    client.step(0.0, 7 * STEP)  # between two samples
    state = client.slave.getFMUState()
    data = client.slave.serializeFMUState(state)

    def onwards(of: Client) -> list[list[float]]:
        rows = []
        for k in range(5):
            of.step((7 + 9 * k) * STEP, 9 * STEP)
            rows.append(of.get(outputs))
        return rows

    first = onwards(client)
    client.set(["control.delta", "plant.m3"], [0.5, 50.0])
    client.step((7 + 45) * STEP)  # whoever restores has a controller that is retuned, and has run
    client.slave.setFMUState(state)
    assert client.get(["control.delta"]) == [0.05]
    assert onwards(client) == first
    other = open_fmu(path)  # another instance, never initialised
    foreign = other.slave.deserializeFMUState(data)
    other.slave.setFMUState(foreign)
    assert other.get(["time"]) == [7 * STEP]
    assert onwards(other) == first
    assert other.slave.serializeFMUState(foreign) == data
    spoilt = bytearray(data)
    spoilt[100] ^= 1
    for bad in (bytes(spoilt), data[:-1], data + b"\0", b""):
        with pytest.raises(Exception, match=r"[Dd]e[sS]erialize"):
            other.slave.deserializeFMUState(bad)
    for instance, kept in ((client, state), (other, foreign)):
        instance.slave.freeFMUState(kept)


@pytest.mark.parametrize("version", [2, 3])
def test_a_restored_controller_has_the_parameters_of_its_state(build: Build, open_fmu: Open, version: int) -> None:
    """Both ways: restored over a retuned controller, and a retuned state restored over one that is as exported."""
    client = open_fmu(build("controller", version, CONTINUOUS)).start()
    client.set(["q1d_lift", "dq1_lift"], [0.2, 0.5])

    def saved(mu: float) -> tuple[object, list[float]]:
        client.set(["control.mu.0"], [mu])
        command = client.get(["U_lift"])
        return client.slave.getFMUState(), command

    (plain, soft), (tuned, hard) = saved(12.0), saved(30.0)
    assert soft != hard
    for state, command in ((plain, soft), (tuned, hard), (plain, soft)):
        client.slave.setFMUState(state)
        assert client.get(["U_lift"]) == command
        client.step(client.get(["time"])[0], PERIOD)
        assert client.get(["U_lift"]) == command
    for state in (plain, tuned):
        client.slave.freeFMUState(state)


class Bytes:
    """A serialised state, taken apart: token, checksum, values, and what instance.h keeps of time and mode."""

    TIMES = ("start", "stop", "clock", "time")
    COUNTS = ("step", "between", "calls", "has_stop", "mode")

    def __init__(self, data: bytes, values: int) -> None:
        self.token = data[:48]
        form = f"={values + len(self.TIMES)}d{len(self.COUNTS)}q"
        assert len(data) == 56 + struct.calcsize(form)
        numbers = struct.unpack(form, data[56:])
        self.form, self.values = form, list(numbers[:values])
        self.fields = dict(zip((*self.TIMES, *self.COUNTS), numbers[values:], strict=True))
        assert self.packed() == data

    def packed(self, **changes: float) -> bytes:
        """With other fields, and the checksum that belongs to them: nothing but a look at them can tell."""
        fields = {**self.fields, **{name: value for name, value in changes.items() if name in self.fields}}
        values = list(self.values)
        for name, value in changes.items():
            if name not in self.fields:
                values[int(name.removeprefix("v"))] = value
        body = struct.pack(self.form, *values, *fields.values())
        checksum = 14695981039346656037  # FNV-1a
        for byte in body:
            checksum = (checksum ^ byte) * 1099511628211 % 2**64
        return self.token + struct.pack("=Q", checksum) + body


IMPOSSIBLE = {
    "mode": (0, 3, 7, 32, -1, 2**62),
    "step": (-1, 2**53 + 2, 2**63 - 1, 6, 8),
    "between": (-1, 1, 2),
    "calls": (-1, 2**54),
    "has_stop": (-1, 2),
    "start": (math.nan, math.inf, 1e16, 0.5),
    "time": (math.nan, -1.0, 1.0, 7.5 * STEP, math.inf),
    "clock": (math.nan, math.inf, 1.0, 8 * STEP),
}


@pytest.mark.parametrize("version", [2, 3])
def test_impossible_states_are_refused_and_change_nothing(build: Build, open_fmu: Open, version: int) -> None:
    client = open_fmu(build("loop", version, CONTINUOUS if version == 2 else SAMPLED)).start()
    client.step(0.0, 7 * STEP)
    state = client.slave.getFMUState()
    good = Bytes(client.slave.serializeFMUState(state), len(client.references))
    client.slave.freeFMUState(state)
    changes = [{field: value} for field, values in IMPOSSIBLE.items() for value in values]
    changes += [{"has_stop": 1, "stop": stop} for stop in (math.nan, -1.0)]
    changes += [{"mode": 2}]  # 7 steps on, and in initialization
    for name, values in {
        "control.delta": (-1.0, math.nan),
        "control.nu": (3.0,),
        "control.U_max.0": (-math.inf, 0.0),
        "q1_lift": (math.nan, math.inf),
        "U_rotation": (math.nan,),
        "saturated_lift": (2.0, 0.5),
        "time": (0.0,),
    }.items():
        changes += [{f"v{client.references[name]}": value} for value in values]
    names = [*client.names("parameter"), *client.names("output"), "time"]
    before = client.get(names)
    restore: Callable[..., int] = client.slave.dll["fmi2SetFMUstate" if version == 2 else "fmi3SetFMUState"]
    instance = ctypes.c_void_p(client.slave.component)
    for change in changes:
        data = good.packed(**change)
        with pytest.raises(Exception, match=r"[Dd]e[sS]erialize"):
            client.slave.deserializeFMUState(data)
        assert "this is no state that can be" in client.messages[-1], change
        assert restore(instance, ctypes.create_string_buffer(data, len(data))) == 3, change
        assert client.get(names) == before
    foreign = b"{another}".ljust(48, b"\0") + good.packed()[48:]
    for data in (foreign, good.packed()[:60] + b"\1" + good.packed()[61:]):
        assert restore(instance, ctypes.create_string_buffer(data, len(data))) == 3
        assert "this is no state of this FMU" in client.messages[-1]
    client.step(7 * STEP, 3 * STEP)
    after = client.get(names)
    data = good.packed()  # what was refused all the time is taken as soon as nothing in it is wrong
    assert restore(instance, ctypes.create_string_buffer(data, len(data))) == 0
    assert client.get(names) == before
    client.step(7 * STEP, 3 * STEP)
    assert client.get(names) == after


def test_impossible_places_inside_a_step(build: Build, open_fmu: Open) -> None:
    client = open_fmu(build("plant", 3)).start()
    client.step(0.0, 7.5 * STEP)
    state = client.slave.getFMUState()
    good = Bytes(client.slave.serializeFMUState(state), len(client.references))
    client.slave.freeFMUState(state)
    assert (good.fields["step"], good.fields["between"]) == (7, 1)
    for change in (
        *({"between": between} for between in (0, -1, 2)),
        *({"step": step} for step in (6, 8)),
        *({"time": time, "clock": time, "v0": time} for time in (7 * STEP, 8 * STEP, 8.5 * STEP)),
    ):
        with pytest.raises(Exception, match="Deserialize"):
            client.slave.deserializeFMUState(good.packed(**change))
        assert "this is no state that can be" in client.messages[-1], change
    moved = {"time": 7.4 * STEP, "clock": 7.4 * STEP, "v0": 7.4 * STEP}
    client.slave.freeFMUState(client.slave.deserializeFMUState(good.packed(**moved)))


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("part", ["controller", "plant", "loop"])
@pytest.mark.parametrize("start", [0.0, 1.7e9])
def test_every_state_that_an_instance_comes_to_may_be_restored(
    build: Build, open_fmu: Open, part: str, version: int, start: float
) -> None:
    settings = {2: CONTINUOUS, 3: SAMPLED}[version] if part != "plant" else SAMPLED
    client = open_fmu(build(part, version, settings))
    outputs = client.names("output")

    def there_and_back() -> None:
        state = client.slave.getFMUState()
        before = client.get(outputs)
        again = client.slave.deserializeFMUState(client.slave.serializeFMUState(state))
        client.slave.setFMUState(again)
        assert client.get(outputs) == before
        for kept in (state, again):
            client.slave.freeFMUState(kept)

    there_and_back()
    client.start(start, stop=start + 10.0)
    there_and_back()
    time = start
    for length in (0.4, 0.6, 1.0, 2.5, 0.003, 0.5, 17.0, 0.3337, 1e-2, 1e-2):
        client.step(time, length * PERIOD)
        time += length * PERIOD
        there_and_back()
    for _ in range(300):  # the importer's sums drift away from the grid, which is no reason to refuse
        client.step(time)
        time += PERIOD
    there_and_back()
    client.slave.terminate()
    there_and_back()


@pytest.mark.parametrize("version", [2, 3])
def test_the_state_after_an_error_may_be_restored(build: Build, open_fmu: Open, version: int) -> None:
    client = open_fmu(build("plant", version)).start()
    client.step(0.0, 2.5 * PERIOD)
    client.set(["U_lift"], [1e300])
    refused(client, lambda: client.step(2.5 * PERIOD, 2 * PERIOD), "the plant left the finite numbers")
    failed = client.slave.getFMUState()
    data = client.slave.serializeFMUState(failed)
    client.slave.freeFMUState(failed)
    other = open_fmu(build("plant", version))
    state = other.slave.deserializeFMUState(data)
    other.slave.setFMUState(state)
    other.slave.freeFMUState(state)
    assert other.get(["q1_lift"]) == client.get(["q1_lift"])
    refused(other, lambda: other.step(2.5 * PERIOD), "may not be called after an error")
