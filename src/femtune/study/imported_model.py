"""A study of matrices: the model from its files, and its modes compared with the listed ones."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.errors import ErrorCollector, FemtuneError, Notice, Where
from femtune.files.built_model import BuiltModel
from femtune.files.matrices.calculix import read_dof_list
from femtune.files.matrices.listed_modes import read_listed_modes
from femtune.files.matrices.placement import INPUT_SUFFIXES, place_matrices, read_points
from femtune.files.matrices.read import read_matrix
from femtune.files.matrices.read_matrix import matrix_of_array
from femtune.files.nastran.build import build_structure
from femtune.files.nastran.deck import read_deck
from femtune.model import configure, parametric_model, solve_modes
from femtune.model.imported.model import ImportedMatrix, imported_structure
from femtune.model.imported.modes import check_modes
from femtune.model.imported.polynomial import MatrixSet, Variable
from femtune.parameters import ParameterSet
from femtune.study.cases import overlay
from femtune.study.drawn_mesh import mesh_beside
from femtune.study.error_places import errors_at
from femtune.study.model_source import model_source

if TYPE_CHECKING:
    from femtune.fem import NodeTable, Structure
    from femtune.files.matrices.placement import Placement
    from femtune.files.matrices.read_matrix import ReadMatrix
    from femtune.files.study_file import MatrixEntry, StudyFile
    from femtune.study.drawn_mesh import DrawnMesh

_FURTHER_MODES = 8
"""Modes beyond the listed ones: a listing may omit rigid-body modes, or modes that the solver missed."""
_NEGATIVE_DIAGONAL = 1e-9
"""Negative diagonal term relative to the largest one from which it is refused; smaller ones are rounding."""


def build_imported(file: StudyFile) -> BuiltModel:
    """The model of a study of matrices, as `build_structure` gives that of a deck.

    Raises
    ------
    FemtuneError : ``matrices.*``; problems of several files are shown together
    """
    matrices = _read_all(file)
    points = None if file.model.grid is None else read_points(file.path_of(file.model.grid))
    listed = None if file.model.dofs is None else read_dof_list(file.path_of(file.model.dofs))
    if file.given.dofs:
        listed = np.array(file.given.dofs, np.int64)
    with errors_at(file.where("model")):
        placed = place_matrices(matrices, listed, points)
    groups = _groups(file, matrices, placed)
    held = np.concatenate([np.zeros(0, np.int64), *(d[m.held] for m, d in zip(matrices, placed.dofs))])
    variables = [Variable(v.name, v.nominal, v.degree, v.crossed) for v in file.variable]
    with errors_at(file.where("matrix", 0)):
        imported = imported_structure(
            placed.nodes, placed.listed, groups, variables, held=held,
            hold_singular=file.model.hold_singular, tolerance=file.model.polynomial_tolerance,
        )  # fmt: skip
        _check_diagonals(imported.structure)
    notices = (*_facts(file, matrices), *placed.notices, *imported.notices)
    return BuiltModel(tuple(map(str, model_source(file).files)), imported.structure, notices)


def _read_all(file: StudyFile) -> list[ReadMatrix]:
    errors, matrices = ErrorCollector(), []
    for i, entry in enumerate(file.matrix):
        with errors.catch(), errors_at(file.where("matrix", i, "file")):
            given = file.given.matrices.get(entry.file)
            if given is not None:
                matrices.append(matrix_of_array(given, entry.name, Where(entry.file)))
            else:
                matrices.append(read_matrix(file.path_of(entry.file), entry.record, entry.format))
    errors.raise_if_any()
    return matrices


def _groups(file: StudyFile, matrices: Sequence[ReadMatrix], placed: Placement) -> list[ImportedMatrix]:
    """Matrices by name, those of one name as sets."""
    sets: dict[str, list[MatrixSet]] = {}
    first: dict[str, tuple[int, MatrixEntry]] = {}
    for i, (entry, matrix) in enumerate(zip(file.matrix, matrices)):
        upper = placed.on_g_set(matrix, i) * entry.factor
        first.setdefault(entry.name, (i, entry))
        sets.setdefault(entry.name, []).append(MatrixSet(sp.csr_array(upper), entry.at, matrix.where))
    return [
        ImportedMatrix(name, entry.kind, tuple(sets[name]), file.where("matrix", i))
        for name, (i, entry) in first.items()
    ]


def _facts(file: StudyFile, matrices: Sequence[ReadMatrix]) -> list[Notice]:
    """Notices of what was read from each file."""
    return [
        Notice(
            "matrices.read",
            where=m.where,
            level="info",
            name=e.name,
            kind=e.kind,
            rows=m.size,
            description=m.facts,
        )
        for e, m in zip(file.matrix, matrices)
    ]


def _check_diagonals(structure: Structure) -> None:
    """Refuse a negative diagonal of the whole stiffness or mass as imported (error ``matrices.negative-diagonal``)."""
    for kind in ("stiffness", "mass"):
        total = np.zeros(structure.nodes.n_dofs)
        for m in structure.assembled:
            if m.kind == kind and set(m.roles) == {"FACTOR"}:
                total += m.upper.diagonal()
        several = any(m.kind == kind and len(m.roles) > 1 for m in structure.assembled)
        bad = np.flatnonzero(total < -_NEGATIVE_DIAGONAL * np.abs(total).max(initial=0.0))
        if bad.size and not several:
            raise _negative(structure, kind, total, bad)


def _negative(structure: Structure, kind: str, total: NDArray[np.float64], bad: NDArray[np.int64]) -> FemtuneError:
    worst = int(bad[np.argmin(total[bad])])
    return FemtuneError(
        "matrices.negative-diagonal",
        values={"DOF": str(structure.nodes.describe(worst))[:-1], "value": total[worst], "such DOFs": bad.size},
        kind=kind,
    )


def mesh_of_grid(file: StudyFile, nodes: NodeTable) -> DrawnMesh | None:
    """The mesh of the deck that gave the coordinates, for drawings; None if there is none, or it is not a complete
    deck."""
    if file.model.grid is None or not len(nodes.ids) or Path(file.model.grid).suffix.lower() in INPUT_SUFFIXES:
        return None
    try:
        mesh = mesh_beside(build_structure(read_deck(file.path_of(file.model.grid)), True).structure, nodes)
    except FemtuneError:
        # its coordinates were read, although something else in it is wrong
        return None
    return mesh if len(mesh.lines) or len(mesh.faces) else None


def compare_listed(file: StudyFile, structure: Structure) -> Notice:
    """Compare the modes of the first configuration with those that the solver listed.

    Raises
    ------
    FemtuneError : ``matrices.modes-differ``, ``matrices.no-listing``
    """
    table = file.model
    listed = table.listed_hz or (read_listed_modes(file.path_of(table.listing)) if table.listing else ())
    if not listed:
        return Notice("matrices.not-compared", where=file.where("model"))
    base = parametric_model(structure, ParameterSet(()), ())
    point = configure(base, overlay(file.configurations[0])).at(np.zeros(0))
    solution = solve_modes(point, len(listed) + _FURTHER_MODES)
    where = _where_listed(file)
    compared = check_modes(point, solution.freq_hz, listed, table.listed_tolerance, where)
    rounded = compared.excess < compared.difference > table.listed_tolerance
    return Notice(
        "matrices.compared/rounded" if rounded else "matrices.compared",
        where=where, level="info", count=len(compared.listed),
        difference_percent=100 * compared.difference, rounding_hz=compared.rounding,
    )  # fmt: skip


def _where_listed(file: StudyFile) -> Where:
    return file.where("model", "listed_hz" if file.model.listed_hz else "listing")
