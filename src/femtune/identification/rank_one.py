"""Residues of rank one for given poles: shapes ψ and participations L of least squares, H = Σ ψLᵀ/(iω − λ) + conj. + D.

ψ and D enter linearly and are eliminated (variable projection); the participations are found by a trust-region
Gauss-Newton iteration with the exact Jacobian of the projected errors. The errors do not change if a participation is
multiplied by a complex number and its shape divided by it: the unknowns are therefore changes orthogonal to a
participation of unit length. In a reciprocal model the participations are the shapes at the driving points; their
length has a meaning, and all their entries are unknowns.

Sources: G. Golub, V. Pereyra (1973), The differentiation of pseudo-inverses and nonlinear least squares problems whose
variables separate, SIAM J. Numerical Analysis 10; of the measure of convergence D. M. Bates, D. G. Watts (1981), A
relative offset orthogonality convergence criterion for nonlinear least squares, Technometrics 23.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import qr, svd
from scipy.optimize import OptimizeResult, least_squares

from femtune.arrays import Complexes, Reals
from femtune.identification.modal_solve import real_rows
from femtune.identification.shapes import DrivingPoint
from femtune.modal import FrfSet

MOST_STEPS = 200
"""Steps of a descent at most."""
STEPS_OF_A_CHART = 50
"""After so many, unknowns are taken about the present participations again."""
ENOUGH = 1e-4
"""Relative projected gradient of a solution; its square is the relative decrease that a further step predicts."""
DECREASE = 1e-8
"""Relative decrease of the sum of squares in a step that ends a descent."""
ROUGH_DECREASE = 1e-4
"""Relative decrease that ends a descent that only shows whether there is another minimum."""
ROUGH_STEPS = 30
"""Steps of such a descent at most."""
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
    Z : (u, q, m), of residues in the problem's scale
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
    signs : (u,) of driving points
    scale : (m,) factors of the residues in this problem
    rest : weighted sum of squares that no residues change
    size : weighted sum of squares of the functions
    """

    groups: tuple[Group, ...]
    tied: tuple[Group, ...]
    signs: tuple[float, ...]
    scale: Reals
    rest: float
    size: float

    def errors(self, L: Complexes) -> Reals:
        """All errors for participations L (m, u) and the shapes of least squares."""
        return np.concatenate(
            [_errors(g, L).ravel() for g in self.groups] + [_tied_errors(g, L, i) for i, g in enumerate(self.tied)]
        )

    def jacobian(self, L: Complexes) -> Reals:
        """(errors, 2, m, u): exact derivative of the errors by Re L and Im L."""
        rows = [_derivative(g, L) for g in self.groups] + [_tied_derivative(g, L, i) for i, g in enumerate(self.tied)]
        return np.concatenate([r.reshape(-1, 2, *L.shape) for r in rows])

    def shapes(self, L: Complexes) -> Complexes:
        """(n, m) of least squares; those of driving points are the participations."""
        n = sum(len(g.members) for g in self.groups + self.tied)
        columns = np.empty((n, len(L)), complex)
        for g in self.groups:
            columns[list(g.members)] = _shapes(g, L)
        for i, g in enumerate(self.tied):
            columns[list(g.members)] = self.signs[i] * L[:, i]
        return columns


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
        """True if no step would decrease the errors notably."""
        return self.gradient <= ENOUGH


# ----------------------------------------------------------------------------------------------------
# The problem.


