"""The pictures of docs/batch.md: packaged sweeps, run whole.

    python -m benchmarks.sweep_pictures [--write]

Runs each sweep in a folder of its own; --write (`make docs-sweeps`) puts its picture into docs/images/.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path

from springline.runner.report import asked_to_write
from springline.runner.sweep import (
    Dataset,
    Plan,
    load_sweep,
    open_pool,
    place,
    run_sweep,
    summarize,
    versions,
    write_summary,
)

IMAGES = Path(__file__).parents[1] / "docs" / "images"

SHOWN: Mapping[str, str] = {
    "gains": "scatter",
    "laws": "groups",
    "payload_and_phase": "scatter",
    "stability_map": "map",
}
"""Name of a packaged sweep -> which of its figures the page shows."""


def run_whole(name: str, folder: Path) -> None:
    """Run a packaged sweep into a folder, with its figures. Raises RuntimeError where runs are missing."""
    plan = Plan(load_sweep(name))
    dataset = Dataset(place(str(folder)))
    dataset.begin(plan, versions(), resume=False)
    with open_pool(None, "") as pool:
        tally = run_sweep(plan, dataset, pool, set())
    if tally.left:
        raise RuntimeError(f"{name}: {tally.left} runs are missing: {tally.failures}")
    write_summary(plan, dataset, summarize(plan, dataset))


def main() -> int:
    """Command line; the exit code is 2 where there is no folder for pictures."""
    write = asked_to_write(__doc__, "the pictures", IMAGES)
    for name in SHOWN:
        with tempfile.TemporaryDirectory() as folder:
            run_whole(name, Path(folder) / name)
            content = (Path(folder) / name / f"{SHOWN[name]}.png").read_bytes()
        sys.stdout.write(f"{name}: {len(content)} bytes\n")
        sys.stdout.flush()
        if write:
            (IMAGES / f"sweep_{name}.png").write_bytes(content)
    return 0


if __name__ == "__main__":
    sys.exit(main())
