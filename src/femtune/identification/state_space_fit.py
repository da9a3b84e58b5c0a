"""A state-space model with given poles: B, C and D by least squares on functions of any bands and channels.

Each pole has one shape ψ and one participation l: H = Σ ψ lᵀ/(iω − λ) + conjugates + D. With one reference that is
linear; with several, `rank_one` solves for both, from the leading singular vectors of free residues.

Source: the re-estimation of B and C with residual modes, as after T. McKelvey, H. Akcay, L. Ljung (1996), IEEE Trans.
Automatic Control 41(7), section on B and D.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr

from femtune.arrays import Complexes, Reals
from femtune.errors import FemtuneError
from femtune.identification.modal_solve import real_rows
from femtune.identification.rank_one import RankOne, rank_one_problem, solve_rank_one
from femtune.identification.shapes import DrivingPoint, driving_points
from femtune.modal import FrfSet, StateSpace


@dataclass(frozen=True, eq=False)
class _Parts:
    """shapes (n, m), participations (m, u), direct (n, u)."""

    shapes: Complexes
    participations: Complexes
    direct: Reals


@dataclass(frozen=True, eq=False)
class SystemFit:
    """A state-space model, and how the iteration ended that found B, C and D.

    Parameters
    ----------
    system : the model
    poles, shapes, participations : (m,) in the order in which they were given, (n, m) and (m, u) of the model
    converged : whether `gradient` is below 1e-4
    steps : evaluations of the errors; none where the problem is linear, as with one reference
    gradient : relative projected gradient: length of the errors' projection on the tangent space of the model, by the
        length of the errors. Its square is the relative decrease of the sum of squares that a further step predicts
    """

    system: StateSpace
    poles: Complexes
    shapes: Complexes
    participations: Complexes
    converged: bool
    steps: int
    gradient: float

    def transposed(self) -> SystemFit:
        """The fit with responses and references exchanged."""
        return replace(
            self, system=self.system.transposed(), shapes=self.participations.T, participations=self.shapes.T
        )


def fit_system(frfs: FrfSet, poles: Complexes, direct: bool = True, reciprocal: bool = False) -> StateSpace:
    """The model of `system_fit`, which also states whether the fit has converged."""
    return system_fit(frfs, poles, direct, reciprocal).system


def system_fit(
    frfs: FrfSet,
    poles: Complexes,
    direct: bool = True,
    reciprocal: bool = False,
    start: Complexes | None = None,
) -> SystemFit:
    """A real state-space model of order 2m of least squares; all responses weigh the same.

    Parameters
    ----------
    frfs : (n, u, k); NaN where a function was not measured at a line, so that bands and channels may differ
        (`join_frfs` puts sets together)
    poles : (m,) rad/s of the upper half plane that decay: those identified, and `residual_poles` for what lies outside
    direct : with a direct term D, which accelerance needs
    reciprocal : participations in proportion to the shapes at the driving points; D stays free
    start : (m, u) participations near the solution, from which no other minimum is looked for; NaN for modes of which
        none are known; None if none are known at all

    Raises
    ------
    FemtuneError : ``identify.no-poles``, ``identify.unstable-poles``, ``identify.few-lines``,
        ``identify.no-driving-point`` where reciprocity is requested and a reference is not among the responses
    """
    poles = np.asarray(poles, complex)
    _check_poles(poles)
    points = _points(frfs) if reciprocal else ()
    near = _near(frfs, poles)
    hertz = np.abs(poles) / (2.0 * np.pi)
    outside = np.flatnonzero((hertz < frfs.freq_hz.min()) | (hertz > frfs.freq_hz.max())).tolist()
    parts, steps, gradient, converged = _start(frfs, near, direct), 0, 0.0, True
    if len(frfs.references) > 1 or points:
        if start is not None:
            known = np.asarray(np.isfinite(start).all(axis=1))
            parts = replace(parts, participations=np.where(known[:, None], start, parts.participations))
            outside = [r for r in outside if not known[r]]
        parts, found = _rank_one(frfs, near, parts, direct, points, outside)
        steps, gradient, converged = found.steps, found.gradient, found.converged
    A, B, C = _real_form(poles, parts)
    system = StateSpace(
        A, B, C, parts.direct, frfs.responses, frfs.references, frfs.kind, source=f"fit of {len(poles)} modes"
    )
    return SystemFit(system, poles, parts.shapes, parts.participations, converged, steps, gradient)


def stable_poles(poles: Complexes) -> Complexes:
    """Those of the upper half plane that decay, by ascending modulus."""
    kept = poles[(poles.real < 0.0) & (poles.imag > 0.0)]
    return kept[np.argsort(np.abs(kept))]


def residual_poles(band_hz: tuple[float, float], low: int = 1, high: int = 2, damping_ratio: float = 1e-3) -> Complexes:
    """Poles below and above a band that stand for what lies there, of very low damping.

    Below: 1/3, 1/9, … of the lower end; above: 1.5, 2.25, … times the upper end.
    """
    below = band_hz[0] / 3.0 ** np.arange(low, 0, -1)
    above = band_hz[1] * 1.5 ** np.arange(1, high + 1)
    omega = 2.0 * np.pi * np.concatenate([below, above])
    return np.asarray(omega * (-damping_ratio + 1j * np.sqrt(1.0 - damping_ratio**2)), dtype=complex)


def _check_poles(poles: Complexes) -> None:
    if not len(poles):
        raise FemtuneError("identify.no-poles/of-state-space")
    growing = poles[(poles.real >= 0.0) | (poles.imag <= 0.0)]
    if len(growing):
        raise FemtuneError(
            "identify.unstable-poles",
            values={"first": f"{growing[0]:.6g} rad/s"},
            n_unstable=len(growing),
            n_poles=len(poles),
        )


def _points(frfs: FrfSet) -> tuple[DrivingPoint, ...]:
    points = driving_points(frfs)
    lacking = set(range(len(frfs.references))) - {p.reference for p in points}
    if lacking:
        names = ", ".join(str(frfs.references[j]) for j in sorted(lacking))
        raise FemtuneError("identify.no-driving-point", values={"references without response": names})
    return points


def _near(frfs: FrfSet, poles: Complexes) -> Complexes:
    """(k, 2m): 1/(iω − λ), then 1/(iω − λ̄)."""
    i_omega = 2j * np.pi * frfs.freq_hz[:, None]
    return np.hstack([1.0 / (i_omega - poles), 1.0 / (i_omega - poles.conj())])


def _columns(near: Complexes, factors: Complexes) -> Complexes:
    """Columns of the real and of the imaginary part of a number x in x·f/(iω − λ) + conjugates, f given; (k, 2m)."""
    m = near.shape[1] // 2
    up, down = near[:, :m] * factors, near[:, m:] * factors.conj()
    return np.hstack([up + down, 1j * (up - down)])


def _start(frfs: FrfSet, near: Complexes, direct: bool) -> _Parts:
    """Free residues of every function, and their leading singular vectors."""
    n, u, k = frfs.values.shape
    m = near.shape[1] // 2
    basis = _with_direct(_columns(near, np.ones(m)), direct)
    x = _least_squares(basis, frfs.values.reshape(n * u, k))
    residues = (x[:, :m] + 1j * x[:, m : 2 * m]).reshape(n, u, m).transpose(2, 0, 1)
    left, s, right = np.linalg.svd(residues, full_matrices=False)
    root = np.sqrt(s[:, 0])
    D = x[:, 2 * m].reshape(n, u) if direct else np.zeros((n, u))
    return _Parts((left[:, :, 0] * root[:, None]).T, right[:, 0] * root[:, None], D)


def _with_direct(columns: Complexes, direct: bool) -> Complexes:
    return np.hstack([columns, np.ones((len(columns), 1))]) if direct else columns


def _least_squares(basis: Complexes, values: Complexes) -> Reals:
    """(F, q) coefficients of each row of values, at its own lines; rows of the same lines go together."""
    coefficients = np.empty((len(values), basis.shape[1]))
    for known, rows in _patterns(values):
        if 2 * known.sum() < basis.shape[1]:
            raise FemtuneError(
                "identify.few-lines/of-one-function", n_lines=int(known.sum()), n_unknowns=basis.shape[1]
            )
        left = real_rows(basis[known])
        size = np.linalg.norm(left, axis=0)
        right = real_rows(values[rows][:, known].T)
        Q, R = qr(left / size, mode="economic", check_finite=False)
        # by singular values, since residual modes and the direct term may be nearly dependent
        coefficients[rows] = (np.linalg.lstsq(R, Q.T @ right, rcond=1e-13)[0] / size[:, None]).T
    return coefficients


def _patterns(values: Complexes) -> Iterator[tuple[NDArray[np.bool_], list[int]]]:
    """Lines that functions have, and the functions that have just these."""
    groups: dict[bytes, list[int]] = {}
    known = np.isfinite(values)
    for i, row in enumerate(known):
        groups.setdefault(row.tobytes(), []).append(i)
    for rows in groups.values():
        yield known[rows[0]], rows


def _rank_one(
    frfs: FrfSet,
    near: Complexes,
    parts: _Parts,
    direct: bool,
    points: Sequence[DrivingPoint],
    outside: Sequence[int],
) -> tuple[_Parts, RankOne]:
    """B, C and D of least squares, from those of free residues."""
    columns = _columns(near, np.ones(near.shape[1] // 2))
    start = _of_driving_points(parts, points) if points else parts.participations
    solution = solve_rank_one(rank_one_problem(frfs, columns, direct, points), start, outside)
    residues = solution.shapes[:, None, :] * solution.participations.T
    model = np.concatenate([residues.real, residues.imag], axis=2) @ columns.T
    D = np.nanmean((frfs.values - model).real, axis=2) if direct else np.zeros(residues.shape[:2])
    return _Parts(solution.shapes, solution.participations, D), solution


def _of_driving_points(parts: _Parts, points: Sequence[DrivingPoint]) -> Complexes:
    """Shapes at the driving points, scaled so that they are nearest to the participations."""
    ends = np.array([parts.shapes[p.response] * p.sign for p in sorted(points, key=lambda p: p.reference)]).T
    square = np.sum(np.abs(ends) ** 2, axis=1)
    factor = np.sum(ends.conj() * parts.participations, axis=1) / np.where(square > 0.0, square, 1.0)
    return np.asarray(ends * np.sqrt(factor)[:, None])


def _real_form(poles: Complexes, parts: _Parts) -> tuple[Reals, Reals, Reals]:
    """State x = (Re ξ, Im ξ) of ξ̇ = λξ + lᵀu, y = 2 Re ψξ."""
    m = len(poles)
    A = np.zeros((2 * m, 2 * m))
    even, odd = np.arange(0, 2 * m, 2), np.arange(1, 2 * m, 2)
    A[even, even] = A[odd, odd] = poles.real
    A[even, odd], A[odd, even] = -poles.imag, poles.imag
    B = np.zeros((2 * m, parts.participations.shape[1]))
    B[even], B[odd] = parts.participations.real, parts.participations.imag
    C = np.zeros((len(parts.shapes), 2 * m))
    C[:, even], C[:, odd] = 2.0 * parts.shapes.real, -2.0 * parts.shapes.imag
    return A, B, C
