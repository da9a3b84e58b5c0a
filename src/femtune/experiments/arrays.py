"""Orthogonal arrays: designs in which every pair of factors has every pair of levels equally often.

All arrays are constructed, none is a stored table:

- L4, L8, L9, L16, L25, L27, L32: linear arrays over a finite field. The runs are all vectors of the field, each factor
  is a point of the projective space. In arrays of two levels the three points of a line together are a factor of four
  levels, as many as there are disjoint lines.
- L12, L20, L24 …: Hadamard matrices by Paley's constructions.
- L18 and L36: difference matrices of three levels, found by a lexicographic search, with the column of their 6 or 12
  blocks divided into factors.

Sources: Hedayat, Sloane and Stufken 1999; Paley 1933; Plackett and Burman 1946.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from itertools import combinations, product

import numpy as np

from femtune.arrays import Integers
from femtune.errors import FemtuneError, did_you_mean


@dataclass(frozen=True, eq=False)
class OrthogonalArray:
    """A design by levels.

    Parameters
    ----------
    name : "L18" …, with the number of levels and factors where there are several of a size: "L16 4^5"
    levels : (runs, factors) level of each factor in each run, from 0
    """

    name: str
    levels: Integers

    @property
    def counts(self) -> Integers:
        """(factors,) number of levels of each factor."""
        return np.asarray(self.levels.max(axis=0) + 1)

    @property
    def structure(self) -> str:
        """Levels and factors: "2^1 3^7"."""
        return " ".join(f"{level}^{count}" for level, count in sorted(Counter(self.counts.tolist()).items()))


# ----------------------------------------------------------------------------------------------------
# Linear arrays.


def _points(prime: int, dimension: int) -> list[tuple[int, ...]]:
    """Points of the projective space: vectors whose first entry that is not zero is one, the unit vectors first."""
    vectors = (v for v in product(range(prime), repeat=dimension) if next((e for e in v if e), 0) == 1)
    return sorted(vectors, key=lambda v: (max(i for i, e in enumerate(v) if e), v[::-1]))


def _linear(prime: int, dimension: int) -> Integers:
    """(pᵈ, (pᵈ − 1)/(p − 1)) all factors of p levels."""
    runs = np.array(list(product(range(prime), repeat=dimension)))
    return np.asarray(runs @ np.array(_points(prime, dimension)).T % prime)


@cache
def _disjoint_lines(dimension: int) -> tuple[tuple[int, int, int], ...]:
    """A largest set of disjoint lines of the projective space over two elements, as positions of their points."""
    points = _points(2, dimension)
    place = {p: i for i, p in enumerate(points)}
    lines = sorted(
        {
            tuple(sorted((place[a], place[b], place[tuple((x + y) % 2 for x, y in zip(a, b, strict=True))])))
            for a, b in combinations(points, 2)
        }
    )
    most = {2: 1, 3: 1, 4: 5, 5: 9}[dimension]

    def extended(chosen: list[tuple[int, ...]], used: set[int]) -> list[tuple[int, ...]] | None:
        if len(chosen) == most:
            return chosen
        # the line through the lowest free point, or that point stays without a line
        rest = [line for line in lines if used.isdisjoint(line) and (not chosen or line > chosen[-1])]
        for line in rest:
            longer = extended([*chosen, line], used | set(line))
            if longer:
                return longer
        return None

    chosen_lines = extended([], set()) or []
    return tuple((line[0], line[1], line[2]) for line in chosen_lines)


def _of_four_levels(dimension: int, fours: int) -> Integers:
    """An array of 2ᵈ runs with `fours` factors of four levels; the other points are factors of two levels."""
    two = _linear(2, dimension)
    lines = _disjoint_lines(dimension)[:fours]
    used = {point for line in lines for point in line}
    four = [2 * two[:, line[0]] + two[:, line[1]] for line in lines]
    rest = [two[:, i] for i in range(two.shape[1]) if i not in used]
    return np.stack([*rest, *four], axis=1)


# ----------------------------------------------------------------------------------------------------
# Hadamard matrices.


def _is_prime(number: int) -> bool:
    return number > 1 and all(number % i for i in range(2, int(number**0.5) + 1))


def _jacobsthal(q: int) -> Integers:
    """(q, q) quadratic character of i − j for a prime q."""
    squares = {i * i % q for i in range(1, q)}
    character = np.array([0] + [1 if i in squares else -1 for i in range(1, q)])
    return np.asarray(character[(np.arange(q)[:, None] - np.arange(q)) % q])


@cache
def hadamard(order: int) -> Integers:
    """Matrix of ±1 with orthogonal columns, the first row and column positive.

    Raises
    ------
    FemtuneError : ``design.runs`` for orders that the constructions do not reach
    """
    half = order // 2
    if order in (1, 2):
        matrix = np.array([[1]]) if order == 1 else np.array([[1, 1], [1, -1]])
    elif order % 4 == 0 and order & (order - 1) == 0:
        matrix = np.kron(hadamard(2), hadamard(half))
    elif order % 4 == 0 and _is_prime(order - 1):
        skew = np.zeros((order, order), dtype=int)
        skew[0, 1:], skew[1:, 0], skew[1:, 1:] = 1, -1, _jacobsthal(order - 1)
        matrix = skew + np.eye(order, dtype=int)
    elif order % 4 == 0 and half % 4 == 2 and _is_prime(half - 1):
        conference = np.zeros((half, half), dtype=int)
        conference[0, 1:], conference[1:, 0], conference[1:, 1:] = 1, 1, _jacobsthal(half - 1)
        identity = np.eye(half, dtype=int)
        matrix = np.kron(conference, [[1, 1], [1, -1]]) + np.kron(identity, [[1, -1], [-1, -1]])
    elif order % 8 == 0:
        matrix = np.kron(hadamard(2), hadamard(half))
    else:
        raise FemtuneError("design.runs", runs=order)
    matrix = matrix * matrix[:, :1]
    return np.asarray(matrix * matrix[:1])


def _of_hadamard(order: int) -> Integers:
    """(n, n − 1) factors of two levels."""
    return np.asarray((1 - hadamard(order)[:, 1:]) // 2)


# ----------------------------------------------------------------------------------------------------
# Difference matrices of three levels.


@cache
def _difference_matrix(order: int) -> Integers:
    """(n, n) over three levels: the difference of every two rows has each level n/3 times, found row by row."""
    part = order // 3
    places = range(1, order)
    rows = []
    for zeros in combinations(places, part - 1):
        rest = [i for i in places if i not in zeros]
        for ones in combinations(rest, part):
            row = np.full(order, 2, dtype=int)
            row[[0, *zeros]] = 0
            row[list(ones)] = 1
            rows.append(row)

    def extended(chosen: list[Integers], allowed: Integers) -> list[Integers] | None:
        if len(chosen) == order:
            return chosen
        for i, row in enumerate(allowed):
            left = (allowed[i + 1 :] - row) % 3
            fits = ((left == 0).sum(axis=1) == part) & ((left == 1).sum(axis=1) == part)
            longer = extended([*chosen, row], allowed[i + 1 :][fits])
            if longer:
                return longer
        return None

    return np.array(extended([np.zeros(order, dtype=int)], np.array(rows, dtype=int)), dtype=int)


def _of_differences(order: int, blocks: Integers) -> Integers:
    """(3n, …) the factors of each of n blocks, (n, …), and n factors of three levels."""
    three = (_difference_matrix(order).T[:, None, :] + np.arange(3)[None, :, None]) % 3
    return np.hstack([np.repeat(blocks, 3, axis=0), three.reshape(3 * order, order)])


def _factorial_blocks(first: int, rest: Integers) -> Integers:
    """Every level of a factor with every run of an array."""
    return np.hstack([np.repeat(np.arange(first), len(rest))[:, None], np.tile(rest, (first, 1))])


def _two_by_three() -> Integers:
    return np.array(list(product(range(2), range(3))))


# ----------------------------------------------------------------------------------------------------
# The catalogue.

_ARRAYS: dict[str, Callable[[], Integers]] = {
    "L4": lambda: _linear(2, 2),
    "L8": lambda: _linear(2, 3),
    "L8 2^4 4^1": lambda: _of_four_levels(3, 1),
    "L9": lambda: _linear(3, 2),
    "L12": lambda: _of_hadamard(12),
    "L12 2^3 3^1": lambda: _factorial_blocks(3, _linear(2, 2)),
    "L16": lambda: _linear(2, 4),
    "L16 2^12 4^1": lambda: _of_four_levels(4, 1),
    "L16 2^9 4^2": lambda: _of_four_levels(4, 2),
    "L16 2^6 4^3": lambda: _of_four_levels(4, 3),
    "L16 2^3 4^4": lambda: _of_four_levels(4, 4),
    "L16 4^5": lambda: _of_four_levels(4, 5),
    "L18": lambda: _of_differences(6, _two_by_three()),
    "L18 3^6 6^1": lambda: _of_differences(6, np.arange(6)[:, None]),
    "L20": lambda: _of_hadamard(20),
    "L24": lambda: _of_hadamard(24),
    "L25": lambda: _linear(5, 2),
    "L27": lambda: _linear(3, 3),
    "L32": lambda: _linear(2, 5),
    **{f"L32 2^{31 - 3 * k} 4^{k}": partial(_of_four_levels, 5, k) for k in range(1, 10)},
    "L36": lambda: _of_differences(12, _of_hadamard(12)),
    "L36 2^3 3^13": lambda: _of_differences(12, _factorial_blocks(3, _linear(2, 2))),
    "L36 3^12 12^1": lambda: _of_differences(12, np.arange(12)[:, None]),
}


def array_names() -> tuple[str, ...]:
    """Names of all arrays, in the order of their runs."""
    return tuple(_ARRAYS)


@cache
def orthogonal_array(name: str) -> OrthogonalArray:
    """The array of a name: "L18", "L16 4^5" …

    Raises
    ------
    FemtuneError : ``design.unknown-array``

    Examples
    --------
    >>> from femtune.experiments import orthogonal_array
    >>> array = orthogonal_array("L18")
    >>> array.levels.shape, array.structure
    ((18, 8), '2^1 3^7')
    """
    if name not in _ARRAYS:
        raise FemtuneError("design.unknown-array", name=name, hint=did_you_mean(name, list(_ARRAYS)))
    array = OrthogonalArray(name, np.array(_ARRAYS[name]()))
    array.levels.flags.writeable = False
    return array


def columns_for(array: OrthogonalArray, counts: Integers | list[int]) -> list[int] | None:
    """Columns of an array for factors with these numbers of levels, the first that fit; None if there are too few."""
    free = {level: list(np.flatnonzero(array.counts == level)) for level in set(array.counts.tolist())}
    columns = []
    for count in counts:
        if not free.get(int(count)):
            return None
        columns.append(int(free[int(count)].pop(0)))
    return columns


def smallest_array(counts: list[int]) -> tuple[OrthogonalArray, list[int]]:
    """The array with the fewest runs for factors with these numbers of levels, and the columns of the factors.

    An array that leaves degrees of freedom for the error is preferred to a saturated one of the same size only by its
    place in the catalogue.

    Raises
    ------
    FemtuneError : ``design.no-array``
    """
    for name in sorted(_ARRAYS, key=_runs):
        array = orthogonal_array(name)
        columns = columns_for(array, counts)
        if columns is not None and len(array.levels) > 1 + sum(c - 1 for c in counts):
            return array, columns
    levels = " ".join(f"{level}^{count}" for level, count in sorted(Counter(counts).items()))
    raise FemtuneError("design.no-array", levels=levels)


def _runs(name: str) -> int:
    return int(name[1:].partition(" ")[0])
