"""Damping ratios of modes that are parameters: values of the model, though no card of the deck holds them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from femtune.fem import ALL_MODES, MODAL, FieldRef, with_mode_ratios
from femtune.files.nastran.build import BuiltModel
from femtune.files.study_file import StudyFile
from femtune.files.study_file.kinds import field_reference


def with_parameters_of_modes(file: StudyFile, built: BuiltModel) -> BuiltModel:
    """The model with the damping ratios that parameters name (``MODAL 3 ZETA``, ``MODAL ZETA`` for all others).

    They start at the ratios of [response], where it has them.
    """
    numbers = [ref.id for ref in _named(file) if ref.card == MODAL]
    return _with(built, {number: _start(file, number) for number in sorted(set(numbers))})


def with_updated_ratios(built: BuiltModel, values: Mapping[FieldRef, float]) -> BuiltModel:
    """The model of a written deck, which says nothing of modes, with the ratios that an update found."""
    return _with(built, {ref.id: value for ref, value in values.items() if ref.card == MODAL})


def _with(built: BuiltModel, ratios: Mapping[int, float]) -> BuiltModel:
    return replace(built, structure=with_mode_ratios(built.structure, ratios)) if ratios else built


def _named(file: StudyFile) -> list[FieldRef]:
    return [field_reference(text) for entry in file.parameter for text in entry.fields]


def _start(file: StudyFile, number: int) -> float:
    table = file.response
    if table is None:
        return 0.0
    if number != ALL_MODES and table.ratios is not None and number <= len(table.ratios):
        return table.ratios[number - 1]
    return table.ratio or 0.0
