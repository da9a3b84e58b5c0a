"""Identification where the input is known: measured frequency response functions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError
from femtune.files.identify_file import IdentifyFile
from femtune.files.uff import read_uff
from femtune.identify.input_known import FRF_METHODS, IdentifiedModes, InputKnown, identify_frfs
from femtune.modal import FrfSet
from femtune.study.identification.found import Curve, Found
from femtune.testdata import NO_GEOMETRY, WireFrame
from femtune.units import unit_system

DEFAULT_ORDER = 60


def found_from_file(file: IdentifyFile) -> Found:
    """Modes of the functions of a Universal File.

    Raises
    ------
    FemtuneError : ``uff.*``, ``identify.no-frfs`` for a file without functions of motion over force, ``identify.*``
    """
    units = unit_system(file.identify.units)
    try:
        content = read_uff(file.measured_path, units=units)
    except FemtuneError as error:
        if error.code != "uff.no-units":
            raise
        content = read_uff(file.measured_path, units=units, file_units=units)
    frfs = _only(content.frf_sets, str(file.measured_path))
    found = found_from_frfs(frfs, file, content.test.geometry)
    return replace(found, notices=(*content.notices, *found.notices))


def _only(sets: tuple[FrfSet, ...], path: str) -> FrfSet:
    if len(sets) != 1:
        kinds = ", ".join(f"{len(s.responses)} × {len(s.references)} {s.kind}, {len(s.freq_hz)} lines" for s in sets)
        raise FemtuneError(
            "identify.no-frfs",
            f"one set of functions of motion over force is wanted, the file has {len(sets)}",
            values={"file": path, "sets": kinds or "none"},
            hint="export the functions of one measurement, of one kind and on the same lines",
        )
    return sets[0]


def found_from_frfs(
    frfs: FrfSet, file: IdentifyFile, geometry: WireFrame = NO_GEOMETRY, sd: NDArray[np.float64] | None = None
) -> Found:
    """Modes of functions, with every pole, the fit and the state-space model; `sd` is the functions' scatter."""
    table = file.identify
    methods = tuple(m for m in table.methods or FRF_METHODS if m in FRF_METHODS)
    asked = InputKnown(
        table.band_hz, table.largest_order or DEFAULT_ORDER, methods, take=table.take_hz, drop=table.drop_hz,
        real=table.real,
    )  # fmt: skip
    made = identify_frfs(frfs, asked, sd)
    measured, synthesised = made.fit.measured, made.fit.synthesised
    error = np.linalg.norm(synthesised.values - measured.values, axis=2)
    size = np.linalg.norm(measured.values, axis=2)
    return Found(
        made.modes, made.table, made.candidates, _by_method(made), _curve(measured), measured=measured,
        synthesised=synthesised, misfit_percent=100.0 * error / np.where(size > 0.0, size, 1.0), system=made.system,
        notices=made.notices, geometry=geometry,
    )  # fmt: skip


def _by_method(made: IdentifiedModes) -> dict[str, NDArray[np.float64]]:
    """Median of each method's own poles in every chosen cluster."""
    names = np.array(made.table.method)
    chosen = [c for c in made.candidates if c.chosen]
    out = {}
    for name in dict.fromkeys(made.table.method):
        own = [c.members[names[c.members] == name] for c in chosen]
        freq = [float(np.median(made.table.freq_hz[i])) if len(i) else float("nan") for i in own]
        out[name] = _in_order(np.array(freq), np.array([c.freq_hz for c in chosen]), made.modes.freq_hz)
    return out


def _in_order(values: NDArray, chosen: NDArray, modes: NDArray) -> NDArray[np.float64]:
    """Values of the chosen clusters beside the fitted modes, which may have changed places."""
    at = [int(np.argmin(np.abs(chosen - f))) for f in modes]
    return np.asarray(values[at], dtype=float)


def _curve(frfs: FrfSet) -> Curve:
    size = np.sqrt((np.abs(frfs.values) ** 2).sum(axis=(0, 1)))
    level = 20.0 * np.log10(np.maximum(size, 1e-300) / max(float(size.max()), 1e-300))
    return Curve(frfs.freq_hz, level, "all functions together")