def rank_one_problem(frfs: FrfSet, columns: Complexes, direct: bool, points: Sequence[DrivingPoint] = ()) -> Problem:
    """All functions, those of each response weighted by its mean square.

    Parameters
    ----------
    frfs : NaN where a function was not measured
    columns : (k, 2m) of Re x and of Im x of residues x
    points : driving points, one of each reference, of a reciprocal model
    """
    n, u, k = frfs.values.shape
    m = columns.shape[1] // 2
    known = np.isfinite(frfs.values)
    squares = np.sum(np.abs(np.where(known, frfs.values, 0.0)) ** 2, axis=(1, 2))
    mean = squares / known.sum(axis=(1, 2))
    weights = 1.0 / np.where(mean > 0.0, mean, 1.0)
    patterns, which = np.unique(known.reshape(n * u, k), axis=0, return_inverse=True)
    which = which.reshape(n, u)
    factors = [qr(_centred(columns[p], direct), mode="economic", check_finite=False) for p in patterns]
    scale = np.sqrt(np.mean([np.sum((R**2).reshape(-1, 2, m), axis=(0, 1)) for _, R in factors], axis=0))
    Z = np.array([R[:, :m] - 1j * R[:, m:] for _, R in factors]) / scale
    data, rest = np.empty((n, u, Z.shape[1])), 0.0
    for at, (Q, _) in enumerate(factors):
        row, reference = np.nonzero(which == at)
        rows = _centred(frfs.values[row, reference][:, patterns[at]].T, direct)
        inside = Q.T @ rows
        data[row, reference] = inside.T
        rest += float(np.sum((rows - Q @ inside) ** 2 * weights[row]))
    ends = {p.response: p.sign for p in sorted(points, key=lambda p: p.reference)}
    free: dict[bytes, list[int]] = {}
    for i in range(n):
        if i not in ends:
            free.setdefault(which[i].tobytes(), []).append(i)
    groups = [_group(rows, Z[which[rows[0]]], data[rows], weights[rows]) for rows in free.values()]
    tied = [_group([i], Z[which[i]] * sign * np.sqrt(weights[i]), data[[i]], weights[[i]]) for i, sign in ends.items()]
    return Problem(tuple(groups), tuple(tied), tuple(ends.values()), scale, rest, float(weights @ squares))


def _centred(values: Complexes, direct: bool) -> Reals:
    """Real rows; what a direct term can do is taken out."""
    return real_rows(values - values.real.mean(axis=0) if direct else values)


def _group(members: list[int], Z: Complexes, values: Reals, weights: Reals) -> Group:
    flat = values.reshape(len(members), -1)
    data = flat * np.sqrt(weights)[:, None]
    if len(data) > data.shape[1]:
        data = qr(data, mode="r", check_finite=False)[0][: data.shape[1]]
    return Group(tuple(members), Z, flat.T, data.T)


# ----------------------------------------------------------------------------------------------------
# Errors and their derivatives.


def _columns(Z: Complexes) -> Reals:
    """Columns of Re x and Im x in Re(Z x)."""
    return np.concatenate([Z.real, -Z.imag], axis=-1)


def _svd(g: Group, L: Complexes) -> tuple[Reals, Reals, Reals]:
    """Of the (u q, 2m) matrix of Re ψ and Im ψ."""
    matrix = _columns(g.Z * L.T[:, None, :]).reshape(-1, 2 * len(L))
    U, s, Vt = np.linalg.svd(matrix, full_matrices=False)
    kept = s > RANK * s[0]
    return U[:, kept], s[kept], Vt[kept].T


def _shapes(g: Group, L: Complexes) -> Complexes:
    """(responses, m)."""
    U, s, V = _svd(g, L)
    shapes = V @ ((U.T @ g.values) / s[:, None])
    return (shapes[: len(L)] + 1j * shapes[len(L) :]).T


def _errors(g: Group, L: Complexes) -> Reals:
    U = _svd(g, L)[0]
    return g.data - U @ (U.T @ g.data)


def _tied_errors(g: Group, L: Complexes, i: int) -> Reals:
    return g.data[:, 0] - np.einsum("jqm,m,mj->jq", g.Z, L[:, i], L).real.ravel()


def _derivative(g: Group, L: Complexes) -> Reals:
    """(u q, columns, 2, m, u): of projected errors by Re L and Im L."""
    u, q, m = g.Z.shape
    n = g.data.shape[1]
    U, s, V = _svd(g, L)
    part = U.T @ g.data
    psi = V @ (part / s[:, None])
    left = (g.data - U @ part).reshape(u, q, n)
    back = (U / s) @ V.T
    derivative = np.empty((u * q, n, 2 * m, u))
    for j in range(u):
        rows = slice(j * q, (j + 1) * q)
        change = _columns(g.Z[j] * (psi[:m] + 1j * psi[m:]).T[:, None, :]).transpose(1, 0, 2)
        across = np.tensordot(U, np.tensordot(U[rows].T, change, 1), 1)
        across[rows] -= change
        v = left[j].T @ g.Z[j]
        of_re = back[:, None, :m] * v.real - back[:, None, m:] * v.imag
        of_im = back[:, None, :m] * v.imag + back[:, None, m:] * v.real
        derivative[..., j] = across + np.concatenate([-of_re, of_im], axis=2)
    return derivative.reshape(u * q, n, 2, m, u)


