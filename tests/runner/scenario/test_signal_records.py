"""Records as loggers and spreadsheets write them: times that jitter, other separators, units rows, noise."""

from __future__ import annotations

import json
import math
import re
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.polynomial.polynomial import polyder, polyval
from typer.testing import CliRunner, Result

from springline.runner.cli import app
from springline.runner.files import InputError
from springline.runner.scenario import load_scenario
from springline.runner.scenario.signal_csv import HALF_TURN, UNITS, Column
from springline.runner.scenario.signal_tables import TableRead, excess_notes, read_table
from springline.runner.scenario.splines import Ends, Spline, spline

SEEDS = st.integers(0, 2**32 - 1)


def written(times: np.ndarray, *columns: np.ndarray, places: int | None = None) -> str:
    """CSV text: shortest exact digits, or times with some decimal places."""
    told = [repr(t) if places is None else f"{t:.{places}f}" for t in times.tolist()]
    rows = zip(told, *(map(repr, column.tolist()) for column in columns), strict=True)
    names = ",".join("tabc"[: 1 + len(columns)])
    return names + "\n" + "".join(",".join(row) + "\n" for row in rows)


def read(
    text: str | bytes, ends: Ends = "error", *, seconds: str = "s", unit: str = "", max_gap: float | None = None
) -> TableRead:
    """The table of columns t and a, the latter a shake in m or in the unit of an angle."""
    time_column = Column("t", "base_motion.columns.t", UNITS["s"][seconds], unit=seconds)
    factor, half_turn = UNITS["rad"].get(unit, 1.0), HALF_TURN.get(unit, math.inf)
    channel = Column("a", "base_motion.columns.roll", factor, half_turn, unit or "m")
    data = text if isinstance(text, bytes) else text.encode()
    return read_table(
        data, "x.csv", time_column, [channel], ends, max_gap=max_gap, where="s.toml", key="base_motion.path"
    )


def refused(text: str | bytes, **options: object) -> str:
    with pytest.raises(InputError) as caught:
        read(text, **options)  # type: ignore[arg-type]
    (problem,) = caught.value.problems
    return str(problem)


def evaluate(table: Spline, t: np.ndarray, derivative: int = 0) -> np.ndarray:
    """A derivative of the only channel, (times,), computed apart from `Spline.values`."""
    k = np.clip(np.floor((t - table.t0) / table.dt).astype(int), 0, len(table.coefficients) - 1)
    c = polyder(table.coefficients[k, 0].T, derivative)
    return polyval(t - table.t0 - k * table.dt, c, tensor=False)


def springline(*words: object) -> Result:
    return CliRunner().invoke(app, [str(word) for word in words])


# Uniform times


@given(
    st.integers(4, 60),
    st.sampled_from([1.0, 7.0, 10.0, 10.24, 30.0, 60.0, 100.0]),
    st.sampled_from([0.0, -3.25, 1e-3, 86400.0]),
    st.sampled_from([None, 9]),
    st.sampled_from(["hold", "error"]),
    SEEDS,
)
def test_uniform_rows_are_the_samples_to_the_bit(
    rows: int, rate: float, start: float, places: int | None, ends: Ends, seed: int
) -> None:
    t = np.array([float(f"{start + k / rate:.9f}") if places else start + k / rate for k in range(rows)])
    values = np.random.default_rng(seed).uniform(-5.0, 5.0, rows)
    found = read(written(t, values, places=places), ends)
    expected = spline(t[0], (t[-1] - t[0]) / (rows - 1), values[:, None], ends)
    assert found.notes == []
    assert (found.spline.t0, found.spline.dt) == (expected.t0, expected.dt)
    assert found.spline.coefficients.tobytes() == expected.coefficients.tobytes()


