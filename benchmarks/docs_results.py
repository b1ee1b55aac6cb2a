"""Put what `springline bench` has measured into docs/performance.md.

    springline bench
    python -m benchmarks.docs_results [DIR]

DIR is the folder of the results, results/bench by default. The text around the results is written by hand.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from springline.runner.report import put

PAGE = Path(__file__).parents[1] / "docs" / "performance.md"
NAME = "bench"
"""The comments in the page between which the results stand."""


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.docs_results", description=__doc__)
    parser.add_argument("folder", metavar="DIR", nargs="?", type=Path, default=Path("results/bench"))
    found = parser.parse_args().folder / "bench.md"
    if not found.exists():
        parser.error(f"there is no {found}: run `springline bench` first")
    if not PAGE.is_file():
        parser.error(f"there is no {PAGE}: run it in a checkout")
    PAGE.write_text(put(PAGE.read_text("utf-8"), NAME, found.read_text("utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
