"""A C constant reads back as the number it was printed from."""

import ctypes
import math

import numpy as np
import pytest

from springline.codegen.kernel import runtime_sources, toolchain
from springline.codegen.program import constant_expression, literal

NUMBERS = [0.0, -0.0, 1.0, 40.0, 0.1, -1 / 3, 1e7, 123456789.0, 1e16, 2.0**60, 1e-5, 3e-25, 5e-324,
           1.7976931348623157e308, math.inf, -math.inf]  # fmt: skip


def compiled(kind: str, constants: list[str]) -> list[float]:
    text = f'#include "sl_math.h"\nconst {kind} *all(void) {{\n  static {kind} value[{len(constants)}];\n'
    text += "".join(f"  value[{i}] = {constant};\n" for i, constant in enumerate(constants)) + "  return value;\n}\n"
    sources = {**runtime_sources(), "constants.c": text}
    handle = toolchain.load(toolchain.build_library(sources, main="constants.c", flags=("-std=c99", "-lm")))
    handle.all.restype = ctypes.POINTER(ctypes.c_double if kind == "double" else ctypes.c_float)
    return [float(value) for value in handle.all()[: len(constants)]]


@pytest.mark.parametrize("of", [float, np.float64])
def test_a_double_reads_back_with_its_bits(of: type) -> None:
    for print_constant in (literal, constant_expression):
        read = compiled("double", [print_constant(of(number)) for number in NUMBERS])
        assert np.array(read).tobytes() == np.array(NUMBERS).tobytes()
    assert math.isnan(compiled("double", [literal(math.nan)])[0])


def test_a_constant_is_floating_point_in_c_too() -> None:
    assert literal(3) == "3.0"
    assert literal(1e16) == "1e+16"
    assert literal(3, "float") == "3.0f"


def test_a_float_is_the_nearest_one() -> None:
    numbers = [number for number in NUMBERS if number == 0.0 or 1e-30 < abs(number) < 1e30]
    text = "".join(f"  value[{i}] = {literal(number, 'float')};\n" for i, number in enumerate(numbers))
    assert text.count("f;") == len(numbers)
    read = [np.float32(literal(number, "float").removesuffix("f")) for number in numbers]
    assert np.array(read).tobytes() == np.array(numbers, np.float32).tobytes()


@pytest.mark.parametrize("number", [1e39, -1e300, 1e-60])
def test_a_number_that_no_float_can_hold_is_refused(number: float) -> None:
    with pytest.raises(ValueError, match="cannot be a float"):
        literal(number, "float")
