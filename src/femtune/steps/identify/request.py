"""The request: an identification file, or a measured file with options; checks of the measured records."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import ValidationError

from femtune.errors import FemtuneError, Where
from femtune.files.identification_file import (
    IdentifyFile,
    is_identification_file,
    read_identify_file,
)
from femtune.files.study_file.problems import problems
from femtune.files.study_file.source import StudyLines, falls
from femtune.files.uff.measured_functions import read_header
from femtune.files.uff.scan import names_universal, scan_uff
from femtune.files.uff.spectrum_sets import SPECTRA
from femtune.identification.kinds import KNOWN_INPUT, OUTPUT_ONLY
from femtune.identification.operational import prepared, segment_of
from femtune.identification.record_checks import dead_channels

if TYPE_CHECKING:
    from femtune.identification.operational import Operational
    from femtune.modal import TimeSeries

_UNKNOWN = 0
_TIME_RESPONSE = 1
_FRF = 4
"""Function types of data set 58."""


def asked_of(path: Path | str, options: Mapping[str, Any]) -> IdentifyFile:
    """An identification file, or one made for a measured file; `options` are keys of [identify] that take precedence.

    The option ``further_records`` adds records to that of the file, such as other hits of a hammer. Names of files
    among the options are relative to the working folder.

    Raises
    ------
    FemtuneError : ``study.*`` and ``identify.*`` of the file; ``record.missing``
    """
    path = Path(path)
    given = {key: value for key, value in options.items() if value is not None}
    _check_band(given.get("band_hz"), path)
    further = tuple(map(os.path.abspath, given.pop("further_records", ())))
    if "choices" in given:
        # a path of the command line, and not of the file
        given["choices"] = os.path.abspath(given["choices"])
    if is_identification_file(path):
        file = read_identify_file(path)
        table = {**file.identify.model_dump(exclude_none=True), **given}
        if further:
            first = file.identify.record or ()
            table["record"] = (*((first,) if isinstance(first, str) else first), *further)
        changed = _checked({**file.model_dump(exclude_none=True), "identify": table}, path)
        changed._path, changed._source = file._path, file._source
        return changed
    if not path.is_file():
        code = "record.missing/folder" if path.is_dir() else "record.missing/request"
        raise FemtuneError(code, where=Where(str(path)))
    kind = "record" if further else _kind_of(path)
    made = _checked({"identify": {kind: (path.name, *further) if further else path.name, **given}}, path)
    made._path, made._source = path, StudyLines(str(path))
    return made


def _check_band(band_hz: object, path: Path) -> None:
    """Limits of an option in their order (error ``identify.record-band``); those of a file are checked with it."""
    if falls(band_hz):
        low, high = (f"{end:g}" for end in band_hz)  # type: ignore[attr-defined]
        code = "identify.record-band/empty" if low == high else "identify.record-band/exchanged"
        raise FemtuneError(code, where=Where(str(path)), values={"band": f"{low} to {high} Hz"}, low=low, high=high)


def _checked(data: dict[str, Any], path: Path) -> IdentifyFile:
    try:
        return IdentifyFile.model_validate(data)
    except ValidationError as findings:
        raise problems(findings, StudyLines(str(path), {}, "docs/identify-file.md"), IdentifyFile)[0] from findings


def _kind_of(path: Path) -> str:
    """ "frfs" for a Universal File, unless its functions are records in time, or spectra without FRFs."""
    if not names_universal(path):
        return "record"
    types = {read_header(one).function_type for one in scan_uff(path) if one.number == 58}
    if types and types <= {_TIME_RESPONSE}:
        return "record"
    others = types - set(SPECTRA)
    return "spectra" if types != others and not others & {_UNKNOWN, _FRF} else "frfs"


LARGEST_SAMPLE = 1e60
"""Largest magnitude of samples. Standard deviations need fourth powers, which overflow above it."""
SMALLEST_SAMPLE = 1e-60
"""Smallest magnitude of the largest sample of a channel, unless it is zero.

