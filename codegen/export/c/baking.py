"""CasADi's C with numbers in it: parameters become constants where the C reads them, and nowhere earlier.

A number substituted into an SX expression would let CasADi simplify around it, and the result would no longer have the
bits of the tunable code. So the Function is printed with all its parameters symbolic, the ones to be baked in an input
of their own, and each read of that input (`a12=arg[4]? arg[4][7] : 0;`) is then replaced by its number.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import casadi as ca

from springline.codegen.program import print_functions
from springline.model.symbolic import as_written

_BAKED = "baked"


class UnexpectedCode(RuntimeError):
    """CasADi's C does not look as this file knows it: its version has to be looked at."""


def _constant(value: float) -> str:
    """A double as CasADi prints its own, so that a baked number reads like any other of its file."""
    if value in (float("inf"), float("-inf")):
        return "SL_INF" if value > 0 else "-SL_INF"
    return f"{value:.16e}"


def split_parameters(function: ca.Function, name: str, tunable: Sequence[int]) -> ca.Function:
    """f(…, p) as `name`(…, p_tunable, baked), operation by operation the same; either of the two only if not empty."""
    *rest, p = function.sx_in()
    fixed = [i for i in range(p.numel()) if i not in set(tunable)]
    ends = [(ca.SX.sym(label, len(part)), label) for label, part in (("p", tunable), (_BAKED, fixed)) if len(part)]
    symbols = [symbol for part, _ in ends for symbol in ca.vertsplit(part)]
    place = {slot: position for position, slot in enumerate([*tunable, *fixed])}
    with as_written():
        outputs = function.call([*rest, ca.vertcat(*(symbols[place[i]] for i in range(p.numel())))])
        return ca.Function(
            name,
            [*rest, *(part for part, _ in ends)],
            outputs,
            [*(function.name_in(i) for i in range(len(rest))), *(label for _, label in ends)],
            [function.name_out(i) for i in range(function.n_out())],
        )


def print_baked(
    functions: Sequence[tuple[str, ca.Function]],
    tunable: Sequence[int],
    values: Sequence[float],
    stem: str,
    includes: Sequence[str],
) -> str:
    """CasADi's C of Functions f(…, p), for a file named stem.c, in which p has the `tunable` entries only.

    functions  public name and Function, its last input p
    values     of all entries of p; those that are not tunable become constants
    Raises UnexpectedCode if CasADi prints in a way that this file does not know.
    """
    split = [split_parameters(function, name, tunable) for name, function in functions]
    text = print_functions(split, stem, includes=includes, integer="long long int")
    numbers = [_constant(value) for i, value in enumerate(values) if i not in set(tunable)]
    if not numbers:
        return text
    for function in split:
        text = _bake_reads(text, function, numbers)
        text = _drop_last_input(text, function, len(numbers))
    return _drop_unused_pattern(text, len(numbers))


def _bake_reads(text: str, function: ca.Function, numbers: Sequence[str]) -> str:
    name, last = function.name(), function.n_in() - 1
    start = _position(text, f"/* {name}:(")
    end = text.index(f"CASADI_SYMBOL_EXPORT int {name}(", start)
    body = text[start:end]
    expected = sum(
        function.instruction_id(k) == ca.OP_INPUT and function.instruction_input(k)[0] == last
        for k in range(function.n_instructions())
    )
    baked, found = re.subn(
        rf"\b(a\d+)=arg\[{last}\]\? arg\[{last}\]\[(\d+)\] : 0;",
        lambda read: f"{read[1]}={numbers[int(read[2])]};",
        body,
    )
    if found != expected or f"arg[{last}]" in baked:
        raise UnexpectedCode(f"{name}: {found} reads of baked parameters found in CasADi's C, expected {expected}")
    return text[:start] + baked + text[end:]


def _drop_last_input(text: str, function: ca.Function, size: int) -> str:
    """Take the last input out of what the C says of the Function: signature comment, counts, name, sparsity."""
    name, count = function.name(), function.n_in()
    entry = _BAKED if size == 1 else rf"{_BAKED}\[{size}\]"
    text = _once(rf"(/\* {name}:\([^)]*?),?{entry}\)", r"\1)", text)
    text = _once(rf"( {name}_n_in\(void\) {{ return ){count};", rf"\g<1>{count - 1};", text)
    text = _once(rf'( {name}_name_in\((?:.*\n)*?)    case {count - 1}: return "{_BAKED}";\n', r"\1", text)
    text = _once(rf"( {name}_sparsity_in\((?:.*\n)*?)    case {count - 1}: return casadi_s\d+;\n", r"\1", text)
    text = _once(rf"( {name}_work\((?:.*\n)*?.*\*sz_arg = ){count};", rf"\g<1>{count - 1};", text)
    return _once(rf"( {name}_work_bytes\((?:.*\n)*?.*\*sz_arg = ){count}\*", rf"\g<1>{count - 1}*", text)


def _drop_unused_pattern(text: str, size: int) -> str:
    """Remove the sparsity pattern that only the baked input had."""
    found = re.search(rf"static const casadi_int (casadi_s\d+)\[3\] = {{{size}, 1, 1}};\n", text)
    if found is None:
        raise UnexpectedCode(f"no sparsity pattern of {size} baked parameters found in CasADi's C")
    symbol = found[1]
    if len(re.findall(rf"\b{symbol}\b", text)) > 2:  # another vector has the same length
        return text
    text = text.replace(found[0], "")
    return _once(rf"#define {symbol} CASADI_PREFIX\(\w+\)\n", "", text)


def _once(pattern: str, replacement: str, text: str) -> str:
    text, found = re.subn(pattern, replacement, text)
    if found != 1:
        raise UnexpectedCode(f"{found} places in CasADi's C look like {pattern!r}, expected 1")
    return text


def _position(text: str, wanted: str) -> int:
    if text.count(wanted) != 1:
        raise UnexpectedCode(f"{text.count(wanted)} places in CasADi's C read {wanted!r}, expected 1")
    return text.index(wanted)
