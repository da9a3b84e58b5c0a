"""Identification with unknown input from auto and cross spectra of the responses."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from femtune.errors import FemtuneError, Notice
from femtune.files.described_test import read_described_geometry, read_described_spectra
from femtune.identification.kinds import OF_SPECTRA
from femtune.identification.operational import Operational
from femtune.identification.spectra import line_distance, modes_of_spectra, narrow_remarks
from femtune.steps.identify.choices import picked_poles
from femtune.steps.identify.from_record import (
    DEFAULT_ORDER,
    check_choice,
    chosen_by_hand,
    of_first_method,
    with_picked,
)
from femtune.steps.identify.identified import Curve, Found, singular_levels
from femtune.steps.identify.result import NothingFound

if TYPE_CHECKING:
    from femtune.files.identification_file import IdentifyFile
    from femtune.modal.spectrum_set import SpectrumSet

_OF_RECORDS = ("remove_hz", "fragments", "period_s", "exponential_s", "force_window_s", "sampling_hz", "gaps")
"""Keys of [identify] that spectra cannot serve."""


def found_from_spectra(file: IdentifyFile) -> Found:
    """Modes of the spectra by every method that is requested; those of the first one.

    Raises
    ------
    FemtuneError : ``identify.*``, ``uff.*``, ``record.*``, ``frf.layout``
    """
    table = file.identify
    for key in _OF_RECORDS:
        if getattr(table, key) != type(table).model_fields[key].default:
            raise FemtuneError("identify.spectra/no-record", where=file.where("identify", key), key=key)
    names = _methods(file)
    spectra, of_file = read_described_spectra(file)
    step_hz = line_distance(spectra.freq_hz)
    if table.band_hz is None:
        lines = f"{spectra.freq_hz[0]:g} to {spectra.freq_hz[-1]:g} Hz"
        raise FemtuneError("identify.no-band", where=file.where("identify"), values={"lines": lines})
    low = max(table.band_hz[0], step_hz, float(spectra.freq_hz[0]))
    asked = Operational((low, table.band_hz[1]), table.largest_order or DEFAULT_ORDER)
    several = {
        (name, 0): chosen_by_hand(found, file)
        for name, found in modes_of_spectra(spectra, asked, names, table.spectra_window).items()
    }
    names = [name for name, _ in several]
    if not names:
        raise FemtuneError("identify.spectra/fdd", where=file.where("identify", "methods"))
    if picked := picked_poles(file):
        several[names[0], 0] = with_picked(several[names[0], 0], picked)
    check_choice([several[names[0], 0]], file)
    curve = _curve(spectra, asked.band_hz)
    try:
        identified = of_first_method(names, several, table.drop_hz)
    except FemtuneError as error:
        first = several[names[0], 0]
        found = Found(first.modes, first.collinearity, first.table, first.candidates, {}, curve)
        raise NothingFound(error, found) from error
    remarks = narrow_remarks(identified.modes.freq_hz, identified.modes.damping_ratio, step_hz)
    told = Notice(
        "identify.spectra/taken", level="info", responses=len(spectra.responses), references=len(spectra.references),
        step=step_hz, window=table.spectra_window,
    )  # fmt: skip
    notices = (*of_file, told, *identified.notices, *(r.notice for r in remarks))
    geometry = read_described_geometry(file)
    identified = replace(identified, curve=curve, remarks=(*identified.remarks, *remarks), notices=notices)
    return identified if geometry is None else replace(identified, geometry=geometry)


def _methods(file: IdentifyFile) -> list[str]:
    """Those that are requested, as far as spectra serve them (error ``identify.output-only/spectra``)."""
    wanted = file.identify.methods or OF_SPECTRA
    if wrong := next((name for name in wanted if name not in OF_SPECTRA), None):
        where, known = file.where("identify", "methods"), ", ".join(OF_SPECTRA)
        raise FemtuneError("identify.output-only/spectra", where=where, method=wrong, known=known)
    return list(wanted)


def _curve(spectra: SpectrumSet, band_hz: tuple[float, float]) -> Curve:
    inside = (spectra.freq_hz >= band_hz[0]) & (spectra.freq_hz <= band_hz[1])
    values = spectra.values[:, :, inside]
    level = 10.0 * np.log10(np.maximum(np.linalg.norm(values, axis=(0, 1)), 1e-300))
    largest = level.max(initial=-3000.0)
    # a spectrum is a square already
    singular = 0.5 * singular_levels(values.transpose(2, 0, 1)) - largest
    power = values[spectra.reference_rows, range(len(spectra.references))].real.sum(axis=0)
    words = "all spectra together"
    return Curve(spectra.freq_hz[inside], level - largest, words, singular, power / max(power.max(initial=0.0), 1e-300))
