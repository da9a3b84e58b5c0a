"""Frequency lines for an identification: those of a given number from which the poles follow with the least variance.

The functions of the model with assumed noise give the covariance of poles of most likelihood, the residues of every
function and terms for what lies outside the band being unknown too. A line counts by what it adds to the information on
the poles; weights of candidates are changed in proportion to the root of this until they stay (multiplicative
algorithm), at most one line at each candidate.

Sources: A. C. Atkinson, A. N. Donev, R. D. Tobias, Optimum Experimental Designs, with SAS, Oxford University Press
2007 (multiplicative algorithm, exchanges); G. Golub, V. Pereyra (1973), The differentiation of pseudo-inverses and
nonlinear least squares problems whose variables separate, SIAM J. Numerical Analysis 10.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import qr, solve_triangular

from femtune.arrays import Integers, Reals
from femtune.errors import FemtuneError
from femtune.identification.modal_solve import OUT_OF_BAND, modal_basis
from femtune.modal import pole_of

_SINGULAR = 1e-12
"""Of a triangular factor, or of the information: what the lines do not determine, relative to what they know best."""
_ROUNDS = 20
"""Changes of the weights."""
_SWAPS = 10
"""Exchanges of single lines at most."""
_NEAR = 24
"""Candidates about each mode."""
_HALF_BANDS = 4.0
"""Half bandwidths on each side of a mode within which these are."""
_COARSE = 120
"""Candidates over the band."""
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
    FemtuneError : ``plan.pole-lines/noise`` where both standard deviations are zero
    """

    freq_hz: Reals
    damping_ratio: Reals
    residues: Reals
    relative: float
    floor: float

    def __post_init__(self) -> None:
        if self.relative <= 0.0 and self.floor <= 0.0:
            raise FemtuneError("plan.pole-lines/noise")

    def relative_sd(self, lines_hz: Reals) -> Reals:
        """(m,) standard deviations of the poles over their half bandwidths ζω, √(var Re λ + var Im λ) / ζω.

        Infinite where the lines do not determine a pole.
        """
        return _Information(self, lines_hz).relative_sd(np.ones(len(lines_hz)))


@dataclass(frozen=True, eq=False)
class _Information:
    """Columns of all functions at candidate lines."""

    of: PoleTest
    lines_hz: Reals

    @cached_property
    def _poles(self) -> np.ndarray:
        return pole_of(self.of.freq_hz, self.of.damping_ratio)

    @cached_property
    def _columns(self) -> tuple[np.ndarray, np.ndarray]:
        basis = modal_basis(self.lines_hz, self._poles, "accelerance", OUT_OF_BAND)
        return basis.columns, basis.slopes

    @cached_property
    def _functions(self) -> list[tuple[Reals, np.ndarray]]:
        """Of each function that moves the inverse variances of its lines, and its residues."""
        columns, _ = self._columns
        m = len(self._poles)
        # of receptance: φφᵀ/(λ − λ*)
        factors = 1.0 / (2j * self._poles.imag)
        residues = self.of.residues * factors
        values = np.concatenate([residues.real, residues.imag], axis=1) @ columns[:, : 2 * m].T
        # the largest value of a function is that at a resonance, whether there is a line or not
        peaks = modal_basis(self.of.freq_hz, self._poles, "accelerance", ()).columns
        at_peaks = np.abs(np.concatenate([residues.real, residues.imag], axis=1) @ peaks.T).max(axis=1)
        out = []
        for value, largest, residue in zip(values, at_peaks, residues):
            if largest > _SILENT * at_peaks.max():
                sd = np.hypot(self.of.relative * np.abs(value), self.of.floor * largest)
                out.append((1.0 / np.maximum(sd, _SILENT * largest) ** 2, residue))
        return out

    def normal(self, weights: Reals) -> tuple[Reals, list[np.ndarray]]:
        """(2m, 2m) information on Re λ and Im λ, and of each function the slopes that nothing else explains."""
        columns, slopes = self._columns
        m, total, left = len(self._poles), np.zeros((2 * len(self._poles),) * 2), []
        scale = np.linalg.norm(columns, axis=0)
        columns = columns / scale
        some = weights > 0.0
        for inverse, residue in self._functions:
            root = np.sqrt(weights[some] * inverse[some])[:, None]
            moved = _by_poles(slopes, residue, m)
            B, Z = _rows(columns[some] * root), _rows(moved[some] * root)
            Q, R = qr(B, mode="economic", check_finite=False)
            if len(B) < B.shape[1] or np.abs(np.diag(R)).min() <= _SINGULAR * np.abs(np.diag(R)).max():
                return np.zeros_like(total), []
            inside = Q.T @ Z
            fit, rest = solve_triangular(R, inside), Z - Q @ inside
            total += rest.T @ rest
            left.append((moved - columns @ fit) * np.sqrt(inverse)[:, None])
        return total, left

    def covariance(self, normal: Reals) -> Reals | None:
        """(2m, 2m) of poles over their half bandwidths; None where some are not determined."""
        size = np.tile(np.abs(self._poles.real), 2)
        scaled = normal * np.outer(size, size)
        values, vectors = np.linalg.eigh(scaled)
        if values[0] <= _SINGULAR * values[-1]:
            return None
        return np.asarray((vectors / values) @ vectors.T)

    def relative_sd(self, weights: Reals) -> Reals:
        """(m,) see `PoleTest`."""
        covariance = self.covariance(self.normal(weights)[0])
        if covariance is None:
            return np.full(len(self._poles), np.inf)
        return np.asarray(np.sqrt(np.diag(covariance).reshape(2, -1).sum(axis=0)))

    def sum_of_squares(self, at: Integers) -> float:
        """What is minimised."""
        weights = np.zeros(len(self.lines_hz))
        weights[at] = 1.0
        return float(np.sum(self.relative_sd(weights) ** 2))

    def gains(self, weights: Reals) -> Reals | None:
        """(lines,) decrease of the sum of variances with the weight of each line."""
        normal, left = self.normal(weights)
        covariance = self.covariance(normal)
        if covariance is None:
            return None
        size = np.tile(np.abs(self._poles.real), 2)
        gains = np.zeros(len(self.lines_hz))
        for rest in left:
            gains += np.sum(np.abs((rest * size) @ covariance) ** 2, axis=1)
        return gains


