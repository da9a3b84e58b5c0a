"""Identified damping values of a run, for the catalogue that later studies use."""

from __future__ import annotations

import datetime
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from femtune.files.damping_catalogue import DampingEntry, write_catalogue
from femtune.journal.run_files import CATALOGUE_FILE
from femtune.steps.run_folder import unwritable

if TYPE_CHECKING:
    from femtune.fem.fields import FieldRef
    from femtune.files.study_file import Parameter
    from femtune.steps.update.record.update import ParameterResult, UpdateResults
    from femtune.study.study import Study

_PLACES = {"PARAM": "structure", "MODAL": "mode"}
_MATERIALS = ("MAT", "PCOMP")


def write_damping(study: Study, update: UpdateResults, folder: Path) -> Path | None:
    """damping.toml of the run folder; None where no damping was found with a standard deviation.

    Raises
    ------
    FemtuneError : ``run.unwritable``
    """
    path = folder / CATALOGUE_FILE
    results = {p.name: p for p in update.parameters}
    expanded = ((name, p) for p in study.file.parameter for name in study.expand((p.name,)))
    written_entries = ((name, _entry(study, p, results.get(name))) for name, p in expanded)
    entries = [
        replace(entry, name=name, source=_source(study, update, name))
        for name, entry in written_entries
        if entry is not None
    ]
    try:
        return write_catalogue(path, entries) if entries else None
    except OSError as error:
        raise unwritable(folder, error) from error


def _entry(study: Study, entry: Parameter, parameter: ParameterResult | None) -> DampingEntry | None:
    if parameter is None or parameter.sd is None or not parameter.sd > 0.0 or not entry.moves_damping:
        return None
    scale = 1.0 if entry.absolute else _value_of_all(study, entry.targets)
    if not scale:
        return None
    today = datetime.datetime.now(datetime.UTC).date().isoformat()
    return DampingEntry(
        name=entry.name,
        of=_kind(entry.targets[0]),
        fields=tuple(map(str, entry.targets)),
        value=scale * parameter.value,
        sd=scale * parameter.sd,
        unit=entry.unit if entry.absolute else "",
        source=study.source.name,
        date=today,
        study=study.file.study.title[:500],
    )


def _value_of_all(study: Study, refs: tuple[FieldRef, ...]) -> float | None:
    """The deck's value that all fields share; None where they differ."""
    table = study.built.structure.values
    values = {float(table.values[i]) for ref in refs if (i := table.index(ref)) is not None}
    return next(iter(values)) if len(values) == 1 else None


def _kind(ref: FieldRef) -> str:
    return _PLACES.get(ref.card, "material" if ref.card.startswith(_MATERIALS) else "joint")


def _source(study: Study, update: UpdateResults, name: str) -> str:
    """The deck and the configurations that gave the value; the last stage that updated it."""
    stages = [s for s in update.stages if name in (p.name for p in s.parameters)]
    used = stages[-1].configurations if stages else [case.name for case in study.cases if case.used is not None]
    stage = f", stage {stages[-1].name}" if stages else ""
    return f"{study.source.name}: {', '.join(used)}{stage}"[:500]
