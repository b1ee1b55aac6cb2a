"""The functions of which something is proved."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from springline.benchmarks.proofs import circular, exponential
from springline.benchmarks.proofs.claims import Claim
from springline.codegen.elementary import Procedure

FUNCTIONS: dict[str, Callable[[Procedure], Iterator[Claim]]] = {
    "exp": exponential.claims,
    "sincos": circular.claims,
}
"""Name -> what is claimed of its program."""
