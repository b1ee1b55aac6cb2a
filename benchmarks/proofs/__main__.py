"""Proofs of the rounding errors of the elementary functions: `python -m benchmarks.proofs [--folder FOLDER]`.

Writes a file for Gappa for each theorem, from the programs that the C is printed from, has them proved and prints
what is proved beside what is measured. The exit code is 1 if one is not, 2 without Gappa.
"""

from __future__ import annotations

import argparse
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from springline.benchmarks.math_accuracy import measure
from springline.benchmarks.proofs.claims import UnprovedError
from springline.benchmarks.proofs.functions import FUNCTIONS
from springline.benchmarks.proofs.gappa import PACKAGE, gappa, objection
from springline.codegen.elementary import procedure

ROW = "{:9} {:24} {:>9} {:>8} {:>8}\n"


def proved(name: str, folder: Path, samples: int) -> list[str]:
    """Print a row for each claim on a function; what stands against them."""
    try:
        claims = [*FUNCTIONS[name](procedure(name))]
    except UnprovedError as error:
        return [f"{name}: {error}"]
    theorems = {theorem.name: theorem for claim in claims for theorem in claim.theorems}  # claims share some
    with ThreadPoolExecutor() as pool:
        said = dict(zip(theorems, pool.map(lambda each: objection(each, folder), theorems.values()), strict=True))
    rows = measure(samples, 1, tuple(claim.case for claim in claims))
    for claim, row in zip(claims, rows, strict=True):
        bound = "no" if any(said[theorem.name] for theorem in claim.theorems) else f"{float(claim.bound):.2f}"
        case = claim.case
        sys.stdout.write(ROW.format(case.function, case.range, len(claim.theorems), bound, f"{row.error:.2f}"))
        sys.stdout.flush()
    return [text for text in said.values() if text]


def main() -> int:
    """Command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.proofs", description=(__doc__ or "").partition(":")[0])
    parser.add_argument("--folder", type=Path, default=Path("build/proofs"), help="where the files for Gappa go")
    parser.add_argument("--samples", type=int, default=20_000, help="arguments a row for what is measured")
    options = parser.parse_args()
    if gappa() is None:
        sys.stderr.write(f"gappa is not installed: apt-get install {PACKAGE} (Debian, Ubuntu)\n")
        return 2
    options.folder.mkdir(parents=True, exist_ok=True)
    sys.stdout.write("largest error in units in the last place\n")
    sys.stdout.write(ROW.format("function", "arguments", "theorems", "proved", "measured"))
    objections = [text for name in FUNCTIONS for text in proved(name, options.folder, options.samples)]
    sys.stderr.writelines(f"{each}\n" for each in objections)
    return int(bool(objections))


if __name__ == "__main__":
    sys.exit(main())
