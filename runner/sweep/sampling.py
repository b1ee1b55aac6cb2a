"""Sequences of numbers in (0, 1) in which entry i depends on seed, name and i alone, on every machine to the last bit.

A sweep can therefore be cut into chunks of any size, stopped and resumed, and a million rows need no memory. Nothing
here calls a library's exp, log or generator of floats, whose last bits differ between machines and versions: integers
come from Philox and SHA-256, and the functions below use additions, products and quotients only, which IEEE 754 rounds
the same everywhere.
"""

from __future__ import annotations

import warnings
from decimal import Context, Decimal
from hashlib import sha256

import numpy as np
from numpy.typing import NDArray

VERSION = 1
"""Goes up whenever any number that is drawn here changes: a dataset that was begun with another is not continued."""

Floats = NDArray[np.float64]
Indices = NDArray[np.uint64]

_HALF = 2.0**-53
_BELOW_ONE = 1.0 - _HALF
_SOBOL_BITS = 32  # SciPy jumps ahead in sequences of 32 bits only
_FEISTEL_ROUNDS = 6
_BLOCK = 4  # random numbers that one count of Philox gives


def _key(seed: int, name: str) -> NDArray[np.uint64]:
    """Sixty-four bytes that belong to a seed and a name, as eight words."""
    digest = sha256(f"{seed}/{name}".encode()).digest() + sha256(f"{seed}/{name}/2".encode()).digest()
    return np.frombuffer(digest, "<u8").astype(np.uint64)