def _tied_derivative(g: Group, L: Complexes, i: int) -> Reals:
    """(u q, 2, m, u)."""
    u, q, m = g.Z.shape
    derivative = np.zeros((u, q, 2 * m, u))
    change = _columns(g.Z * L[:, i])
    for j in range(u):
        derivative[j, :, :, j] = -change[j]
    derivative[..., i] -= _columns(g.Z * L.T[:, None, :])
    return derivative.reshape(u * q, 2, m, u)


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
        complex_slopes = (by_l[:, 0] - 1j * by_l[:, 1]).transpose(1, 0, 2) @ self.directions
        both = np.stack([complex_slopes.real, -complex_slopes.imag]).transpose(2, 0, 1, 3)
        return both.reshape(len(by_l), self.unknowns)


def _chart(problem: Problem, L: Complexes) -> _Chart:
    size = np.linalg.norm(L, axis=1)
    if problem.tied:
        size = np.where(size > 0.0, size, max(size.max(), 1.0))
        return _Chart(L, size[:, None, None] * np.eye(L.shape[1]))
    L = np.where(size[:, None] > 0.0, L, 1.0)
    L = L / np.linalg.norm(L, axis=1)[:, None]
    return _Chart(L, np.linalg.svd(L[:, :, None])[0][:, :, 1:])


def solve_rank_one(problem: Problem, start: Complexes, doubtful: Sequence[int] = ()) -> RankOne:
    """Participations and shapes of the least sum of squares.

    Parameters
    ----------
    start : (m, u) participations; in a reciprocal model the shapes at the driving points, with the signs of these
    doubtful : modes, such as those outside the band, that may have ended in a local minimum: each is started once more
        from a participation orthogonal to the one found
    """
    root = np.sqrt(problem.scale)[:, None]
    best = _descent(problem, start * root, DECREASE, MOST_STEPS)
    steps = best.steps
    for r in () if problem.tied or start.shape[1] == 1 else doubtful:
        turned = best.participations.copy()
        turned[r] = _chart(problem, turned).directions[r, :, 0]
        trial = _descent(problem, turned, ROUGH_DECREASE, ROUGH_STEPS)
        steps += trial.steps
        if trial.squares < (1.0 - ROUGH_DECREASE) * best.squares:
            best = _descent(problem, trial.participations, DECREASE, MOST_STEPS)
            steps += best.steps
    shapes, L = problem.shapes(best.participations), best.participations
    return RankOne(shapes / root.T, L / root, best.squares, steps, best.gradient)


@dataclass(frozen=True, eq=False)
class _End:
    """Where a descent ended; participations in the problem's scale."""

    participations: Complexes
    squares: float
    steps: int
    gradient: float


def _descent(problem: Problem, L: Complexes, decrease: float, most_steps: int) -> _End:
    """Until the relative gradient is small, and a step decreases the errors by less than a part of them."""
    steps = 0
    if not problem.errors(_chart(problem, L).centre).any():
        return _End(L, problem.rest, 1, 0.0)
    while True:
        chart = _chart(problem, L)
        descent = _in_chart(problem, chart, decrease, min(STEPS_OF_A_CHART, most_steps - steps))
        L, steps = chart.participations(descent.x), steps + descent.nfev
        squares = 2.0 * descent.cost + problem.rest
        gradient = _relative_gradient(descent, max(squares, ROUNDING**2 * problem.size))
        if gradient <= max(ENOUGH, np.sqrt(decrease)) or steps >= most_steps:
            return _End(L, squares, steps, gradient)


def _in_chart(problem: Problem, chart: _Chart, decrease: float, most_steps: int) -> OptimizeResult:
    def errors(y: Reals) -> Reals:
        return problem.errors(chart.participations(y))

    def jacobian(y: Reals) -> Reals:
        return chart.slopes(problem.jacobian(chart.participations(y)))

    start = np.zeros(chart.unknowns)
    ends = {"ftol": decrease, "xtol": 1e-8, "max_nfev": most_steps}
    try:
        return least_squares(errors, start, jacobian, gtol=None, **ends)
    except np.linalg.LinAlgError:
        # LAPACK's divide and conquer may fail for a Jacobian of deficient rank; MINPACK needs no singular values
        return least_squares(errors, start, jacobian, method="lm", **ends)


def _relative_gradient(found: OptimizeResult, squares: float) -> float:
    U, s, _ = svd(found.jac, full_matrices=False, lapack_driver="gesvd")
    along = U[:, s > RANK * s[0]].T @ found.fun
    return float(np.linalg.norm(along) / np.sqrt(squares)) if squares > 0.0 else 0.0
