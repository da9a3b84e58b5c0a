"""Modes of measured auto and cross spectra of responses to unmeasured forces.

The correlation functions of the responses are the inverse Fourier transform of their spectra, and decay as free
vibrations do; FDD takes the spectra as they are. Averaged periodograms have the correlation functions multiplied by
that of their window, which is divided out.

Source: G. H. James, T. G. Carne, J. P. Lauffer (1993); J. S. Bendat, A. G. Piersol, Random Data (2010), chapter 5.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import signal

from femtune.arrays import Reals
from femtune.errors import FemtuneError, Notice
from femtune.identification.averaging import CrossSpectra
from femtune.identification.kinds import SpectraWindow
from femtune.identification.mode_checks import ModeRemark
from femtune.identification.operational import Operational, OperationalModes, modes_of_orders, modes_of_peaks
from femtune.identification.realisation import era
from femtune.modal import Channel
from femtune.modal.spectrum_set import SpectrumSet

_LEAST_WINDOW = 0.3
"""Correlation of the window, as a part of its largest, up to which the correlation functions are used: dividing by less
multiplies their noise."""
_WINDOW_SAMPLES = 1024
"""Samples at which the window is evaluated; its correlation is a smooth function."""
_EVEN = 1e-3
"""Deviation of a frequency line from an even grid, in distances of lines, that rounding of a file explains."""
_MARGIN = 1.25
"""Upper end of the spectra that are used, over that of the band; correlations are sampled at twice of it."""
_LEAST_ORDER = 4
"""Order of a model of two modes: shorter correlation functions are refused."""
NARROW = 0.1
"""Half-power bandwidth of a mode in distances of lines, below which a line of a machine cannot be told from it."""


@dataclass(frozen=True, eq=False)
class SpectralCorrelations:
    """Correlation functions of spectra.

    Parameters
    ----------
    values : (s, r, lags + 1) of responses with references
    step_s : distance of the lags
    rows : block rows that fit the lags
    asked : with the largest order that they allow
    """

    values: Reals
    step_s: float
    rows: int
    asked: Operational


def modes_of_spectra(
    spectra: SpectrumSet, asked: Operational, methods: Sequence[str], window: SpectraWindow = "hann"
) -> dict[str, OperationalModes]:
    """Modes by each of "SSI-cov", "ERA" and "FDD"; without standard deviations, since spectra do not state their noise.

    FDD is left out where not all responses are references.

    Raises
    ------
    FemtuneError : ``identify.spectra/uneven`` for lines that are not evenly spaced, ``identify.spectra/band`` if they
        do not reach the end of the band, ``identify.spectra/resolution`` if they are too far apart for the methods;
        ``identify.mixed-quantities``
    """
    channels = channels_of(spectra)
    data = correlations_of_spectra(spectra, asked, window)
    out: dict[str, OperationalModes] = {}
    for name in methods:
        if name == "FDD" and len(spectra.references) == len(spectra.responses):
            out[name] = modes_of_peaks(_square(spectra, window), channels, data.asked)
        elif name != "FDD":
            rows = data.rows if name == "SSI-cov" else 2 * data.rows
            seen = era(data.values[:, :, : 2 * rows + 1], data.step_s, rows, rows, data.asked.largest_order)
            out[name] = modes_of_orders(seen, channels, data.asked, name)
    return out


def channels_of(spectra: SpectrumSet) -> tuple[Channel, ...]:
    """A channel for each response."""
    return tuple(Channel(dof, quantity) for dof, quantity in zip(spectra.responses, spectra.quantities))


def correlations_of_spectra(spectra: SpectrumSet, asked: Operational, window: SpectraWindow) -> SpectralCorrelations:
    """The correlation functions of lags that the band and the order need, as far as the resolution allows."""
    freq, high = spectra.freq_hz, asked.band_hz[1]
    step_hz = line_distance(freq)
    if freq[-1] < high * (1.0 - _EVEN) or freq[0] > asked.band_hz[0]:
        values = {"band": f"{asked.band_hz[0]:g} to {high:g} Hz", "lines": f"{freq[0]:g} to {freq[-1]:g} Hz"}
        raise FemtuneError("identify.spectra/band", values=values)
    rate = 2.0 * _MARGIN * high
    own = _window_correlation(window)
    longest = int(np.argmax(own < _LEAST_WINDOW) / _WINDOW_SAMPLES / step_hz * rate)
    references = len(spectra.references)
    rows = min(asked.rows_at(rate, references), longest // 4)
    order = min(asked.largest_order, int(rows * references / 1.2))
    if order < _LEAST_ORDER:
        values = {"lines": f"{step_hz:.3g} Hz apart", "longest correlation": f"{longest / rate:.3g} s"}
        raise FemtuneError("identify.spectra/resolution", values=values)
    lags = np.arange(4 * rows + 1) / rate
    faded = np.interp(lags * step_hz, np.arange(_WINDOW_SAMPLES) / _WINDOW_SAMPLES, own)
    used = (freq > 0.0) & (freq <= _MARGIN * high)
    waves = np.exp(2j * np.pi * freq[used, None] * lags) * _taper(freq[used], high)[:, None]
    values = (spectra.values[:, :, used] @ waves).real / faded
    return SpectralCorrelations(values, 1.0 / rate, rows, replace(asked, largest_order=order))


def line_distance(freq_hz: Reals) -> float:
    """Distance of evenly spaced lines (error ``identify.spectra/uneven``)."""
    steps = np.diff(freq_hz)
    if len(steps) < _LEAST_ORDER or np.abs(steps - steps.mean()).max() > max(_EVEN, 1e-5 * len(steps)) * steps.mean():
        shown = f"{steps.min():.6g} to {steps.max():.6g} Hz" if len(steps) else "one line"
        raise FemtuneError("identify.spectra/uneven", values={"distances": shown})
    return float(steps.mean())


def narrow_remarks(freq_hz: Reals, damping_ratio: Reals | None, step_hz: float) -> tuple[ModeRemark, ...]:
    """``identify.harmonic/spectra`` of modes whose bandwidth is far below the distance of the lines.

    The envelope of a line, which tells a machine from a mode, is not in its spectrum.
    """
    if damping_ratio is None:
        return ()
    widths = 2.0 * damping_ratio * freq_hz
    return tuple(
        ModeRemark(i, Notice("identify.harmonic/spectra", frequency_hz=float(f), width_hz=float(w), step_hz=step_hz))
        for i, (f, w) in enumerate(zip(freq_hz, widths))
        if np.isfinite(w) and 0.0 < w < NARROW * step_hz
    )


def _window_correlation(window: SpectraWindow) -> Reals:
    """Correlation of the window at lags of fractions of its length, 1 at zero; 1 up to half of it without a window."""
    if window == "none":
        return np.where(np.arange(_WINDOW_SAMPLES) < _WINDOW_SAMPLES // 2, 1.0, 0.0)
    weights = _weights(window)
    own = np.correlate(weights, weights, "full")[_WINDOW_SAMPLES - 1 :]
    return np.asarray(own / own[0], dtype=float)


def _weights(window: SpectraWindow) -> Reals:
    return np.asarray(signal.get_window("boxcar" if window == "none" else window, _WINDOW_SAMPLES), dtype=float)


def _taper(freq_hz: Reals, high_hz: float) -> Reals:
    """1 in the band, falling to 0 at the end of the lines, so that the end does not ring in the correlations."""
    end = max(freq_hz[-1], high_hz)
    if end <= 1.02 * high_hz:
        return np.ones(len(freq_hz))
    beyond = np.clip((freq_hz - high_hz) / (end - high_hz), 0.0, 1.0)
    return np.asarray(np.cos(0.5 * np.pi * beyond) ** 2)


def _square(spectra: SpectrumSet, window: SpectraWindow) -> CrossSpectra:
    """All responses with each other, Hermitian, references in the order of the responses."""
    order = [list(spectra.references).index(dof) for dof in spectra.responses]
    values = spectra.values[:, order].transpose(2, 0, 1)
    used = spectra.freq_hz > 0.0
    hermitian = 0.5 * (values + np.conj(np.swapaxes(values, 1, 2)))
    return CrossSpectra(spectra.freq_hz[used], hermitian[used], 0, _weights(window))
