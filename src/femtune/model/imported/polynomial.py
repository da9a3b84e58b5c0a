"""Matrices at a few values of some variables as a polynomial: exact through as many sets as it has coefficients.

K(p) = Σ_j ξ^{e_j} B_j with every variable scaled to ξ = (p − centre)/half over the range of the sets, and
B = V⁻¹ K of the sets that were chosen as nodes (Vandermonde matrix V, nodes by pivoted QR). The other sets
check it: without at least one of them a wrong degree would not be noticed.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import scipy.linalg
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.errors import FemtuneError, Notice, Where
from femtune.model.solvers.factorise import factorise

# ----------------------------------------------------------------------------------------------------
# How far a polynomial of matrices misses a checking set in its softest motions.
#
# Entries over the diagonal show what is stiff: the membrane of a panel hides its bending, whose energy is smaller by
# (thickness over element size)² and which alone decides the lowest frequencies. A few steps of subspace iteration on
# (K, D) with the diagonal D give soft motions x; what counts is the error of x·K x over its change between the sets.


_MOTIONS = 24
"""Soft motions at which the energy is compared; the six rigid-body motions are among them."""
_STEPS = 4
"""Steps of subspace iteration: the motions need not be modes, but soft."""
_ADDED = 1e-10
"""Stiffness relative to the diagonal that is added so that rigid motions can be solved for."""
_ELASTIC = 1e-8
"""Energy relative to that of the diagonal above which a motion is not rigid."""
_LEAST_CHANGE = 1e-3
"""Change of an energy between the sets, relative to it, below which it contains few digits of the files."""


def soft_error(pattern: sp.csr_array, expected: Reals, missed: Reals, sets: Reals) -> float:
    """Largest error of the energy of a soft motion, over its change between the sets.

    Parameters
    ----------
    pattern : upper triangle whose entries the numbers are
    expected : (nnz,) the matrix of the checking set
    missed : (nnz,) what the polynomial gives beside it
    sets : (sets, nnz) the matrices of all sets
    """
    K = _full(pattern, expected)
    used = np.flatnonzero(K.diagonal() > 0.0)
    D = K.diagonal()[used]
    if not used.size:
        return 0.0
    X = _soft(sp.csr_array(K[used][:, used]), D)
    energy = _energies(_full(pattern, expected), used, X)
    elastic = energy > _ELASTIC * np.einsum("ij,i,ij->j", X, D, X)
    change = np.ptp([_energies(_full(pattern, data), used, X) for data in sets], axis=0)
    error = np.abs(_energies(_full(pattern, missed), used, X))
    # the change of a constant energy is the rounding of the files
    known = elastic & (change > _LEAST_CHANGE * energy)
    return float((error[known] / change[known]).max(initial=0.0))


def _full(pattern: sp.csr_array, data: Reals) -> sp.csr_array:
    upper = sp.csr_array((data, pattern.indices, pattern.indptr), shape=pattern.shape)
    return sp.csr_array(upper + sp.triu(upper, 1).T)


def _energies(K: sp.csr_array, used: NDArray[np.int64], X: Reals) -> Reals:
    """x·K x of the columns of X."""
    return np.asarray(np.einsum("ij,ij->j", X, K[used][:, used] @ X))


def _soft(K: sp.csr_array, D: Reals) -> Reals:
    """(n, motions) Ritz vectors of (K, D) for the lowest values."""
    n = len(D)
    factor = factorise(sp.csr_array(K + sp.diags_array(_ADDED * D)))
    X = np.random.default_rng(7).standard_normal((n, min(_MOTIONS, n)))
    for _ in range(_STEPS):
        X = factor.solve(D[:, None] * X)
        # columns of unit weight, so that rigid motions do not drown the others
        root = np.sqrt(D)[:, None]
        X = np.linalg.qr(root * X)[0] / root
    _, vectors = scipy.linalg.eigh(X.T @ (K @ X))
    return np.asarray(X @ vectors)


Powers = tuple[int, ...]

_ROUNDING = 1e-13
"""Entry of a coefficient matrix, relative to the terms that make it, that is rounding: files have at most 16 digits."""
_SINGULAR = 1e-10
"""Reciprocal condition below which the sets do not determine the coefficients."""
_DIGITS = 1e-7
"""Deviation below which the sets differ from the polynomial by the digits of the files only."""
_SOFT = 10.0
"""Factor of the tolerance for the energy of soft motions, which is a small difference of large entries."""


@dataclass(frozen=True)
class Variable:
    """What sets of matrices depend on: name, value of the model as it is, degree, and whether it meets others."""

    name: str
    nominal: float
    degree: int
    crossed: bool = False


@dataclass(frozen=True, eq=False)
class MatrixSet:
    """The upper triangle of a matrix at a point of the variables; without a point it is constant."""

    upper: sp.csr_array
    at: Mapping[str, float] = field(default_factory=dict)
    where: Where = field(default_factory=Where)


@dataclass(frozen=True, eq=False)
class Polynomial:
    """Coefficient matrices by powers of the scaled variables, and how far they miss the sets that check them.

    Parameters
    ----------
    variables, scales : the variables with centre and half range of each
    terms : powers and upper triangle, those without entries left out
    deviation : largest error at a checking set, entries over the diagonal, relative to the change between the sets
    checks : number of the sets that check
    """

    name: str
    variables: tuple[Variable, ...]
    scales: tuple[tuple[float, float], ...]
    terms: tuple[tuple[Powers, sp.csr_array], ...]
    deviation: float
    checks: int

    def notice(self, where: Where) -> Notice:
        """What was found, for the report."""
        names = ", ".join(f"{v.name} (degree {v.degree})" for v in self.variables)
        sets = "1 further set" if self.checks == 1 else f"{self.checks} further sets"
        return Notice(
            "matrices.polynomial",
            where=where,
            level="info",
            name=self.name,
            variables=names,
            sets=sets,
            deviation=self.deviation,
        )


def fit_polynomial(
    name: str, sets: Sequence[MatrixSet], variables: Sequence[Variable], tolerance: float, where: Where
) -> Polynomial:
    """The polynomial through the sets.

    Raises
    ------
    FemtuneError : ``matrices.sets`` (too few, the same twice, or none that moves a variable),
        ``matrices.not-polynomial``
    """
    used = tuple(v for v in variables if any(v.name in s.at for s in sets))
    points = _points(name, sets, used, where)
    scales = _scales(name, points, used, where)
    powers = _powers(used)
    _check_count(name, sets, powers, used, where)
    V = _vandermonde(points, scales, powers)
    nodes = _nodes(name, V, where)
    pattern, data = _on_one_pattern([s.upper for s in sets])
    inverse = np.linalg.inv(V[nodes])
    coefficients = inverse @ data[nodes]
    sizes = np.abs(inverse).sum(axis=1)[:, None] * np.abs(data).max(axis=0)
    coefficients[np.abs(coefficients) <= _ROUNDING * sizes] = 0.0
    rest = np.setdiff1d(np.arange(len(sets)), nodes)
    deviation = _check(
        name=name,
        sets=sets,
        rest=rest,
        V=V,
        coefficients=coefficients,
        data=data,
        pattern=pattern,
        tolerance=tolerance,
        where=where,
    )
    terms = tuple((p, _matrix(pattern, c)) for p, c in zip(powers, coefficients) if c.any())
    return Polynomial(name, used, scales, terms, deviation, len(rest))


def _points(name: str, sets: Sequence[MatrixSet], used: Sequence[Variable], where: Where) -> Reals:
    """(sets, variables) values; a variable that a set does not name has its nominal value there."""
    points = np.array([[s.at.get(v.name, v.nominal) for v in used] for s in sets])
    _, first, count = np.unique(points, axis=0, return_index=True, return_counts=True)
    if (count > 1).any():
        at = dict(zip((v.name for v in used), points[first[int(np.argmax(count > 1))]]))
        raise _sets(name, "matrices.sets/same-point", where, at)
    return points


def _scales(
    name: str, points: Reals, used: Sequence[Variable], where: Where
) -> tuple[tuple[float, float], ...]:  # fmt: skip
    low, high = points.min(axis=0), points.max(axis=0)
    for v, a, b in zip(used, low, high):
        if a == b:
            raise _sets(name, "matrices.sets/one-value", where, {v.name: a}, variable=v.name)
    return tuple((float(a + b) / 2, float(b - a) / 2) for a, b in zip(low, high))


def _powers(used: Sequence[Variable]) -> list[Powers]:
    """Powers of each variable up to its degree; products of variables where both are crossed."""
    every = itertools.product(*(range(v.degree + 1) for v in used))
    crossed = np.array([v.crossed for v in used])
    return [p for p in every if sum(e > 0 for e in p) <= 1 or crossed[[e > 0 for e in p]].all()]


def _check_count(
    name: str, sets: Sequence[MatrixSet], powers: Sequence[Powers], used: Sequence[Variable], where: Where
) -> None:
    if len(sets) <= len(powers):
        raise _sets(
            name,
            "matrices.sets/too-few",
            where,
            {"degrees": ", ".join(f"{v.name}: {v.degree}" for v in used), "sets wanted": len(powers) + 1},
            n_sets=len(sets),
            n_coefficients=len(powers),
            n_missing=len(powers) + 1 - len(sets),
        )
    moved = np.array([[s.at.get(v.name, v.nominal) != v.nominal for v in used] for s in sets])
    if len(used) > 1 and not moved.all(axis=1).any():
        raise _sets(name, "matrices.sets/no-joint-change", where, {})


def _vandermonde(points: Reals, scales: Sequence[tuple[float, float]], powers: Sequence[Powers]) -> Reals:
    scaled = (points - [c for c, _ in scales]) / [h for _, h in scales]
    return np.prod(scaled[:, None, :] ** np.array(powers)[None], axis=2)


def _nodes(name: str, V: Reals, where: Where) -> NDArray[np.int64]:
    """The sets that determine the coefficients best."""
    _, R, order = scipy.linalg.qr(V.T, mode="economic", pivoting=True)
    pivots = np.abs(np.diag(R))
    if pivots[-1] < _SINGULAR * pivots[0]:
        raise _sets(name, "matrices.sets/not-determined", where, {"rank": int((pivots > 1e-10).sum())})
    return np.sort(order[: V.shape[1]])


def _on_one_pattern(matrices: Sequence[sp.csr_array]) -> tuple[sp.csr_array, NDArray]:
    """A matrix with the union of the patterns, and (sets, nnz) values on it."""
    first = matrices[0]
    if all(np.array_equal(m.indptr, first.indptr) and np.array_equal(m.indices, first.indices) for m in matrices):
        return first, np.stack([m.data for m in matrices])
    union = sp.csr_array(sum(abs(m) for m in matrices[1:]) + abs(first))
    union.sort_indices()
    keys = _keys(union)
    data = np.zeros((len(matrices), union.nnz), np.result_type(*(m.dtype for m in matrices)))
    for row, m in zip(data, matrices):
        row[np.searchsorted(keys, _keys(m))] = m.data
    return union, data


def _keys(matrix: sp.csr_array) -> NDArray[np.int64]:
    rows = np.repeat(np.arange(matrix.shape[0], dtype=np.int64), np.diff(matrix.indptr))
    return rows * matrix.shape[1] + matrix.indices


def _matrix(pattern: sp.csr_array, data: NDArray) -> sp.csr_array:
    out = sp.csr_array((data.copy(), pattern.indices.copy(), pattern.indptr.copy()), shape=pattern.shape)
    out.eliminate_zeros()
    return out


def _check(
    name: str, sets: Sequence[MatrixSet], rest: NDArray, V: Reals, coefficients: NDArray, data: NDArray,
    pattern: sp.csr_array, tolerance: float, where: Where,
) -> float:  # fmt: skip
    scale = _entry_scale(pattern, data)
    change = float((np.ptp(np.abs(data) if np.iscomplexobj(data) else data, axis=0) / scale).max(initial=0.0))
    errors = [np.abs(V[r] @ coefficients - data[r]) / scale for r in rest]
    worst = int(np.argmax([e.max() for e in errors]))
    absolute = float(errors[worst].max())
    # sets that hardly differ do so by the digits of the file only
    deviation = absolute / max(change, 1e-9)
    if deviation > tolerance:
        raise _not_polynomial(name, sets[rest[worst]], absolute, change, deviation, tolerance, where)
    if deviation > _DIGITS and not np.iscomplexobj(data):
        checked = int(rest[worst])
        soft = soft_error(pattern, data[checked], V[checked] @ coefficients - data[checked], data)
        if soft > _SOFT * tolerance:
            raise _not_in_soft(name, sets[checked], deviation, soft, _SOFT * tolerance, where)
    return deviation


def _entry_scale(pattern: sp.csr_array, data: NDArray) -> Reals:
    """√(d_i d_j) of an entry, so that rotations and translations have similar weight."""
    n = pattern.shape[0]
    rows = np.repeat(np.arange(n), np.diff(pattern.indptr))
    on_diagonal = rows == pattern.indices
    diagonal = np.zeros(n)
    diagonal[rows[on_diagonal]] = np.abs(data[:, on_diagonal]).max(axis=0)
    scale = np.sqrt(diagonal[rows] * diagonal[pattern.indices])
    return np.maximum(scale, 1e-12 * diagonal.max(initial=0.0))


def _not_polynomial(
    name: str, checked: MatrixSet, absolute: float, change: float, deviation: float, tolerance: float, where: Where
) -> FemtuneError:
    return FemtuneError(
        "matrices.not-polynomial",
        where=where if str(where) else checked.where,
        values={
            "checked at": ", ".join(f"{k} = {v:g}" for k, v in checked.at.items()),
            "largest error (over the diagonal)": f"{absolute:.3g}",
            "change between the sets": f"{change:.3g}",
            "error over change": f"{deviation:.3g}",
            "tolerance": f"{tolerance:.3g}",
        },
        name=name,
    )


def _not_in_soft(
    name: str, checked: MatrixSet, deviation: float, soft: float, limit: float, where: Where
) -> FemtuneError:
    return FemtuneError(
        "matrices.not-polynomial/soft-motions",
        where=where if str(where) else checked.where,
        values={
            "checked at": ", ".join(f"{k} = {v:g}" for k, v in checked.at.items()),
            "error over change, entries": f"{deviation:.3g}",
            "error over change, energy of a soft motion": f"{soft:.3g}",
            "limit": f"{limit:.3g}",
        },
        name=name,
    )


def _sets(name: str, code: str, where: Where, values: Mapping[str, object], **facts: Any) -> FemtuneError:
    return FemtuneError(code, where=where, values=dict(values), name=name, **facts)
