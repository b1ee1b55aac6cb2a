"""What the tests of the runner share: kernels that are compiled soon."""

from collections.abc import Iterator

import pytest

from springline.codegen import kernel_source


@pytest.fixture(scope="module", autouse=True)
def _kernels_that_are_compiled_soon() -> Iterator[None]:
    """In this process without the costly optimisations: they change no bit, which codegen/test_engines.py shows."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(kernel_source, "best_flags", lambda compiler: ("-O1",))
        yield
