"""CSV tables: splines that are as smooth and as exact as promised, and messages for every kind of bad file."""

from __future__ import annotations

import math
from importlib import resources

import numpy as np
import pytest
from numpy.polynomial.polynomial import polyder, polyval

from springline.codegen.program import SignalTable
from springline.runner.files import InputError
from springline.runner.scenario import kernel_tables
from springline.runner.scenario.signal_csv import HALF_TURN, UNITS, Column
from springline.runner.scenario.signal_tables import read_table
from springline.runner.scenario.splines import ENDS, Ends, Spline, spline

Knots = Spline | SignalTable


def evaluate(table: Knots, t: np.ndarray, derivative: int = 0) -> np.ndarray:
    """Value or derivative, (times, channels); outside the knots the value and the slope of the nearest one."""
    t = np.clip(t, table.t0, table.t0 + table.dt * len(table.coefficients))
    k = np.clip(np.floor((t - table.t0) / table.dt).astype(int), 0, len(table.coefficients) - 1)
    tau = t - (table.t0 + k * table.dt)
    coefficients = np.moveaxis(table.coefficients[k], -1, 0)
    return polyval(tau[:, None], polyder(coefficients, derivative), tensor=False)


def at_knots(table: Knots, derivative: int) -> tuple[np.ndarray, np.ndarray]:
    """A derivative just before and just after every inner knot, (knots, channels) each."""
    c = np.moveaxis(table.coefficients, -1, 0)
    d = polyder(c, derivative)
    return polyval(table.dt, d, tensor=False)[:-1], polyval(0.0, d, tensor=False)[1:]


def read(
    text: str, ends: Ends = "error", columns: tuple[str, ...] = ("a",), *, unit: str = "", seconds: float = 1.0
) -> tuple[Spline, list[str]]:
    """A table from CSV text, with its notes; the columns in SI units or in a unit of an angle."""
    factor, half_turn = UNITS["rad"].get(unit, 1.0), HALF_TURN.get(unit, math.inf)
    channels = [Column(name, f"reference.columns.{name}", factor, half_turn) for name in columns]
    time = Column("t", "reference.columns.t", seconds)
    found = read_table(text.encode(), "x.csv", time, channels, ends, where="s.toml", key="reference.path")
    return found.spline, found.notes


def csv(text: str, ends: Ends = "error", columns: tuple[str, ...] = ("a",)) -> Spline:
    """A table in SI units from CSV text of which there is nothing to note."""
    table, notes = read(text, ends, columns)
    assert notes == []
    return table


def rows(times: np.ndarray, *columns: np.ndarray, names: str = "t,a") -> str:
    """CSV text with shortest exact digits."""
    lines = [",".join(repr(float(v)) for v in row) for row in zip(times, *columns, strict=True)]
    return "\n".join([names, *lines]) + "\n"


def message(text: str, ends: Ends = "error", columns: tuple[str, ...] = ("a",)) -> str:
    with pytest.raises(InputError) as caught:
        csv(text, ends, columns)
    return str(caught.value)


@pytest.mark.parametrize("ends", ENDS)
def test_value_rate_and_acceleration_are_continuous(ends: Ends) -> None:
    generator = np.random.default_rng(7)
    samples = generator.standard_normal((40, 2))
    if ends == "periodic":
        samples[-1] = samples[0]
    table = spline(-1.5, 0.1, samples, ends)
    for derivative in range(3):
        before, after = at_knots(table, derivative)
        scale = np.abs(table.coefficients[..., derivative]).max()
        assert np.abs(before - after).max() <= 1e-11 * scale
    assert np.allclose(evaluate(table, -1.5 + 0.1 * np.arange(40)), samples, rtol=0, atol=1e-12)


# Outside the samples


def own_accelerations(table: Spline) -> np.ndarray:
    """The largest acceleration of each channel between the samples: it is linear from knot to knot."""
    c2, c3 = table.coefficients[..., 2], table.coefficients[..., 3]
    return np.maximum(np.abs(2 * c2).max(axis=0), np.abs(2 * c2 + 6 * c3 * table.dt).max(axis=0))


