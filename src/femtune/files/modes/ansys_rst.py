"""Modes of Ansys: frequencies and shapes of a result file (.rst) of a modal analysis, through ansys-mapdl-reader."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from femtune._optional import require
from femtune.arrays import Reals
from femtune.errors import FemtuneError, Where
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
    require("ansys.mapdl.reader", extra="ansys")
    with TemporaryDirectory() as folder:
        target = Path(folder) / "modes.npz"
        code = "import sys; from femtune.files.modes.ansys_rst import convert; convert(*sys.argv[1:])"
        # a process of its own: on files that are cut the library ends the process that it runs in
        command = [sys.executable, "-c", code, str(path), str(target)]
        done = subprocess.run(command, capture_output=True, text=True, errors="replace", check=False)
        if not target.is_file():
            last = done.stderr.strip().splitlines()[-1:] if done.returncode == 1 else []
            reason = last[0] if last else "the reading library crashed"
            raise FemtuneError("external.output/unreadable", where=where, reason=reason[:200])
        with np.load(target, allow_pickle=False) as data:
            modes = SolvedModes(data["freq_hz"], data["nodes"], data["shapes"])
    if not len(modes.freq_hz):
        raise no_modes(path, "a modal analysis")
    return modes


def convert(source: str, target: str) -> None:
    """Modes of a .rst file as arrays in an .npz file; none where it is of another analysis (errors of the library)."""
    library = require("ansys.mapdl.reader", extra="ansys")
    modes = _modes(library.read_binary(source)) or SolvedModes.of_frequencies(np.zeros(0))
    part = Path(target).with_suffix(".part.npz")
    np.savez(part, freq_hz=modes.freq_hz, nodes=modes.nodes, shapes=modes.shapes)
    part.rename(target)


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
