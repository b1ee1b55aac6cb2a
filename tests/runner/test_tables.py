"""CSV tables: splines that are as smooth and as exact as promised, and messages for every kind of bad file."""

from __future__ import annotations

import math
from importlib import resources
from pathlib import Path

import numpy as np
import pytest
from numpy.polynomial.polynomial import polyder, polyval

from springline.runner.errors import InputError
from springline.runner.tables import ENDS, UNITS, Column, Ends, Table, read_table, spline

DATA = Path(__file__).parent.parent / "data"


def evaluate(table: Table, t: np.ndarray, derivative: int = 0) -> np.ndarray:
    """Value or derivative at times inside the table, (times, channels)."""
    k = np.clip(np.floor((t - table.t0) / table.dt).astype(int), 0, len(table.coefficients) - 1)
    tau = t - (table.t0 + k * table.dt)
    coefficients = np.moveaxis(table.coefficients[k], -1, 0)
    return polyval(tau[:, None], polyder(coefficients, derivative), tensor=False)


def at_knots(table: Table, derivative: int) -> tuple[np.ndarray, np.ndarray]:
    """A derivative just before and just after every inner knot, (knots, channels) each."""
    c = np.moveaxis(table.coefficients, -1, 0)
    d = polyder(c, derivative)
    return polyval(table.dt, d, tensor=False)[:-1], polyval(0.0, d, tensor=False)[1:]


def csv(text: str, ends: Ends = "error", columns: tuple[str, ...] = ("a",)) -> Table:
    """A table in SI units from CSV text."""
    channels = [Column(name, f"reference.columns.{name}") for name in columns]
    time = Column("t", "reference.columns.t")
    return read_table(text.encode(), "x.csv", time, channels, ends, where="s.toml", key="reference.path")


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


def test_held_ends_start_and_stop_at_rest() -> None:
    table = csv(rows(np.arange(9.0), np.arange(9.0) ** 2), "hold")
    ends = np.array([0.0, 8.0])
    assert np.abs(evaluate(table, ends, 1)).max() < 1e-12
    assert np.allclose(evaluate(table, ends)[:, 0], [0.0, 64.0], rtol=0, atol=1e-12)


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


def test_the_unit_of_a_column_is_applied() -> None:
    text = rows(np.arange(5.0) * 1000, np.full(5, 90.0), names="t,a")
    channels = [Column("a", "k", UNITS["rad"]["deg"])]
    table = read_table(text.encode(), "x.csv", Column("t", "t", UNITS["s"]["ms"]), channels, "error", where="", key="")
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
        pytest.param(GOOD.replace("3.0,", "3.00001,"), ["line 5", "uniform", "resample"], id="jitter"),
        pytest.param(GOOD.replace("3.0,", "2.0,"), ["line 5", "uniform"], id="repeated time"),
        pytest.param(rows(-np.arange(6.0), np.zeros(6)), ["line 3", "increasing"], id="backwards"),
        pytest.param(rows(np.zeros(6), np.zeros(6)), ["increasing"], id="no time passes"),
        pytest.param(rows(np.arange(3.0), np.zeros(3)), ["at least 4 rows", "got 3"], id="too few rows"),
        pytest.param("t,a\n", ["at least 4 rows", "got 0"], id="no rows"),
        pytest.param("", ["unknown column"], id="empty file"),
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
    file = resources.files("springline.runner") / "scenarios" / "data" / "vessel_orcaflex_10hz.csv"
    names = ("surge", "sway", "heave", "roll", "pitch", "yaw")
    channels = [Column(name, name) for name in names]
    table = read_table(file.read_bytes(), "vessel", Column("time_s", "t"), channels, "error", where="", key="")
    imu = np.genfromtxt(DATA / "vessel_imu_60s.csv", delimiter=",", names=True)
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