def records() -> list[np.ndarray]:
    """Records that begin and end in the middle of a motion, at several scales: (rows, channels)."""
    t, generator = 0.05 * np.arange(160), np.random.default_rng(11)
    swell = np.stack([2.0 * np.sin(0.8 * t + 0.3), 1e-3 * np.cos(1.7 * t), 40.0 + np.sin(5.1 * t) + t], axis=1)
    return [
        swell,
        generator.standard_normal((30, 2)) * [1e-6, 1e6],
        (t[:20, None] - 0.2) ** 3,
        np.sin(1.5 * t[:21, None]),
    ]


@pytest.mark.parametrize("record", records(), ids=["swell", "noise", "cubic", "quarter of a sine"])
@pytest.mark.parametrize("dt", [1e-3, 0.05, 7.0])
def test_a_held_record_comes_to_rest_with_no_more_acceleration_than_it_has(record: np.ndarray, dt: float) -> None:
    table = spline(3.0, dt, record, "hold")
    (knots,) = kernel_tables([table])
    for derivative in range(3):
        before, after = at_knots(knots, derivative)
        scale = np.abs(knots.coefficients[..., derivative]).max(axis=0)
        assert np.all(np.abs(before - after) <= 1e-11 * scale), derivative
    c2, c3 = knots.coefficients[..., 2], knots.coefficients[..., 3]
    largest = np.maximum(np.abs(2 * c2).max(axis=0), np.abs(2 * c2 + 6 * c3 * dt).max(axis=0))
    assert np.all(largest <= own_accelerations(table) * (1 + 1e-12))
    # Far outside nothing moves, and what stands there are the first and the last sample.
    assert np.all(knots.coefficients[[0, -1], :, 1:] == 0.0)
    far = evaluate(knots, np.array([-1e9, 1e9]))
    assert np.allclose(far, record[[0, -1]], rtol=0, atol=1e-12 * np.abs(record).max(axis=0))


@pytest.mark.parametrize("record", records(), ids=["swell", "noise", "cubic", "quarter of a sine"])
def test_between_the_samples_a_held_record_is_the_one_with_no_ends(record: np.ndarray) -> None:
    held, none = spline(-1.0, 0.25, record, "hold"), spline(-1.0, 0.25, record, "error")
    assert np.array_equal(held.coefficients, none.coefficients)
    (knots,) = kernel_tables([held])
    t = np.linspace(none.t0, none.end, 1001)
    for derivative in range(3):
        exact = evaluate(none, t, derivative)
        assert np.allclose(evaluate(knots, t, derivative), exact, rtol=0, atol=1e-10 * np.abs(exact).max())


def test_the_way_to_rest_is_the_quintic_of_least_jerk() -> None:
    """With many samples on the way, it is the polynomial that joins the motion of the end with rest at the same place.

    The quintic with q(0) = q(T) = q'(T) = q''(T) = 0, q'(0) = v, q''(0) = a is
    v T s (1 - s)^3 (1 + 3 s) + a T^2 / 2 s^2 (1 - s)^3, s = t / T.
    """
    t = 0.01 * np.arange(401)
    table = spline(0.0, 0.01, np.sin(0.9 * t)[:, None] + 2.0, "hold")
    before, after = table.rests()
    for intervals, now, sign in ((after, t[-1], 1.0), (before, t[0], -1.0)):
        last = (len(intervals) - 1) * 0.01
        assert last > 2.0
        v, a = sign * 0.9 * math.cos(0.9 * now), -0.81 * math.sin(0.9 * now)
        s = np.arange(len(intervals)) / (len(intervals) - 1)
        quintic = v * last * s * (1 - s) ** 3 * (1 + 3 * s) + a / 2 * last**2 * s**2 * (1 - s) ** 3
        found = intervals[:, 0, 0] if sign > 0 else np.append(intervals[1:, 0, 0], math.sin(0.9 * now) + 2.0)[::-1]
        assert np.abs(found - (math.sin(0.9 * now) + 2.0) - quintic).max() <= 2e-4 * np.abs(quintic).max()


