"""FRFs of an equalised test when its measured lines are drawn again.

An identified test has no lines that scatter: the noise of the measurement is in its poles and residues. Here changes of
the measured FRFs are followed through the fits of poles and of the state-space model, and through the equalisation, to
the FRFs that are compared. The changes are those of a draw: the error e of the identified system at a line that is
drawn w times is multiplied by (w − 1)/√(1 − h). To first order a fit to H + (w − 1)e is the fit in which lines have the
weights w; the leverage h makes up for the part of its own error that a line hides in the fit.

`RedrawnTest.functions` takes one Gauss-Newton step of both fits, with matrices that all draws share; `refitted`
iterates both fits until they have converged; `identified_again` also chooses the modes again.

Sources: C. F. J. Wu (1986), Jackknife, bootstrap and other resampling methods in regression analysis, The Annals of
Statistics 14(4), sections 4 and 7; G. Golub, V. Pereyra (1973), The differentiation of pseudo-inverses and nonlinear
least squares problems whose variables separate, SIAM J. Numerical Analysis 10.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import qr

from femtune.arrays import Complexes, Flags, Reals
from femtune.identification.kinds import Drawing
from femtune.identification.modal_fit import ModalFit, fit_modes
from femtune.identification.modal_solve import (
    OutsideTerms,
    PartialFractions,
    Solved,
    modal_basis,
    real_rows,
    solve_residues,
)
from femtune.identification.rigid_body import rigid_body_motion, without_rigid_body
from femtune.identification.shapes import as_modes
from femtune.identification.state_space_fit import SystemFit, system_fit
from femtune.identification.window import window_factor, without_window
from femtune.modal import FrfSet, ModeSet, freq_and_damping, pole_of
from femtune.modal.equalise import residue_factors

_RANK = 1e-13
"""Singular value relative to the largest that is rounding of a double."""
_TURN_RANK = 1e-10
"""Singular value relative to the largest, of the turns of shapes, at or below which a turn is not determined."""
_MOST_LEVERAGE = 0.95
"""Leverage of a value at most, so that its error is not divided by nearly zero: factors 1/√(1 − h) end at 4.5."""
_DRAWS = 50
"""Draws from which the standard deviations of equalised FRFs are found, to a tenth."""
_NEAR = 10
"""Noise of a line is the mean square of the errors at so many lines on each side."""

_DIFFERENCES = 4
"""Order of differences between lines, in which what is smooth over some lines vanishes."""
_OF_DIFFERENCES = 70.0
"""Variance of these differences of white noise over its own: the sum of squares of 1, 4, 6, 4, 1."""


@dataclass(frozen=True, eq=False)
class RedrawnTest:
    """An identified and equalised test, and how its FRFs follow the measured ones.

    Parameters
    ----------
    measured : (n, u, k) functions that were identified
    fit, system : the fits of the poles and of the state-space model to these functions; with an exponential window the
        poles have its damping, too
    terms : of the fit, for what lies outside the band
    moved : (M,) poles of the system that get the damping ratio
    damping_ratio : ζ of these
    freq_hz : (l,) lines of the equalised FRFs
    again : measured functions -> their equalised FRFs, by another identification
    roving : whether the shapes of the modes are at the references, as of a hammer that roves
    decay : σ = 1/τ in rad/s of an exponential window e^{−t/τ} with which the functions were measured, 0 without one.
        They are those of the structure at s = σ + iω, whose poles are those of the fits plus σ
    rigid : mass-normalised rigid-body modes whose motion was taken away before the fits
    """

    measured: FrfSet
    fit: ModalFit
    system: SystemFit
    terms: OutsideTerms
    moved: Flags
    damping_ratio: float
    freq_hz: Reals
    again: Callable[[FrfSet], Complexes]
    roving: bool = False
    decay: float = 0.0
    rigid: ModeSet | None = None

    def with_fit(self, fit: ModalFit) -> RedrawnTest:
        """The same test with another fit of its poles, and the system that belongs to it.

        Poles beyond the band keep their damping, as those that stand for what lies there (errors as `system_fit`).
        """
        beyond = self.system.poles[len(self.fit.poles) :]
        system = system_fit(self._elastic(self.measured), np.concatenate([fit.poles, beyond]))
        moved = np.concatenate([~fit.outside, np.zeros(len(beyond), bool)])
        return replace(self, fit=fit, system=system, moved=moved)

    def __getstate__(self) -> dict[str, Any]:
        """State for another process, which computes the matrices of the steps again."""
        return {name: self.__dict__[name] for name in self.__dataclass_fields__}

    @cached_property
    def modes(self) -> ModeSet:
        """The identified modes inside the band."""
        return self.modes_of(self.fit)

    def modes_of(self, fit: ModalFit) -> ModeSet:
        """The modes of another fit of the same functions, at the same points, without the window."""
        fit = replace(fit, poles=fit.poles + self.decay)
        return as_modes(fit.transposed() if self.roving else fit)

    def functions_at(self, freq_hz: Reals) -> Complexes:
        """(n, u, lines) functions of the identified system as they are measured, with the window."""
        elastic = self.system.system.frf(freq_hz).values
        return (
            elastic
            if self.rigid is None
            else elastic + rigid_body_motion(self.rigid, self.measured, freq_hz, self.decay)
        )

    def _elastic(self, frfs: FrfSet) -> FrfSet:
        """Functions without rigid-body motion, as the system repeats them."""
        return frfs if self.rigid is None else without_rigid_body(frfs, self.rigid, self.decay)

    def _to_fit(self, frfs: FrfSet) -> FrfSet:
        """Functions as the modal fit repeats them."""
        return without_window(self._elastic(frfs), self.decay)

    # ------------------------------------------------------------------------------------------------
    # Draws.

    @property
    def lines(self) -> int:
        """Number of measured lines."""
        return len(self.measured.freq_hz)

    def drawn_from(self, how: Drawing) -> int:
        """Number of lines or single values that are drawn from."""
        return self.lines if how == "lines" else self.measured.values.size

    def draw(self, how: Drawing, rng: np.random.Generator) -> Complexes:
        """(n, u, k) change of the measured functions in one draw.

        "lines": as many lines as there are, with replacement, all functions of a line together; "entries": single
        values; "noise": normal noise as large as the errors of the identified system near each line.
        """
        shape = self.measured.values.shape
        if how == "noise":
            noise = rng.standard_normal((2, *shape))
            return np.asarray(self.noise_sd * (noise[0] + 1j * noise[1]))
        count = self.drawn_from(how)
        extra = np.bincount(rng.integers(count, size=count), minlength=count) - 1.0
        return np.asarray((extra if how == "lines" else extra.reshape(shape)) * self.errors)

    @cached_property
    def errors(self) -> Complexes:
        """(n, u, k) measured functions less those of the system, divided by √(1 − h)."""
        left = self.measured.values - self.functions_at(self.measured.freq_hz)
        return np.asarray(left / np.sqrt(1.0 - np.minimum(self.leverage, _MOST_LEVERAGE)))

    @cached_property
    def noise_sd(self) -> Reals:
        """(n, u, k) standard deviation of real and imaginary parts, from the errors near each line."""
        squares = 0.5 * np.abs(self.errors) ** 2
        width = min(2 * _NEAR + 1, self.lines)
        start = np.clip(np.arange(self.lines) - width // 2, 0, self.lines - width)
        sums = np.concatenate([np.zeros((*squares.shape[:2], 1)), np.cumsum(squares, axis=2)], axis=2)
        means = (sums[:, :, start + width] - sums[:, :, start]) / width
        return np.asarray(np.sqrt(np.maximum(means, 0.0)))

    def noise_beside_peak(self, line: int) -> Reals:
        """(n, u) the same at one line, without the peak of errors that a mode leaves there which the fits have missed.

        In the mean square of the errors it would pass for noise of its own size. A peak as narrow as the lines is left
        out by the median of the squares, a wide one by that of the squares of fourth differences.
        """
        start = int(np.clip(line - _NEAR, 0, max(self.lines - 2 * _NEAR - 1, 0)))
        near = self.errors[:, :, start : start + 2 * _NEAR + 1]
        squares = [np.abs(near) ** 2]
        if near.shape[2] > _DIFFERENCES:
            squares.append(np.abs(np.diff(near, _DIFFERENCES, axis=2)) ** 2 / _OF_DIFFERENCES)
        # squares of noise are exponentially distributed, with a median of ln 2 of their mean
        return np.asarray(np.sqrt(0.5 * np.min([np.median(s, axis=2) for s in squares], axis=0) / np.log(2.0)))

    @cached_property
    def equalised_sd(self) -> Reals:
        """(n, u, l) standard deviation of real and imaginary parts of the equalised FRFs by this noise."""
        squares = np.zeros(self.equalised.shape)
        for i in range(_DRAWS):
            change = self.draw("noise", np.random.default_rng([i, _DRAWS]))
            squares += np.abs(self.functions(change) - self.equalised) ** 2
        return np.asarray(np.sqrt(0.5 * squares / _DRAWS))

    @cached_property
    def leverage(self) -> Reals:
        """(u, k) part of the error of a value that the fits hide, the mean over the responses."""
        return self._ends.leverage(self.lines) + self._poles.leverage

    # ------------------------------------------------------------------------------------------------
    # The FRFs of a draw.

    def functions(self, change: Complexes) -> Complexes:
        """(n, u, l) equalised FRFs of changed measured ones, to first order in poles, shapes and participations."""
        unit = window_factor(self.measured.freq_hz, self.measured.kind, self.decay)
        step = self._poles.step((change * unit).reshape(-1, self.lines))
        residues, direct = self._ends.step(change - self._by_poles(step, self._measured_slopes))
        # poles that keep their damping are outside the band or badly known: they are followed to first order only
        step = np.concatenate([step, np.zeros(len(self.moved) - len(step))])
        poles = self.system.poles + np.where(self.moved, step, 0.0)
        equalised = self._equalised(poles, self._residues + residues, self.system.system.D + direct)
        kept = np.where(self.moved, 0.0, step)
        return equalised + self._by_poles(kept, self._slopes) if kept.any() else equalised

    def refitted(self, change: Complexes) -> Complexes:
        """(n, u, l) the same, with converged fits of the same weights (errors as `fit_modes` and `system_fit`)."""
        changed = self.changed(change)
        inside = ~self.fit.outside
        neighbours = self.fit.poles[self.fit.outside]
        own = self.fit.line_sd
        sd = np.broadcast_to(self.fit.sd[:, :, None], changed.values.shape) if own is None else own
        fit = fit_modes(self._to_fit(changed), self.fit.poles[inside], sd, self.terms, neighbours=neighbours)
        poles = np.concatenate([fit.poles, self.system.poles[len(fit.poles) :]])
        system = system_fit(self._elastic(changed), poles, start=self.system.participations)
        return self._equalised(system.poles, _outer(system.shapes, system.participations), system.system.D)

    def identified_again(self, change: Complexes) -> Complexes:
        """(n, u, l) the same, by another identification with its choice of modes (errors as `equalised_test`)."""
        return self.again(self.changed(change))

    def changed(self, change: Complexes) -> FrfSet:
        """The functions of the system with a change, which is all that noise does to them."""
        return replace(self.measured, values=self.functions_at(self.measured.freq_hz) + change)

    @cached_property
    def equalised(self) -> Complexes:
        """(n, u, l) FRFs of the test as it was measured."""
        return self._equalised(self.system.poles, self._residues, self.system.system.D)

    def _equalised(self, poles: Complexes, residues: Complexes, direct: Reals) -> Complexes:
        of_structure = poles + self.decay
        to = np.array(of_structure)
        hertz = freq_and_damping(of_structure[self.moved])[0]
        to[self.moved] = pole_of(hertz, np.full(self.moved.sum(), self.damping_ratio))
        scaled = residues * residue_factors(of_structure, to, self.measured.kind)
        i_omega = 2j * np.pi * self.freq_hz
        up, down = 1.0 / (i_omega - to[:, None]), 1.0 / (i_omega - to.conj()[:, None])
        elastic = np.asarray(scaled @ up + scaled.conj() @ down + direct[:, :, None])
        return elastic if self.rigid is None else elastic + rigid_body_motion(self.rigid, self.measured, self.freq_hz)

    @cached_property
    def _residues(self) -> Complexes:
        return _outer(self.system.shapes, self.system.participations)

    def _by_poles(self, step: Complexes, slopes: tuple[Complexes, Complexes]) -> Complexes:
        """(n, u, lines) change of the system's functions with the first poles, residues unchanged."""
        m = len(step)
        moved = self._residues[:, :, :m] * step
        return np.asarray(moved @ slopes[0][:m] + moved.conj() @ slopes[1][:m])

    @cached_property
    def _measured_slopes(self) -> tuple[Complexes, Complexes]:
        return self._slopes_at(self.measured.freq_hz, self.system.poles)

    @cached_property
    def _slopes(self) -> tuple[Complexes, Complexes]:
        return self._slopes_at(self.freq_hz, self.system.poles + self.decay)

    def _slopes_at(self, freq_hz: Reals, poles: Complexes) -> tuple[Complexes, Complexes]:
        """(M, lines) derivatives of 1/(iω − λ) and of 1/(iω − λ*) by the pole and by its conjugate."""
        i_omega, poles = 2j * np.pi * freq_hz, poles[:, None]
        return np.asarray(1.0 / (i_omega - poles) ** 2), np.asarray(1.0 / (i_omega - poles.conj()) ** 2)

    @cached_property
    def _poles(self) -> _PoleSteps:
        freq, fit = self.measured.freq_hz, self.fit
        basis = modal_basis(freq, fit.poles, self.measured.kind, self.terms)
        values, m = self._to_fit(self.measured).values.reshape(-1, len(freq)), len(fit.poles)
        weights = None if fit.line_sd is None else np.sqrt(2.0) / fit.line_sd.reshape(values.shape)
        solved = solve_residues(values, basis, weights, m)
        if weights is None:
            weights = 1.0 / np.sqrt(solved.variance)[:, None]
            across = [_slopes_across(basis, np.ones(len(freq)))]
        else:
            across = [_slopes_across(basis, one) / np.tile(one, 2)[:, None] for one in weights]
        return _PoleSteps(across, weights, solved)

    @cached_property
    def _ends(self) -> _EndSteps:
        i_omega = 2j * np.pi * self.measured.freq_hz[:, None]
        up, down = 1.0 / (i_omega - self.system.poles), 1.0 / (i_omega - self.system.poles.conj())
        columns = np.hstack([up + down, 1j * (up - down)])
        squares = np.mean(np.abs(self._elastic(self.measured).values) ** 2, axis=(1, 2))
        return _end_steps(columns, self.system, 1.0 / np.where(squares > 0.0, squares, 1.0))


