"""A block as C on vectors: a statement for each operation and group."""

from __future__ import annotations

from collections.abc import Sequence

from springline.codegen.elementary import INFIX, Kind, Op
from springline.codegen.kernel.block import Block, Primitive
from springline.codegen.kernel.schedule import aliases
from springline.codegen.program import constant_expression


class Constants:
    """The constants of a kernel's blocks: those of each group in memory of its own, which no compiler sees through.

    So each is an operand where it is used. Constants that a compiler knows it loads into registers for several uses,
    and with twice as many blocks of few registers that costs more than the memory does.
    """

    def __init__(self) -> None:
        self._reals: dict[str, int] = {}
        self._bits: dict[str, int] = {}

    def real(self, value: float, second: float | None, group: str) -> str:
        """C expression of a number, and of another in a second lane."""
        entry = _entry(_static(value), None if second is None else _static(second))
        return f"sl_reals[{group}][{self._reals.setdefault(entry, len(self._reals))}]"

    def bits(self, value: int, second: int | None, group: str) -> str:
        """C expression of 64 bits."""
        entry = _entry(f"UINT64_C({value:#x})", None if second is None else f"UINT64_C({second:#x})")
        return f"sl_words[{group}][{self._bits.setdefault(entry, len(self._bits))}]"

    def text(self, groups: int) -> list[str]:
        """The definitions."""
        lines = []
        for kind, name, values in (("sl_v", "sl_reals", self._reals), ("sl_b", "sl_words", self._bits)):
            entries = "".join(f"\n  {value}," for value in values)
            size = f"{name}[SL_G][{len(values)} + 1]"
            lines += [f"extern {kind} {size};", f"{kind} {size} = {{{', '.join(['{' + entries + '}'] * groups)}}};\n"]
        return lines


def _entry(value: str, second: str | None) -> str:
    return f"SL_EACH({value})" if second is None else f"SL_EACH_TWO({value}, {second})"


def _static(value: float) -> str:
    return constant_expression(value).replace("SL_NAN", "(0.0 / 0.0)")


_TYPES = {Kind.REAL: "sl_v", Kind.BITS: "sl_b", Kind.MASK: "sl_m"}


def statements(
    block: Block, order: Sequence[int], groups: Sequence[str], constants: Constants, indent: str
) -> list[str]:
    """Statements of a block in this order, for these groups side by side; `ok`, `ok_0`, ... collect where it holds.

    groups  the index of each, as C has it
    """
    nodes = block.nodes
    same = aliases(block)
    scheduled, fine = set(order), {same[i] for i in block.fine}
    stores: dict[int, list[tuple[str, int]]] = {}
    for place, i in block.stores:
        stores.setdefault(same[i] if same[i] in scheduled else -1, []).append((place, i))

    def suffix(g: str) -> str:
        return f"_{g}" if len(groups) > 1 else ""

    def value(i: int, g: str) -> str:
        node = nodes[i]
        if node.op is Op.INPUT:
            return node.text.replace("@", g)
        if node.op is Op.REAL_CONSTANT:
            return constants.real(float(node.number), node.second, g)
        if node.op is Op.BITS_CONSTANT:
            return constants.bits(int(node.number), None if node.second is None else int(node.second), g)
        if node.op in (Op.REAL, Op.BITS):
            return f"slv_{node.op.value[0]}({value(node.arguments[0], g)})"
        return block.labels.get(i, f"a{i}") + suffix(g)

    def store(i: int, g: str) -> list[str]:
        return [f"{indent}{place.replace('@', g)} = {value(k, g)};" for place, k in stores.get(i, ())]

    lines = []
    for i in order:
        for g in groups:
            operands = [value(k, g) for k in nodes[i].arguments]
            expression = _expression(nodes[i], operands)
            lines.append(f"{indent}const {_TYPES[nodes[i].op.kind]} {value(i, g)} = {expression};")
            if i in fine:
                lines.append(f"{indent}ok{suffix(g)} = ok{suffix(g)} & {value(i, g)};")
            lines.extend(store(i, g))
    for g in groups:
        lines.extend(store(-1, g))  # what was only loaded
    return lines


def _expression(node: Primitive, operands: Sequence[str]) -> str:
    if node.op in (Op.SHIFT_LEFT, Op.SHIFT_RIGHT):
        return f"{operands[0]} {'<<' if node.op is Op.SHIFT_LEFT else '>>'} {int(node.number)}"
    if node.op in INFIX:
        return f"{operands[0]} {INFIX[node.op]} {operands[1]}"
    if node.op is Op.NEG:
        return f"-{operands[0]}"
    if node.op in (Op.PAIR, Op.PAIR_MASKS):
        lanes = divmod(int(node.number), 2)
        return f"slv_{node.op.value[0]}({operands[0]}, {lanes[1]}, {operands[1]}, {lanes[0]})"
    if node.op is Op.BELOW:
        return f"slv_below({operands[0]}, UINT64_C({int(node.number):#x}))"
    return f"slv_{node.op.value[0]}({', '.join(operands)})"
