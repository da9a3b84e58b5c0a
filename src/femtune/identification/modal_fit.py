"""Poles and residues of most likelihood: the modal model fitted to all functions at once, and its covariance.

The residues enter linearly and are eliminated (variable projection); the poles take Gauss-Newton steps. At the solution
the same matrices give the Cramér-Rao covariance of poles and residues. The noise is what its standard deviations
say or, where they are not known, one level for each function, estimated from what the fit leaves.

Sources: G. Golub, V. Pereyra (1973), The differentiation of pseudo-inverses and nonlinear least squares problems whose
variables separate, SIAM J. Numerical Analysis 10; M. El-Kafafy, P. Guillaume, B. Peeters (2013), Modal parameter
estimation by combining stochastic and deterministic frequency-domain approaches, Mechanical Systems and Signal
Processing 35; R. T. Birge (1932), The calculation of errors by the method of least squares, Physical Review 40.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from femtune.arrays import Complexes, Flags, Integers, Reals
from femtune.errors import FemtuneError
from femtune.identification.join import complete_lines
from femtune.identification.modal_solve import (
    OUT_OF_BAND,
    OutsideTerms,
    Solved,
    left_squares,
    modal_basis,
    solve_residues,
)
from femtune.identification.whole_record import WholeRecord
from femtune.modal import FrfSet

MOST_STEPS = 30
"""Gauss-Newton steps of a fit at most."""
SMALL = 1e-9
"""Steps of all poles below this fraction of their modulus end the iteration."""
SMALL_GAIN = 1e-4
"""Decrease of χ² of a whole record, or by stated noise, that ends the iteration: the poles are within a hundredth of
their errors."""
HOPELESS = 30.0
"""Factor on the decrease that two steps in turn predict, above which a fit is ended if more is missing for it to be of
use. Of fits that decrease by more than 10 after a step, half decrease by no more than three times what it predicts,
nine of ten by 49 times."""
_FARTHEST = 5.0
"""Largest magnitude of a pole over the highest line of a whole record: at five times the Nyquist frequency a strongly
damped motion decays to 1e-7 within a sample."""
_MOST_OF_DAMPING = 0.9
"""Part of its decay rate that a pole loses in a step at most."""
NO_POLES: Complexes = np.zeros(0, complex)


@dataclass(frozen=True, eq=False)
class ModalFit:
    """The modal model of a band; functions are counted response by response, each with all its references.

    Parameters
    ----------
    poles : (m,) rad/s, by ascending modulus
    residues : (n, u, m) complex, of receptances
    terms : (n, u, t) real, of the terms for what lies outside
    pole_covariance : (2m, 2m) of Re λ of every mode, then Im λ
    own_covariance : (n, u, m, 2, 2) of (Re R, Im R), without what errors of the poles add
    pole_effect : (n, u, m, 2, 2m) change of (Re R, Im R) with the poles
    sd : (n, u) noise of each function, √E|error|², at a mean line
    misfit : mean square of the weighted errors by its expectation: 1 where noise of the standard deviations given is
        all that is left; above it the covariances have been raised by it. NaN where no standard deviations were given
    spread : (m,) by how much the functions disagree on each pole, over what their noise explains: 1 where noise
        explains it; above it the covariance of that pole has been raised by it
    synthesised : the model at the lines that were used
    measured : the functions there
    steps : Gauss-Newton steps that were taken
    converged : whether they ended by themselves
    begun_at : (m,) position in `start` of the pole from which each mode was fitted; −1 for `neighbours`
    left : (m,) modes that ended too far from where they began to be the same
    deviance : −2 log likelihood, but for a constant: χ² where standard deviations were given
    ends : (n, k) of a whole record, what the transients of its ends add to the functions
    by_parts : (m,) of a whole record, by how much parts of its time disagree on each pole, over what noise explains: 1
        where noise explains it; above it the covariance of that pole has been raised to their scatter
    by_noise : (m,) part of the standard deviation of each pole that is noise alone
    by_force : (m, 2) relative change of each frequency from the part with the smallest force to that with the largest,
        and the ratio of these forces; NaN where the frequency does not follow the force
    line_sd : (n, u, k) standard deviations by which the values were weighted; None where each function has one level
    """

    poles: Complexes
    residues: Complexes
    terms: Reals
    pole_covariance: Reals
    own_covariance: Reals
    pole_effect: Reals
    sd: Reals
    misfit: float
    spread: Reals
    synthesised: FrfSet
    measured: FrfSet
    steps: int
    converged: bool
    begun_at: Integers
    left: Flags
    deviance: float
    ends: Complexes | None = None
    by_parts: Reals | None = None
    by_noise: Reals | None = None
    by_force: Reals | None = None
    line_sd: Reals | None = None

    def transposed(self) -> ModalFit:
        """The fit with responses and references exchanged; not of a whole record, which has one reference."""
        if self.ends is not None:
            raise ValueError("the fit of a whole record has one reference")

        def turned(values: NDArray) -> NDArray:
            return np.ascontiguousarray(np.swapaxes(values, 0, 1))

        return replace(
            self,
            residues=turned(self.residues),
            terms=turned(self.terms),
            own_covariance=turned(self.own_covariance),
            pole_effect=turned(self.pole_effect),
            sd=turned(self.sd),
            line_sd=None if self.line_sd is None else turned(self.line_sd),
            synthesised=self.synthesised.transposed(),
            measured=self.measured.transposed(),
        )

    @property
    def outside(self) -> Flags:
        """(m,) modes outside the band, which are fitted because they bend the functions inside it."""
        return np.asarray(self.begun_at < 0)

    @property
    def reported(self) -> Flags:
        """(m,) modes that are a result: neither outside the band nor away from where they began."""
        return np.asarray(~self.outside & ~self.left)


def fit_modes(
    frfs: FrfSet,
    start: Complexes,
    sd: Reals | None = None,
    terms: OutsideTerms = OUT_OF_BAND,
    most_steps: int = MOST_STEPS,
    neighbours: Complexes = NO_POLES,
    whole: WholeRecord | None = None,
    below: float = np.inf,
) -> ModalFit:
    """Refine poles on all functions.

    Parameters
    ----------
    frfs : (n, u, k), at the lines of the band
    start : (m,) poles in rad/s, upper half plane
    sd : (n, u, k) standard deviations √E|error|² of the functions, or None
    terms : real terms for what lies outside of the band, out of ``"lower"``, ``"upper"``
    most_steps : 0 keeps the poles, and fits residues only
    neighbours : further poles, of modes outside the band
    whole : the record of which `frfs` are the lines, in place of `sd`: its transients are fitted too, and the noise of
        each response is what the fit leaves
    below : the deviance below which the fit is of use; one that will not be below ends early, and has not converged

    Raises
    ------
    FemtuneError : ``identify.no-poles``, ``identify.few-lines``, ``identify.missing-pair``, ``identify.missing-lines``
    """
    used = complete_lines(frfs)
    poles = np.append(np.asarray(start, complex), neighbours)
    _check_start(poles, used, terms)
    kept = None if sd is None else sd[:, :, np.isin(frfs.freq_hz, used.freq_hz)]
    problem = _Problem(used, kept, terms, whole)
    begun_at = np.append(np.arange(len(start)), np.full(len(neighbours), -1))
    fitted_poles, now, steps, converged = _iterate(problem, poles, most_steps, below)
    order = np.argsort(np.abs(fitted_poles))
    if (np.diff(order) < 0).any():
        fitted_poles, now, begun_at = fitted_poles[order], problem.solve(fitted_poles[order]), begun_at[order]
    return _as_fit(problem, fitted_poles, now, steps, converged, begun_at)


def deviance_at(
    frfs: FrfSet, poles: Complexes, sd: Reals | None, terms: OutsideTerms, whole: WholeRecord | None = None
) -> float:
    """The `deviance` of a fit that keeps its poles; arguments and errors as of `fit_modes`."""
    used = complete_lines(frfs)
    _check_start(poles, used, terms)
    if sd is None:
        values = used.values.reshape(-1, len(used.freq_hz))
        basis = modal_basis(used.freq_hz, poles, used.kind, terms) if whole is None else whole.basis(poles, terms)
        squares = left_squares(values, basis.columns, None if whole is None else whole.line)
        return float(2.0 * len(used.freq_hz) * np.sum(np.log(np.maximum(squares, np.finfo(float).tiny))))
    kept = sd[:, :, np.isin(frfs.freq_hz, used.freq_hz)]
    problem = _Problem(used, kept, terms, whole)
    return problem.deviance(problem.solve(poles))


def _check_start(poles: Complexes, frfs: FrfSet, terms: OutsideTerms) -> None:
    if not len(poles):
        raise FemtuneError("identify.no-poles")
    unknowns = 2 * len(poles) + len(terms)
    if 2 * len(frfs.freq_hz) <= unknowns:
        values = {"equations a function": 2 * len(frfs.freq_hz), "unknowns": unknowns}
        raise FemtuneError(
            "identify.few-lines/of-modal-fit", values=values, n_lines=len(frfs.freq_hz), n_poles=len(poles)
        )


@dataclass(frozen=True, eq=False)
class _Problem:
    frfs: FrfSet
    sd: Reals | None
    terms: OutsideTerms
    whole: WholeRecord | None = None

    def solve(self, poles: Complexes) -> Solved:
        values, freq = self.frfs.values.reshape(-1, len(self.frfs.freq_hz)), self.frfs.freq_hz
        if self.whole is not None:
            return solve_residues(values, self.whole.basis(poles, self.terms), None, len(poles), self.line)
        basis = modal_basis(freq, poles, self.frfs.kind, self.terms)
        # a standard deviation of a complex number is √2 times that of each part
        weights = None if self.sd is None else np.sqrt(2.0) / self.sd.reshape(values.shape)
        return solve_residues(values, basis, weights, len(poles))

    def deviance(self, now: Solved) -> float:
        """The `deviance` of a fit."""
        return _deviance(now, len(self.frfs.freq_hz), self.sd is not None)

    @property
    def has_noise(self) -> bool:
        """Whether the errors are those of a measurement: functions without stated noise may be exact."""
        return self.whole is not None or self.sd is not None

    @property
    def farthest(self) -> float:
        """Largest magnitude of a pole, rad/s. What decays within a sample has no transient that a record could show."""
        return np.inf if self.whole is None else _FARTHEST * 2.0 * np.pi * float(self.frfs.freq_hz[-1])

    @property
    def line(self) -> Reals | None:
        """(k,) weights of the lines of a whole record."""
        return None if self.whole is None else self.whole.line


def _iterate(problem: _Problem, poles: Complexes, most_steps: int, below: float) -> tuple[Complexes, Solved, int, bool]:
    now, before = problem.solve(poles), np.inf
    for step in range(most_steps):
        move = np.linalg.lstsq(now.normal, now.gradient, rcond=1e-13)[0]
        predicted = float(now.gradient @ move)
        if problem.has_noise and 0.0 <= predicted < SMALL_GAIN:
            return poles, now, step, True
        if problem.deviance(now) - HOPELESS * max(predicted, before) > below:
            return poles, now, step, False
        before = predicted
        delta = move[: len(poles)] + 1j * move[len(poles) :]
        poles, now, length = _shortened(problem, poles, delta, now)
        if length * np.max(np.abs(delta) / np.abs(poles)) < SMALL:
            return poles, now, step + 1, True
    return poles, now, most_steps, not most_steps


def _shortened(problem: _Problem, poles: Complexes, delta: Complexes, now: Solved) -> tuple[Complexes, Solved, float]:
    """The step, halved until the weighted errors do not grow; length 0 where it would have to be too short.

    Of functions a pole takes a smaller part of the step alone if it would not decay: the others need not wait for it.
    In a whole record all wait: poles outside the band that are fitted so can stand for modes in it.
    """
    length, farthest = 1.0, max(problem.farthest, float(np.abs(poles).max()))
    while length > 1e-3:
        step = length * delta
        if problem.whole is None:
            step = step / np.maximum(step.real / (_MOST_OF_DAMPING * -poles.real), 1.0)
        trial = poles + step
        if (trial.real < 0.0).all() and (trial.imag > 0.0).all() and (np.abs(trial) <= farthest).all():
            after = problem.solve(trial)
            if np.sum(after.squares / now.variance) <= np.sum(now.squares / now.variance) * (1.0 + 1e-12):
                return trial, after, length
        length *= 0.5
    return poles, now, 0.0


def _as_fit(
    problem: _Problem, poles: Complexes, now: Solved, steps: int, converged: bool, begun_at: Integers
) -> ModalFit:
    frfs, m = problem.frfs, len(poles)
    n, u, k = frfs.values.shape
    misfit = _misfit(now, k, m) if problem.sd is not None else np.nan
    raised = max(misfit, 1.0) if np.isfinite(misfit) else 1.0
    spread = _spread(now.shares, n * u)
    basis, c = modal_basis(frfs.freq_hz, poles, frfs.kind, problem.terms), now.coefficients
    ends = None
    if problem.whole is not None:
        everything = c @ problem.whole.basis(poles, problem.terms).columns.T
        c = problem.whole.of_functions(c, m, len(problem.terms))
        ends = everything - c @ basis.columns.T
    values = (c @ basis.columns.T).reshape(n, u, k)
    square = 2.0 * now.variance.reshape(n, u) if problem.sd is None else np.mean(problem.sd**2, axis=2)
    if problem.line is not None:
        square = square * np.mean(problem.line**-2.0)
    return ModalFit(
        poles,
        (c[:, :m] + 1j * c[:, m : 2 * m]).reshape(n, u, m),
        c[:, 2 * m :].reshape(n, u, -1),
        raised * _widened(np.linalg.pinv(now.normal, hermitian=True), spread),
        raised * (now.own * now.variance[:, None, None, None]).reshape(n, u, m, 2, 2),
        now.pole_effect.reshape(n, u, m, 2, 2 * m),
        np.asarray(np.sqrt(square), float),
        misfit,
        spread,
        replace(frfs, values=values, coherence=None, source="modal model"),
        frfs,
        steps,
        converged,
        begun_at,
        np.zeros(m, bool),
        problem.deviance(now),
        ends,
        line_sd=problem.sd,
    )


def _deviance(now: Solved, lines: int, stated: bool) -> float:
    """χ²; without standard deviations that of the likeliest noise level of each function."""
    if stated:
        return float(np.sum(now.squares / now.variance))
    return float(2.0 * lines * np.sum(np.log(np.maximum(now.squares, np.finfo(float).tiny))))


def _misfit(now: Solved, lines: int, modes: int) -> float:
    """χ² by its degrees of freedom; values that chance explains count as 1."""
    functions, q = now.coefficients.shape
    freedom = functions * (2 * lines - q) - 2 * modes
    ratio = float(np.sum(now.squares / now.variance)) / max(freedom, 1)
    return 1.0 if abs(ratio - 1.0) < 4.0 * np.sqrt(2.0 / max(freedom, 1)) else ratio


def _spread(shares: Reals, functions: int) -> Reals:
    """Birge's ratio: χ² of the steps that each function alone would take, by its degrees of freedom.

    Values that chance explains (to about one in a thousand) count as 1.
    """
    freedom = max(2 * (functions - 1), 1)
    ratio = shares / freedom
    limit = chdtri(freedom, 0.001) / freedom
    return np.asarray(np.where((ratio > limit) & (functions > 1), ratio, 1.0), dtype=float)


def _widened(covariance: NDArray, spread: Reals) -> Reals:
    factor = np.sqrt(np.tile(spread, 2))
    return covariance * np.outer(factor, factor)