def _outer(shapes: Complexes, participations: Complexes) -> Complexes:
    """(n, u, m) residues."""
    return np.asarray(shapes[:, None, :] * participations.T)


# ----------------------------------------------------------------------------------------------------
# Gauss-Newton steps of the poles, residues eliminated.


def _slopes_across(basis: PartialFractions, weights: Reals) -> Reals:
    """(2k, 4m) weighted slopes of the columns by the poles, without what the weighted columns themselves can do."""
    columns, slopes = (real_rows(part * weights[:, None]) for part in (basis.columns, basis.slopes))
    Q = qr(columns / np.linalg.norm(columns, axis=0), mode="economic", check_finite=False)[0]
    return np.asarray(slopes - Q @ (Q.T @ slopes))


@dataclass(frozen=True, eq=False)
class _PoleSteps:
    """Steps of the modal fit at its solution.

    Parameters
    ----------
    across : (2k, 4m) of each function, or one of all, slopes by the poles without what residues can do
    weights : (F, k), or (F, 1), inverses of the standard deviation of one real part
    solved : residues and normal equations there
    """

    across: Sequence[Reals]
    weights: Reals
    solved: Solved

    @property
    def _modes(self) -> int:
        return len(self.solved.gradient) // 2

    @cached_property
    def _coefficients(self) -> Reals:
        return self.solved.coefficients[:, : 2 * self._modes].reshape(-1, 2, self._modes)

    @cached_property
    def _inverse(self) -> Reals:
        return np.asarray(np.linalg.pinv(self.solved.normal, rcond=_RANK, hermitian=True), float)

    def step(self, change: Complexes) -> Complexes:
        """(m,) change of the poles with (F, k) changes of the functions."""
        rows = real_rows((self.weights**2 * change).T)
        if len(self.across) == 1:
            sums = self.across[0].T @ rows
        else:
            sums = np.stack([one.T @ row for one, row in zip(self.across, rows.T)], axis=1)
        sums = sums.reshape(2, 2, self._modes, -1)
        move = self._inverse @ np.einsum("aprf,fpr->ar", sums, self._coefficients, optimize=True).ravel()
        return move[: self._modes] + 1j * move[self._modes :]

    @cached_property
    def leverage(self) -> Reals:
        """(k,) mean over the functions."""
        lines = len(self.across[0]) // 2
        rows = np.zeros((2, lines))
        for f, (c, weights) in enumerate(zip(self._coefficients, self.weights)):
            across = self.across[min(f, len(self.across) - 1)].reshape(-1, 2, 2, self._modes)
            slopes = np.einsum("iapr,pr->iar", across, c).reshape(2 * lines, -1)
            rows += np.einsum("ij,ij->i", slopes @ self._inverse, slopes).reshape(2, lines) * weights**2
        return np.asarray(rows.mean(axis=0) / len(self._coefficients))


