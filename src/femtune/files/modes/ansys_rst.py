"""Modes of Ansys: frequencies and shapes of a result file (.rst) of a modal analysis, through ansys-mapdl-reader."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from femtune.arrays import Reals
from femtune.errors import FemtuneError, Where
from femtune.files.ansys_process import Arrays, arrays_of
from femtune.files.modes.solved import MOST_BYTES, SolvedModes, no_modes

_COMPONENTS = ("UX", "UY", "UZ", "ROTX", "ROTY", "ROTZ")
_MODAL_ANALYSIS = 2
"""Type of analysis `kan` of a modal analysis in the header of a result file."""


def read_rst(path: Path) -> SolvedModes:
    """Frequencies and shapes in the nodal coordinate systems, in the scale of the file (unit modal mass by default).

    Raises
    ------
    FemtuneError : ``external.output`` in its variants, ``install.missing``, ``install.broken``
    """
    where = Where(str(path))
    if not path.is_file():
        raise FemtuneError("external.output/missing", where=where)
    if path.stat().st_size > MOST_BYTES:
        raise FemtuneError("external.output/too-large", where=where, size_gib=path.stat().st_size / 2**30)
    data = arrays_of(path, modes_of, "external.output/unreadable", where)
    modes = SolvedModes(data["freq_hz"], data["nodes"], data["shapes"])
    if not len(modes.freq_hz):
        raise no_modes(path, "a modal analysis")
    return modes


def modes_of(file: Any) -> Arrays:
    """Frequencies, nodes and shapes of a result file; none where it is of another analysis."""
    modes = _modes(file) or SolvedModes.of_frequencies(np.zeros(0))
    return {"freq_hz": modes.freq_hz, "nodes": modes.nodes, "shapes": modes.shapes}


def _modes(file: Any) -> SolvedModes | None:
    if file._resultheader["kan"] != _MODAL_ANALYSIS:
        return None
    freq_hz = np.array(file.time_values, dtype=float)
    shapes: list[Reals] = []
    nodes = np.zeros(0, np.int64)
    for j in range(len(freq_hz)):
        numbers, values = file.nodal_solution(j, in_nodal_coord_sys=True)
        block = np.full((len(numbers), 6), np.nan)
        for column, name in enumerate(file.result_dof(j)):
            if name in _COMPONENTS:
                block[:, _COMPONENTS.index(name)] = values[:, column]
        nodes = np.asarray(numbers, np.int64)
        shapes.append(block)
    if not shapes:
        return None
    order = np.argsort(nodes, kind="stable")
    return SolvedModes(freq_hz, nodes[order], np.stack(shapes, axis=-1)[order])
