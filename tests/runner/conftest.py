"""What the tests of the runner share: kernels that are compiled soon, exports that are generated once."""

import copy
from collections.abc import Iterator
from typing import Any

import pytest

from springline.codegen.export import Export
from springline.codegen.export.c import tree
from springline.codegen.kernel import source, toolchain

Generated = tuple[dict[str, bytes], dict[str, Any]]

_generate_files = tree.generate_files
_GENERATED: dict[object, Generated] = {}


def _generated_once(export: Export) -> Generated:
    """As generate_files, but for what this process has generated before; a compiler is asked for all the same."""
    if export.tables:
        return _generate_files(export)
    toolchain.find_compiler()
    numbers = tuple(value.hex() for value in export.values)
    key = (export.system.structure, numbers, export.tunable, export.prefix, export.real)
    if key not in _GENERATED:
        _GENERATED[key] = _generate_files(export)
    return copy.deepcopy(_GENERATED[key])


@pytest.fixture(scope="module", autouse=True)
def _no_work_that_other_tests_look_at() -> Iterator[None]:
    """In this process.

    Costly optimisations change no bit of a kernel, which codegen/kernel/test_engines.py shows; equal exports give
    equal files, which codegen/export/c/test_api.py does.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(source, "best_flags", lambda compiler: ("-O1",))
        patch.setattr(tree, "generate_files", _generated_once)
        yield