# ----------------------------------------------------------------------------------------------------
# Gauss-Newton steps of shapes and participations for given poles; shapes and D eliminated.


@dataclass(frozen=True, eq=False)
class _EndSteps:
    """Steps of the fit of B, C and D at its solution; unknowns are residues ψlᵀ in a scale of their own.

    Parameters
    ----------
    columns : (k, 2m) of Re x and of Im x of residues x
    Q : (2k, 2m) orthonormal, of the columns without what D can do
    U : (u·2m, r) orthonormal, of what the shapes can do in these coordinates, references one below the other
    back : (2m, u·2m) least-squares shapes (real parts above imaginary parts) of a response's coordinates
    turns : (d, n·u·2m) least-squares unknowns of the participations
    by_turns : (n, u·2m, d) change of the coordinates with these
    directions : (u, m, d) complex change of the participations with them
    shapes, participations : (n, m), (m, u), in the scale of the unknowns
    scale : (m,) what residues of that scale are multiplied by
    """

    columns: Complexes
    Q: Reals
    U: Reals
    back: Reals
    turns: Reals
    by_turns: Reals
    directions: Complexes
    shapes: Complexes
    participations: Complexes
    scale: Reals

    def step(self, change: Complexes) -> tuple[Complexes, Reals]:
        """(n, u, m) change of the residues and (n, u) of D with (n, u, k) changes of the functions."""
        n, u, k = change.shape
        m = len(self.scale)
        inside = (self.Q.T @ real_rows(change.reshape(n * u, k).T)).T.reshape(n, -1)
        across = inside - (inside @ self.U) @ self.U.T
        y = self.turns @ across.ravel()
        half = (inside - self.by_turns @ y) @ self.back.T
        shapes = half[:, :m] + 1j * half[:, m:]
        ends = self.directions @ y
        residues = (shapes[:, None] * self.participations.T + self.shapes[:, None] * ends) * self.scale
        stacked = np.concatenate([residues.real, residues.imag], axis=2)
        return residues, np.mean(change.real - (stacked @ self.columns.T).real, axis=2)

    def leverage(self, lines: int) -> Reals:
        """(u, k) of shapes and D, the mean of real and imaginary parts."""
        u = self.participations.shape[1]
        parts = self.U.reshape(u, -1, self.U.shape[1])
        rows = np.stack([np.sum((self.Q @ part) ** 2, axis=1) for part in parts])
        return np.asarray(rows.reshape(u, 2, lines).mean(axis=1) + 0.5 / lines)


