"""Averaged spectra between measured inputs and responses: windows, overlap, hits of a hammer, several records."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import signal
from scipy.signal import get_window

from femtune.arrays import Complexes, Reals
from femtune.dofs import DofSet
from femtune.errors import FemtuneError
from femtune.modal import TimeSeries

# ----------------------------------------------------------------------------------------------------
# Cross-spectral density matrices of responses by Welch's method.


@dataclass(frozen=True, eq=False)
class CrossSpectra:
    """One-sided spectral densities.

    Parameters
    ----------
    freq_hz : (k,) lines
    values : (k, s, s) Hermitian: G[k, i, j] is E[Y_i conj(Y_j)], unit²/Hz
    averages : number of overlapping segments
    window : (segment,) weights of the samples of a segment
    """

    freq_hz: Reals
    values: NDArray[np.complex128]
    averages: int
    window: Reals


def segment_starts(samples: int, segment: int, overlap: float) -> range:
    """First samples of all whole segments that overlap by a part."""
    return range(0, samples - segment + 1, max(1, round(segment * (1.0 - overlap))))


def segment_transforms(
    values: Reals, starts: Iterable[int], window: Reals, keep_mean: bool = False
) -> Iterator[NDArray[np.complex128]]:
    """(channels, k) Fourier transforms of each windowed segment, without its mean unless that is kept."""
    for begin in starts:
        piece = values[:, begin : begin + len(window)]
        yield np.fft.rfft((piece if keep_mean else piece - piece.mean(axis=1, keepdims=True)) * window)


_TOGETHER = 32
"""Segments whose products are summed at once: it bounds the memory."""


def cross_spectra(
    values: Reals, rate_hz: float, segment: int, overlap: float = 0.5, window: str = "hann"
) -> CrossSpectra:
    """Spectra of channels (s, n) from segments of `segment` samples, each without its mean."""
    weights = np.asarray(signal.get_window(window, segment), dtype=np.float64)
    starts = segment_starts(values.shape[1], segment, overlap)
    total = np.zeros((segment // 2 + 1, len(values), len(values)), dtype=complex)
    for first in range(0, len(starts), _TOGETHER):
        several = np.stack(list(segment_transforms(values, starts[first : first + _TOGETHER], weights)), axis=2)
        several = several.transpose(1, 0, 2)
        total += several @ several.conj().transpose(0, 2, 1)
    scale = 2.0 / (rate_hz * (weights**2).sum() * len(starts))
    freq_hz = np.asarray(np.fft.rfftfreq(segment, 1.0 / rate_hz), dtype=np.float64)
    return CrossSpectra(freq_hz, scale * total, len(starts), weights)


@dataclass(frozen=True)
class Averaging:
    """How records are cut into segments.

    Parameters
    ----------
    segment : samples of a segment; lines are rate/segment apart
    overlap : part of a segment that the next one repeats, 0 for hits (each record is one hit then) and periods
    window : a name that scipy.signal.get_window knows; "boxcar" for periodic signals and hits that die out
    exponential_s : time constant τ of a decay e^{−t/τ} on inputs and responses of hits that do not die out; it adds 1/τ
        to the decay of every pole, which `undo_exponential` takes away again
    """

    segment: int
    overlap: float = 0.5
    window: str = "hann"
    exponential_s: float | None = None

    def __post_init__(self) -> None:
        if self.segment < 4 or not 0.0 <= self.overlap < 1.0 or (self.exponential_s or 1.0) <= 0.0:
            values = {"segment": self.segment, "overlap": self.overlap, "exponential_s": self.exponential_s}
            raise FemtuneError("identify.averaging", values=values)


@dataclass(frozen=True, eq=False)
class InputOutputSpectra:
    """Mean products of the Fourier transforms of inputs X and responses Y.

    Parameters
    ----------
    freq_hz : (k,) lines
    inputs : (k, u, u) E[X Xᴴ]
    cross : (k, n, u) E[Y Xᴴ]
    outputs : (k, n) E[|Y|²]
    averages : independent segments that the overlapping ones are worth
    responses, references : DOFs of Y and X
    quantity : of all responses
    """

    freq_hz: Reals
    inputs: Complexes
    cross: Complexes
    outputs: Reals
    averages: float
    responses: DofSet
    references: DofSet
    quantity: str


def input_output_spectra(records: Sequence[TimeSeries], averaging: Averaging) -> InputOutputSpectra:
    """Average over all segments of all records.

    Parameters
    ----------
    records : of the same channels and rate, one or more of them inputs; each hit of a hammer may be a record

    Raises
    ------
    FemtuneError : ``identify.no-input``, ``identify.records-differ``, ``record.lost-samples``,
        ``identify.short-record``, ``record.uneven``
    """
    _check_records(records)
    first = records[0]
    rows, columns = first.positions("response") + first.positions("reference"), first.positions("input")
    window = _window(averaging, first.even_hz)
    sums, count = _sums(records, rows, columns, window, averaging)
    averages = sum(_worth(_starts(r, averaging), window, averaging) for r in records)
    freq = np.asarray(np.fft.rfftfreq(averaging.segment, 1.0 / first.even_hz), dtype=float)
    responses = DofSet(first.channels[i].dof for i in rows)
    inputs, cross, outputs = (s / count for s in sums)
    quantity = _one_quantity(first, rows)
    return InputOutputSpectra(freq, inputs, cross, outputs.real, averages, responses, first.dofs("input"), quantity)


def undo_exponential(poles: Complexes, exponential_s: float) -> Complexes:
    """Poles without the decay 1/τ that an exponential window has added."""
    return poles + 1.0 / exponential_s


def _check_records(records: Sequence[TimeSeries]) -> None:
    if not records or not records[0].positions("input"):
        raise FemtuneError("identify.no-input")
    for record in records:
        if record.channels != records[0].channels or record.even_hz != records[0].even_hz:
            rates = "; ".join(f"{len(r)} channels at {r.even_hz:g} Hz" for r in records[:5])
            raise FemtuneError("identify.records-differ", values={"records": rates})
        no_lost_samples(record)


def no_lost_samples(record: TimeSeries) -> None:
    """Raise ``record.lost-samples`` where a channel has NaN."""
    lost = np.isnan(record.values).sum(axis=1)
    if lost.any():
        names = ", ".join(f"{record.channels[i]}: {lost[i]}" for i in np.flatnonzero(lost)[:5])
        raise FemtuneError("record.lost-samples", values={"samples lost": names, "first gap": _first_gap(record)})


def _first_gap(record: TimeSeries) -> str:
    """Channel, time and length of the first gap."""
    missing = np.isnan(record.values)
    at = int(np.flatnonzero(missing.any(axis=0))[0])
    row = int(np.flatnonzero(missing[:, at])[0])
    present = np.flatnonzero(~missing[row, at:])
    length = int(present[0]) if len(present) else record.samples - at
    return f"{record.channels[row]}: {length} samples from {record.time_s[at]:.6g} s"


def _one_quantity(record: TimeSeries, rows: Sequence[int]) -> str:
    quantities = {record.channels[i].quantity for i in rows}
    if len(quantities) != 1:
        raise FemtuneError("identify.records-differ", values={"quantities": ", ".join(sorted(quantities))})
    return quantities.pop()


def _window(averaging: Averaging, rate: float) -> Reals:
    window = np.asarray(get_window(averaging.window, averaging.segment), float)
    if averaging.exponential_s is not None:
        window = window * np.exp(-np.arange(averaging.segment) / (rate * averaging.exponential_s))
    return window


def _starts(record: TimeSeries, averaging: Averaging) -> range:
    if record.samples < averaging.segment:
        raise FemtuneError(
            "identify.short-record",
            values={"duration": f"{record.duration_s:g} s"},
            samples=record.samples,
            segment=averaging.segment,
        )
    return segment_starts(record.samples, averaging.segment, averaging.overlap)


def _transforms(record: TimeSeries, window: Reals, averaging: Averaging) -> Iterator[Complexes]:
    """(channels, k) of each segment without its mean; a hit begins from rest, so its mean stays."""
    keep = averaging.exponential_s is not None or averaging.window == "boxcar"
    return segment_transforms(record.values, _starts(record, averaging), window, keep)


def _sums(
    records: Sequence[TimeSeries], rows: Sequence[int], columns: Sequence[int], window: Reals, averaging: Averaging
) -> tuple[tuple[Complexes, Complexes, Complexes], int]:
    k, n, u = averaging.segment // 2 + 1, len(rows), len(columns)
    inputs, cross, outputs = np.zeros((k, u, u), complex), np.zeros((k, n, u), complex), np.zeros((k, n), complex)
    count = 0
    for record in records:
        for lines in _transforms(record, window, averaging):
            x, y = lines[columns].T, lines[rows].T
            inputs += x[:, :, None] * x[:, None, :].conj()
            cross += y[:, :, None] * x[:, None, :].conj()
            outputs += np.abs(y) ** 2
            count += 1
    return (inputs, cross, outputs), count


def _worth(starts: range, window: Reals, averaging: Averaging) -> float:
    """Independent segments, from the correlation of overlapping windows (P. Welch 1967)."""
    count, step = len(starts), starts.step
    total = 1.0
    for lag in range(1, count):
        shift = lag * step
        if shift >= averaging.segment:
            break
        shared = float(window[shift:] @ window[:-shift]) / float(window @ window)
        total += 2.0 * (1.0 - lag / count) * shared**2
    return count / total
