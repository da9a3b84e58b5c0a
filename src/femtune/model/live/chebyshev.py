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
_DEGREES = {1: 24, 2: 12}
"""Degree in each parameter, by the number of parameters: 1/x over bounds of ratio 10 then has errors of 1e-7."""
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


def separated_terms(configured: ConfiguredModel, at: Reals, kinds: Sequence[MatrixKind]) -> list[Separated] | str:
    """All coefficients that change with the parameters, by the parameters on which they depend.

    Parameters
    ----------
    configured : the model; its bounds are the domain of the polynomials
    at : (k,) the updated point

    Returns
    -------
    list of Separated, or why the coefficients are no such functions, in words
    """
    columns = list(_moving_columns(configured, at, kinds))
    most = max((len(c.parameters) for c in columns), default=0)
    if most > MOST_TOGETHER:
        return (
            f"a coefficient of its matrices depends on {most} parameters at once, and a page can follow {MOST_TOGETHER}"
        )
    groups: dict[tuple[MatrixKind, tuple[int, ...]], list[_Column]] = {}
    for c in columns:
        groups.setdefault((c.kind, c.parameters), []).append(c)
    sampled = _Sampled(configured, at)
    return [_separated(sampled, kind, parameters, some) for (kind, parameters), some in groups.items()]


def _moving_columns(configured: ConfiguredModel, at: Reals, kinds: Sequence[MatrixKind]) -> Iterator[_Column]:
    lower, upper = configured.model.parameters.bounds
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

    def __init__(self, configured: ConfiguredModel, at: Reals) -> None:
        self.configured, self.base = configured, np.asarray(at, float)
        self.lower, self.upper = configured.model.parameters.bounds
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

    def at_base(self) -> list[NDArray]:
        """Weights at the updated point."""
        return self._weights(("base",), self.base)

    def _weights(self, key: tuple[object, ...], x: Reals) -> list[NDArray]:
        if key not in self._known:
            point = self.configured.at(x)
            self._known[key] = [np.asarray(point.weights(i, ())) for i in range(len(self.configured.projected))]
        return self._known[key]


def _separated(
    sampled: _Sampled, kind: MatrixKind, parameters: tuple[int, ...], columns: Sequence[_Column]
) -> Separated:
    dimension = len(parameters)
    nodes = np.cos(np.pi * (np.arange(_DEGREES[dimension] + 1) + 0.5) / (_DEGREES[dimension] + 1))
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
    functions = ChebyshevFunctions(parameters, _shortened(coefficients))
    moved = functions.coefficients.copy()
    moved.reshape(len(columns), -1)[:, 0] -= functions.at(sampled.base, sampled.lower, sampled.upper)
    where = np.array([(c.term, c.column) for c in columns], np.int64)
    return Separated(kind, where, ChebyshevFunctions(parameters, moved))


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