def test_every_channel_comes_to_rest_in_its_own_time() -> None:
    t = 0.1 * np.arange(100)
    fast, slow = np.sin(9.0 * t), np.sin(0.7 * t)
    both = spline(0.0, 0.1, np.stack([fast, slow], axis=1), "hold").rests()
    for channel, alone in enumerate((fast, slow)):
        before, after = spline(0.0, 0.1, alone[:, None], "hold").rests()
        assert np.array_equal(both[0][-len(before) :, channel], before[:, 0])
        assert np.array_equal(both[1][: len(after), channel], after[:, 0])
    assert len(both[0]) > 5 * len(spline(0.0, 0.1, fast[:, None], "hold").rests()[0])


def test_a_record_at_rest_needs_no_way_to_it() -> None:
    before, after = spline(0.0, 0.1, np.full((9, 2), [0.3, -7.0]), "hold").rests()
    assert before.tolist() == after.tolist() == [[[0.3, 0.0, 0.0, 0.0], [-7.0, 0.0, 0.0, 0.0]]]


def digits(values: np.ndarray, places: int | None) -> np.ndarray:
    return values if places is None else np.round(values, places)


@pytest.mark.parametrize(("places", "bend"), [(None, 0.0), (3, 0.0), (2, 1e-3)])
def test_a_ramp_stops_as_at_a_corner_of_its_samples(places: int | None, bend: float) -> None:
    """It has no acceleration but what its digits make: its rate over the sample interval is enough to stop it."""
    t = 0.2 * np.arange(30)
    table = csv(rows(t, digits(1.5 * t + bend * np.sin(t), places)), "hold")
    for intervals in table.rests():
        assert 3 <= len(intervals) - 1 <= 8
        assert np.abs(2 * intervals[..., 2]).max() <= 1.55 / 0.2
        assert np.ptp(intervals[..., 0]) <= 1.55 * 0.2  # and it goes no further than one sample would have taken it


@pytest.mark.parametrize("dt", [1e-3, 0.2, 30.0])
@pytest.mark.parametrize("bend", [0.5, 0.02, 1e-3])
@pytest.mark.parametrize("unit", [1.0, 1e-3])
def test_what_is_nearly_a_ramp_is_stopped_by_its_own_accelerations(dt: float, bend: float, unit: float) -> None:
    """However long that takes, and in whatever unit its digits are written."""
    turns = 0.2 * np.arange(30)
    record = rows(dt * np.arange(30), (1.5 * turns + bend * np.sin(turns)) / unit)
    channels = [Column("a", "reference.columns.a", unit)]
    table = read_table(record.encode(), "x.csv", Column("t", ""), channels, "hold", where="s.toml", key="").spline
    own = own_accelerations(table)
    assert own == pytest.approx(bend * (0.2 / dt) ** 2, rel=0.1)
    for intervals in table.rests():
        c2, c3 = intervals[..., 2], intervals[..., 3]
        assert np.all(np.maximum(np.abs(2 * c2), np.abs(2 * c2 + 6 * c3 * dt)).max(axis=0) <= own * (1 + 1e-12))


def test_accelerations_too_small_to_count_take_no_longer_than_a_table_may() -> None:
    t = 0.2 * np.arange(30)
    before, after = spline(0.0, 0.2, (1.5 * t + 1e-9 * np.sin(t))[:, None], "hold").rests()
    assert 2**18 <= len(before) <= 2**18 * 1.13 and 2**18 <= len(after) <= 2**18 * 1.13


def test_a_digit_is_what_the_last_place_written_is_worth() -> None:
    t = 0.2 * np.arange(30)
    bent = [f"{value:.4f}" for value in 1.5 * t + 1e-3 * np.sin(t)]

    def bound(cells: list[str]) -> float:
        text = "t,a\n" + "".join(f"{time!r},{cell}\n" for time, cell in zip(t.tolist(), cells, strict=True))
        return float(csv(text, "hold").bounds[0])

    as_ramp = bound(bent)
    assert as_ramp == pytest.approx(1.5 / 0.2, rel=0.01)
    assert bound([f"{float(cell) * 100:.2f}e-2" for cell in bent]) == as_ramp
    # One digit more, wherever it stands, says that the others are as good; what overflows and underflows is no digit.
    assert bound([f"{bent[0]}00", *bent[1:]]) < 0.1
    assert bound(["0e-99999", *bent[1:]]) < 0.1
    assert bound([f"0e{'9' * 5000}", *bent[1:]]) == as_ramp


