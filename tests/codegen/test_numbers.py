"""What comes through the door for numbers is what the caller had, to the last bit; everything else is refused."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pyarrow as pa
import pytest

from springline.codegen.numbers import double, doubles
from springline.runner import batch, load_scenario
from springline.runner.files import InputError
from springline.runner.scenario import Scenario

NUMBERS = np.array([1.5, -0.0, 3.0e-310, 2.0**60, np.inf])


def unaligned(values: np.ndarray) -> np.ndarray:
    return np.frombuffer(b"x" + values.tobytes(), dtype=values.dtype, offset=1)


@pytest.mark.parametrize(
    "given",
    [
        NUMBERS,
        NUMBERS.astype(">f8"),
        NUMBERS.astype(np.longdouble),
        NUMBERS.astype(object),
        np.repeat(NUMBERS, 3)[::3],
        unaligned(NUMBERS),
        np.ma.masked_array(NUMBERS, mask=False),
        NUMBERS.tolist(),
        tuple(NUMBERS),
        pa.array(NUMBERS),
        pa.chunked_array([NUMBERS[:2], NUMBERS[2:]]),
    ],
    ids=lambda given: f"{type(given).__name__}-{getattr(given, 'dtype', '')}",
)
def test_numbers_stay_what_they_are(given: Any) -> None:
    result = doubles(given)
    assert result.tobytes() == NUMBERS.tobytes()
    assert result.dtype == np.dtype("=f8")
    assert result.flags.c_contiguous
    assert result.flags.aligned


@pytest.mark.parametrize("kind", ["i1", ">i4", "u8", "i8", ">i8", "f2", ">f4"])
def test_narrower_and_whole_numbers_are_taken(kind: str) -> None:
    assert np.array_equal(doubles(np.array([[1, 0], [100, 7]], dtype=kind)), [[1.0, 0.0], [100.0, 7.0]])


def test_what_is_a_double_already_is_not_copied() -> None:
    assert np.shares_memory(doubles(NUMBERS), NUMBERS)


@pytest.mark.parametrize("value", [2**53, -(2**53), 2**62, 10**22, 2**1023])
def test_large_integers_that_are_doubles_are_taken(value: int) -> None:
    assert double(value) == value
    assert doubles([value]).tolist() == [value]


@pytest.mark.parametrize(
    "value", [2**53 + 1, -(2**53) - 1, 2**64 - 1, 10**23 + 1, 10**400, -(10**6000)], ids=int.bit_length
)
def test_integers_between_two_doubles_are_refused(value: int) -> None:
    with pytest.raises(ValueError, match="no 64-bit float is"):
        double(value)
    with pytest.raises(ValueError, match="no 64-bit float is"):
        doubles([1.0, value])


@pytest.mark.parametrize(
    "given",
    [
        np.array([1, 2**53 + 1]),
        np.array([1, 2**64 - 1], dtype=np.uint64),
        np.array([-(2**63), -(2**63) + 1]),
        np.array([1, 2**53 + 1]).astype(">i8"),
        np.array([1, 1 + np.finfo(np.longdouble).eps], dtype=np.longdouble),
        np.array([1, np.finfo(np.longdouble).max], dtype=np.longdouble),
        np.ma.masked_array([1.0, 2.0], mask=[False, True]),
        [np.ma.masked_array([1, 2], mask=[False, True]), np.array([3, 4])],
        pa.array([1.0, None]),
        pa.array([1, 2**53 + 1]),
    ],
    ids=lambda given: type(given).__name__,
)
def test_what_would_be_lost_is_refused(given: Any) -> None:
    with pytest.raises(ValueError, match=r"no 64-bit float is|masked|missing"):
        doubles(given)


@pytest.mark.parametrize(
    "given",
    [
        [True, 1.0],
        np.array([True]),
        pa.array([True]),
        ["1.0"],
        np.array(["1"]),
        [None],
        [1j],
        np.array([1j]),
        np.array(["2026-01-01"], dtype="M8[ns]"),
        np.array([1], dtype="m8[ns]"),
        [[1.0], [1.0, 2.0]],
        None,
        {"a": 1.0},
    ],
    ids=lambda given: type(given).__name__,
)
def test_what_is_no_number_is_refused(given: Any) -> None:
    with pytest.raises(TypeError, match="is no"):
        doubles(given)


@pytest.fixture
def scenario() -> Scenario:
    return load_scenario("paper/nominal", {"simulation.duration": 0.002})


@pytest.mark.parametrize(
    "convert",
    [
        lambda a: a.astype(">f8"),
        lambda a: a.astype(np.longdouble),
        lambda a: np.repeat(a, 2)[::2],
        unaligned,
        pa.array,
        list,
    ],
)
def test_a_batch_takes_columns_of_any_make(scenario: Scenario, convert: Callable[[np.ndarray], Any]) -> None:
    column = np.array([2.5, 3.0, 4.75])
    assert batch(scenario, {"control.k1": convert(column)}, jobs=1).equals(
        batch(scenario, {"control.k1": column}, jobs=1), check_metadata=True
    )


@pytest.mark.parametrize("value", [2**53 + 1, np.uint64(2**64 - 1), np.longdouble("0.1"), True, np.ma.masked])
def test_neither_a_batch_nor_an_override_rounds(scenario: Scenario, value: Any) -> None:
    if isinstance(value, np.longdouble) and float(value) == value:
        pytest.skip("here long double is double")
    with pytest.raises(InputError, match=r"control\.k1: expected a column of numbers"):
        batch(scenario, {"control.k1": [1.0, value]})
    with pytest.raises(InputError, match=r"control\.k1: expected a"):
        scenario.with_overrides({"control.k1": value})


@pytest.mark.parametrize("make", [np.array, pa.array, lambda a: np.array(a, dtype=">f8"), np.longdouble])
def test_overrides_take_arrays_of_any_make(scenario: Scenario, make: Callable[[Any], Any]) -> None:
    assert scenario.with_overrides({"control.mu": make([0.5, 0.25])}).document["control"]["mu"] == [0.5, 0.25]
    assert scenario.with_overrides({"control.l": np.int64(5)}).document["control"]["l"] == 5


def test_overrides_refuse_times_and_endless_nesting(scenario: Scenario) -> None:
    with pytest.raises(InputError, match=r"control\.k1: expected a value.*no kind of number"):
        scenario.with_overrides({"control.k1": np.datetime64("2026-01-01", "ns")})
    nested: Any = 1.0
    for _ in range(5000):
        nested = [nested]
    with pytest.raises(InputError, match=r"control\.k1: .*nested more than"):
        scenario.with_overrides({"control.k1": nested})
