"""Frequency lines for an identification: those of a given number from which the poles follow with the least variance.

The functions of the model with assumed noise give the covariance of poles of most likelihood, the residues of every
function and terms for what lies outside the band being unknown too. A line counts by what it adds to the information on
the poles; weights of candidates are changed in proportion to the root of this until they stay (multiplicative
algorithm), at most one line at each candidate. Then single lines are exchanged for other candidates as long as that
lowers the sum of the variances. What is found is a local optimum; in large problems the exchanges end before.

The half bandwidth of a mode is 2ζf, as in `femtune.planning.lines`.

Sources: A. C. Atkinson, A. N. Donev, R. D. Tobias, Optimum Experimental Designs, with SAS, Oxford University Press
2007 (multiplicative algorithm, exchanges); G. Golub, V. Pereyra (1973), The differentiation of pseudo-inverses and
nonlinear least squares problems whose variables separate, SIAM J. Numerical Analysis 10.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr, solve_triangular

from femtune.arrays import Complexes, Integers, Reals
from femtune.errors import FemtuneError
from femtune.identification.modal_solve import OUT_OF_BAND, PartialFractions, modal_basis, real_rows
from femtune.modal import pole_of

_SINGULAR = 1e-12
"""Of a triangular factor, or of the information: what the lines do not determine, relative to what they know best."""
_ROUNDING = 1e-24
"""Information relative to that with known residues, which rounding may make: the square of an error of 1e-12."""
_ROUNDS = 20
"""Changes of the weights."""
_WORK = 4e7
"""Numbers that the exchanges go through: rows of all functions at all candidates, for each line that is tried."""
_TRIED = 10
"""Lines that are tried at least, however large the problem."""
_BETTER = 1e-6
"""Part of the sum of variances that an exchange must save, so that rounding does not exchange lines for ever."""
_NEAR = 24
"""Candidates about each mode."""
_HALF_BANDS = 4.0
"""Half bandwidths on each side of a mode within which these are."""
_COARSE = 120
"""Candidates over the band."""
_APART = 1e-3
"""Part of the smallest half bandwidth below which two lines are one."""
_SILENT = 1e-9
"""Largest value of a function, relative to that of all, at or below which it is not measured."""


@dataclass(frozen=True, eq=False)
class PoleTest:
    """What is measured for an identification.

    Parameters
    ----------
    freq_hz, damping_ratio : (m,) of the modes
    residues : (F, m) of the accelerances, products φ_out φ_in of mass-normalised shapes
    relative, floor : standard deviation of real and imaginary part, relative to the magnitude, and to the largest one
        of each function

    Raises
    ------
    FemtuneError : ``plan.pole-lines/noise`` where both standard deviations are zero, ``plan.pole-lines/damping`` where
        a damping ratio is not above 0
    """

    freq_hz: Reals
    damping_ratio: Reals
    residues: Reals
    relative: float
    floor: float

    def __post_init__(self) -> None:
        if self.relative <= 0.0 and self.floor <= 0.0:
            raise FemtuneError("plan.pole-lines/noise")
        if not (self.damping_ratio > 0.0).all():
            raise FemtuneError("plan.pole-lines/damping", count=int(np.sum(~(self.damping_ratio > 0.0))))

    def relative_sd(self, lines_hz: Reals) -> Reals:
        """(m,) standard deviations of the poles over their half bandwidths 2ζω, √(var Re λ + var Im λ) / 2ζω.

        Infinite where the lines do not determine all poles.
        """
        return _Information(self, lines_hz).relative_sd(np.ones(len(lines_hz)))

    @property
    def half_hz(self) -> Reals:
        """(m,) half bandwidths 2ζf."""
        return 2.0 * self.damping_ratio * self.freq_hz

    @property
    def least_lines(self) -> int:
        """Least number of lines k from which the poles can follow, F (2k - 2m - 2) ≥ 2m for F functions.

        Each function has two real values a line, and 2m + 2 real unknowns of its own.
        """
        functions, m = max(int(np.sum(self.measured)), 1), len(self.freq_hz)
        return m + len(OUT_OF_BAND) // 2 + -(-m // functions)

    @cached_property
    def poles(self) -> Complexes:
        """(m,) in rad/s."""
        return pole_of(self.freq_hz, self.damping_ratio)

    @cached_property
    def peaks(self) -> Reals:
        """(F,) largest magnitude of each function: that at a resonance, whether there is a line or not."""
        return np.asarray(np.abs(self.values(modal_basis(self.freq_hz, self.poles, "accelerance", ()))).max(axis=1))

    @property
    def measured(self) -> NDArray[np.bool_]:
        """(F,) which functions are not silent."""
        return np.asarray(self.peaks > _SILENT * self.peaks.max())

    @cached_property
    def pole_residues(self) -> Complexes:
        """(F, m) of receptance: φφᵀ/(λ - λ*)."""
        return np.asarray(self.residues / (2j * self.poles.imag))

    def values(self, basis: PartialFractions) -> Complexes:
        """(F, k) the functions at the lines of a basis."""
        residues = np.concatenate([self.pole_residues.real, self.pole_residues.imag], axis=1)
        return np.asarray(residues @ basis.columns[:, : residues.shape[1]].T)


@dataclass(frozen=True, eq=False)
class _Function:
    """A function at candidate lines, each divided by the standard deviation of its noise.

    `columns` (k, q) those of its own unknowns, each of norm 1 without the division; `moved` (k, 2m) its change with the
    poles, in half bandwidths.
    """

    columns: Complexes
    moved: Complexes

    def fitted(self, root: Reals, at: NDArray) -> _Fitted | None:
        """Its own unknowns eliminated at some lines, weights `root`²; None where these do not determine them."""
        B, Z = (real_rows(values[at] * root[:, None]) for values in (self.columns, self.moved))
        if len(B) < B.shape[1]:
            return None
        Q, R = qr(B, mode="economic", check_finite=False)
        if np.abs(np.diag(R)).min() <= _SINGULAR * np.abs(np.diag(R)).max():
            return None
        inside = Q.T @ Z
        return _Fitted(R, solve_triangular(R, inside), Z - Q @ inside, float(np.sum(Z**2, axis=0).max()))


@dataclass(frozen=True, eq=False)
class _Fitted:
    """R of the columns, what they explain of the slopes, what they leave of them, and the largest square of a slope."""

    R: Reals
    fit: Reals
    rest: Reals
    largest: float


@dataclass(frozen=True, eq=False)
class _Information:
    """Information on the poles, in half bandwidths, of lines out of candidates."""

    of: PoleTest
    lines_hz: Reals

    @cached_property
    def functions(self) -> list[_Function]:
        """Those that are measured."""
        test = self.of
        basis = modal_basis(self.lines_hz, test.poles, "accelerance", OUT_OF_BAND)
        columns = basis.columns / np.linalg.norm(basis.columns, axis=0)
        half = np.tile(2.0 * np.abs(test.poles.real), 2)
        out = []
        for value, largest, residue, some in zip(test.values(basis), test.peaks, test.pole_residues, test.measured):
            if some:
                sd = np.hypot(test.relative * np.abs(value), test.floor * largest)
                inverse = 1.0 / np.maximum(sd, _SILENT * largest)[:, None]
                out.append(_Function(columns * inverse, basis.by_poles(residue) * half * inverse))
        return out

    def fitted(self, weights: Reals) -> list[_Fitted] | None:
        """Of every function; None where the lines do not determine the unknowns of one."""
        some = weights > 0.0
        out = []
        for function in self.functions:
            one = function.fitted(np.sqrt(weights[some]), some)
            if one is None:
                return None
            out.append(one)
        return out

    def relative_sd(self, weights: Reals) -> Reals:
        """(m,) see `PoleTest`."""
        fitted, m = self.fitted(weights), len(self.of.freq_hz)
        lines = len(np.unique(self.lines_hz[weights > 0.0]))
        covariance = None if fitted is None or lines < self.of.least_lines else _covariance(fitted)
        if covariance is None:
            return np.full(m, np.inf)
        return np.asarray(np.sqrt(np.diag(covariance).reshape(2, -1).sum(axis=0)))

    def sum_of_squares(self, at: Integers) -> float:
        """What is minimised."""
        return float(np.sum(self.relative_sd(self.chosen(at)) ** 2))

    def chosen(self, at: Integers) -> Reals:
        """(k,) weights of 1 at some lines."""
        weights = np.zeros(len(self.lines_hz))
        weights[at] = 1.0
        return weights

    def gains(self, weights: Reals) -> Reals | None:
        """(k,) decrease of the sum of variances with the weight of each line."""
        fitted = self.fitted(weights)
        covariance = None if fitted is None else _covariance(fitted)
        if fitted is None or covariance is None:
            return None
        gains = np.zeros(len(self.lines_hz))
        for function, one in zip(self.functions, fitted):
            gains += np.sum(np.abs((function.moved - function.columns @ one.fit) @ covariance) ** 2, axis=1)
        return gains


def _covariance(fitted: list[_Fitted]) -> Reals | None:
    """(2m, 2m) of poles over their half bandwidths; None where some are not determined."""
    normal = np.sum([one.rest.T @ one.rest for one in fitted], axis=0)
    values, vectors = np.linalg.eigh(normal)
    if values[0] <= _least_known(values[-1], fitted):
        return None
    return np.asarray((vectors / values) @ vectors.T)


def _least_known(most: Reals | float, fitted: list[_Fitted]) -> Reals:
    """What is rounding, of information with a largest eigenvalue."""
    return np.maximum(_SINGULAR * np.asarray(most), _ROUNDING * max(one.largest for one in fitted))


def _pairs(values: Complexes) -> Reals:
    """(k, 2, …) real and imaginary part of each line."""
    return np.stack([values.real, values.imag], axis=1)


@dataclass(frozen=True, eq=False)
class PoleLines:
    """Lines of one kind of spacing, and the poles that follow from them.

    Parameters
    ----------
    spacing : in words
    lines_hz : (n,) ascending
    relative_sd : (m,) of the poles, see `PoleTest.relative_sd`
    """

    spacing: str
    lines_hz: Reals
    relative_sd: Reals

    @property
    def root_mean_square(self) -> float:
        """Of the relative standard deviations."""
        return float(np.sqrt(np.mean(self.relative_sd**2)))


def pole_lines(test: PoleTest, low_hz: float, high_hz: float, count: int) -> tuple[PoleLines, ...]:
    """Uniform lines, logarithmic ones, those by half bandwidths, and the best that were found, each of the same number.

    Parameters
    ----------
    count : number of lines, all different; see `PoleTest.least_lines`

    Raises
    ------
    FemtuneError : ``plan.pole-lines`` where these are too few, ``plan.pole-lines/band`` where no mode is in the band

    Examples
    --------
    >>> test = PoleTest(np.array([50.0, 80.0]), np.array([0.01, 0.01]), np.ones((1, 2)), 0.02, 0.001)
    >>> found = pole_lines(test, 40.0, 100.0, 16)
    >>> [one.spacing for one in found]
    ['uniform', 'logarithmic', 'by half bandwidths', 'best']
    >>> bool(found[3].root_mean_square <= min(one.root_mean_square for one in found))
    True
    """
    modes, functions = len(test.freq_hz), int(np.sum(test.measured))
    if count < test.least_lines:
        raise FemtuneError("plan.pole-lines", lines=count, least=test.least_lines, modes=modes, functions=functions)
    simple = {
        "uniform": np.linspace(low_hz, high_hz, count),
        "logarithmic": np.geomspace(low_hz, high_hz, count),
        "by half bandwidths": by_half_bandwidths(test.freq_hz, test.damping_ratio, low_hz, high_hz, count),
    }
    sets = [PoleLines(name, lines, test.relative_sd(lines)) for name, lines in simple.items()]
    return (*sets, _best(test, low_hz, high_hz, count, sets))


def by_half_bandwidths(freq_hz: Reals, damping_ratio: Reals, low_hz: float, high_hz: float, count: int) -> Reals:
    """(count,) different lines shared evenly among the modes, from a half bandwidth 2ζf below each to one above it.

    Only the part of a mode's range that is inside the band has lines. Modes with common ranges share their lines: there
    these are as close as the lines of all of them together.

    Raises
    ------
    FemtuneError : ``plan.pole-lines/band`` where no part is inside the band

    Examples
    --------
    >>> by_half_bandwidths(np.array([100.0]), np.array([0.01]), 50.0, 150.0, 3).tolist()
    [98.0, 100.0, 102.0]
    >>> by_half_bandwidths(np.array([100.0, 100.0]), np.array([0.01, 0.01]), 50.0, 101.0, 4).tolist()
    [98.0, 99.0, 100.0, 101.0]
    """
    half = 2.0 * damping_ratio * freq_hz
    order = np.argsort(freq_hz - half, kind="stable")
    low, high = np.maximum(freq_hz - half, low_hz)[order], np.minimum(freq_hz + half, high_hz)[order]
    inside = low < high
    low, high, centre = low[inside], high[inside], np.clip(freq_hz[order][inside], low_hz, high_hz)
    m = len(low)
    if not m:
        raise FemtuneError("plan.pole-lines/band", low=low_hz, high=high_hz)
    numbers = np.full(m, count // m) + (np.arange(m) < count % m)
    # modes whose ranges touch belong together
    begins = np.flatnonzero(np.concatenate([[True], low[1:] > np.maximum.accumulate(high)[:-1]]))
    lines = []
    for one in np.split(np.arange(m), begins[1:]):
        n = int(numbers[one].sum())
        if n == 1:
            lines.append(centre[one[numbers[one] > 0]])
            continue
        edges = np.unique(np.concatenate([low[one], high[one]]))
        shares = np.clip((edges[:, None] - low[one]) / (high[one] - low[one]), 0.0, 1.0) @ numbers[one]
        grows = np.concatenate([[True], np.diff(shares) > 0.0])
        lines.append(np.interp(np.linspace(0.0, n, n), shares[grows], edges[grows]))
    return np.concatenate(lines)


def _best(test: PoleTest, low_hz: float, high_hz: float, count: int, others: list[PoleLines]) -> PoleLines:
    """The better of the lines of largest weight and the best simple ones, exchanged while that helps."""
    start = min(others, key=lambda one: one.root_mean_square)
    information = _Information(test, _candidates(test, low_hz, high_hz, start.lines_hz))
    begun = np.searchsorted(information.lines_hz, start.lines_hz)
    at = _exchanged(information, min(begun, _chosen(information, count), key=information.sum_of_squares))
    lines = information.lines_hz[np.sort(at)]
    return PoleLines("best", lines, test.relative_sd(lines))


def _candidates(test: PoleTest, low_hz: float, high_hz: float, start_hz: Reals) -> Reals:
    """Lines of a start, and others near the modes and over the band that are different from them."""
    offsets = np.linspace(-_HALF_BANDS, _HALF_BANDS, _NEAR + 1)
    near = (test.freq_hz[:, None] + test.half_hz[:, None] * offsets).ravel()
    coarse = np.geomspace(low_hz, high_hz, max(_COARSE, len(start_hz)))
    least = _APART * test.half_hz.min()
    others = np.sort(np.concatenate([near, coarse]))
    others = others[(others >= low_hz) & (others <= high_hz)]
    others = others[np.concatenate([[True], np.diff(others) >= least])]
    after = np.searchsorted(start_hz, others).clip(1, len(start_hz) - 1)
    away = np.minimum(np.abs(others - start_hz[after - 1]), np.abs(others - start_hz[after]))
    return np.sort(np.concatenate([start_hz, others[away >= least]]))


def _chosen(information: _Information, count: int) -> Integers:
    """Positions of the lines of largest weight."""
    weights = np.full(len(information.lines_hz), count / len(information.lines_hz))
    for _ in range(_ROUNDS):
        gains = information.gains(weights)
        if gains is None:
            break
        weights = _of_sum(np.maximum(weights, 1e-12) * np.sqrt(gains / gains.max()), count)
    return np.argsort(-weights, kind="stable")[:count]


def _of_sum(weights: Reals, count: int) -> Reals:
    """Weights of a sum, each at most 1."""
    out = weights.copy()
    for _ in range(len(out)):
        full = out >= 1.0
        rest = count - int(full.sum())
        if rest <= 0:
            break
        out = np.where(full, 1.0, out * rest / out[~full].sum())
        if (out[~full] <= 1.0).all():
            break
    return np.minimum(out, 1.0)


def _exchanged(information: _Information, at: Integers) -> Integers:
    """Single lines exchanged for the candidates that lower the sum of squares most, until none lowers it.

    Those that tell least are tried first. Large problems end after as many lines as `_WORK` allows.
    """
    best = information.sum_of_squares(at)
    now = _Exchange.of(information, at)
    if now is None:
        return at
    left, before = max(int(_WORK / now.size), _TRIED), np.inf
    while best < before and left > 0:
        before = best
        for line in now.by_loss()[:left]:
            left -= 1
            other = now.other(int(line), best)
            value = np.inf if other is None else information.sum_of_squares(other)
            following = _Exchange.of(information, other) if other is not None and value < best else None
            if following is not None:
                now, best = following, value
    return now.at


@dataclass(frozen=True, eq=False)
class _Exchange:
    """Lines at positions `at`, and what the others would change.

    A line adds to the information of a function rᵀ(1 + h)⁻¹r, for its two real rows r of slopes that the own unknowns
    do not explain and their leverage h = TTᵀ; a removed line takes rᵀ(1 - h)⁻¹r away.

    Parameters
    ----------
    normal : (2m, 2m) information of the lines
    rows : (F, k, 2, 2m) r of all candidates
    T : (F, k, 2, q)
    least : information that is rounding
    """

    at: Integers
    normal: Reals
    rows: Reals
    T: Reals
    least: float

    @classmethod
    def of(cls, information: _Information, at: Integers) -> _Exchange | None:
        """None where the lines do not determine all unknowns."""
        fitted = information.fitted(information.chosen(at))
        if fitted is None:
            return None
        rows, T = [], []
        for function, one in zip(information.functions, fitted):
            rows.append(_pairs(function.moved - function.columns @ one.fit))
            columns = _pairs(function.columns)
            flat = columns.reshape(-1, len(one.R)).T
            T.append(solve_triangular(one.R, flat, trans="T", check_finite=False).T.reshape(columns.shape))
        normal = np.sum([one.rest.T @ one.rest for one in fitted], axis=0)
        least = float(_least_known(np.linalg.eigvalsh(normal)[-1], fitted))
        return cls(at, normal, np.stack(rows), np.stack(T), least)

    @property
    def size(self) -> int:
        """Numbers of all rows."""
        return self.rows.size + self.T.size

    @cached_property
    def leverages(self) -> Reals:
        """(F, k, 2, 2)."""
        return self.T @ np.swapaxes(self.T, 2, 3)

    def by_loss(self) -> Integers:
        """The lines in the order of the sums of squares without each of them."""
        taken = _whitened(np.eye(2) - self.leverages[:, self.at], self.rows[:, self.at])
        return self.at[np.argsort(self._sums(self.normal - _squares(taken)), kind="stable")]

    def other(self, line: int, best: float) -> Integers | None:
        """The lines with the best candidate in place of one of them; None where that is not better than a sum."""
        left = self.at[self.at != line]
        free = np.setdiff1d(np.arange(self.rows.shape[1]), self.at)
        F, k, _, q = self.T.shape
        own, across = self.rows[:, line], self.T.reshape(F, 2 * k, q) @ np.swapaxes(self.T[:, line], 1, 2)
        across = across.reshape(F, k, 2, 2)[:, free]
        inside = np.eye(2) - self.leverages[:, line]
        if len(free) == 0 or np.linalg.eigvalsh(inside).min() <= _SINGULAR:
            return None
        back = np.linalg.inv(inside)
        normal = self.normal - np.einsum("fai,fab,fbj->ij", own, back, own, optimize=True)
        # rows and leverages of the others without the line
        turned = across @ back[:, None]
        rows = self.rows[:, free] + (turned.reshape(F, -1, 2) @ own).reshape(F, len(free), 2, -1)
        leverage = self.leverages[:, free] + turned @ np.swapaxes(across, 2, 3)
        added = normal + _squares(_whitened(np.eye(2) + leverage, rows))
        # what is known without a line is known with another one
        known = bool(np.isfinite(self._sums(normal[None])[0]))
        sums = np.trace(np.linalg.inv(added), axis1=1, axis2=2) if known else self._sums(added)
        most = int(np.argmin(sums))
        return np.append(left, free[most]) if sums[most] < (1.0 - _BETTER) * best else None

    def _sums(self, normal: Reals) -> Reals:
        """Traces of the inverses of (…, 2m, 2m); infinite where that is rounding."""
        values = np.linalg.eigvalsh(normal)
        known = values[:, 0] > np.maximum(_SINGULAR * values[:, -1], self.least)
        return np.where(known, np.sum(1.0 / np.where(known[:, None], values, 1.0), axis=1), np.inf)


def _whitened(squares: Reals, rows: Reals) -> Reals:
    """L⁻¹ rows for (…, 2, 2) squares LLᵀ; what has no square is next to infinite."""
    a = np.sqrt(np.maximum(squares[..., 0, 0], _SINGULAR))
    b = squares[..., 1, 0] / a
    c = np.sqrt(np.maximum(squares[..., 1, 1] - b**2, _SINGULAR))
    first = rows[..., 0, :] / a[..., None]
    return np.stack([first, (rows[..., 1, :] - b[..., None] * first) / c[..., None]], axis=-2)


def _squares(rows: Reals) -> Reals:
    """(k, 2m, 2m) sums over the functions of rowsᵀrows."""
    all_ = np.concatenate(list(rows), axis=1)
    return np.asarray(np.swapaxes(all_, 1, 2) @ all_)