@pytest.mark.parametrize("share", [0.0, 0.4, 1.0, 1.1, 1.6, 5.0])
@pytest.mark.parametrize("last", [False, True])
def test_how_far_astray_counts_as_much_of_the_way_as_the_run_sees(share: float, last: bool) -> None:
    t = 0.25 * np.arange(41)
    record = (t + 0.2 * np.sin(t))[:, None]
    way = spline(0.0, 0.25, record, "hold").rests()[last]
    seen = int(share * len(way))
    part = way[: seen + 1, 0, 0] if last else way[len(way) - min(seen, len(way)) :, 0, 0]
    far = part[np.abs(part - 5.0).argmax()] if len(part) else 5.0
    table = spline(0.0 if last else 0.25 * seen, 0.25, record, "hold")
    (found,) = table.astray(10.0 + 0.25 * seen if last else table.end - 1.0)
    assert (found == far) if abs(far - record.mean()) > np.ptp(record) else math.isnan(found)


# Between them


def test_cubics_are_exact_between_and_at_the_ends() -> None:
    t = 2.0 + 0.25 * np.arange(12)
    wanted = np.array([0.3, -1.0, 2.0, 0.5])
    table = csv(rows(t, polyval(t, wanted)))
    dense = np.linspace(t[0], t[-1], 501)
    for derivative in range(3):
        exact = polyval(dense, polyder(wanted, derivative))
        assert np.allclose(evaluate(table, dense, derivative)[:, 0], exact, rtol=1e-11, atol=0)


def test_error_of_a_sine_falls_with_the_fourth_power() -> None:
    errors = []
    for n in (80, 160, 320):
        t = np.linspace(0.0, 2.0, n + 1)
        table = csv(rows(t, np.sin(5 * t)))
        dense = np.linspace(0.0, 2.0, 4001)
        errors.append(np.abs(evaluate(table, dense)[:, 0] - np.sin(5 * dense)).max())
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all((orders > 3.7) & (orders < 4.3)), orders


@pytest.mark.parametrize("closed", [True, False])
def test_a_periodic_table_closes_its_period(closed: bool) -> None:
    n, period = 64, 2 * math.pi
    t = period * np.arange(n + closed) / n
    table = csv(rows(t, np.sin(t)), "periodic")
    assert table.end == pytest.approx(period, rel=1e-12)
    dense = np.linspace(0.0, period, 777)
    assert np.abs(evaluate(table, dense)[:, 0] - np.sin(dense)).max() < 1e-6
    for derivative in range(3):
        first, last = evaluate(table, np.array([0.0, table.end]), derivative)
        assert first == pytest.approx(last, abs=1e-9)


def test_a_record_that_does_not_repeat_is_no_period() -> None:
    t = np.arange(20.0)
    text = message(rows(t, t), "periodic")
    assert "reference.columns.a" in text and "'hold'" in text and "jumps" in text


@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize(("step", "repeats"), [(1.0, True), (1.45, True), (1.55, False), (3.0, False), (14.0, False)])
def test_the_step_that_closes_a_period_is_up_to_half_as_much_again_as_the_longest(
    step: float, repeats: bool, sign: float
) -> None:
    """A slow way up and steps of 1 down, as far as `step` from the first row, which is to follow the last."""
    values = sign * np.concatenate([np.linspace(0.0, step + 3.0, 40), step + np.arange(2.0, -1.0, -1.0)])
    text = rows(np.arange(43.0), values)
    if repeats:
        assert csv(text, "periodic").end == 43.0
    else:
        assert "jumps where it should repeat" in message(text, "periodic")


def test_units_are_what_they_are_called() -> None:
    assert {
        "s": {"s": 1.0, "ms": 0.001, "min": 60.0},
        "m": {"m": 1.0, "mm": 0.001, "cm": 0.01, "km": 1000.0},
        "rad": {"rad": 1.0, "mrad": 0.001, "deg": pytest.approx(0.017453292519943295, rel=1e-15)},
    } == UNITS
    assert {unit: 2 * half * UNITS["rad"][unit] for unit, half in HALF_TURN.items()} == pytest.approx(
        dict.fromkeys(UNITS["rad"], 2 * math.pi), rel=1e-15
    )


