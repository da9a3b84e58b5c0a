"""Residues of rank one for given poles: shapes ψ and participations l of least squares, H = Σ ψ lᵀ/(iω − λ) + conj. + D.

ψ and D enter linearly and are eliminated (variable projection); the participations are found by a trust-region
Gauss-Newton iteration with the exact Jacobian of the projected errors. The errors do not change if a participation is
multiplied by a complex number and its shape divided by it: participations start with unit length, and each step is the
shortest one that has its effect, which leaves the length nearly as it is. In a reciprocal model the participations are
the shapes at the driving points, and their length has a meaning.

Sources: G. Golub, V. Pereyra (1973), The differentiation of pseudo-inverses and nonlinear least squares problems whose
variables separate, SIAM J. Numerical Analysis 10; of the measure of convergence D. M. Bates, D. G. Watts (1981), A
relative offset orthogonality convergence criterion for nonlinear least squares, Technometrics 23.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr
from scipy.optimize import least_squares

from femtune.arrays import Complexes, Reals
from femtune.identification.modal_solve import real_rows
from femtune.identification.shapes import DrivingPoint
from femtune.modal import FrfSet

MOST_STEPS = 200
STEPS_OF_A_CHART = 50
ENOUGH = 1e-4
"""Relative projected gradient of a solution; its square is the relative decrease of the sum of squares still predicted."""
ROUNDING = 1e-9
"""Errors below this part of the functions count as none."""
RANK = 1e-13
"""Singular values below this part of the largest count as zero, since residual modes and D may be nearly dependent."""


@dataclass(frozen=True, eq=False)
class Group:
    """Responses that have the same lines, h_j = Re(Z_j (ψ ∘ l_j)) for reference j.

    Parameters
    ----------
    members : positions of the responses
    Z : (u, q, m)
    values : (u q, responses) of the functions
    data : (u q, columns) with data dataᵀ = Σ w h hᵀ, w being the weights of the responses
    """

    members: tuple[int, ...]
    Z: Complexes
    values: Reals
    data: Reals


@dataclass(frozen=True, eq=False)
class Problem:
    """Weighted functions without D, compressed to as many numbers as there are unknown residues.

    Parameters
    ----------
    groups : of responses whose shapes are eliminated
    tied : in a reciprocal model the driving point of each reference, whose shape is the participation; weight and sign
        are in Z and data
    scale : (m,) factors of the residues in this problem
    rest : weighted sum of squares that no residues change
    size : weighted sum of squares of the functions
    """

    groups: tuple[Group, ...]
    tied: tuple[Group, ...]
    scale: Reals
    rest: float
    size: float

    def errors(self, l: Complexes) -> Reals:
        """All errors for participations l (m, u) and the shapes of least squares."""
        return np.concatenate(
            [_errors(g, l).ravel() for g in self.groups] + [_tied_errors(g, l, i) for i, g in enumerate(self.tied)]
        )

    def jacobian(self, l: Complexes) -> Reals:
        """(errors, 2, m, u): exact derivative of the errors by Re l and Im l."""
        rows = [_derivative(g, l) for g in self.groups] + [_tied_derivative(g, l, i) for i, g in enumerate(self.tied)]
        return np.concatenate([r.reshape(-1, 2, *l.shape) for r in rows])


@dataclass(frozen=True, eq=False)
class RankOne:
    """Shapes (n, m) and participations (m, u), and how the iteration ended.

    Parameters
    ----------
    squares : weighted sum of squared errors
    steps : evaluations of the errors
    gradient : length of the errors' projection on the range of their Jacobian, by the length of the errors
    """

    shapes: Complexes
    participations: Complexes
    squares: float
    steps: int
    gradient: float

    @property
    def converged(self) -> bool:
        """Whether a further step would change nothing."""
        return self.gradient <= ENOUGH


# ----------------------------------------------------------------------------------------------------
# The problem.


def rank_one_problem(frfs: FrfSet, columns: Complexes, direct: bool, points: Sequence[DrivingPoint] = ()) -> Problem:
    """All functions, those of each response weighted by its mean square.

    Parameters
    ----------
    columns : (k, 2m) of Re x and of Im x of residues x
    points : driving points, one of each reference, of a reciprocal model
    """
    n, u, _ = frfs.values.shape
    m = columns.shape[1] // 2
    known = np.isfinite(frfs.values)
    squares = np.sum(np.abs(np.where(known, frfs.values, 0.0)) ** 2, axis=(1, 2))
    mean = squares / known.sum(axis=(1, 2))
    weights = 1.0 / np.where(mean > 0.0, mean, 1.0)
    patterns, which = np.unique(known.reshape(n * u, -1), axis=0, return_inverse=True)
    which = which.reshape(n, u)
    factors = [_factors(columns[p], direct) for p in patterns]
    sizes = np.array([np.sum(R**2, axis=0).reshape(2, m).sum(axis=0) for _, R in factors])
    scale = np.sqrt(np.mean(sizes, axis=0))
    Z = [(R[:, :m] - 1j * R[:, m:]) / scale for _, R in factors]
    data = np.empty((n, u, len(Z[0])))
    for at, (Q, _) in enumerate(factors):
        i, j = np.nonzero(which == at)
        data[i, j] = _centred(frfs.values[i, j][:, patterns[at]].T, direct).T @ Q
    centred = sum(
        weights[i] * np.sum(_centred(frfs.values[i, j][known[i, j]][:, None], direct) ** 2)
        for i in range(n)
        for j in range(u)
    )
    of_point = {p.response: p for p in points}
    free: dict[bytes, list[int]] = {}
    for i in range(n):
        if i not in of_point:
            free.setdefault(which[i].tobytes(), []).append(i)
    groups = tuple(
        _group(rows, np.array([Z[p] for p in which[rows[0]]]), data[rows], weights[rows]) for rows in free.values()
    )
    tied = []
    for p in sorted(points, key=lambda p: p.reference):
        root, i = np.sqrt(weights[p.response]), p.response
        own = np.array([Z[q] for q in which[i]]) * (root * p.sign)
        tied.append(Group((i,), own, data[i].reshape(-1, 1), root * data[i].reshape(-1, 1)))
    rest = max(centred - float(np.sum(weights[:, None, None] * data**2)), 0.0)
    return Problem(groups, tuple(tied), scale, rest, float(weights @ squares))


def _centred(values: Complexes, direct: bool) -> Reals:
    """Real rows; what a direct term can do is taken out."""
    return real_rows(values - values.real.mean(axis=0) if direct else values)


def _factors(columns: Complexes, direct: bool) -> tuple[Reals, Reals]:
    Q, R = qr(_centred(columns, direct), mode="economic", check_finite=False)
    return Q, R


def _group(members: list[int], Z: Complexes, values: Reals, weights: Reals) -> Group:
    flat = values.reshape(len(members), -1)
    data = flat * np.sqrt(weights)[:, None]
    if len(data) > data.shape[1]:
        data = qr(data, mode="r", check_finite=False)[0][: data.shape[1]]
    return Group(tuple(members), Z, flat.T, data.T)


# ----------------------------------------------------------------------------------------------------
# Errors and their derivatives.


def _columns(Z: Complexes) -> Reals:
    """Of Re x and Im x in Re(Z x)."""
    return np.concatenate([Z.real, -Z.imag], axis=-1)


def _svd(g: Group, l: Complexes) -> tuple[Reals, Reals, Reals]:
    """Of the (u q, 2m) matrix of Re ψ and Im ψ."""
    matrix = _columns(g.Z * l.T[:, None, :]).reshape(-1, 2 * len(l))
    U, s, Vt = np.linalg.svd(matrix, full_matrices=False)
    kept = s > RANK * s[0]
    return U[:, kept], s[kept], Vt[kept].T


def _shapes(g: Group, l: Complexes) -> Complexes:
    """(responses, m)."""
    U, s, V = _svd(g, l)
    found = V @ ((U.T @ g.values) / s[:, None])
    return (found[: len(l)] + 1j * found[len(l) :]).T


def _errors(g: Group, l: Complexes) -> Reals:
    U = _svd(g, l)[0]
    return g.data - U @ (U.T @ g.data)


def _tied_errors(g: Group, l: Complexes, i: int) -> Reals:
    return g.data[:, 0] - np.einsum("jqm,m,mj->jq", g.Z, l[:, i], l).real.ravel()


def _derivative(g: Group, l: Complexes) -> Reals:
    """(u q, columns, 2, m, u): of projected errors by Re l and Im l."""
    u, q, m = g.Z.shape
    n = g.data.shape[1]
    U, s, V = _svd(g, l)
    part = U.T @ g.data
    psi = V @ (part / s[:, None])
    left = (g.data - U @ part).reshape(u, q, n)
    back = (U / s) @ V.T
    found = np.empty((u * q, n, 2 * m, u))
    for j in range(u):
        rows = slice(j * q, (j + 1) * q)
        change = _columns(g.Z[j] * (psi[:m] + 1j * psi[m:]).T[:, None, :]).transpose(1, 0, 2)
        across = np.tensordot(U, np.tensordot(U[rows].T, change, 1), 1)
        across[rows] -= change
        v = left[j].T @ g.Z[j]
        of_re = back[:, None, :m] * v.real - back[:, None, m:] * v.imag
        of_im = back[:, None, :m] * v.imag + back[:, None, m:] * v.real
        found[..., j] = across + np.concatenate([-of_re, of_im], axis=2)
    return found.reshape(u * q, n, 2, m, u)


def _tied_derivative(g: Group, l: Complexes, i: int) -> Reals:
    """(u q, 2, m, u)."""
    u, q, m = g.Z.shape
    found = np.zeros((u, q, 2 * m, u))
    change = _columns(g.Z * l[:, i])
    for j in range(u):
        found[j, :, :, j] = -change[j]
    found[..., i] -= _columns(g.Z * l.T[:, None, :])
    return found.reshape(u * q, 2, m, u)


# ----------------------------------------------------------------------------------------------------
# The solution.


@dataclass(frozen=True, eq=False)
class _Chart:
    """Participations centre + directions·y of unknowns y; the directions leave out those that change nothing.

    Parameters
    ----------
    centre : (m, u)
    directions : (m, u, d)
    """

    centre: Complexes
    directions: Complexes

    @property
    def unknowns(self) -> int:
        """Number of real unknowns."""
        return 2 * len(self.centre) * self.directions.shape[2]

    def participations(self, y: Reals) -> Complexes:
        """(m, u)."""
        half = y.reshape(2, len(self.centre), -1)
        return np.asarray(self.centre + np.einsum("mud,md->mu", self.directions, half[0] + 1j * half[1]))

    def slopes(self, by_l: Reals) -> Reals:
        """Derivative by y from that by the real and imaginary parts of the participations, (rows, 2, m, u)."""
        re, im = self.directions.real, self.directions.imag
        of_re = np.einsum("rmu,mud->rmd", by_l[:, 0], re) + np.einsum("rmu,mud->rmd", by_l[:, 1], im)
        of_im = np.einsum("rmu,mud->rmd", by_l[:, 1], re) - np.einsum("rmu,mud->rmd", by_l[:, 0], im)
        return np.stack([of_re, of_im], axis=1).reshape(len(by_l), self.unknowns)


def _chart(problem: Problem, l: Complexes) -> _Chart:
    size = np.linalg.norm(l, axis=1)
    size = np.where(size > 0.0, size, max(size.max(), 1.0))
    if problem.tied:
        return _Chart(l, size[:, None, None] * np.eye(l.shape[1]))
    l = l / size[:, None]
    return _Chart(l, np.linalg.svd(l[:, :, None])[0][:, :, 1:])


def solve_rank_one(problem: Problem, participations: Complexes) -> tuple:
    """From given participations (m, u) of the problem's scale."""
    l, steps = participations, 0
    while True:
        chart = _chart(problem, l)
        found = least_squares(
            lambda y, c=chart: problem.errors(c.participations(y)),
            np.zeros(chart.unknowns),
            lambda y, c=chart: c.slopes(problem.jacobian(c.participations(y))),
            ftol=1e-10, xtol=1e-10, gtol=None,
            max_nfev=STEPS_OF_A_CHART,
        )
        steps += found.nfev
        l = chart.participations(found.x)
        squares = 2.0 * found.cost + problem.rest
        U, s, _ = np.linalg.svd(found.jac, full_matrices=False)
        gradient = np.linalg.norm(U[:, s > RANK * s[0]].T @ found.fun) / max(np.sqrt(squares), ROUNDING * np.sqrt(problem.size))
        if gradient <= ENOUGH or steps >= MOST_STEPS:
            return l, squares, found, gradient, steps
