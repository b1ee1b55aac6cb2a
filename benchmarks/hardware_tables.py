"""The tables and pictures of docs/hardware.md: sweeps over delays and periods, encoders, payload and friction.

    python -m benchmarks.hardware_tables [--write]

Runs the sweeps and prints what each says; --write (`make docs-hardware`) puts the tables into the page, between the
comments that name them, and the pictures, as `springline batch` draws them, into docs/images/.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from springline.benchmarks.sweep_pictures import run_whole
from springline.codegen.kernel import CHATTERING
from springline.model.control import CONTROLLERS
from springline.runner.report import asked_to_write, put
from springline.runner.sweep import read_dataset

DOCS = Path(__file__).parent.parent / "docs"
PAGE = DOCS / "hardware.md"

PERIODS = (1e-4, 5e-4, 1e-3, 2e-3, 2.1e-3)
"""s; those of PAPER.md's figures."""

MISMATCHES = ((1.0, 0.0), (0.7, 0.0), (1.3, 0.0), (1.0, 10.0), (1.0, 50.0))
"""Factor on the payload, and friction in N and N m."""

Rows = Iterator[str]


def column(table: pa.Table, name: str) -> NDArray[np.float64]:
    """Numbers of a column, NaN for null."""
    return np.asarray(table[name].cast(pa.float64()).to_numpy(), dtype=np.float64)


def controller_of(table: pa.Table, name: str) -> pa.Table:
    """The rows of one controller."""
    return table.filter(pa.array(np.array(table["control.controller"].to_pylist()) == name))


def calm(table: pa.Table) -> NDArray[np.bool_]:
    """Which runs reach their end and do not chatter on any joint."""
    chatter = np.max([column(table, f"chatter_{joint}") for joint in ("lift", "rotation")], axis=0)
    return np.asarray(ended(table) & (chatter <= CHATTERING), dtype=np.bool_)


def ended(table: pa.Table) -> NDArray[np.bool_]:
    """Which runs reach their end."""
    return np.asarray(np.array(table["status"].to_pylist()) == "ok", dtype=np.bool_)


def largest_delay(table: pa.Table, period: float, good: NDArray[np.bool_]) -> float | None:
    """The largest delay up to which all runs with this period are good; None if not even that without delay is."""
    here = np.isclose(column(table, "control.period"), period)
    order = np.argsort(column(table, "actuator.delay")[here])
    delays, fine = column(table, "actuator.delay")[here][order], good[here][order]
    count = len(fine) if fine.all() else int(np.argmin(fine))
    return None if count == 0 else float(delays[count - 1])


def delay_rows(table: pa.Table) -> Rows:
    """Largest delay in ms without chatter / without divergence, by controller and period."""
    yield f"| sample period | {' | '.join(f'{1e3 * period:g} ms' for period in PERIODS)} |"
    yield "|---" * (1 + len(PERIODS)) + "|"
    for name in CONTROLLERS:
        rows = controller_of(table, name)
        cells = []
        for period in PERIODS:
            pair = (largest_delay(rows, period, good) for good in (calm(rows), ended(rows)))
            cells.append(" / ".join("–" if delay is None else f"{1e3 * delay:.1f}" for delay in pair))
        yield f"| {name} | {' | '.join(cells)} |"


def bits_rows(table: pa.Table) -> Rows:
    """Fewest bits without chatter, and the largest chatter at some bits, by controller and observer."""
    shown = (16, 14, 13, 12, 11)
    yield f"| controller | observer | fewest bits | {' | '.join(f'{bits} bits' for bits in shown)} |"
    yield "|---" * (3 + len(shown)) + "|"
    bits = np.round(np.log2(2.0 * np.pi / column(table, "sensor.position_resolution.1"))).astype(int)
    table = table.append_column("bits", pa.array(bits))
    for name in CONTROLLERS:
        of_controller = controller_of(table, name)
        for observer in dict.fromkeys(of_controller["control.observer"].to_pylist()):
            rows = of_controller.filter(pa.array(np.array(of_controller["control.observer"].to_pylist()) == observer))
            there, fine = rows["bits"].to_numpy(), calm(rows)
            chatter = np.max([column(rows, f"chatter_{joint}") for joint in ("lift", "rotation")], axis=0)
            fewest = max(there[~fine]) + 1 if not fine.all() else min(there)
            cells = [f"{float(chatter[there == count][0]):.1f}" for count in shown]
            yield f"| {name} | {observer} | {fewest} | {' | '.join(cells)} |"


def mismatch_rows(table: pa.Table) -> Rows:
    """Settling time in s and steady-state error in mm and mrad, lift / rotation."""
    heads = [f"payload {_off(factor)}, {force:g} N" for factor, force in MISMATCHES]
    yield f"| controller | what | {' | '.join(heads)} |"
    yield "|---" * (2 + len(heads)) + "|"
    for name in CONTROLLERS:
        rows = controller_of(table, name)
        for metric, what, factor in (
            ("settling_time", "settling, s", 1.0),
            ("steady_state_error", "error, mm / mrad", 1e3),
        ):
            cells = []
            for scale, force in MISMATCHES:
                here = np.isclose(column(rows, "plant.m3.scale"), scale)
                here &= np.isclose(column(rows, "plant.link_coulomb"), force, atol=1e-9)
                pair = [factor * float(column(rows, f"{metric}_{joint}")[here][0]) for joint in ("lift", "rotation")]
                cells.append(" / ".join("–" if np.isnan(value) else f"{value:#.2g}".rstrip(".") for value in pair))
            yield f"| {name} | {what} | {' | '.join(cells)} |"


def _off(factor: float) -> str:
    """How far a factor is off, in per cent with its sign."""
    return f"{100 * (factor - 1):+.0f} %".replace("-", "−").replace("+0", "±0")


TABLES: Mapping[str, tuple[Callable[[pa.Table], Rows], str]] = {
    "delay_and_period": (delay_rows, "outcomes"),
    "encoder_bits": (bits_rows, "curve"),
    "payload_and_friction": (mismatch_rows, "error_map"),
}
"""By the name of a sweep: what makes its table, and which of its figures the page shows."""


def answer(name: str, folder: Path) -> tuple[str, bytes]:
    """Run a packaged sweep into a folder: its table in Markdown, and its picture as PNG."""
    run_whole(name, folder)
    rows, figure = TABLES[name]
    return "".join(f"{row}\n" for row in rows(read_dataset(folder))), (folder / f"{figure}.png").read_bytes()


def main() -> int:
    """Command line; the exit code is 2 where there is no page to write."""
    write = asked_to_write(__doc__, "tables and their pictures", PAGE)
    for name in TABLES:
        with tempfile.TemporaryDirectory() as folder:
            table, picture = answer(name, Path(folder) / name)
        sys.stdout.write(f"{name}\n{table}\n")
        sys.stdout.flush()
        if write:
            PAGE.write_text(put(PAGE.read_text(encoding="utf-8"), name.replace("_", " "), table), encoding="utf-8")
            (DOCS / "images" / f"sweep_{name}.png").write_bytes(picture)
    return 0


if __name__ == "__main__":
    sys.exit(main())