def random(seed: int, name: str, first: int, count: int) -> Floats:
    """Entries first .. first+count-1 of independent uniform numbers, (count,), in (0, 1)."""
    stream = np.random.Philox(key=_key(seed, name)[:2])
    stream.advance(first // _BLOCK)
    skipped = first % _BLOCK
    words = stream.random_raw(count + skipped)[skipped:]
    return np.asarray((words >> np.uint64(12)) * 2.0**-52 + _HALF, dtype=np.float64)


def latin_hypercube(seed: int, name: str, first: int, count: int, samples: int) -> Floats:
    """Entries of a Latin hypercube's column, (count,), in (0, 1): each of `samples` equal strata has one entry.

    The permutation of the strata is computed entry by entry, by a Feistel network that is walked until it lands below
    `samples` (Black and Rogaway, "Ciphers with arbitrary finite domains", 2002).
    """
    stratum = _permuted(np.arange(first, first + count, dtype=np.uint64), samples, _key(seed, name))
    return np.minimum((stratum + random(seed, f"{name}/within", first, count)) / samples, _BELOW_ONE)


def _permuted(index: Indices, size: int, key: NDArray[np.uint64]) -> Indices:
    half = np.uint64(max(1, (size - 1).bit_length() + 1 >> 1))
    mask = np.uint64((1 << int(half)) - 1)

    def network(x: Indices) -> Indices:
        left, right = x >> half, x & mask
        for turn in range(_FEISTEL_ROUNDS):
            left, right = right, left ^ (_scrambled(right + key[turn]) & mask)
        return (left << half) | right

    result = network(index)
    while (outside := result >= size).any():
        result[outside] = network(result[outside])
    return result


def _scrambled(x: Indices) -> Indices:
    """The finaliser of SplitMix64 (Steele, Lea, Flood 2014)."""
    x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return x ^ (x >> np.uint64(31))


class Sobol:
    """A Sobol sequence (Joe and Kuo's numbers, from SciPy), shifted digitally by the seed, one column a name."""

    def __init__(self, seed: int, names: tuple[str, ...]) -> None:
        from scipy.stats.qmc import Sobol as Sequence  # noqa: PLC0415 - slow to load, and seldom needed

        self._sequence = Sequence(len(names), scramble=False, bits=_SOBOL_BITS)
        self._shift = np.array([_key(seed, name)[0] for name in names]) >> np.uint64(64 - _SOBOL_BITS)

    def rows(self, first: int, count: int) -> Floats:
        """Entries first .. first+count-1, (count, names), in (0, 1). Cheapest when asked for in order."""
        if first < self._sequence.num_generated:
            self._sequence.reset()
        if first > self._sequence.num_generated:
            self._sequence.fast_forward(first - self._sequence.num_generated)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # the first call may well not be for a power of two
            points = self._sequence.random(count)
        digits = (points * 2.0**_SOBOL_BITS).astype(np.uint64) ^ self._shift
        return np.asarray((digits + 0.5) * 2.0**-_SOBOL_BITS, dtype=np.float64)


def uniform(u: Floats, low: float, high: float) -> Floats:
    """Numbers in [low, high]."""
    return np.clip(low + (high - low) * u, low, high)


def log_uniform(u: Floats, low: float, high: float) -> Floats:
    """Numbers in [low, high], 0 < low, whose logarithms are uniform."""
    exact = Context(prec=40)
    span = float(exact.ln(exact.divide(Decimal(high), Decimal(low))))
    return np.clip(low * _exp(u * span), low, high)


def normal(u: Floats, mean: float, deviation: float) -> Floats:
    """Normal numbers by the inverse distribution function (Wichura 1988, algorithm AS 241), within 8.3 deviations."""
    q = u - 0.5
    r = 0.180625 - q * q
    central = q * _polynomial(_CENTRAL[0], r) / _polynomial(_CENTRAL[1], r)
    tail = np.sqrt(-_log(np.minimum(u, 1.0 - u)))
    outer = np.where(
        tail <= 5.0,
        _polynomial(_OUTER[0], tail - 1.6) / _polynomial(_OUTER[1], tail - 1.6),
        _polynomial(_FAR[0], tail - 5.0) / _polynomial(_FAR[1], tail - 5.0),
    )
    return mean + deviation * np.where(np.abs(q) <= 0.425, central, np.copysign(outer, q))


def chosen(u: Floats, count: int) -> NDArray[np.int64]:
    """Indices 0 .. count-1, equally likely."""
    return np.minimum((u * count).astype(np.int64), count - 1)


def _polynomial(coefficients: tuple[float, ...], x: Floats) -> Floats:
    """Horner's rule, the highest power's coefficient first."""
    value = np.full_like(x, coefficients[0])
    for coefficient in coefficients[1:]:
        value = value * x + coefficient
    return value


_LN2_HIGH, _LN2_LOW = 6.93147180369123816490e-01, 1.90821492927058770002e-10
_EXP = tuple(1.0 / d for d in (6227020800, 479001600, 39916800, 3628800, 362880, 40320, 5040, 720, 120, 24, 6, 2, 1, 1))
_ATANH = tuple(1.0 / d for d in range(25, 0, -2))


def _exp(x: Floats) -> Floats:
    n = np.rint(x * 1.4426950408889634)
    rest = (x - n * _LN2_HIGH) - n * _LN2_LOW
    return np.ldexp(_polynomial(_EXP, rest), n.astype(np.int32))


def _log(x: Floats) -> Floats:
    mantissa, exponent = np.frexp(x)
    small = mantissa < 0.7071067811865476
    mantissa, exponent = np.where(small, 2.0 * mantissa, mantissa), exponent - small
    s = (mantissa - 1.0) / (mantissa + 1.0)
    return exponent * _LN2_HIGH + (2.0 * s * _polynomial(_ATANH, s * s) + exponent * _LN2_LOW)


# Numerators and denominators of AS 241 (PPND16), the highest power first.
_CENTRAL = (
    (
        2509.0809287301226727,
        33430.575583588128105,
        67265.770927008700853,
        45921.953931549871457,
        13731.693765509461125,
        1971.5909503065514427,
        133.14166789178437745,
        3.387132872796366608,
    ),
    (
        5226.495278852545925,
        28729.085735721942674,
        39307.89580009271061,
        21213.794301586595867,
        5394.1960214247511077,
        687.1870074920579083,
        42.313330701600911252,
        1.0,
    ),
)
_OUTER = (
    (
        7.7454501427834140764e-4,
        0.0227238449892691845833,
        0.24178072517745061177,
        1.27045825245236838258,
        3.64784832476320460504,
        5.7694972214606914055,
        4.6303378461565452959,
        1.42343711074968357734,
    ),
    (
        1.05075007164441684324e-9,
        5.475938084995344946e-4,
        0.0151986665636164571966,
        0.14810397642748007459,
        0.68976733498510000455,
        1.6763848301838038494,
        2.05319162663775882187,
        1.0,
    ),
)
_FAR = (
    (
        2.01033439929228813265e-7,
        2.71155556874348757815e-5,
        0.0012426609473880784386,
        0.026532189526576123093,
        0.29656057182850489123,
        1.7848265399172913358,
        5.4637849111641143699,
        6.6579046435011037772,
    ),
    (
        2.04426310338993978564e-15,
        1.4215117583164458887e-7,
        1.8463183175100546818e-5,
        7.868691311456132591e-4,
        0.0148753612908506148525,
        0.13692988092273580531,
        0.59983220655588793769,
        1.0,
    ),
)
