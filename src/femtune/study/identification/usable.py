"""Whether anything can be identified from a record: asked before any method works on it."""

from __future__ import annotations

import numpy as np

from femtune.errors import FemtuneError
from femtune.files.identify_file import KNOWN_INPUT, OUTPUT_ONLY, IdentifyFile
from femtune.identify.operational import Operational, prepared, segment_of
from femtune.identify.record_checks import dead_channels
from femtune.modal import TimeSeries

LARGEST, SMALLEST = 1e60, 1e-60
"""Between these the fourth powers that standard deviations need neither overflow nor vanish."""
LEAST_SAMPLES, LEAST_LINES = 128, 4
"""Of a piece of record, and of spectra in the band, that any method can work on."""


def check_usable(record: TimeSeries) -> None:
    """Responses that move, in numbers that can be squared.

    Raises
    ------
    FemtuneError : ``record.dead`` where no response moves, ``record.values`` for numbers that are too large or small
    """
    # sizes first: the squares that tell a dead channel would overflow
    _check_size(record)
    responses = record.select_channels([*record.positions("reference"), *record.positions("response")])
    if len(responses) and dead_channels(responses).all():
        hint = "look at the amplifier and the export: constant numbers hold no vibration"
        raise FemtuneError("record.dead", "none of the responses moves", hint=hint)


def _check_size(record: TimeSeries) -> None:
    largest = np.nanmax(np.abs(record.values), axis=1, initial=0.0)
    bad = np.flatnonzero((largest > LARGEST) | ((largest < SMALLEST) & (largest > 0.0)))
    if len(bad):
        names = ", ".join(str(record.channels[i]) for i in bad[:5])
        values = {"largest sample": f"{largest[bad[0]]:.3g}", "wanted": f"{SMALLEST:g} to {LARGEST:g}"}
        hint = "look at the export; a factor of [[channel]] brings numbers into a unit of reasonable size"
        raise FemtuneError(
            "record.values", f"the samples of {names} are of no reasonable size", values=values, hint=hint
        )


def check_methods(file: IdentifyFile, forces: bool) -> None:
    """Methods suit what the record holds.

    Raises
    ------
    FemtuneError : ``identify.output-only``
    """
    known = KNOWN_INPUT if forces else OUTPUT_ONLY
    wrong = [m for m in file.identify.methods or () if m not in known]
    if wrong:
        needs = "records whose forces were not measured" if forces else "measured forces, or functions"
        has = "has" if forces else "has no"
        raise FemtuneError(
            "identify.output-only",
            f"{wrong[0]} works on {needs}, and this record {has} channels with the role input and the quantity force",
            where=file.where("identify", "methods"),
            values={"methods": ", ".join(wrong)},
            hint=f"write one of {', '.join(known)}",
        )


def check_length(record: TimeSeries, asked: Operational, file: IdentifyFile) -> None:
    """Pieces of the record are long enough for the correlations of the largest order and for lines in the band.

    Raises
    ------
    FemtuneError : ``identify.short-record``, ``identify.band``
    """
    fragments = file.identify.fragments
    if record.samples // fragments >= LEAST_SAMPLES:
        piece = prepared(record.select_samples(0, record.samples // fragments), asked)
        lags = 2 * asked.rows(piece)
        if piece.samples > 2 * lags + asked.pieces:
            return _check_lines(piece, asked)
    raise FemtuneError(
        "identify.short-record",
        "the record is too short for this order and band" if fragments == 1 else "the fragments are too short",
        values={"samples": record.samples, "fragments": fragments, "duration": f"{record.duration_s:g} s"},
        hint="lower the largest order, cut into fewer fragments, or measure longer",
    )


def _check_lines(piece: TimeSeries, asked: Operational) -> None:
    step = piece.even_hz / segment_of(piece, asked)
    low, high = asked.band_hz
    if high - low < LEAST_LINES * step:
        raise FemtuneError(
            "identify.band",
            f"the band from {low:g} to {high:g} Hz is narrower than {LEAST_LINES} lines of the spectra",
            values={"lines": f"{step:.3g} Hz apart", "duration": f"{piece.duration_s:g} s"},
            hint="give a wider band, cut into fewer fragments, or measure longer",
        )
