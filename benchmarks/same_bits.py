"""Whether two checkouts compute the same bits: every packaged scenario, run with each one's own interpreter.

    python -m benchmarks.same_bits OTHER_CHECKOUT

Prints a line per scenario: equal, or the first column of trajectory or metrics that differs, where and by how much.
Columns and scenarios that only one of the two has are left out, and said so. The exit code is 1 if anything differs.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from springline.runner.scenario import packaged_scenarios

# Runs in the other checkout too, so it uses nothing but what every version has.
_RUN = """
import sys
from pathlib import Path
import pyarrow.parquet as pq
from springline.runner import load_scenario, simulate
for name in sys.argv[2:]:
    try:
        scenario = load_scenario(name)
    except ValueError:
        continue
    result = simulate(scenario)
    folder = Path(sys.argv[1]) / name
    folder.mkdir(parents=True)
    pq.write_table(result.trajectory, folder / "trajectory.parquet")
    pq.write_table(result.metrics, folder / "metrics.parquet")
"""


def results(interpreter: Path, folder: Path, names: tuple[str, ...]) -> None:
    """Simulate these packaged scenarios with the springline of an interpreter, into <folder>/<name>/.

    Scenarios that it does not have are left out. Raises CalledProcessError if one cannot be simulated.
    """
    command = [str(interpreter), "-B", "-c", _RUN, str(folder), *names]
    subprocess.run(command, check=True, cwd=folder)


def difference(ours: pa.Table, theirs: pa.Table) -> str:
    """The first column that both have whose bits differ, and by how much; "" if all are equal (NaN equals NaN)."""
    for name in (name for name in ours.column_names if name in theirs.column_names):
        a, b = ours[name].combine_chunks(), theirs[name].combine_chunks()
        if len(a) != len(b):
            return f"{name} has {len(a)} rows, and {len(b)} in the other"
        if not pa.types.is_floating(a.type):
            if not a.equals(b):
                return f"{name} is {a.to_pylist()[:3]}, and {b.to_pylist()[:3]} in the other"
            continue
        x, y = (np.asarray(column.to_numpy(zero_copy_only=False), dtype=np.float64) for column in (a, b))
        differs = (x.view(np.int64) != y.view(np.int64)) & ~(np.isnan(x) & np.isnan(y))
        if differs.any():
            row = int(np.argmax(differs))
            most = float(np.max(np.abs(x - y)[differs]))
            first = f"{float(x[row])!r}, and {float(y[row])!r} in the other"
            return f"{name} from row {row} on ({first}), by at most {most:.3g}"
    return ""


def compared(ours: Path, theirs: Path, name: str) -> tuple[str, bool]:
    """What is to be said of a scenario, and whether its results are the same as far as both have them."""
    if not (theirs / name).is_dir():
        return "the other does not have it", True
    found, alone = [], set()
    for table in ("trajectory", "metrics"):
        a, b = (pq.read_table(folder / name / f"{table}.parquet") for folder in (ours, theirs))
        alone |= set(a.column_names) ^ set(b.column_names)
        found.append(difference(a, b))
    text = "; ".join(filter(None, found)) or "equal"
    left_out = f"; only one has {', '.join(sorted(alone))}" if alone else ""
    return text + left_out, not any(found)


def main() -> int:
    """Command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("other", type=Path, help="a checkout that `make install` was run in")
    interpreter = parser.parse_args().other.absolute() / ".venv" / "bin" / "python"
    if not interpreter.exists():
        parser.error(f"there is no {interpreter}: run `make install` in the other checkout")
    names, same = packaged_scenarios(), True
    with tempfile.TemporaryDirectory() as root:
        ours, theirs = Path(root, "ours"), Path(root, "theirs")
        for folder, python in ((ours, Path(sys.executable)), (theirs, interpreter)):
            folder.mkdir()
            results(python, folder, names)
        for name in names:
            text, equal = compared(ours, theirs, name)
            same = same and equal
            sys.stdout.write(f"{name:34} {text}\n")
    return int(not same)


if __name__ == "__main__":
    sys.exit(main())
