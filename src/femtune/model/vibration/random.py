"""Random vibration: power spectral densities and root mean squares of responses, in closed form.

With poles and residues, |H|² = |D|² + 2Re Σ cₖ/(iω − λₖ) over all poles, where cₖ = Rₖ(D − Σ Rₗ*/(λₖ + λₗ*)): the
products of all pairs of modes are in cₖ. The integral of a linear piece of a spectrum over this is a logarithm, so that
the mean square is exact for spectra that are linear between their points. Those that are straight in a double
logarithmic plot are divided into linear pieces.

Sources: Crandall and Mark 1963; Miles 1954 (one degree of freedom).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from femtune.arrays import Complexes, Reals
from femtune.errors import FemtuneError
from femtune.model.vibration.transfer import ModalTransfer

_PIECE_TOLERANCE = 1e-5
"""Largest relative error of a linear piece of a spectrum that is straight in a double logarithmic plot."""
_MOST_PIECES = 20_000
"""Linear pieces of a spectrum at most: only extremely steep ones need more."""


@dataclass(frozen=True, eq=False)
class Spectrum:
    """One-sided power spectral density, straight between its points in a double logarithmic plot, zero outside of them.

    Parameters
    ----------
    freq_hz : (n,) increasing, above zero
    density : (n,) above zero, unit²/Hz

    Raises
    ------
    FemtuneError : ``vibration.spectrum``

    Examples
    --------
    >>> from femtune.model.vibration import Spectrum
    >>> level = Spectrum([20.0, 80.0, 350.0, 2000.0], [0.01, 0.04, 0.04, 0.007])
    >>> round(level.root_mean_square, 2)
    6.06
    """

    freq_hz: Reals
    density: Reals

    def __post_init__(self) -> None:
        hz, g = (np.asarray(a, dtype=float) for a in (self.freq_hz, self.density))
        object.__setattr__(self, "freq_hz", hz)
        object.__setattr__(self, "density", g)
        fits = hz.ndim == 1 and hz.shape == g.shape and len(hz) > 1
        if not (fits and np.all(np.isfinite(g) & (g > 0.0)) and hz[0] > 0.0 and np.all(np.diff(hz) > 0.0)):
            raise FemtuneError("vibration.spectrum")

    def at(self, freq_hz: Reals) -> Reals:
        """(k,) density at frequencies (k,)."""
        hz = np.asarray(freq_hz, dtype=float)
        inside = (hz >= self.freq_hz[0]) & (hz <= self.freq_hz[-1])
        density = np.exp(
            np.interp(np.log(np.where(inside, hz, self.freq_hz[0])), np.log(self.freq_hz), np.log(self.density))
        )
        return np.where(inside, density, 0.0)

    def within(self, low_hz: float, high_hz: float) -> Spectrum | None:
        """The spectrum in a band; None if they have nothing in common."""
        low, high = max(low_hz, float(self.freq_hz[0])), min(high_hz, float(self.freq_hz[-1]))
        if not low < high:
            return None
        hz = np.unique(np.concatenate([[low, high], self.freq_hz[(self.freq_hz > low) & (self.freq_hz < high)]]))
        return Spectrum(hz, self.at(hz))

    @property
    def root_mean_square(self) -> float:
        """Of the excitation."""
        ratio = np.log(self.freq_hz[1:] / self.freq_hz[:-1])
        first, last = self.density[:-1] * self.freq_hz[:-1], self.density[1:] * self.freq_hz[1:]
        slope = np.log(last / first) / ratio
        flat = np.abs(slope * ratio) < 1e-9
        area = np.where(flat, first * ratio, (last - first) / np.where(flat, 1.0, slope))
        return float(np.sqrt(area.sum()))

    @cached_property
    def pieces(self) -> tuple[Reals, Reals]:
        """Points (p,) in Hz, and densities, between which the density is linear to the tolerance."""
        slope = np.diff(np.log(self.density)) / np.diff(np.log(self.freq_hz))
        step = np.sqrt(8.0 * _PIECE_TOLERANCE / np.maximum(np.abs(slope * (slope - 1.0)), 1e-12))
        counts = np.maximum(1, np.ceil(np.diff(np.log(self.freq_hz)) / step)).astype(int)
        if counts.sum() > _MOST_PIECES:
            raise FemtuneError("vibration.spectrum/steep")
        parts = [
            np.geomspace(a, b, n + 1)[:-1] for a, b, n in zip(self.freq_hz[:-1], self.freq_hz[1:], counts, strict=True)
        ]
        hz = np.concatenate([*parts, self.freq_hz[-1:]])
        return hz, self.at(np.clip(hz, self.freq_hz[0], self.freq_hz[-1]))


def response_density(transfer: ModalTransfer, spectra: list[Spectrum], freq_hz: Reals) -> Reals:
    """(o, n) power spectral density of each output at frequencies (n,), for inputs that are not correlated.

    Parameters
    ----------
    spectra : one for each input of the transfer functions
    """
    g = np.array([spectrum.at(freq_hz) for spectrum in _one_each(transfer, spectra)])
    return np.asarray(np.einsum("oin,in->on", np.abs(transfer.at(freq_hz)) ** 2, g))


def response_rms(transfer: ModalTransfer, spectra: list[Spectrum]) -> Reals:
    """(o,) root mean square of each output over all frequencies of the spectra, with the products of all modes."""
    total = np.zeros(len(transfer.direct))
    poles = np.concatenate([transfer.poles, transfer.poles.conj()])
    for i, spectrum in enumerate(_one_each(transfer, spectra)):
        residues = np.concatenate([transfer.residues[:, i], transfer.residues[:, i].conj()], axis=1)
        D = transfer.direct[:, i]
        sums = -1.0 / (poles[:, None] + poles.conj()[None, :])
        c = residues * (D[:, None] + residues.conj() @ sums.T)
        area, logs = _integrals(poles, spectrum)
        total += D**2 * area + 2.0 * np.real(c @ logs)
    return np.asarray(np.sqrt(np.maximum(total, 0.0)))


def _integrals(poles: Complexes, spectrum: Spectrum) -> tuple[float, Complexes]:
    """∫ G df, and (k,) ∫ G/(iω − λ) df for poles (k,), over linear pieces of G."""
    hz, g = spectrum.pieces
    w = 2.0 * np.pi * hz
    slope = np.diff(g) / np.diff(w)
    start = g[:-1] - slope * w[:-1]
    area = float(np.sum(0.5 * (g[1:] + g[:-1]) * np.diff(hz)))
    # ω + iλ stays below the real axis, so that the principal logarithm has no step
    logs = np.diff(np.log(w + 1j * poles[:, None]), axis=1)
    integrals = -1j * (slope * np.diff(w) + (start - 1j * poles[:, None] * slope) * logs)
    return area, np.asarray(integrals.sum(axis=1) / (2.0 * np.pi))


def _one_each(transfer: ModalTransfer, spectra: list[Spectrum]) -> list[Spectrum]:
    if len(spectra) != len(transfer.inputs):
        raise FemtuneError("vibration.inputs", given=len(spectra), inputs=len(transfer.inputs))
    return spectra