def test_the_unit_of_a_column_is_applied() -> None:
    text = rows(np.arange(5.0) * 1000, np.full(5, 90.0), names="t,a")
    channels = [Column("a", "k", UNITS["rad"]["deg"])]
    time = Column("t", "t", UNITS["s"]["ms"])
    table = read_table(text.encode(), "x.csv", time, channels, "error", where="", key="").spline
    assert table.dt == pytest.approx(1.0)
    assert table.coefficients[:, 0, 0] == pytest.approx(math.pi / 2)


GOOD = rows(np.arange(6.0), np.zeros(6))


@pytest.mark.parametrize(
    ("text", "told"),
    [
        pytest.param(GOOD.replace("t,a", "t,b"), ["reference.columns.a", "unknown column", "'a'"], id="missing column"),
        pytest.param(GOOD.replace("t,a", "a,a"), ["reference.columns.t", "more than one column 'a'"], id="twice"),
        pytest.param(GOOD.replace("3.0,0.0", "3.0,nan"), ["line 5", "'a'", "a finite number", "'nan'"], id="NaN"),
        pytest.param(GOOD.replace("3.0,0.0", "3.0,1e999"), ["line 5", "a finite number"], id="too large"),
        pytest.param(GOOD.replace("3.0,0.0", "3.0,three"), ["line 5", "'three'"], id="text"),
        pytest.param(GOOD.replace("3.0,0.0", "3.0,"), ["line 5", "''"], id="empty cell"),
        pytest.param(GOOD.replace("3.0,0.0", "3.0"), ["line 5", "expected 2 cells", "got 1"], id="short row"),
        pytest.param(
            GOOD.replace("3.0,", "2.0,"), ["line 5", "'t'", "repeats the time of line 4, 2 s"], id="repeated time"
        ),
        pytest.param(
            GOOD.replace("3.0,", "1.5,"),
            ["line 5, column 't'", "later than that of line 4, 2 s", "got 1.5 s"],
            id="earlier time",
        ),
        pytest.param(rows(-np.arange(6.0), np.zeros(6)), ["line 3", "increasing", "got -1 s"], id="backwards"),
        pytest.param(rows(np.zeros(6), np.zeros(6)), ["line 3", "repeats the time of line 2"], id="no time passes"),
        pytest.param(GOOD.replace("3.0,0.0", "3.0,1_000"), ["line 5", "'1_000'", "-1.5e-3"], id="underscore"),
        pytest.param(GOOD.replace("4.0,", "4_0.0,"), ["line 6", "'t'", "'4_0.0'"], id="underscore in a time"),
        pytest.param(GOOD.replace("3.0,0.0", "3.0,\u0661\u0662"), ["line 5", "a finite number"], id="other digits"),
        pytest.param(GOOD.replace("3.0,0.0", "3.0,\uff11"), ["line 5", "a finite number"], id="wide digits"),
        pytest.param(GOOD.replace("3.0,0.0", "3.0,0x10"), ["line 5", "'0x10'"], id="hexadecimal"),
        pytest.param(GOOD.replace("3.0,0.0", "3.0,Infinity"), ["line 5", "'Infinity'"], id="infinity"),
        pytest.param(GOOD.replace("3.0,0.0", "3.0,1e300"), ["'a'", "overflows", "1e+150"], id="spline overflows"),
        pytest.param(GOOD.replace("3.0,0.0", "3.0,-1.7e308"), ["'a'", "overflows"], id="differences overflow"),
        pytest.param(
            rows(1e-45 * np.arange(6.0), 1e60 * np.arange(6.0) ** 3), ["'a'", "overflows"], id="rates overflow"
        ),
        pytest.param(rows(1e60 * np.arange(6.0), np.zeros(6)), ["'t'", "1e+50 s", "apart"], id="rows far apart"),
        pytest.param(rows(1e308 * np.arange(-1, 1.5, 0.5), np.zeros(5)), ["'t'", "apart"], id="span overflows"),
        pytest.param(rows(1e-300 * np.arange(6.0), np.zeros(6)), ["'t'", "1e-50 s"], id="rows too near"),
        pytest.param(rows(np.arange(3.0), np.zeros(3)), ["at least 4 rows", "got 3"], id="too few rows"),
        pytest.param("t,a\n", ["at least 4 rows", "got 0"], id="no rows"),
        pytest.param("", ["is empty", "a header"], id="empty file"),
        pytest.param(" \n\n,\n", ["is empty"], id="nothing but blanks"),
        pytest.param('t,a\n0,"1\n', ["no CSV file"], id="open quote"),
    ],
)
def test_bad_files_are_told(text: str, told: list[str]) -> None:
    found = message(text)
    assert "s.toml" in found and "x.csv" in found
    assert all(part in found for part in told), found