@pytest.mark.parametrize("rate", [30.0, 60.0, 29.97, 75.0, 144.0, 240.0])
@pytest.mark.parametrize("rounding", [np.round, np.floor])
@pytest.mark.parametrize("unit", ["s", "ms"])
def test_times_rounded_to_milliseconds_are_those_of_a_grid(rate: float, rounding, unit: str) -> None:
    """And so the rounding, which is up to 12 % of a sample here, does not get into the accelerations."""
    exact = np.arange(600) / rate
    omega = 0.2 * math.pi
    stamps = rounding(exact * 1e3 + 1e-9)
    text = written(stamps * (1e-3 if unit == "s" else 1.0), np.sin(omega * exact), places=3 if unit == "s" else 0)
    found = read(text, seconds=unit)
    if rate == 240.0 or (rounding(exact * 1e3 + 1e-9) != exact * 1e3).any():
        (note,) = found.notes
        assert note.startswith("base_motion.columns.t: the times in column 't' of x.csv are rounded to 0.001 s")
    table = found.spline
    assert (table.t0, table.end) == (0.0, pytest.approx(stamps[-1] / 1e3, abs=1e-12))
    dense = np.linspace(0.0, table.end, 5001)
    acceleration = -(omega**2) * np.sin(omega * dense)
    assert np.abs(evaluate(table, dense, 2) - acceleration).max() <= 2e-3 * omega**2
    assert table.dt == pytest.approx(1 / rate, rel=1e-3 * rate / 599)


