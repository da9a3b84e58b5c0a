"""Functions of periodic, multisine and stepped-sine tests at the lines that were driven, with noise by repeats."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Complexes, Reals
from femtune.errors import FemtuneError
from femtune.identification.averaging import no_lost_samples
from femtune.identification.estimators import KIND_OF
from femtune.modal import FrfSet, TimeSeries


@dataclass(frozen=True, eq=False)
class PeriodicFrfs:
    """Functions at the driven lines, with √E|error|² of each, (n, u, k), from the variance of the repeats."""

    frfs: FrfSet
    sd: Reals


def periodic_frfs(
    records: Sequence[TimeSeries], period: int, lines: Reals | None = None, skip: int = 1
) -> PeriodicFrfs:
    """Functions of periodic signals: no window, no leakage.

    Parameters
    ----------
    records : experiments, as many as inputs; those of several inputs differ in their inputs' phases
    period : samples
    lines : driven frequencies in Hz, each a multiple of rate/period; those with more than a thousandth of the largest
        input's amplitude where None
    skip : periods at the beginning that hold the transient

    Raises
    ------
    FemtuneError : ``identify.few-periods`` (two are needed after those skipped), ``identify.experiments``,
        ``identify.not-a-line``, ``record.lost-samples``
    """
    repeats = [_periods(record, period, skip) for record in records]
    rate = records[0].even_hz
    every = np.arange(1, period // 2) * rate / period
    at = _driven(repeats, records[0]) if lines is None else _bins(np.asarray(lines, float), rate, period)
    return _frfs(records[0], [r[:, :, at] for r in repeats], every[at - 1])


def stepped_frfs(steps: Sequence[tuple[TimeSeries, Sequence[float]]], blocks: int = 4) -> PeriodicFrfs:
    """Functions of a stepped sine or a multisine of any frequencies, one input, each step with its own lines.

    Amplitudes are fitted by least squares of sines and cosines, so that lines need not fit the length of a step.

    Parameters
    ----------
    steps : steady parts of the record, each with the frequencies in Hz that drove it
    blocks : parts that a step is cut into, whose variance gives the noise

    Raises
    ------
    FemtuneError : ``identify.experiments`` for more than one input, ``identify.step-too-short``,
        ``record.lost-samples``
    """
    parts = [(freq, _amplitudes(record, np.asarray(freq, float), blocks)) for record, freq in steps]
    lines = np.concatenate([np.asarray(freq, float) for freq, _ in parts])
    order = np.argsort(lines)
    together = np.concatenate([amplitudes for _, amplitudes in parts], axis=2)
    return _frfs(steps[0][0], [together[:, :, order]], lines[order])


def _periods(record: TimeSeries, period: int, skip: int) -> Complexes:
    """(repeats, channels, bins) transforms of each period after the transient."""
    no_lost_samples(record)
    count = record.samples // period - skip
    if count < 2:
        raise FemtuneError(
            "identify.few-periods", values={"samples": record.samples, "period": period}, count=max(count, 0), skip=skip
        )
    kept = record.values[:, skip * period : (skip + count) * period].reshape(len(record), count, period)
    return np.fft.rfft(kept).transpose(1, 0, 2) * (2.0 / period)


def _driven(repeats: Sequence[Complexes], record: TimeSeries) -> NDArray[np.int64]:
    inputs = record.positions("input")
    size = np.max([np.abs(r[:, inputs].mean(axis=0)).max(axis=0, initial=0.0) for r in repeats], axis=0)
    size[[0, -1]] = 0.0
    return np.flatnonzero(size > 1e-3 * size.max())


def _bins(lines: Reals, rate: float, period: int) -> NDArray[np.int64]:
    at = np.rint(lines * period / rate).astype(int)
    off = np.abs(at * rate / period - lines) > 1e-6 * rate / period
    bad = lines[off | (at < 1) | (at >= period // 2)]
    if len(bad):
        raise FemtuneError(
            "identify.not-a-line",
            values={"first": f"{bad[0]:g} Hz", "lines are apart": f"{rate / period:g} Hz"},
            n_bad=len(bad),
            n_lines=len(lines),
        )
    return at


def _amplitudes(record: TimeSeries, freq: Reals, blocks: int) -> Complexes:
    """(blocks, channels, lines) of e^{iωt}, on the clock of the record."""
    no_lost_samples(record)
    pieces = np.array_split(np.arange(record.samples), blocks)
    apart = np.min(np.diff(np.sort(freq)), initial=freq.min())
    length = len(pieces[-1]) / record.even_hz
    if blocks < 2 or length * apart < 1.0 or len(pieces[-1]) < 4 * len(freq) + 2:
        raise FemtuneError(
            "identify.step-too-short", values={"blocks": blocks, "lines": len(freq)}, length=length, apart=apart
        )
    return np.array([_sines(record, piece, freq) for piece in pieces])


def _sines(record: TimeSeries, piece: NDArray, freq: Reals) -> Complexes:
    angle = 2.0 * np.pi * np.outer(record.time_s[piece], freq)
    basis = np.hstack([np.cos(angle), np.sin(angle), np.ones((len(piece), 1))])
    amplitudes = np.linalg.lstsq(basis, record.values[:, piece].T, rcond=None)[0]
    return (amplitudes[: len(freq)] - 1j * amplitudes[len(freq) : 2 * len(freq)]).T


def _frfs(record: TimeSeries, repeats: Sequence[Complexes], lines: Reals) -> PeriodicFrfs:
    """H = Ȳ X̄⁻¹ over experiments; the noise is the variance of Y − HX over the repeats."""
    rows, columns = record.positions("response") + record.positions("reference"), record.positions("input")
    kinds = {KIND_OF.get(record.channels[i].quantity) for i in rows}
    if len(repeats) != len(columns) or len(kinds) != 1 or None in kinds:
        raise FemtuneError(
            "identify.experiments",
            values={"experiments": len(repeats), "inputs": len(columns), "kinds": ", ".join(sorted(map(str, kinds)))},
        )
    x = np.array([r[:, columns].mean(axis=0) for r in repeats]).transpose(2, 1, 0)
    y = np.array([r[:, rows].mean(axis=0) for r in repeats]).transpose(2, 1, 0)
    back = np.linalg.inv(x)
    H = y @ back
    sd = np.sqrt(np.einsum("kne,keu->nuk", _noise(repeats, H, rows, columns), np.abs(back) ** 2))
    responses = record.select_channels(rows)
    dofs = type(record.dofs())(c.dof for c in responses.channels)
    frfs = FrfSet(lines, H.transpose(1, 2, 0), dofs, record.dofs("input"), str(kinds.pop()), source="periodic test")
    return PeriodicFrfs(frfs, sd)


def _noise(repeats: Sequence[Complexes], H: Complexes, rows: Sequence[int], columns: Sequence[int]) -> Reals:
    """(k, n, experiments) variance of the mean of Y − HX."""
    variances = []
    for r in repeats:
        left = r[:, rows].transpose(2, 1, 0) - H @ r[:, columns].transpose(2, 1, 0)
        variances.append(left.var(axis=2, ddof=1) / left.shape[2])
    return np.array(variances).transpose(1, 2, 0)
