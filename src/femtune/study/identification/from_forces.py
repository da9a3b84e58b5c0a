"""Identification from records in time whose forces were measured: functions first, then their modes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError
from femtune.files.identify_file import IdentifyFile
from femtune.identify.averaging import Averaging, input_output_spectra
from femtune.identify.estimators import estimate_frfs
from femtune.identify.lines import at_lines
from femtune.identify.periodic import periodic_frfs
from femtune.modal import FrfSet, TimeSeries
from femtune.study.identification.found import Found
from femtune.study.identification.from_frfs import found_from_frfs

LINES = 400
"""Lines of a band where no resolution is asked for, as far as the record allows with eight segments."""


WHOLE = 1e-3
"""A period may miss a whole number of samples by so much, for it is written with few digits."""


def has_forces(record: TimeSeries) -> bool:
    """True where every input is a force: the ground's motion is no force."""
    quantities = {record.channels[i].quantity for i in record.positions("input")}
    return quantities == {"force"}


def found_from_forces(record: TimeSeries, file: IdentifyFile) -> Found:
    """Modes of the functions that the record gives, weighed by their scatter.

    Raises
    ------
    FemtuneError : ``identify.*``, ``record.*``
    """
    frfs, sd = functions_of(record, file)
    usable = np.isfinite(frfs.values).all(axis=(0, 1)) & (frfs.freq_hz > 0.0)
    kept = np.flatnonzero(usable)
    errors = sd[:, :, kept]
    known = np.isfinite(errors).all() and (errors > 0.0).all()
    return found_from_frfs(at_lines(frfs, kept), file, sd=errors if known else None)


def functions_of(record: TimeSeries, file: IdentifyFile) -> tuple[FrfSet, NDArray[np.float64]]:
    """The functions and √E|error|² of each, (n, u, k)."""
    table = file.identify
    if table.period_s is not None:
        periodic = periodic_frfs([record], _period(record, file))
        return periodic.frfs, periodic.sd
    estimate = estimate_frfs(input_output_spectra([record], Averaging(_segment(record, file))), table.estimator)
    return replace(estimate.frfs, source=record.source), estimate.sd


def _period(record: TimeSeries, file: IdentifyFile) -> int:
    """Samples of the period that is stated, which must be whole: a fraction would leak into every line."""
    period_s = file.identify.period_s or 0.0
    samples = period_s * record.even_hz
    if abs(samples - round(samples)) > WHOLE:
        raise FemtuneError(
            "identify.period",
            "the period is no whole number of samples",
            where=file.where("identify", "period_s"),
            values={"period_s": period_s, "sampling rate": f"{record.even_hz:g} Hz", "samples": f"{samples:.6g}"},
            hint="correct the period; for a signal without one leave period_s out",
        )
    return round(samples)


def _segment(record: TimeSeries, file: IdentifyFile) -> int:
    """Samples of a segment: by the resolution, or so that the band has `LINES` lines; an even number."""
    table = file.identify
    low, high = table.band_hz or (0.0, 0.5 * record.even_hz)
    step = table.resolution_hz or (high - low) / LINES
    wanted = 2 * round(0.5 * record.even_hz / step)
    most = 2 * (record.samples // 16)
    if table.resolution_hz is not None and wanted > record.samples:
        raise FemtuneError(
            "identify.resolution",
            f"lines {step:g} Hz apart need segments that are longer than the record",
            where=file.where("identify", "resolution_hz"),
            values={"segment": f"{wanted / record.even_hz:g} s", "record": f"{record.duration_s:g} s"},
            hint="ask for a coarser resolution, or measure longer",
        )
    return wanted if table.resolution_hz is not None else min(wanted, most)