@pytest.mark.parametrize("rate", [30.0, 60.0, 29.97])
@pytest.mark.parametrize("ends", ["hold", "error", "periodic"])
def test_rounded_times_keep_to_their_grid_where_rows_are_lost(rate: float, ends: Ends) -> None:
    """A frame that was dropped does not let the rounding of all others in, which would be five times the motion."""
    count = round(60 * rate)
    exact = np.arange(count) / rate
    omega = 2 * math.pi * rate / count * 6
    there = ~np.isin(np.arange(count), [17, 500, 501, count // 2])
    text = written(np.round(exact[there], 3), np.sin(omega * exact[there]), places=3)
    found = read(text, ends)
    (note,) = found.notes
    assert "are rounded to 0.001 s: read as uniform" in note and "4 of them missing" in note
    table = found.spline
    assert table.dt == pytest.approx(1 / rate, rel=1e-3 * rate / count)
    assert len(table.coefficients) == (count if ends == "periodic" else count - 1)
    dense = np.linspace(0.0, exact[-1], 9001)
    assert np.abs(evaluate(table, dense, 2) + omega**2 * np.sin(omega * dense)).max() <= 5e-3 * omega**2
    assert found.shown[0] == pytest.approx(omega**2, rel=5e-3), "the rows' own are at their places, too"
    kept = np.flatnonzero(there)[:-1]
    np.testing.assert_allclose(table.coefficients[kept, 0, 0], np.sin(omega * exact[kept]), rtol=0, atol=1e-13)


def test_a_long_gap_among_rounded_times_is_counted_right() -> None:
    there = np.r_[0:300, 420:700]
    exact = np.arange(700) / 60
    found = read(written(np.round(exact[there], 3), np.sin(exact[there]), places=3), max_gap=3.0)
    assert "120 of them missing" in found.notes[0] and len(found.spline.coefficients) == 699
    at = found.spline.t0 + found.spline.dt * np.arange(280)
    np.testing.assert_allclose(found.spline.accelerations()[:280, 0], -np.sin(at), atol=1e-3)


def test_three_intervals_are_no_gap_however_they_are_rounded() -> None:
    """Two frames lost at 30 Hz are a step of 100 ms, where most steps are of 33."""
    exact = np.delete(np.arange(600), [100, 101]) / 30
    assert "2 of them missing" in read(written(np.round(exact, 3), exact, places=3)).notes[0]
    exact = np.delete(np.arange(600), [100, 101, 102]) / 30
    assert "a gap from 3.3 s" in refused(written(np.round(exact, 3), exact, places=3))


def test_rows_that_do_jitter_are_not_taken_for_rounded_ones() -> None:
    t = np.round(np.arange(40) / 30, 3)
    y = np.sin(t)
    assert "rounded" in read(written(t, y, places=3)).notes[0]
    t[20] += 0.003
    assert "sampled every" in read(written(t, y, places=3)).notes[0]
    # Nor are a few rows, whose times may be meant as they stand, nor digits as coarse as the steps.
    assert "sampled every" in read(written(np.array([0.0, 4.0, 9.0, 13.0]), np.arange(4.0), places=0)).notes[0]
    t = np.floor(np.arange(40) * 2.5)
    assert "sampled every" in read(written(t, np.sin(t / 9), places=0)).notes[0]


# Times that jitter


def jittered(generator: np.random.Generator, rows: int, share: float) -> np.ndarray:
    return np.arange(rows) + generator.uniform(-share, share, rows)


@given(
    st.integers(24, 90),
    st.floats(0.001, 0.45),
    st.sampled_from([1e-3, 1 / 30, 2.0]),
    st.sampled_from(["hold", "error"]),
    SEEDS,
)
def test_jittering_rows_give_a_band_limited_signal_back(
    rows: int, share: float, dt: float, ends: Ends, seed: int
) -> None:
    """Position within (omega h)^4 / 30 of each sine's amplitude, h the longest interval, as docs/records.md says."""
    generator = np.random.default_rng(seed)
    t = dt * jittered(generator, rows, share)
    longest = np.diff(t).max()
    sines = generator.uniform([0.1, 0.05 / dt, 0.0], [3.0, 0.63 / dt, 6.3], (3, 3)).tolist()

    def signal(times: np.ndarray) -> np.ndarray:
        return sum((a * np.sin(omega * times + phase) for a, omega, phase in sines), np.zeros_like(times))

    found = read(written(t, signal(t)), ends)
    (note,) = found.notes
    assert "the cubic spline through the rows is sampled every" in note
    table = found.spline
    assert table.t0 == t[0] and table.end == pytest.approx(t[-1], rel=1e-12, abs=1e-12 * dt)
    assert table.dt == pytest.approx(np.median(np.diff(t)), rel=1 / rows)
    dense = np.linspace(t[0], t[-1], 1001)
    allowed = sum(a * (omega * longest) ** 4 for a, omega, _ in sines) / 30
    assert np.abs(evaluate(table, dense) - signal(dense)).max() <= allowed + 1e-12


@pytest.mark.parametrize("share", [0.1, 0.3, 0.45])
def test_accelerations_of_jittering_rows_are_as_right_as_the_docs_say(share: float) -> None:
    page = " ".join((Path(__file__).parents[3] / "docs" / "records.md").read_text("utf-8").split())
    told = re.search(
        r"the acceleration to ([\d.]+) A ω² \(ω h\)² six rows away from the ends, ([\d.]+) A ω² \(ω h\)²", page
    )
    assert told
    for seed in range(20):
        generator = np.random.default_rng(seed)
        t = jittered(generator, int(generator.integers(40, 200)), share)
        omega, phase, longest = generator.uniform(0.1, 0.63), generator.uniform(0, 6.3), np.diff(t).max()
        table, dense = read(written(t, np.sin(omega * t + phase))).spline, np.linspace(t[0], t[-1], 2001)
        off = np.abs(evaluate(table, dense, 2) + omega**2 * np.sin(omega * dense + phase))
        inner = (dense >= t[6]) & (dense <= t[-7])
        allowed = omega**2 * (omega * longest) ** 2
        assert off[inner].max() <= float(told[1]) * allowed and off.max() <= float(told[2]) * allowed


@given(st.floats(0.001, 0.3), st.booleans(), SEEDS)
def test_a_jittering_period_closes(share: float, closed: bool, seed: int) -> None:
    rows = 64
    t = jittered(np.random.default_rng(seed), rows, share)
    t[0] = 0.0
    if closed:
        t = np.append(t, float(rows))
    angle = 2 * math.pi / rows
    found = read(written(t, np.sin(angle * t) if not closed else np.append(np.sin(angle * t[:-1]), 0.0)), "periodic")
    table = found.spline
    assert table.end == pytest.approx(rows if closed else t[-1] + np.median(np.diff(t)), rel=1e-12)
    first, last = evaluate(table, np.array([0.0, table.end]), 1)
    assert first == pytest.approx(last, abs=1e-9)
    dense = np.linspace(0.0, t[-1], 501)
    if closed:
        assert np.abs(evaluate(table, dense) - np.sin(angle * dense)).max() <= (angle * np.diff(t).max()) ** 4 / 30


def test_a_cubic_comes_back_whatever_the_times() -> None:
    generator = np.random.default_rng(3)
    t = np.cumsum(generator.uniform(0.5, 1.4, 40))
    table = read(written(t, 2.0 - 3.0 * t + 0.1 * t**3)).spline
    dense = np.linspace(t[0], t[-1], 700)
    exact = 2.0 - 3.0 * dense + 0.1 * dense**3
    assert np.abs(evaluate(table, dense) - exact).max() <= 1e-11 * np.abs(exact).max()
    assert np.abs(evaluate(table, dense, 2) - 0.6 * dense).max() <= 1e-9 * dense.max()


def test_the_note_tells_how_far_the_samples_pass_the_rows_by() -> None:
    """Rows that are dense in one half alone: what is between two samples there is lost, and told."""
    t = np.concatenate([np.arange(0.0, 10.0, 0.5), np.arange(10.0, 40.0)])
    wiggle = np.where(t < 10, (-1.0) ** np.arange(len(t)), 0.0)
    (note,) = read(written(t, wiggle)).notes
    assert "0.5 to 1 s apart" in note
    assert float(note.rpartition("no more than ")[2].split()[0]) > 0.5
    (note,) = read(written(t, np.sin(t / 9))).notes
    assert float(note.rpartition("no more than ")[2].split()[0]) < 1e-3


# Gaps


def test_gaps_are_told_and_what_max_gap_allows_is_bridged() -> None:
    t = np.delete(np.arange(60) / 10, [20, 21, 22, 40])
    y = np.sin(t)
    found = refused(written(t, y))
    assert "base_motion.max_gap: x.csv, line 22, column 't': a gap from 1.9 s (line 21) to 2.3 s" in found
    assert "at most 0.3 s apart (3 times the median interval)" in found
    assert "max_gap = 0.4 " in found and "got 0.4 s" in found
    table = read(written(t, y), max_gap=0.4).spline
    dense = np.linspace(0.0, 5.9, 600)
    assert np.abs(evaluate(table, dense) - np.sin(dense)).max() <= 0.4**4 / 30
    assert "to 2.3 s (and 1 more): expected rows at most 0.19 s apart" in refused(written(t, y), max_gap=0.19)


@given(st.floats(0.31, 50.0), st.sampled_from(["s", "ms", "min"]))
def test_the_gap_that_a_message_names_is_bridged(gap: float, unit: str) -> None:
    seconds = np.concatenate([np.arange(10) / 10, 0.9 + gap + np.arange(10) / 10])
    text = written(seconds / UNITS["s"][unit], np.sin(seconds))
    remedy = float(refused(text, seconds=unit).partition("max_gap = ")[2].split()[0])
    assert read(text, seconds=unit, max_gap=remedy).spline.end == pytest.approx(1.8 + gap)


def test_a_gap_of_three_intervals_is_bridged_and_a_longer_one_is_not() -> None:
    t = np.delete(np.arange(30.0), [7, 8])
    assert len(read(written(t, t)).spline.coefficients) == 29
    assert "line 9" in refused(written(np.delete(t, 7), np.delete(t, 7)))


def test_a_limit_holds_for_uniform_rows_too() -> None:
    t = np.arange(10) / 10
    assert read(written(t, t), max_gap=0.1).notes == []
    assert "line 3" in refused(written(t, t), max_gap=0.09)


def test_a_gap_that_would_make_millions_of_samples_is_told() -> None:
    t = np.append(np.arange(10) / 1000, 2e3)
    assert "would take 2000000 samples at its median interval of 0.001 s" in refused(written(t, t), max_gap=1e9)


@pytest.mark.parametrize("value", ["0", "-1", "nan", "inf", '"1 s"', "true"])
def test_max_gap_is_a_time(value: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"base_motion\.max_gap: expected a number > 0 \[s\]"):
        scenario_of(tmp_path, "t,a\n0,0\n1,0\n2,0\n3,0\n", f"max_gap = {value}")


# Files in other forms

PLAIN = written(np.arange(8) / 8, np.arange(8) / 4)


def scenario_of(folder: Path, content: str | bytes, extra: str = "", columns: str = 'shake = "a"'):
    """A scenario whose base moves as a file says."""
    (folder / "m.csv").write_bytes(content if isinstance(content, bytes) else content.encode())
    (folder / "s.toml").write_text(
        f'[base_motion]\nkind = "table"\npath = "m.csv"\ncolumns = {{ t = "t", {columns} }}\n{extra}\n'
        "[simulation]\nduration = 0.5\n"
    )
    return load_scenario(folder / "s.toml")


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (PLAIN.replace(",", ";"), "has semicolons between its cells: expected commas between cells and decimal points"),
        (PLAIN.replace(",", ";").replace(".", ","), "has semicolons between its cells and decimal commas"),
        (PLAIN.replace(",", "\t"), "has tabs between its cells: "),
        (PLAIN.replace(",", "\t").replace(".", ","), "has tabs between its cells and decimal commas"),
        (PLAIN.replace(",", "  "), "has blanks between its cells"),
        ("".join(f"  {line}\r\n" for line in PLAIN.replace(",", " ").splitlines()), "has blanks between its cells"),
        ("recorded by A, on deck\n# port side\n" + PLAIN, "has its header in line 3"),
        (PLAIN.encode("utf-16"), "is text in UTF-16"),
    ],
)
def test_the_remedy_for_a_file_of_another_form_makes_it_one_that_is_read(
    content: str | bytes, told: str, tmp_path: Path
) -> None:
    """The command that the message shows is run."""
    folder = tmp_path / "it's here"
    folder.mkdir()
    with pytest.raises(InputError) as caught:
        scenario_of(folder, content)
    (problem,) = caught.value.problems
    assert problem.key == "base_motion.path" and told in problem.expected, problem
    command = problem.expected.rpartition(" (")[2].removesuffix(" writes it so)")
    subprocess.run(["sh", "-c", command], check=True, cwd=tmp_path)
    (made,) = set(folder.glob("*.csv")) - {folder / "m.csv"}
    assert scenario_of(folder, made.read_bytes()) == scenario_of(folder, PLAIN)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (PLAIN.replace("0.25,0.5", "0,25,0,5"), ["line 4: expected 2 cells", "decimal commas", "got 4"]),
        (PLAIN.replace("0.25,0.5", '0.25,"0,5"'), ["line 4, column 'a'", "expected a decimal point, 0.5", "'0,5'"]),
        (PLAIN.replace("0.25,0.5", "0.25;0.5"), ["line 4: expected 2 cells with commas", "this row has semicolons"]),
        (PLAIN.replace("0.25,0.5", "# stopped"), ["line 4", "CSV has no comments", "got 1"]),
        (PLAIN.replace("0.25,0.5", "0.25,"), ["line 4, column 'a'", "may be left out", "max_gap", "got ''"]),
        (PLAIN.replace("0.25,0.5", "0.25,NaN"), ["line 4, column 'a'", "may be left out", "got 'NaN'"]),
        (PLAIN.replace("0.25,0.5", ",0.5"), ["line 4, column 't'", "a finite number"]),
        (PLAIN.replace("0.0,0.0", "nan,nan"), ["line 2, column 't'", "got 'nan'"]),
        (PLAIN.replace("0.0,0.0", '"0,0","0,0"'), ["line 2, column 't'", "a decimal point, 0.0"]),
        ("t,a\n0,1\n", ["at least 4 rows", "got 1"]),
        ("t,a\ns,m\n0,1\n1,2\n", ["at least 4 rows", "got 2"]),
        ("t,a\ns,m\n", ["at least 4 rows", "got 0"]),
        (PLAIN.replace("t,a\n", "t,a\ns,m\n-,-\n"), ["line 3, column 't'", "a finite number", "got '-'"]),
        (PLAIN.replace("t,a", "t,roll °").encode("latin-1"), ["no CSV file in UTF-8", "0xb0"]),
    ],
)
def test_what_is_wrong_in_a_file_is_told_with_its_place(text: str | bytes, told: list[str]) -> None:
    with pytest.raises(InputError) as caught:
        read(text)
    found = str(caught.value.problems[0])
    assert found.startswith("s.toml: base_motion.") and "x.csv" in found
    assert all(part in found for part in told), found