def test_a_file_that_is_no_text_is_told() -> None:
    with pytest.raises(InputError, match=r"x\.csv is no CSV file in UTF-8"):
        read_table(b"t,a\n\xff\xfe", "x.csv", Column("t", "t"), [Column("a", "a")], "hold", where="s.toml", key="path")


def test_nearest_column_and_all_missing_ones_are_named() -> None:
    found = message(rows(np.arange(5.0), np.zeros(5), np.zeros(5), names="t,heave,roll"), columns=("heav", "pitch"))
    assert "did you mean 'heave'?" in found
    assert "reference.columns.pitch" in found


def test_rounded_time_stamps_are_uniform_enough() -> None:
    t = np.round(np.arange(400) / 30, 9)  # 30 Hz printed with nine decimals
    assert csv(rows(t, np.sin(t))).dt == pytest.approx(1 / 30, rel=1e-9)


@pytest.mark.parametrize("cell", ["12", "+12.", " 12.0\t", "1.2e1", "120E-1", "0.12e+02", ".12e2"])
def test_numbers_are_read_as_instruments_write_them(cell: str) -> None:
    assert csv(GOOD.replace("2.0,0.0", f"2.0,{cell}")).coefficients[2, 0, 0] == 12.0


@pytest.mark.parametrize(("start", "rate"), [(1.7e9, 100), (1.7e9, 30), (1.6e9, 1000), (3e5, 4096)])
def test_times_as_large_as_unix_seconds_are_uniform_enough(start: float, rate: int) -> None:
    t = start + np.arange(500) / rate
    table = csv(rows(t, np.sin(np.arange(500) / 50)), "hold")
    assert table.t0 == start and table.dt == pytest.approx(1 / rate, rel=1e-6)


def test_jitter_is_found_however_large_the_times_are() -> None:
    t = 1.7e9 + np.arange(500) / 100
    t[77] += 1e-4
    _, (note,) = read(rows(t, np.zeros(500)))
    assert "0.00990009 to 0.0100999 s apart" in note


def test_a_product_of_cell_and_unit_that_overflows_is_told() -> None:
    channels = [Column("a", "reference.columns.a", UNITS["m"]["km"])]
    text = GOOD.replace("3.0,0.0", "3.0,1e307").encode()
    with pytest.raises(InputError, match=r"reference\.columns\.a: column 'a' of x\.csv overflows"):
        read_table(text, "x.csv", Column("t", "t"), channels, "hold", where="s.toml", key="path")


# Angles that wrap


@pytest.mark.parametrize(("unit", "turn"), [("deg", 360.0), ("rad", 2 * math.pi), ("mrad", 2000 * math.pi)])
@pytest.mark.parametrize("ends", ["hold", "error"])
@pytest.mark.parametrize("low", [0.0, -0.5])
def test_angles_that_wrap_are_unwrapped(unit: str, turn: float, ends: Ends, low: float) -> None:
    """An angle that turns twice and swings back, written within one turn, 0 ... 1 or -1/2 ... 1/2."""
    t = np.arange(80.0)
    angle = turn * (0.05 + 2.2 * np.sin(0.04 * t))
    wrapped = angle - turn * np.floor(angle / turn - low)
    straight, _ = read(rows(t, angle), ends, unit=unit)
    table, (note,) = read(rows(t, wrapped), ends, unit=unit)
    first = UNITS["rad"][unit] * (wrapped[0] - angle[0])
    dense = np.linspace(0.0, 79.0, 800)
    assert np.allclose(evaluate(table, dense), evaluate(straight, dense) + first, rtol=0, atol=1e-12)
    wraps = [k + 2 for k in range(1, 80) if abs(wrapped[k] - wrapped[k - 1]) > turn / 2]
    named, rest = ", ".join(map(str, wraps[:5])), len(wraps) - 5
    assert f"lines {named}{f' and {rest} more' if rest > 0 else ''}: read as an angle that wraps" in note
    assert note.startswith("reference.columns.a: column 'a' of x.csv")


