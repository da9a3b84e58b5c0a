"""Expanded test shapes as Universal Files, on the mesh of the model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError, Where
from femtune.files.uff import write_uff_modes
from femtune.steps.correlate.expansion import expanded_modes
from femtune.steps.respond.run import id_line
from femtune.study.drawn_mesh import whole_mesh
from femtune.testdata import NO_GEOMETRY, ModalTest, WireFrame

if TYPE_CHECKING:
    from femtune.modal import ModeSet
    from femtune.steps.correlate.record.correlation import CorrelationResults
    from femtune.study.cases import StudyCase
    from femtune.study.study import Study


def check_expansion_asked(study: Study, path: Path) -> None:
    """Refuse a file of expanded shapes that a study does not request (error ``correlate.no-expansion``)."""
    if study.file.correlate.expand == "none":
        raise FemtuneError("correlate.no-expansion", where=Where(str(path)))


def write_expanded_files(
    study: Study, correlations: Sequence[CorrelationResults], arrays: Mapping[str, NDArray], paths: Sequence[Path]
) -> list[Path]:
    """The expanded shapes of each configuration as a Universal File (data set 55); errors ``uff.cannot-write``.

    Modes that could not be expanded are left out. A configuration without expanded modes or grid points has no file.
    """
    written = []
    for case, path in zip(study.cases, paths):
        record = next((c.expansion for c in correlations if c.configuration == case.name), None)
        if record is None:
            continue
        modes = expanded_modes(record, arrays)
        if len(modes) and len(modes.dofs):
            write_uff_modes(path, _as_test(study, case, modes), (f"femtune: {modes.source}",))
            written.append(path)
    return written


def _as_test(study: Study, case: StudyCase, modes: ModeSet) -> ModalTest:
    frame = _mesh(case) if case.configured.model.structure.nodes.has_coordinates else NO_GEOMETRY
    return ModalTest(id_line(case.name), study.file.study.unit_system, frame, modes=_numbered(modes))


def _numbered(modes: ModeSet) -> ModeSet:
    """The modes with numbers as labels, as the format requires: their own, or from 1."""
    are_numbers = all(label.isdecimal() and int(label) > 0 for label in modes.labels)
    return modes if are_numbers else replace(modes, labels=tuple(str(j + 1) for j in range(len(modes))))


def _mesh(case: StudyCase) -> WireFrame:
    structure = case.configured.model.structure
    nodes = structure.nodes
    mesh = case.mesh or whole_mesh(structure, case.configured.configuration.elements_off)
    ids = np.append(nodes.ids, 0)
    elements = [*ids[mesh.lines].tolist(), *([n for n in face if n] for face in ids[mesh.faces].tolist())]
    return WireFrame(nodes.ids, nodes.xyz, elements=tuple(map(tuple, elements)))