def _end_steps(columns: Complexes, system: SystemFit, weights: Reals) -> _EndSteps:
    m, u = system.participations.shape
    Q, R = qr(real_rows(columns - columns.real.mean(axis=0)), mode="economic", check_finite=False)
    scale = 1.0 / np.sqrt(np.sum((R**2).reshape(-1, 2, m), axis=(0, 1)))
    size = np.linalg.norm(system.participations, axis=1)
    size = np.where(size > 0.0, size, 1.0)
    ends, shapes = system.participations / size[:, None], system.shapes * size / scale
    Z = (R[:, :m] - 1j * R[:, m:]) * scale
    left, s, right = np.linalg.svd(_columns(Z * ends.T[:, None, :]).reshape(-1, 2 * m), full_matrices=False)
    kept = s > _RANK * s[0]
    U, back = left[:, kept], (right[kept].T / s[kept]) @ left[:, kept].T
    # participations change only across themselves: what is along them is a factor of the shape
    free = np.linalg.svd(ends[:, :, None])[0][:, :, 1:]
    d = 2 * m * (u - 1)
    directions = np.zeros((u, m, d), complex)
    for r in range(m):
        for s_ in range(u - 1):
            at = 2 * (r * (u - 1) + s_)
            directions[:, r, at], directions[:, r, at + 1] = free[r, :, s_], 1j * free[r, :, s_]
    by_turns = np.einsum("qr,nr,urd->nuqd", Z, shapes, directions, optimize=True).real
    by_turns = by_turns.reshape(len(shapes), u * 2 * m, d)
    across = by_turns - U @ (U.T @ by_turns)
    root = np.sqrt(weights)[:, None, None]
    rows = (root * across).reshape(across.shape[0] * across.shape[1], d)
    turns = np.linalg.pinv(rows, rcond=_TURN_RANK) if d else rows.T
    turns = turns * np.repeat(root.ravel(), across.shape[1])
    return _EndSteps(
        columns=columns,
        Q=Q,
        U=U,
        back=back,
        turns=turns,
        by_turns=by_turns,
        directions=directions,
        shapes=shapes,
        participations=ends,
        scale=scale,
    )


def _columns(Z: Complexes) -> Reals:
    """Columns of Re x and Im x in Re(Z x)."""
    return np.concatenate([Z.real, -Z.imag], axis=-1)
