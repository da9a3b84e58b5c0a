"""Auto and cross spectra of responses in data sets 58."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from femtune.dofs import Dof
from femtune.errors import FemtuneError, Notice, Where
from femtune.files.uff.function_units import in_hz
from femtune.files.uff.measured_functions import FREQUENCY, FunctionHeader, MeasuredFunction, dof_of, read_functions
from femtune.files.uff.scan import DataSet
from femtune.modal.spectrum_set import SpectrumSet, spectrum_set

AUTO = 2
CROSS = 3
DENSITY = 9
SPECTRA = (AUTO, CROSS, DENSITY)
"""Function types of data set 58 that are spectra of responses: auto, cross, power spectral density."""
_QUANTITIES = {8: "displacement", 11: "velocity", 12: "acceleration", 13: "force", 15: "pressure", 2: "strain"}
"""Quantities by the specific data type of the numerator."""


def read_uff_spectra(sets: Iterable[DataSet], source: str) -> tuple[SpectrumSet, tuple[Notice, ...]]:
    """The spectra of the data sets 58 of a file or of several, and what was remarkable about them.

    An auto spectrum whose reference is node 0 is one of its response.

    Raises
    ------
    FemtuneError : ``uff.*``; ``identify.spectra/none`` if there are none, ``identify.spectra/lines`` if their frequency
        lines differ, ``identify.spectra/twice`` for two spectra of one pair; errors of `spectrum_set`
    """
    stored, of_body = read_functions(sets)
    functions, of_axes = in_hz(stored)
    chosen = [one for one in functions if _is_spectrum(one.header)]
    if not chosen:
        types = ", ".join(map(str, sorted({one.header.function_type for one in functions}))) or "none"
        raise FemtuneError("identify.spectra/none", where=Where(source), values={"function types": types})
    placed = [(one, pair) for one in chosen if (pair := _pair(one.header))]
    pairs: dict[tuple[Dof, Dof], np.ndarray] = {}
    for one, pair in placed:
        _check_lines(one, chosen[0])
        if pair in pairs:
            raise FemtuneError("identify.spectra/twice", where=one.where, response=pair[0], reference=pair[1])
        pairs[pair] = one.values
    unplaced = [one for one in chosen if _pair(one.header) is None]
    made = spectrum_set(chosen[0].x, pairs, _quantities_of(placed), source)
    return made, (*of_body, *of_axes, *_told(unplaced))


def _is_spectrum(header: FunctionHeader) -> bool:
    return header.function_type in SPECTRA and header.kinds[0] == FREQUENCY


def _pair(header: FunctionHeader) -> tuple[Dof, Dof] | None:
    response, reference = dof_of(*header.response), dof_of(*header.reference)
    if reference is None and header.function_type != CROSS:
        reference = response
    return None if response is None or reference is None else (response, reference)


def _quantities_of(placed: Sequence[tuple[MeasuredFunction, tuple[Dof, Dof]]]) -> dict[Dof, str]:
    """What the responses are, by the numerators, then by the denominators; if all known ones are one, so are all."""
    stated: dict[Dof, str] = {}
    for place in (0, 1):
        for one, pair in placed:
            if (kind := _QUANTITIES.get(one.header.kinds[1 + place])) is not None:
                stated.setdefault(pair[place], kind)
    known = set(stated.values())
    usual = known.pop() if len(known) == 1 else "unknown"
    return {dof: stated.get(dof, usual) for _, pair in placed for dof in pair}


def _check_lines(one: MeasuredFunction, first: MeasuredFunction) -> None:
    if len(one.x) != len(first.x) or not np.allclose(one.x, first.x, rtol=1e-6, atol=0.0):
        lines = {"first": first.x, "here": one.x}
        shown = {name: f"{len(x)}, {x[0]:g} to {x[-1]:g} Hz" for name, x in lines.items()}
        raise FemtuneError("identify.spectra/lines", where=one.where, values=shown)


def _told(unplaced: Sequence[MeasuredFunction]) -> Iterable[Notice]:
    if unplaced:
        reason = "cross spectra without response or reference node"
        yield Notice("uff.not-an-frf", where=unplaced[0].where, n_functions=len(unplaced), reason=reason)