Standard deviations need fourth powers, which underflow below it.
"""
LEAST_SAMPLES = 128
"""Samples that a piece of record needs for any of the methods."""
LEAST_LINES = 4
"""Lines that spectra need in the band for any of the methods: less than four cannot show a resonance."""


def check_usable(record: TimeSeries) -> None:
    """Responses that move, in numbers that can be squared.

    Raises
    ------
    FemtuneError : ``record.dead`` where no response moves or no force changes, ``record.values`` for numbers that are
        too large or small
    """
    # magnitudes are checked first, because the squares that reveal a dead channel could overflow
    _check_size(record)
    forces = [i for i in record.positions("input") if record.channels[i].quantity == "force"]
    if forces and (np.nanmax(record.values[forces], axis=1) == np.nanmin(record.values[forces], axis=1)).all():
        names = ", ".join(str(record.channels[i]) for i in forces[:5])
        raise FemtuneError("record.dead/force", channels=names)
    responses = record.select_channels([*record.positions("reference"), *record.positions("response")])
    if len(responses) and dead_channels(responses).all():
        raise FemtuneError("record.dead/all-responses")


def _check_size(record: TimeSeries) -> None:
    largest = np.nanmax(np.abs(record.values), axis=1, initial=0.0)
    bad = np.flatnonzero((largest > LARGEST_SAMPLE) | ((largest < SMALLEST_SAMPLE) & (largest > 0.0)))
    if len(bad):
        names = ", ".join(str(record.channels[i]) for i in bad[:5])
        values = {"largest sample": f"{largest[bad[0]]:.3g}", "wanted": f"{SMALLEST_SAMPLE:g} to {LARGEST_SAMPLE:g}"}
        raise FemtuneError("record.values/size", values=values, channels=names)


def check_methods(file: IdentifyFile, forces: bool) -> None:
    """Methods suit what the record holds.

    Raises
    ------
    FemtuneError : ``identify.output-only``, ``identify.no-line`` where lines shall be subtracted beside forces
    """
    if forces:
        check_no_lines(file)
    known = KNOWN_INPUT if forces else OUTPUT_ONLY
    wrong = [m for m in file.identify.methods or () if m not in known]
    if wrong:
        raise FemtuneError(
            "identify.output-only" if forces else "identify.output-only/no-forces",
            where=file.where("identify", "methods"),
            values={"methods": ", ".join(wrong)},
            method=wrong[0],
            methods=", ".join(known),
        )


def check_no_lines(file: IdentifyFile) -> None:
    """No lines shall be subtracted where the forces were measured.

    Raises
    ------
    FemtuneError : ``identify.no-line``
    """
    if file.identify.remove_hz:
        raise FemtuneError("identify.no-line/forces", where=file.where("identify", "remove_hz"))


def check_length(record: TimeSeries, asked: Operational, file: IdentifyFile) -> None:
    """Pieces of the record are long enough for the correlations of the largest order and for lines in the band.

    Raises
    ------
    FemtuneError : ``identify.short-record``, ``identify.band``
    """
    fragments = file.identify.fragments
    # a rate that is far too high leaves no period of any frequency, and makes filters too long for any machine
    has_a_period = record.duration_s * asked.band_hz[1] >= 1.0
    if has_a_period and record.samples // fragments >= LEAST_SAMPLES:
        piece = prepared(record.select_samples(0, record.samples // fragments), asked)
        lags = 2 * asked.rows(piece)
        if piece.samples > 2 * lags + asked.pieces:
            return _check_lines(piece, asked)
    raise FemtuneError(
        "identify.short-record" if fragments == 1 else "identify.short-record/fragments",
        values={"samples": record.samples, "fragments": fragments, "duration": f"{record.duration_s:g} s"},
    )


def _check_lines(piece: TimeSeries, asked: Operational) -> None:
    step = piece.even_hz / segment_of(piece, asked)
    low, high = asked.band_hz
    if high - low < LEAST_LINES * step:
        raise FemtuneError(
            "identify.band/too-few-lines",
            values={"lines": f"{step:.3g} Hz apart", "duration": f"{piece.duration_s:g} s"},
            low=low,
            high=high,
            least_lines=LEAST_LINES,
        )