@pytest.mark.parametrize(
    "text",
    [
        "\ufeff" + PLAIN.replace("\n", "\r\n"),
        PLAIN.replace("\n", "\r"),
        PLAIN + "\n \n,\n , \n\r\n",
        "\n\n" + PLAIN,
        PLAIN.replace("t,a", '"t","a"').replace("0.25,0.5", '"0.25","0.5"'),
        PLAIN.replace("0.25,0.5", "0.25,0.5\n,"),
        "\n".join(f"{line}," for line in PLAIN.splitlines()),
        PLAIN.replace("t,a", "t,a\ns,m"),
    ],
)
def test_what_says_nothing_changes_nothing(text: str) -> None:
    found = read(text)
    assert found.spline == read(PLAIN).spline and found.notes == []


def test_lines_are_counted_as_an_editor_does(tmp_path: Path) -> None:
    text = "\n" + PLAIN.replace("t,a", '"t",a').replace("0.5,1.0", "\n,\n0.5,x")
    assert "line 9, column 'a'" in refused(text)


def test_many_rows_are_read_in_seconds() -> None:
    """100,000 of them: nothing in the reader grows faster than the rows do."""
    generator = np.random.default_rng(1)
    t = np.arange(100_000) / 100 + generator.uniform(-1e-3, 1e-3, 100_000)
    text = written(t, np.sin(t))
    began = time.process_time()
    found = read(text)
    assert len(found.spline.coefficients) == 99_999
    assert time.process_time() - began < 20.0