def test_degrees_are_unwrapped_exactly() -> None:
    wrapped = np.array([358.3, 359.1, 0.2, 1.7, 359.9, 357.25, 350.0])
    table, (note,) = read(rows(np.arange(7.0), wrapped), unit="deg")
    straight, _ = read(rows(np.arange(7.0), np.where(wrapped < 180, wrapped + 360, wrapped)), unit="deg")
    assert table == straight
    assert "lines 4, 6: " in note


def test_steps_of_up_to_half_a_turn_and_columns_of_other_units_are_left_alone() -> None:
    t, steps = np.arange(8.0), np.array([0.0, 180.0, 0.0, 170.0, -10.0, 169.0, 0.0, 100.0])
    assert read(rows(t, steps), unit="deg")[1] == []
    assert csv(rows(t, 10 * steps)).coefficients[1, 0, 0] == 1800.0  # metres, say


def test_a_byte_order_mark_blanks_and_empty_lines_are_no_mistake() -> None:
    assert csv("\ufeff t , a\n0,1\n\n1, 2\n2,3\n3,4\n\n").t0 == 0.0


def test_equal_tables_are_equal() -> None:
    a, b = csv(GOOD), csv(GOOD)
    assert a == b and hash(a) == hash(b)
    assert a != csv(GOOD, "hold") and a != csv(GOOD.replace("5.0,0.0", "5.0,1.0"))


def test_derivatives_of_the_vessel_record_agree_with_its_inertial_measurement_unit() -> None:
    """The second derivative of the splines is what an accelerometer aboard felt, the first what its gyroscope did.

    The unit's readings come from the vessel's simulation, not from the motion record. Specific force f = R' (a - g) and
    body rates from Euler rates z-y'-x'', north-east-down axes, g = 9.80665 m/s^2. Over the first 60 s they differ by at
    most 0.5, 0.5 and 2.1 mm/s^2 (0.7, 0.2 and 1.5 % of the signals' standard deviations) and 2.2e-6 rad/s (0.1 %).
    """
    data = resources.files("springline.runner") / "scenarios" / "data"
    file = data / "vessel_orcaflex_10hz.csv"
    names = ("surge", "sway", "heave", "roll", "pitch", "yaw")
    channels = [Column(name, name) for name in names]
    table = read_table(file.read_bytes(), "vessel", Column("time_s", "t"), channels, "error", where="", key="").spline
    lines = (data / "vessel_orcaflex_10hz_imu.csv").read_text().splitlines()
    imu = np.genfromtxt(lines[:616], delimiter=",", names=True)
    t = imu["time_s"]
    surge, sway, heave, *_ = evaluate(table, t, 2).T
    roll, pitch, yaw = evaluate(table, t).T[3:]
    droll, dpitch, dyaw = evaluate(table, t, 1).T[3:]

    cr, sr, cp, sp, cy, sy = (f(a) for a in (roll, pitch, yaw) for f in (np.cos, np.sin))
    to_body = np.array(
        [
            [cy * cp, sy * cp, -sp],
            [cy * sp * sr - sy * cr, sy * sp * sr + cy * cr, cp * sr],
            [cy * sp * cr + sy * sr, sy * sp * cr - cy * sr, cp * cr],
        ]
    )
    felt = np.einsum("ijt,jt->it", to_body, np.array([surge, sway, -heave - 9.80665]))
    rate = np.array([droll - dyaw * sp, dpitch * cr + dyaw * cp * sr, -dpitch * sr + dyaw * cp * cr])
    force_error = np.abs(felt - [imu[name] for name in ("ax", "ay", "az")]).max(axis=1)
    rate_error = np.abs(rate - [imu[name] for name in ("gx", "gy", "gz")]).max(axis=1)
    assert np.all(force_error <= 2.5e-3), force_error
    assert np.all(rate_error <= 4e-6), rate_error
