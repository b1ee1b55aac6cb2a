"""Put what `springline bench` has measured into docs/performance.md, and five rows of it into README.md.

    springline bench
    python -m benchmarks.docs_results [DIR]

DIR is the folder of the results, results/bench by default. The text around the results is written by hand.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from springline.runner.report import put

ROOT = Path(__file__).parents[1]
PAGE, README = ROOT / "docs" / "performance.md", ROOT / "README.md"
NAME = "bench"
"""The comments in the pages between which the results stand."""

SHORT = ("springline", "handwritten C", "Numba", "CasADi C", "NumPy")
"""The contenders of README.md."""


def short(results: str) -> str:
    """The table of README.md, of bench.md: ns of an evaluation with continuous and with sampled control, and ratios."""
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in results.splitlines() if line[:1] == "|"]
    found = {(row[0], row[1]): f"{row[2]} ns" + ("" if row[3] == "1" else f" ({row[3]} ×)") for row in rows}
    lines = ["| | continuous control | sampled at every step |", "|---|---:|---:|"]
    lines += [f"| {name} | {found[name, 'continuous']} | {found[name, 'sampled']} |" for name in SHORT]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.docs_results", description=__doc__)
    parser.add_argument("folder", metavar="DIR", nargs="?", type=Path, default=Path("results/bench"))
    found = parser.parse_args().folder / "bench.md"
    if not found.exists():
        parser.error(f"there is no {found}: run `springline bench` first")
    results = found.read_text("utf-8")
    pages = {PAGE: results, README: short(results)}
    for page in pages:
        if not page.is_file():
            parser.error(f"there is no {page}: run it in a checkout")
    texts = {page: put(page.read_text("utf-8"), NAME, shown) for page, shown in pages.items()}
    for page, text in texts.items():
        page.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