# Units rows


@pytest.mark.parametrize("row", ["s,deg", "[s],[deg]", " (s) ,degrees", ",", "-,-", "sec,°", "# s,deg", ",deg"])
def test_a_units_row_that_agrees_changes_nothing(row: str) -> None:
    found = read(PLAIN.replace("t,a", f"t,a\n{row}"), unit="deg")
    assert found.spline == read(PLAIN, unit="deg").spline and found.notes == []


@pytest.mark.parametrize(
    ("row", "told"),
    [
        ("s,deg", ["base_motion.units.roll", "has 'deg' for column 'a'", "reads rad", 'say "deg" here']),
        ("s,[mrad]", ["base_motion.units.roll", "has 'mrad'", 'say "mrad" here']),
        ("ms,rad", ["base_motion.units.t", "has 'ms' for column 't'", "reads s", 'say "ms" here']),
        ("s,m", ["base_motion.units.roll", "has 'm'", "name a column of the right kind"]),
        ("s,deg/s", ["base_motion.units.roll", "has 'deg/s'", "not of rates"]),
        ("s,rad/s^2", ["has 'rad/s^2'", "not of rates"]),
        ("s,rad s^-1", ["has 'rad s^-1'", "not of rates"]),
    ],
)
def test_units_that_are_not_the_scenarios_are_told_and_not_guessed(row: str, told: list[str]) -> None:
    found = refused(PLAIN.replace("t,a", f"t,a\n{row}"), unit="rad")
    assert all(part in found for part in told), found


