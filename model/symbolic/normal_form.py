"""Normal form of polynomials in symbols, sines and cosines.

Automatic differentiation of energies leaves terms that cancel (C dq of a joint that has none) or that add up to one
(sin^2 + cos^2). `collect` expands an expression, cancels exactly, and writes it again as a sum over products of the
variables whose coefficients depend on nothing else: the form in which everything that depends only on parameters, or
only on time, can be computed once.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from springline.model import lazy_casadi as ca

# A monomial is a sorted tuple of (atom index, power), a polynomial maps monomials to coefficients.
Monomial = tuple[tuple[int, int], ...]
Polynomial = dict[Monomial, float]

# Terms of one polynomial, beyond which a normal form is not worth its making: the paper's arm has 13 at most.
_MOST_TERMS = 600


class TooManyTerms(Exception):
    """A normal form explodes."""


class _Atoms:
    """The indeterminates: symbols, and functions of normal forms (sin, cos, or anything not polynomial)."""

    def __init__(self) -> None:
        self.sx: list[ca.SX] = []
        self.sine_of: dict[int, int] = {}  # atom of sin(a) -> atom of cos(a)
        self.reduced: dict[Monomial, Polynomial] = {}  # found once, needed again and again
        self._index: dict[object, int] = {}

    def intern(self, key: object, expression: ca.SX) -> int:
        if key not in self._index:
            self._index[key] = len(self.sx)
            self.sx.append(expression)
        return self._index[key]


def _accumulate(result: Polynomial, b: Polynomial, scale: float = 1.0) -> None:
    """Add a polynomial to `result`, in place."""
    for monomial, coefficient in b.items():
        value = result.get(monomial, 0.0) + scale * coefficient
        if value == 0.0:
            result.pop(monomial, None)
        else:
            result[monomial] = value


def _add(a: Polynomial, b: Polynomial, scale: float = 1.0) -> Polynomial:
    result = dict(a)
    _accumulate(result, b, scale)
    return result


def _merge(a: Monomial, b: Monomial) -> Monomial:
    powers = dict(a)
    for atom, power in b:
        powers[atom] = powers.get(atom, 0) + power
    return tuple(sorted(powers.items()))


def _multiply(a: Polynomial, b: Polynomial, atoms: _Atoms) -> Polynomial:
    result: Polynomial = {}
    if len(a) * len(b) > _MOST_TERMS * 10:
        raise TooManyTerms
    for left, u in a.items():
        for right, v in b.items():
            _accumulate(result, _reduced(_merge(left, right), atoms), u * v)
    if len(result) > _MOST_TERMS:
        raise TooManyTerms
    return result


def _reduced(monomial: Monomial, atoms: _Atoms) -> Polynomial:
    """A monomial with every sin(a)^2 replaced by 1 - cos(a)^2."""
    if monomial not in atoms.reduced:
        atoms.reduced[monomial] = {monomial: 1.0}
        for atom, power in monomial:
            if power >= 2 and atom in atoms.sine_of:
                rest = tuple((a, k - 2 if a == atom else k) for a, k in monomial if a != atom or k > 2)
                cosine = _merge(rest, ((atoms.sine_of[atom], 2),))
                atoms.reduced[monomial] = _add(_reduced(rest, atoms), _reduced(cosine, atoms), -1.0)
                break
    return atoms.reduced[monomial]


def _polynomials(function: ca.Function, symbols: ca.SX, atoms: _Atoms) -> list[Polynomial]:
    """Normal forms of all outputs of a one-input one-output SX Function, by walking its instructions."""
    work: dict[int, Polynomial] = {}
    outputs: dict[int, Polynomial] = {}

    def opaque(name: str, arguments: Sequence[Polynomial], expression: ca.SX) -> Polynomial:
        key = (name, *(tuple(sorted(a.items())) for a in arguments))
        return {((atoms.intern(key, expression), 1),): 1.0}

    for k in range(function.n_instructions()):
        op = function.instruction_id(k)
        into, source = function.instruction_output(k), function.instruction_input(k)
        if op == ca.OP_OUTPUT:
            outputs[into[1]] = work[source[0]]
            continue
        if op == ca.OP_INPUT:
            index = source[1]
            work[into[0]] = {((atoms.intern(("symbol", index), symbols[index]), 1),): 1.0}
            continue
        if op == ca.OP_CONST:
            value = function.instruction_constant(k)
            work[into[0]] = {(): value} if value != 0.0 else {}
            continue
        arguments = [work[i] for i in source]
        first = arguments[0]
        if op == ca.OP_ADD:
            result = _add(first, arguments[1])
        elif op == ca.OP_SUB:
            result = _add(first, arguments[1], -1.0)
        elif op == ca.OP_NEG:
            result = _add({}, first, -1.0)
        elif op == ca.OP_TWICE:
            result = _add({}, first, 2.0)
        elif op == ca.OP_MUL:
            result = _multiply(first, arguments[1], atoms)
        elif op == ca.OP_SQ:
            result = _multiply(first, first, atoms)
        elif op == ca.OP_DIV and set(arguments[1]) == {()}:
            divisor = arguments[1][()]
            result = {monomial: coefficient / divisor for monomial, coefficient in first.items()}
        elif op in (ca.OP_SIN, ca.OP_COS):
            argument = _emit(first, atoms, [])
            sine = opaque("sin", [first], ca.sin(argument))
            cosine = opaque("cos", [first], ca.cos(argument))
            atoms.sine_of[next(iter(sine))[0][0]] = next(iter(cosine))[0][0]
            result = sine if op == ca.OP_SIN else cosine
        else:
            values = [_emit(argument, atoms, []) for argument in arguments]
            result = opaque(str(op), arguments, _apply(op, values))
        work[into[0]] = result
    return [outputs.get(i, {}) for i in range(function.numel_out(0))]


def _apply(op: int, arguments: Sequence[ca.SX]) -> ca.SX:
    """The SX operation with the opcode `op`; an unknown one is refused by name."""
    table: dict[int, Callable[..., ca.SX]] = {
        ca.OP_DIV: lambda a, b: a / b,
        ca.OP_INV: lambda a: 1 / a,
        ca.OP_SQRT: ca.sqrt,
        ca.OP_EXP: ca.exp,
        ca.OP_LOG: ca.log,
        ca.OP_POW: lambda a, b: a**b,
        ca.OP_CONSTPOW: lambda a, b: a**b,
        ca.OP_FABS: ca.fabs,
        ca.OP_SIGN: ca.sign,
        ca.OP_TAN: ca.tan,
        ca.OP_TANH: ca.tanh,
        ca.OP_FMIN: ca.fmin,
        ca.OP_FMAX: ca.fmax,
    }
    if op not in table:
        names = {getattr(ca, name): name for name in dir(ca) if name.startswith("OP_")}
        raise ValueError(
            f"an energy may not contain the operation {names.get(op, op)}; write it with +, -, *, /, "
            "powers, sqrt, exp, log, sin, cos, tan, tanh, fabs, sign, fmin or fmax"
        )
    return table[op](*arguments)


def _by_degree(monomial: Monomial) -> tuple[int, Monomial]:
    return sum(power for _, power in monomial), monomial


def _emit(polynomial: Polynomial, atoms: _Atoms, levels: Sequence[frozenset[int]]) -> ca.SX:
    """Write a polynomial; terms that share their factors among the atoms of `levels[0]` are put together first."""
    if not levels:
        total = ca.SX(0)
        for monomial in sorted(polynomial, key=_by_degree):
            coefficient = polynomial[monomial]
            term = abs(coefficient) * _product(monomial, atoms)
            total = total + term if coefficient > 0 else total - term
        return total
    groups: dict[Monomial, Polynomial] = {}
    for monomial, coefficient in polynomial.items():
        outer = tuple(item for item in monomial if item[0] in levels[0])
        inner = tuple(item for item in monomial if item[0] not in levels[0])
        groups.setdefault(outer, {})[inner] = coefficient
    total = ca.SX(0)
    for outer in sorted(groups, key=_by_degree):
        total = total + _emit(groups[outer], atoms, levels[1:]) * _product(outer, atoms)
    return total


def _product(monomial: Monomial, atoms: _Atoms) -> ca.SX:
    result = ca.SX(1)
    for atom, power in monomial:
        for _ in range(power):
            result = result * atoms.sx[atom]
    return result


def collect(expression: ca.SX, symbols: ca.SX, levels: Sequence[ca.SX]) -> ca.SX:
    """Normal form of `expression` (any dense shape) with nested grouping.

    symbols  column of all free symbols
    levels   columns of symbols, the fastest-changing first: terms are grouped by their factors that depend on
             levels[0], their coefficients by factors that depend on levels[1], and so on
    Raises ValueError where the expression holds an operation that cannot be rebuilt (named), TooManyTerms where it
    explodes.
    """
    function = ca.Function("expression", [symbols], [ca.densify(ca.vec(expression))])
    atoms = _Atoms()
    polynomials = _polynomials(function, symbols, atoms)
    taken: set[int] = set()
    level_atoms: list[frozenset[int]] = []
    for level in levels:
        mine = frozenset(i for i, sx in enumerate(atoms.sx) if i not in taken and ca.depends_on(sx, level))
        taken |= mine
        level_atoms.append(mine)
    rows = [_emit(polynomial, atoms, level_atoms) for polynomial in polynomials]
    return ca.reshape(ca.vertcat(*rows), *expression.shape)