def _by_poles(slopes: np.ndarray, residue: np.ndarray, m: int) -> np.ndarray:
    """(k, 2m) change of a function with Re λ and Im λ of each pole."""
    parts = slopes.reshape(-1, 2, 2, m)
    return np.asarray((parts[:, :, 0] * residue.real + parts[:, :, 1] * residue.imag).reshape(-1, 2 * m))


def _rows(values: np.ndarray) -> Reals:
    return np.concatenate([values.real, values.imag])


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
    """Uniform lines, logarithmic ones, those by half bandwidths, and the best ones, each of the same number.

    Parameters
    ----------
    count : number of lines; each function has 2m + 2 real unknowns, and two real values a line

    Raises
    ------
    FemtuneError : ``plan.pole-lines``

    Examples
    --------
    >>> test = PoleTest(np.array([50.0, 80.0]), np.array([0.01, 0.01]), np.ones((1, 2)), 0.02, 0.001)
    >>> found = pole_lines(test, 40.0, 100.0, 16)
    >>> [one.spacing for one in found]
    ['uniform', 'logarithmic', 'by half bandwidths', 'best']
    >>> bool(found[3].root_mean_square <= min(one.root_mean_square for one in found))
    True
    """
    least = len(test.freq_hz) * 2 + len(OUT_OF_BAND)
    if count < least:
        raise FemtuneError("plan.pole-lines", lines=count, least=least, modes=len(test.freq_hz))
    simple = {
        "uniform": np.linspace(low_hz, high_hz, count),
        "logarithmic": np.geomspace(low_hz, high_hz, count),
        "by half bandwidths": by_half_bandwidths(test.freq_hz, test.damping_ratio, low_hz, high_hz, count),
    }
    sets = [PoleLines(name, lines, test.relative_sd(lines)) for name, lines in simple.items()]
    return (*sets, _best(test, low_hz, high_hz, count, sets))


def by_half_bandwidths(freq_hz: Reals, damping_ratio: Reals, low_hz: float, high_hz: float, count: int) -> Reals:
    """(count,) lines shared evenly among the modes, from a half bandwidth 2ζf below each to one above it.

    Lines of modes that are closer than that lie between each other; those outside the band are moved to its ends.

    Examples
    --------
    >>> by_half_bandwidths(np.array([100.0]), np.array([0.01]), 50.0, 150.0, 3).tolist()
    [98.0, 100.0, 102.0]
    """
    m = len(freq_hz)
    numbers = np.full(m, count // m) + (np.arange(m) < count % m)
    half = 2.0 * damping_ratio * freq_hz
    lines = [f + h * np.linspace(-1.0, 1.0, n) if n > 1 else np.full(n, f) for f, h, n in zip(freq_hz, half, numbers)]
    return np.sort(np.clip(np.concatenate(lines), low_hz, high_hz))


def _best(test: PoleTest, low_hz: float, high_hz: float, count: int, others: list[PoleLines]) -> PoleLines:
    half = 2.0 * test.damping_ratio * test.freq_hz
    offsets = np.linspace(-_HALF_BANDS, _HALF_BANDS, _NEAR + 1)
    near = (test.freq_hz[:, None] + half[:, None] * offsets).ravel()
    start = min(others, key=lambda one: one.root_mean_square)
    coarse = np.geomspace(low_hz, high_hz, max(_COARSE, count))
    lines = np.unique(np.concatenate([near, coarse, start.lines_hz]))
    lines = lines[(lines >= low_hz) & (lines <= high_hz)]
    information = _Information(test, lines)
    at = _chosen(information, count)
    best = information.sum_of_squares(at)
    for _ in range(_SWAPS):
        other = _swapped(information, at)
        if other is None or (now := information.sum_of_squares(other)) >= best:
            break
        at, best = other, now
    found = PoleLines("best", lines[np.sort(at)], test.relative_sd(lines[np.sort(at)]))
    return (
        found
        if found.root_mean_square <= start.root_mean_square
        else PoleLines("best", start.lines_hz, start.relative_sd)
    )


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


def _swapped(information: _Information, at: Integers) -> Integers | None:
    """The lines with the one that tells least exchanged for the one that would tell most."""
    weights = np.zeros(len(information.lines_hz))
    weights[at] = 1.0
    gains = information.gains(weights)
    if gains is None:
        return None
    least = int(at[np.argmin(gains[at])])
    most = int(np.argmax(np.where(weights > 0.0, -1.0, gains)))
    return np.append(at[at != least], most)