def test_units_that_are_not_known_are_noted() -> None:
    found = read(PLAIN.replace("t,a", "t,a\ns,dps"), unit="deg")
    assert found.spline == read(PLAIN, unit="deg").spline
    assert found.notes == [
        "base_motion.units.roll: the units row of x.csv has 'dps' for column 'a', and the scenario reads deg: the "
        "scenario's unit counts"
    ]


def test_only_the_columns_that_are_read_are_held_against_the_scenario() -> None:
    text = "t,b,a\ns,deg/s,m\n" + "".join(f"{k},0,{k}\n" for k in range(6))
    assert read(text).notes == []


# Noise


def warnings(found: TableRead, t0: float = 0.0) -> list[str]:
    return excess_notes(found, [Column("a", "base_motion.columns.shake")], ["m/s^2"], "x.csv", t0)


@pytest.mark.parametrize("samples", [8, 10, 16, 64])
@pytest.mark.parametrize("ends", ["hold", "error", "periodic"])
@pytest.mark.parametrize("phase", [0.0, 0.4, 1.1, 2.5])
def test_a_clean_sine_is_no_noise(samples: int, ends: Ends, phase: float) -> None:
    omega = 0.8
    t = 2 * math.pi / omega / samples * np.arange(6 * samples)
    found = read(written(t, 2.0 * np.sin(omega * t + phase)), ends)
    assert warnings(found) == []
    ratio = 3 / (2 + math.cos(2 * math.pi / samples))
    inner = np.abs(found.spline.accelerations())[3 * samples : 4 * samples].max()
    highest = np.abs(2.0 * np.sin(omega * t + phase)).max()
    differences = highest * (2 - 2 * math.cos(2 * math.pi / samples)) / (t[1] - t[0]) ** 2
    assert found.shown[0] == pytest.approx(differences, rel=1e-9)
    assert inner == pytest.approx(ratio * differences, rel=5e-3)


def test_where_a_period_closes_there_are_second_differences_too() -> None:
    values = np.zeros(32)
    values[0] = 1.0
    found = read(written(np.arange(32) / 10, values), "periodic")
    assert found.shown[0] == pytest.approx(2.0 / 0.1**2)
    assert "(at 0 s)" in warnings(found)[0]  # which is a corner


