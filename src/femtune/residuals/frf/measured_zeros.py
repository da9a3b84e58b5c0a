"""Antiresonances of measured FRFs: a polynomial of ω² through the lines about each deep minimum, and its root.

Near a zero H is smooth, where near a pole it is not; the root μ = ω₀²(1 + iη) of the fitted polynomial lies between the
lines and beside the real axis by what damps the motion. The standard deviation of ω₀ follows from the residuals of the
fit.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from femtune.arrays import Complexes, Reals
from femtune.dofs import Dof
from femtune.errors import FemtuneError
from femtune.modal import FrfSet, as_kind

_ORDER = 3
_ROUNDING = 1e-9
_GROWN = 4.0


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
    """What is taken for an antiresonance.

    Parameters
    ----------
    from_hz, to_hz : band
    half_width : lines on each side of a minimum that the polynomial goes through at least; it goes on to where the
        magnitude has grown to its fourfold, or half of the way to the peak
    depth : magnitude of the minimum over that of the smaller peak beside it, at most
    most_damping : |Im μ|/Re μ at most; a shallow minimum between two poles has a root far from the real axis
    """

    from_hz: float = 0.0
    to_hz: float = float("inf")
    half_width: int = 4
    depth: float = 0.5
    most_damping: float = 0.05


def measured_antiresonances(frfs: FrfSet, search: ZeroSearch | None = None) -> tuple[Antiresonance, ...]:
    """Antiresonances of all functions, by function and frequency.

    Raises
    ------
    FemtuneError : ``residual.no-antiresonances`` where none is found
    """
    search = search or ZeroSearch()
    receptance = as_kind(frfs, "receptance")
    found = [zero for i, j in np.ndindex(frfs.values.shape[:2]) for zero in _of_function(receptance, i, j, search)]
    if not found:
        raise _none(frfs, search)
    return tuple(found)


def _of_function(frfs: FrfSet, i: int, j: int, search: ZeroSearch) -> Iterator[Antiresonance]:
    x, values = (2.0 * np.pi * frfs.freq_hz) ** 2, frfs.values[i, j]
    last = 0.0
    for k, window in _minima(frfs.freq_hz, values, search):
        root, sd = _root(x[window], values[window], x[k])
        if not _is_zero(root, x[window], search) or root.real <= last * (1.0 + _ROUNDING):
            continue
        last = root.real
        freq = float(np.sqrt(root.real) / (2.0 * np.pi))
        yield Antiresonance(
            frfs.responses[i], frfs.references[j], freq, float(sd / (8.0 * np.pi**2 * freq)),
            float(root.imag / root.real), _between(frfs, j, freq),
        )  # fmt: skip


def _minima(freq_hz: Reals, values: Complexes, search: ZeroSearch) -> Iterator[tuple[int, slice]]:
    """Lines that are the smallest of their neighbours and deep between two peaks, and the lines that are fitted."""
    size, w = np.abs(values), search.half_width
    inside = (freq_hz >= search.from_hz) & (freq_hz <= search.to_hz) & (freq_hz > 0.0)
    for k in np.flatnonzero(inside[w : len(size) - w]) + w:
        near = size[k - w : k + w + 1]
        if np.isfinite(near).all() and size[k] == near.min():
            left, right = _rise(size[k::-1]), _rise(size[k:])
            if size[k] <= search.depth * min(size[k - left], size[k + right]):
                edge = _GROWN * float(size[k])
                before, after = _fitted(size[k::-1], left, w, edge), _fitted(size[k:], right, w, edge)
                yield int(k), slice(int(k) - before, int(k) + after + 1)


def _rise(size: Reals) -> int:
    """How many lines on the largest magnitude lies before it has fallen to half of that, or a value is missing."""
    top = 0
    for i in range(1, len(size)):
        if not np.isfinite(size[i]) or size[i] < 0.5 * size[top]:
            break
        top = i if size[i] > size[top] else top
    return top


def _fitted(size: Reals, peak: int, least: int, edge: float) -> int:
    """How many lines on the magnitude has grown to that of a line that is no longer near the minimum."""
    grown = np.flatnonzero(size[: peak // 2 + 1] > edge)
    return max(least, min(int(grown[0]) if grown.size else peak, peak // 2))


def _root(x: Reals, values: Complexes, at: float) -> tuple[complex, float]:
    """The root nearest to a line of the polynomial through the values, and the standard deviation of its real part."""
    scale = float(np.abs(x - at).max())
    V = np.vander((x - at) / scale, _ORDER + 1, increasing=True)
    coefficients = np.linalg.lstsq(V, values, rcond=None)[0]
    roots = np.polynomial.polynomial.polyroots(coefficients)
    if not roots.size:
        return complex(np.nan), np.nan
    root = roots[np.abs(roots).argmin()]
    # real and imaginary parts have the variance of half of the squares
    variance = 0.5 * float(np.sum(np.abs(values - V @ coefficients) ** 2)) / max(len(x) - _ORDER - 1, 1)
    powers = root ** np.arange(_ORDER + 1)
    slope = coefficients[1:] @ (np.arange(1, _ORDER + 1) * powers[:-1])
    spread = variance * float((powers.conj() @ np.linalg.solve(V.T @ V, powers)).real) / abs(slope) ** 2
    return complex(at + scale * root), float(scale * np.sqrt(spread))


def _is_zero(root: complex, x: Reals, search: ZeroSearch) -> bool:
    if not np.isfinite(root) or not x[0] <= root.real <= x[-1]:
        return False
    return abs(root.imag) <= search.most_damping * root.real


def _between(frfs: FrfSet, j: int, freq_hz: float) -> Complexes:
    """(responses,) values at a frequency between two lines."""
    k = int(np.clip(np.searchsorted(frfs.freq_hz, freq_hz), 1, len(frfs.freq_hz) - 1))
    left, right = frfs.freq_hz[k - 1], frfs.freq_hz[k]
    part = (freq_hz - left) / (right - left)
    return np.asarray((1.0 - part) * frfs.values[:, j, k - 1] + part * frfs.values[:, j, k])


def _none(frfs: FrfSet, search: ZeroSearch) -> FemtuneError:
    span = f"{max(search.from_hz, frfs.freq_hz[0]):g} to {min(search.to_hz, frfs.freq_hz[-1]):g} Hz"
    return FemtuneError(
        "residual.no-antiresonances/none-measured",
        values={"functions": int(np.isfinite(frfs.values).any(axis=2).sum()), "lines": len(frfs.freq_hz)},
        band=span,
    )
