"""Coefficients of the terms as Chebyshev polynomials of the parameters, which a page can evaluate.

A coefficient is a closure over the value table with its ties. It is sampled at the Chebyshev points of the parameters
on which its gradient is not zero, at most two, the others at the updated point, and the samples are interpolated
(Trefethen, Approximation Theory and Approximation Practice, chapter 3).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.fem.fields import MatrixKind
from femtune.model.configured import ConfiguredModel

MOST_TOGETHER = 2
"""Parameters that one coefficient may depend on."""
_DEGREES = {1: (24, 74, 224), 2: (12, 24, 48)}
"""Degrees in each parameter that are tried one after the other, by the number of parameters: 1/x over bounds of ratio
10 has errors of 1e-7 with 24, over bounds of ratio 400 with 224."""
_CONVERGED = 1e-8
"""Last coefficients relative to the largest one at which the degree is high enough."""
_POOR = 1e-4
"""The same above which a function is refused: it is no polynomial of the highest degree."""
_LAST = 3
"""Coefficients that count as the last ones: those of odd or even degree may vanish."""
_CUT = 1e-12
"""Coefficient of a polynomial relative to the largest one below which it is left out."""
_SEED = 36
_TRIED = 4
"""Points at which gradients tell which parameters a coefficient depends on."""


@dataclass(frozen=True, eq=False)
class ChebyshevFunctions:
    """Polynomials f_j of one or two parameters, zero at the updated point.

    Parameters
    ----------
    parameters : positions of the parameters in x
    coefficients : (m, d + 1) or (m, d + 1, d + 1) of Chebyshev polynomials on the bounds mapped to −1 … 1
    """

    parameters: tuple[int, ...]
    coefficients: Reals

    def at(self, x: NDArray, lower: Reals, upper: Reals) -> Reals:
        """(m,) values at normalised parameters."""
        out = self.coefficients
        for i in reversed(self.parameters):
            t = (2.0 * x[i] - lower[i] - upper[i]) / (upper[i] - lower[i])
            out = out @ chebyshev_values(float(t), out.shape[-1])
        return out


def chebyshev_values(t: float, count: int) -> Reals:
    """(count,) T_0(t), T_1(t), …"""
    out = np.ones(count)
    if count > 1:
        out[1] = t
    for k in range(2, count):
        out[k] = 2.0 * t * out[k - 1] - out[k - 2]
    return out


@dataclass(frozen=True, eq=False)
class Separated:
    """What multiplies the matrices of a kind that depend on the same parameters.

    Parameters
    ----------
    kind : "stiffness", "mass", "viscous" or "hysteretic"
    columns : (m, 2) projected term and column of each function
    functions : their change from the updated point
    """

    kind: MatrixKind
    columns: NDArray[np.int64]
    functions: ChebyshevFunctions


@dataclass(frozen=True, eq=False)
class _Column:
    kind: MatrixKind
    term: int
    column: int
    parameters: tuple[int, ...]


def separated_terms(
    configured: ConfiguredModel, at: Reals, kinds: Sequence[MatrixKind], box: tuple[Reals, Reals] | None = None
) -> list[Separated] | str:
    """All coefficients that change with the parameters, by the parameters on which they depend.

    Parameters
    ----------
    configured : the model
    at : (k,) the updated point
    box : lower and upper ends (k,) of the domain of the polynomials; the bounds where None

    Returns
    -------
    list of Separated, or why the coefficients are no such functions, in words: of too many parameters, or changing too
    sharply between the bounds for the highest degree
    """
    box = box or configured.model.parameters.bounds
    columns = list(_moving_columns(configured, at, kinds, box))
    most = max((len(c.parameters) for c in columns), default=0)
    if most > MOST_TOGETHER:
        return (
            f"a coefficient of its matrices depends on {most} parameters at once, and a page can follow {MOST_TOGETHER}"
        )
    groups: dict[tuple[MatrixKind, tuple[int, ...]], list[_Column]] = {}
    for c in columns:
        groups.setdefault((c.kind, c.parameters), []).append(c)
    sampled = _Sampled(configured, at, box)
    out = []
    for (kind, parameters), some in groups.items():
        separated = _separated(sampled, kind, parameters, some)
        if separated is None:
            degree, names = _DEGREES[len(parameters)][-1], configured.model.parameters.free
            return (
                f"a coefficient of its matrices changes with {' and '.join(names[i].name for i in parameters)} between "
                f"the bounds too sharply for a polynomial of degree {degree}"
            )
        out.append(separated)
    return out


def _moving_columns(
    configured: ConfiguredModel, at: Reals, kinds: Sequence[MatrixKind], box: tuple[Reals, Reals]
) -> Iterator[_Column]:
    lower, upper = box
    random = np.random.default_rng(_SEED)
    points = [at, *(lower + random.uniform(0.1, 0.9, (_TRIED - 1, len(at))) * (upper - lower))]
    slopes = [configured.at(x).coefficients for x in points]
    for i, projected in enumerate(configured.projected):
        if projected.term.matrix not in kinds or projected.term.coefficient is None:
            continue
        moving = np.zeros((projected.term.n_columns, len(at)), bool)
        for of_point in slopes:
            jet = of_point[i]
            assert jet is not None
            moving |= np.broadcast_to(jet.grad != 0.0, moving.shape)
        for j in np.flatnonzero(moving.any(axis=1)):
            yield _Column(projected.term.matrix, i, int(j), tuple(np.flatnonzero(moving[j]).tolist()))


class _Sampled:
    """Weights of all terms at points that were asked for; points of one parameter are shared by all functions."""

    def __init__(self, configured: ConfiguredModel, at: Reals, box: tuple[Reals, Reals]) -> None:
        self.configured, self.base = configured, np.asarray(at, float)
        self.lower, self.upper = box
        self._known: dict[tuple[object, ...], list[NDArray]] = {}

    def along_all(self, t: float) -> list[NDArray]:
        """Weights with all parameters at one place of their ranges, −1 … 1."""
        x = 0.5 * (self.lower + self.upper) + 0.5 * t * (self.upper - self.lower)
        return self._weights(("all", t), x)

    def at_pair(self, pair: tuple[int, ...], t: tuple[float, ...]) -> list[NDArray]:
        """Weights with two parameters at places of their ranges, the others at the updated point."""
        x = self.base.copy()
        for i, value in zip(pair, t):
            x[i] = 0.5 * (self.lower[i] + self.upper[i]) + 0.5 * value * (self.upper[i] - self.lower[i])
        return self._weights((pair, t), x)

    def _weights(self, key: tuple[object, ...], x: Reals) -> list[NDArray]:
        if key not in self._known:
            point = self.configured.at(x)
            self._known[key] = [np.asarray(point.weights(i, ())) for i in range(len(self.configured.projected))]
        return self._known[key]


def _separated(
    sampled: _Sampled, kind: MatrixKind, parameters: tuple[int, ...], columns: Sequence[_Column]
) -> Separated | None:
    """The polynomials of the lowest degree that is high enough; None if none is."""
    for degree in _DEGREES[len(parameters)]:
        coefficients = _transformed(sampled, parameters, columns, degree)
        rest = _last(coefficients)
        if rest <= _CONVERGED:
            break
    if not rest <= _POOR:
        return None
    functions = ChebyshevFunctions(parameters, _shortened(coefficients))
    moved = functions.coefficients.copy()
    moved.reshape(len(columns), -1)[:, 0] -= functions.at(sampled.base, sampled.lower, sampled.upper)
    where = np.array([(c.term, c.column) for c in columns], np.int64)
    return Separated(kind, where, ChebyshevFunctions(parameters, moved))


def _last(coefficients: Reals) -> float:
    """The largest of the last coefficients along each axis, relative to the largest of the function."""
    size = np.abs(coefficients).reshape(len(coefficients), -1).max(axis=1)
    size = np.where(size > 0.0, size, 1.0)
    return max(
        float((np.abs(np.moveaxis(coefficients, axis, -1)[..., -_LAST:]).reshape(len(size), -1) / size[:, None]).max())
        for axis in range(1, coefficients.ndim)
    )


def _transformed(sampled: _Sampled, parameters: tuple[int, ...], columns: Sequence[_Column], degree: int) -> Reals:
    """(m, d + 1) or (m, d + 1, d + 1) coefficients of the polynomials through the samples."""
    dimension = len(parameters)
    nodes = np.cos(np.pi * (np.arange(degree + 1) + 0.5) / (degree + 1))
    values = np.empty((len(columns), *[len(nodes)] * dimension))
    for place in product(range(len(nodes)), repeat=dimension):
        t = tuple(float(nodes[k]) for k in place)
        weights = sampled.along_all(t[0]) if dimension == 1 else sampled.at_pair(parameters, t)
        at: tuple[int | slice, ...] = (slice(None), *place)
        values[at] = [weights[c.term][c.column] for c in columns]
    coefficients: NDArray = values
    for axis in range(1, dimension + 1):
        transformed = np.moveaxis(np.asarray(scipy.fft.dct(coefficients, type=2, axis=axis)) / len(nodes), axis, -1)
        transformed[..., 0] *= 0.5
        coefficients = np.moveaxis(transformed, -1, axis)
    return coefficients


def _shortened(coefficients: Reals) -> Reals:
    """Without the highest degrees, as far as they are rounding."""
    size = np.abs(coefficients).reshape(len(coefficients), -1).max(axis=1)
    relative = np.abs(coefficients) / np.where(size > 0.0, size, 1.0).reshape(-1, *[1] * (coefficients.ndim - 1))
    out = coefficients
    for axis in range(1, coefficients.ndim):
        others = tuple(a for a in range(coefficients.ndim) if a != axis)
        needed = np.flatnonzero(relative.max(axis=others) > _CUT)
        out = np.take(out, np.arange(int(needed.max(initial=0)) + 1), axis=axis)
    return np.ascontiguousarray(out)
