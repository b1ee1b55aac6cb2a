"""Pictures in docs/ that are drawn from the code, with a hash of what they show by which a test finds stale ones."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

from matplotlib.figure import Figure

from springline.runner.report.style import figure_files


def stamped(picture: Path, figure: Figure, shown: str) -> bytes:
    """A figure as SVG, with the hash of what it shows; the same sources and Matplotlib give the same bytes."""
    image = figure_files(picture.stem, figure)[f"{picture.stem}.svg"]
    return image.rstrip() + f"\n<!-- shown: {shown} -->\n".encode()


def command(picture: Path, drawn: Callable[[], bytes], description: str | None) -> int:
    """The command line that draws a picture anew; the exit code is 2 where there is no docs/ to write to.

    description  docstring of what draws it
    """
    parser = argparse.ArgumentParser(description=(description or "").partition("\n")[0])
    if not picture.parent.is_dir():
        parser.error(f"there is no {picture.parent}: run it in a checkout")
    parser.parse_args()
    picture.write_bytes(drawn())
    return 0
