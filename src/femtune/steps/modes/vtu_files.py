"""Mesh, mode shapes and values of parameters as VTU files, for ParaView and PyVista; requires meshio."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from femtune._optional import require
from femtune.errors import FemtuneError, Where
from femtune.files.whole_file import write_whole
from femtune.journal.run_files import VTU_FILE, numbered
from femtune.model.response.rigid import is_rigid
from femtune.steps.modes.shapes import grid_translations
from femtune.study.vtk_cells import vtk_cells

if TYPE_CHECKING:
    from femtune.model import EigenSolution
    from femtune.study.cases import StudyCase
    from femtune.study.study import Study
    from femtune.study.vtk_cells import Cells


def check_vtu(study: Study, path: Path) -> None:
    """Refuse, before anything is solved, what cannot be written.

    Raises
    ------
    FemtuneError : ``write.vtu``, ``install.missing``
    """
    if path.suffix != ".vtu":
        raise FemtuneError("write.vtu/suffix", where=Where(str(path)))
    if not path.parent.is_dir():
        raise FemtuneError("write.vtu", where=Where(str(path)), reason="the folder does not exist")
    check_cells(study, path)


def check_cells(study: Study, path: Path) -> None:
    """Refuse to write a model without elements, and a file that the installed libraries cannot write.

    Raises
    ------
    FemtuneError : ``write.vtu``, ``install.missing``
    """
    require("meshio", extra="vtu")
    if not (study.model.structure.nodes.has_coordinates and vtk_cells(study.model.structure)):
        raise FemtuneError("write.vtu/no-mesh", where=Where(str(path)))


def write_vtu_files(study: Study, x: NDArray, solved: Mapping[str, EigenSolution], path: Path) -> list[Path]:
    """A VTU file of each configuration that is solved: mesh, modes, values of the parameters at `x`.

    Parameters
    ----------
    solved : by name of the configuration
    path : file to write; with several configurations a number is added to its name

    Raises
    ------
    FemtuneError : ``write.vtu``, ``install.missing``
    """
    written = []
    for case, file in zip(study.cases, numbered(path, len(study.cases))):
        if case.name in solved:
            _write(case, x, solved[case.name], file)
            written.append(file)
    return written


def _write(case: StudyCase, x: NDArray, solution: EigenSolution, path: Path) -> None:
    meshio = require("meshio", extra="vtu")
    structure = case.configured.model.structure
    cells = vtk_cells(structure, case.configured.configuration.elements_off)
    motion = grid_translations(case.configured, solution)
    rigid = is_rigid(solution)
    names = [
        f"mode {j + 1}, {'rigid body' if rigid[j] else f'{solution.freq_hz[j]:.5g} Hz'}" for j in range(solution.wanted)
    ]
    shapes = {name: np.ascontiguousarray(motion[:, :, j]) for j, name in enumerate(names)}
    mesh = meshio.Mesh(
        structure.nodes.xyz,
        [(one.kind, one.nodes) for one in cells],
        point_data={"grid point": structure.nodes.ids, **shapes},
        cell_data={"element": [one.elements for one in cells], **_values(case, x, cells)},
    )
    try:
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / VTU_FILE
            meshio.write(file, mesh)
            write_whole(path, file.read_bytes())
    except OSError as error:
        raise FemtuneError("write.vtu", where=Where(str(path)), reason=error.strerror or str(error)) from error


def _values(case: StudyCase, x: NDArray, cells: Sequence[Cells]) -> dict[str, list[NDArray[np.float64]]]:
    """Of each field that a parameter sets, its value on the elements that use it; NaN on all others."""
    model = case.configured.model
    values = np.asarray(model.table(np.asarray(x, dtype=float)).value)
    fields = {}
    for name, position, _ in model.placed:
        users = model.structure.users(position)
        of_cells = [np.where(np.isin(one.elements, users), values[position], np.nan) for one in cells]
        label = f"{model.name_of(name)}: {model.structure.values.refs[position]}"
        if any(np.isfinite(one).any() for one in of_cells):
            fields[label] = of_cells
    return fields