@pytest.mark.parametrize("jitter", [0.0, 0.1])
def test_a_noisy_sine_is_told_with_what_its_rows_show(jitter: float) -> None:
    generator = np.random.default_rng(5)
    t = np.arange(400) / 20 + jitter / 20 * generator.uniform(-1.0, 1.0, 400)
    clean = np.sin(0.8 * t)
    noisy = clean + 1e-3 * generator.standard_normal(400)
    assert warnings(read(written(t, clean))) == []
    found = read(written(t, noisy))
    (note,) = warnings(found, t0=100.0)
    assert note.startswith("base_motion.columns.shake: the spline through column 'a' of x.csv has accelerations of up")
    told = [note.partition(before)[2].split()[0] for before in ("up to ", "(at ", "s), ", "times the ")]
    largest, at, times, shown = map(float, told)
    steps = np.diff(t)
    divided = 2 * np.diff(np.diff(noisy) / steps) / (steps[1:] + steps[:-1])
    assert shown == pytest.approx(np.abs(divided).max(), rel=6e-3)
    inner = np.abs(found.spline.accelerations()[1:-1, 0])
    assert largest == pytest.approx(inner.max(), rel=6e-3)
    assert at == pytest.approx(100.0 + found.spline.t0 + found.spline.dt * (1 + inner.argmax()), abs=1e-3)
    assert times == pytest.approx(largest / shown, abs=0.06) and times > 1.25


def test_rounding_of_doubles_is_no_noise() -> None:
    t = np.arange(50) / 7
    for values in (np.zeros(50), np.full(50, 3.7), 1e6 + 0.3 * t, -1.5 * t):
        assert warnings(read(written(t, values))) == []


def test_digits_that_are_too_coarse_for_the_rate_are_told() -> None:
    t = np.arange(2000) / 100
    assert warnings(read(written(t, np.round(np.sin(0.8 * t), 6)))) == []
    assert len(warnings(read(written(t, np.round(np.sin(0.8 * t), 3))))) == 1


def test_a_run_reports_accelerations_and_warns_on_stderr_alone(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    generator = np.random.default_rng(2)
    t = np.arange(200) / 20
    scenario_of(tmp_path, written(t, np.sin(t), 1e-3 * np.sin(t) + 1e-4 * generator.standard_normal(200)),
                columns='shake = "a", roll = "b"')  # fmt: skip
    result = springline("run", "s.toml", "-o", "out", "--no-plot", "--json")
    assert result.exit_code == 0
    assert json.loads(result.stdout)["status"] == "ok"
    _, report, warning = result.stderr.splitlines()
    assert report.startswith("base_motion: the largest accelerations (and second differences of the rows) of ")
    assert "m.csv are heave 1 m/s^2 (1), roll " in report and "rad/s^2 (" in report
    assert warning.startswith("base_motion.columns.roll: the spline through column 'b' of ")
    refusal = springline("run", "s.toml", "-o", "no", "--set", "base_motion.max_gap=0.01")
    assert refusal.exit_code == 2 and "m.csv, line 3, column 't': a gap from 0 s" in refusal.stderr
    assert not Path("no").exists()


def test_a_units_row_is_held_against_the_units_of_the_scenario(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    text = PLAIN.replace("t,a", "t,a\ns,cm")
    with pytest.raises(InputError, match=r"base_motion\.units\.heave: .*m\.csv has 'cm' .* reads m: say \"cm\" here"):
        scenario_of(tmp_path, text)
    plain = scenario_of(tmp_path, PLAIN, 'units = { shake = "cm" }')
    assert scenario_of(tmp_path, text, 'units = { shake = "cm" }') == plain
    refusal = springline("run", "s.toml", "-o", "no", "--set", "base_motion.units.shake=mm")
    assert refusal.exit_code == 2 and "has 'cm' for column 'a', and the scenario reads mm" in refusal.stderr


def test_the_packaged_record_is_clean() -> None:
    *_, report = load_scenario("ship/vessel_10hz").notes
    assert "heave 0.43" in report and "(0.43" in report


def test_max_gap_is_kept_with_the_scenario(tmp_path: Path) -> None:
    t = np.delete(np.arange(30) / 10, [9, 10, 11])
    scenario = scenario_of(tmp_path, written(t, np.sin(t)), "max_gap = 0.5")
    assert scenario.document["base_motion"]["max_gap"] == 0.5
    (tmp_path / "again.toml").write_text(scenario.to_toml(tmp_path))
    assert load_scenario(tmp_path / "again.toml") == scenario
    with pytest.raises(InputError, match=r"base_motion\.max_gap: .*m\.csv, line 11, column 't': a gap"):
        scenario.with_overrides({"base_motion.max_gap": 0.2})
