"""What somebody who mistyped a name may have meant."""

import pytest

from springline.codegen.nearest import nearest

VALID = ("control.delta", "control.lambda", "plant.J", "Case")


@pytest.mark.parametrize(("name", "alike", "expected"), [
    ("control.dleta", 0.5, "control.delta"),
    ("CONTROL.LAMDA", 0.5, "control.lambda"),
    ("case", 1.0, "Case"),
    ("cases", 1.0, ""),
    ("zzz", 0.5, ""),
    ("zzz", 0.0, "plant.J"),
    ("", 0.5, ""),
])  # fmt: skip
def test_the_nearest_name_is_found_whatever_its_case(name: str, alike: float, expected: str) -> None:
    assert nearest(name, VALID, alike) == expected


def test_of_no_names_none_is_near() -> None:
    assert nearest("control.delta", (), 0.0) == ""
