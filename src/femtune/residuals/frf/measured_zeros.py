"""Antiresonances of measured FRFs: the root of a rational function of x = ω² through the lines at each minimum.

Between two poles p₁ and p₂ the receptance is c₀ + c₁x + c₂/(x − p₁) + c₃/(x − p₁)² + c₄/(x − p₂) + c₅/(x − p₂)² to good
accuracy: a line describes the poles farther away, and the squares are the errors of p₁ and p₂, which are read from the
peaks. The root μ = ω₀²(1 + iη) is beside the real axis by what damps the motion.

Accelerances are fitted; their noise is about the same at all lines. It is estimated from differences of fourth order,
which vanish for a smooth function, and decides which peaks are no noise, and over how many lines H is described well:
as many as possible, because the standard deviation of the root decreases with their number.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from femtune.arrays import Complexes, Reals
from femtune.dofs import Dof
from femtune.errors import FemtuneError
from femtune.identification.window import without_window
from femtune.modal import FrfSet, as_kind

_FIT_TERMS = 6
"""Coefficients of a local fit."""
_SAME_ZERO = 1e-9
"""Relative distance of two zeros that is rounding: they are one, found in two valleys."""
_DIFFERENCE_ORDER = 4
"""Order of the differences over lines from which the noise is estimated: smooth functions leave next to nothing."""
_DIFFERENCE_VARIANCE = 70.0
"""Variance of such a difference of unit noise: 1 + 16 + 36 + 16 + 1."""
_NEIGHBOURS = 20
"""Lines on each side of a minimum from which the noise is estimated, at least."""
_PRIOR = 20.0
"""Degrees of freedom of that estimate beside those of the fit."""
_WITHIN = 0.75
"""Part of the way to the peaks within which a root lies; one beside a pole cancels this pole."""
_NARROWING = 0.8
"""Factor from window to window while the fit does not describe the lines."""
_UNLIKELY = 2.0
"""Standard deviations by which squares of a fit may exceed their expectation; it is repeated with fewer lines."""


@dataclass(frozen=True, eq=False)
class Antiresonance:
    """A zero of a measured function.

    Parameters
    ----------
    response, reference : which function
    freq_hz, sd_hz : of the zero, and its standard deviation from the residuals of the fit
    damping : Im μ/Re μ, a loss factor
    motion : (responses,) what all responses to this reference measure at this frequency, as receptance
    """

    response: Dof
    reference: Dof
    freq_hz: float
    sd_hz: float
    damping: float
    motion: Complexes

    @property
    def label(self) -> str:
        """Text for tables."""
        return f"{self.response} / {self.reference} at {self.freq_hz:.4g} Hz"


@dataclass(frozen=True)
class ZeroSearch:
    """Criteria for an antiresonance.

    Parameters
    ----------
    from_hz, to_hz : band
    half_width : lines on each side of a minimum that the polynomial goes through at least; at most half of those to
        the peaks
    depth : magnitude of the minimum over that of the smaller peak beside it, at most
    most_damping : |Im μ|/Re μ at most; a shallow minimum between two poles has a root far from the real axis
    above_noise : magnitude of the smaller peak beside a minimum over the noise of the lines, at least; 0 accepts minima
        of noise
    decay : 1/τ in rad/s of an exponential window with which the functions were made; zeros are those without it
    """

    from_hz: float = 0.0
    to_hz: float = float("inf")
    half_width: int = 4
    depth: float = 0.5
    most_damping: float = 0.05
    above_noise: float = 8.0
    decay: float = 0.0


@dataclass(frozen=True)
class FoundZeros:
    """Antiresonances in the functions of a test.

    Parameters
    ----------
    zeros : antiresonances by function and frequency
    in_noise : number of minima that were left out because a peak beside them does not stand above the noise
    """

    zeros: tuple[Antiresonance, ...]
    in_noise: int = 0


def measured_antiresonances(frfs: FrfSet, search: ZeroSearch | None = None) -> tuple[Antiresonance, ...]:
    """Antiresonances of all functions, by function and frequency.

    Raises
    ------
    FemtuneError : ``residual.no-antiresonances`` where none is found
    """
    return found_antiresonances(frfs, search).zeros


def found_antiresonances(frfs: FrfSet, search: ZeroSearch | None = None) -> FoundZeros:
    """The same, with the number of minima that are left out as noise."""
    search = search or ZeroSearch()
    accelerance = as_kind(without_window(frfs, search.decay), "accelerance")
    valleys: list[_Valley] = []
    antiresonances: list[Antiresonance] = []
    for i, j in np.ndindex(frfs.values.shape[:2]):
        of_function = list(_valleys(frfs.freq_hz, accelerance.values[i, j], search))
        valleys += of_function
        antiresonances += _of_function(accelerance, i, j, search, [v for v in of_function if v.above_noise])
    in_noise = sum(not v.above_noise for v in valleys)
    if not antiresonances:
        raise _none(frfs, search, in_noise)
    return FoundZeros(tuple(antiresonances), in_noise)


@dataclass(frozen=True)
class _Valley:
    """Lines between two peaks: the smallest one, and the peaks."""

    lowest: int
    left: int
    right: int
    above_noise: bool


def _of_function(
    frfs: FrfSet, i: int, j: int, search: ZeroSearch, valleys: Sequence[_Valley]
) -> Iterator[Antiresonance]:
    x, values = (2.0 * np.pi * frfs.freq_hz) ** 2, frfs.values[i, j]
    last = 0.0
    for valley in valleys:
        root, sd, lines = _root(x, values, valley, search.half_width)
        # a window moves ω of a zero by i/τ
        root = complex((np.sqrt(root) - 1j * search.decay) ** 2)
        if not _is_zero(root, x[lines], search) or root.real <= last * (1.0 + _SAME_ZERO):
            continue
        last = root.real
        freq = float(np.sqrt(root.real) / (2.0 * np.pi))
        yield Antiresonance(
            frfs.responses[i], frfs.references[j], freq, float(sd / (8.0 * np.pi**2 * freq)),
            float(root.imag / root.real), _between(frfs, j, freq),
        )  # fmt: skip


def _valleys(freq_hz: Reals, values: Complexes, search: ZeroSearch) -> Iterator[_Valley]:
    """Lines that are the smallest of their neighbours and deep between two peaks; one between each two peaks.

    What has not risen above the noise is no peak: only beyond it the magnitude may have fallen to half of it.
    """
    size, w = np.abs(values), search.half_width
    inside = (freq_hz >= search.from_hz) & (freq_hz <= search.to_hz) & (freq_hz > 0.0)
    lowest: dict[tuple[int, int], _Valley] = {}
    for k in (np.flatnonzero(inside[w : len(size) - w]) + w).tolist():
        near = size[k - w : k + w + 1]
        if not (np.isfinite(near).all() and size[k] == near.min()):
            continue
        level = search.above_noise * _noise(values, k - _NEIGHBOURS, k + _NEIGHBOURS)
        left, right = k - _rise(size[k::-1], level), k + _rise(size[k:], level)
        peak = min(size[left], size[right])
        valley = _Valley(k, left, right, bool(peak >= level))
        known = lowest.get((valley.left, valley.right))
        if size[k] <= search.depth * peak and (known is None or size[k] < size[known.lowest]):
            lowest[valley.left, valley.right] = valley
    yield from sorted(lowest.values(), key=lambda v: v.lowest)


def _noise(values: Complexes, first: int, last: int) -> float:
    """Standard deviation E|error|² of the lines from one to another.

    The squares of complex normal values have the median ln 2 times their mean; the median leaves poles out.
    """
    differences = np.diff(values[max(first, 0) : last + 1], _DIFFERENCE_ORDER)
    known = np.abs(differences[np.isfinite(differences)]) ** 2
    return float(np.sqrt(np.median(known) / (_DIFFERENCE_VARIANCE * np.log(2.0)))) if known.size else 0.0


def _rise(size: Reals, level: float) -> int:
    """How many lines on the largest magnitude lies before it has fallen to half of that, or a value is missing."""
    top = 0
    for i in range(1, len(size)):
        if not np.isfinite(size[i]) or (size[i] < 0.5 * size[top] and size[top] >= level):
            break
        top = i if size[i] > size[top] else top
    return top


def _root(x: Reals, values: Complexes, valley: _Valley, half_width: int) -> tuple[complex, float, slice]:
    """The root of a rational function through lines of a valley, the standard deviation of its real part, its place.

    The lines are the most that the function describes to within the noise. The root lies between the lines returned.
    """
    lowest = valley.lowest
    noise = _noise(values, min(valley.left, lowest - _NEIGHBOURS), max(valley.right, lowest + _NEIGHBOURS))
    centre = _centre(values, valley, noise)
    poles = _pole(x, values, valley.left, half_width), _pole(x, values, valley.right, half_width)
    before, after = max((centre - valley.left) // 2, half_width), max((valley.right - centre) // 2, half_width)
    fits = [_Fit(x, values, centre, (before, after), poles, noise)]
    while max(before, after) > half_width:
        before, after = (max(int(_NARROWING * n), half_width) for n in (before, after))
        fits.append(_Fit(x, values, centre, (before, after), poles, noise))
    chosen = next((fit for fit in fits if fit.describes), fits[-1])
    low, high = min(centre, lowest), max(centre, lowest)
    reach = slice(low - int(_WITHIN * (low - valley.left)), high + int(_WITHIN * (valley.right - high)) + 1)
    return chosen.root, chosen.sd, reach


def _centre(values: Complexes, valley: _Valley, noise: float) -> int:
    """The line about which the magnitudes of a valley are smallest; the smallest one where there is no noise."""
    lines = np.arange(valley.left, valley.right + 1)
    weights = 1.0 / (np.abs(values[lines]) ** 2 + noise**2 + np.abs(values[valley.lowest]) ** 2) ** 2
    return int(np.rint(weights @ lines / weights.sum()))


def _pole(x: Reals, values: Complexes, peak: int, half_width: int) -> complex:
    """The pole at a peak, where the receptance is h = a + bx + c/(x − p): xh = ph + …; the peak where this fails."""
    lines = np.arange(max(peak - half_width, 0), min(peak + half_width + 1, len(x)))
    lines = lines[np.isfinite(values[lines])]
    at, step = x[peak], float(np.ptp(x[lines])) / max(len(lines) - 1, 1)
    near, h = (x[lines] - at) / step, values[lines] / x[lines]
    p = np.linalg.lstsq(np.column_stack([h, np.ones_like(near), near, near**2]), near * h, rcond=None)[0][0]
    return complex(at + step * (p if abs(p.real) <= half_width and abs(p.imag) <= 10 * half_width else 0.5j))


class _Fit:
    """The rational function with the poles p₁ and p₂ through the receptance, by least squares of the accelerance.

    `describes` is true if the squares of the fit are those of the noise; `root` is the one nearest to the centre, with
    the standard deviation `sd` of its real part.
    """

    def __init__(
        self, x: Reals, values: Complexes, centre: int, width: tuple[int, int], poles: tuple[complex, complex],
        noise: float,
    ) -> None:  # fmt: skip
        self.lines = slice(max(centre - width[0], 0), centre + width[1] + 1)
        at, x, values = x[centre], x[self.lines], values[self.lines]
        scale = float(np.abs(x - at).max())
        self.poles = p, q = (poles[0] - at) / scale, (poles[1] - at) / scale
        A = self._terms((x - at) / scale) * (x / at)[:, None]
        c = np.linalg.lstsq(A, values, rcond=None)[0]
        squares = float(np.sum(np.abs(values - A @ c) ** 2))
        freedom = max(len(x) - _FIT_TERMS, 1)
        self.describes = squares <= noise**2 * (freedom + _UNLIKELY * np.sqrt(freedom))
        of_roots = np.polynomial.polynomial.polyfromroots
        numerator = np.convolve(c[:2], of_roots([p, p, q, q]))
        for k, others in enumerate(([p, q, q], [q, q], [p, p, q], [p, p]), start=2):
            numerator[: len(others) + 1] += c[k] * of_roots(others)
        roots = np.polynomial.polynomial.polyroots(numerator)
        root = roots[np.abs(roots).argmin()] if roots.size else complex(np.nan)
        # real and imaginary parts have the variance of half of the squares
        variance = 0.5 * (squares + _PRIOR * noise**2) / (freedom + _PRIOR)
        terms = self._terms(root)
        slope = c[1] - sum(c[k] / (root - r) ** 2 + 2.0 * c[k + 1] / (root - r) ** 3 for k, r in ((2, p), (4, q)))
        coefficients = np.linalg.lstsq(A.conj().T @ A, terms.conj(), rcond=None)[0]
        self.root = complex(at + scale * root)
        self.sd = float(scale * np.sqrt(variance * float((terms @ coefficients).real)) / abs(slope))

    def _terms(self, at: ArrayLike) -> Complexes:
        (p, q), z = self.poles, np.asarray(at)
        return np.stack([np.ones_like(z), z, 1 / (z - p), 1 / (z - p) ** 2, 1 / (z - q), 1 / (z - q) ** 2], axis=-1)


def _is_zero(root: complex, x: Reals, search: ZeroSearch) -> bool:
    if not np.isfinite(root) or not x[0] <= root.real <= x[-1]:
        return False
    return abs(root.imag) <= search.most_damping * root.real


def _between(frfs: FrfSet, j: int, freq_hz: float) -> Complexes:
    """(responses,) values at a frequency between two lines."""
    k = int(np.clip(np.searchsorted(frfs.freq_hz, freq_hz), 1, len(frfs.freq_hz) - 1))
    left, right = frfs.freq_hz[k - 1], frfs.freq_hz[k]
    part = (freq_hz - left) / (right - left)
    accelerance = (1.0 - part) * frfs.values[:, j, k - 1] + part * frfs.values[:, j, k]
    return np.asarray(accelerance / -((2.0 * np.pi * freq_hz) ** 2))


def _none(frfs: FrfSet, search: ZeroSearch, in_noise: int) -> FemtuneError:
    span = f"{max(search.from_hz, frfs.freq_hz[0]):g} to {min(search.to_hz, frfs.freq_hz[-1]):g} Hz"
    facts = {"functions": int(np.isfinite(frfs.values).any(axis=2).sum()), "lines": len(frfs.freq_hz)}
    facts |= {"minima in the noise": in_noise} if in_noise else {}
    return FemtuneError("residual.no-antiresonances/none-measured", values=facts, band=span)
