"""Modes of CalculiX: frequencies from a .dat file, frequencies and shapes from a .frd file.

The .frd file has frequencies of six to ten digits and shapes of six. Both files are written step by step, so that a
file of a run that was killed is recognised by its end.

Participation factors follow from the forces at the supports (RF). With K r = 0 for a rigid-body motion r of the whole
model, φᵀMr = φᵀKr/ω² = −(sum of the support forces along r)/ω²; what the mass matrix couples to the supports is left
out. The factors of the .dat file are not used: for C3D8I elements they are three times as large.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from femtune.arrays import Reals
from femtune.files.modes.solved import SolvedModes, lines_of, no_modes, number, of_blocks, truncated

_ROW = re.compile(r"\s*(\d+)\s+([-+.\dED]+)\s+([-+.\dED]+)\s+([-+.\dED]+)\s+([-+.\dED]+)\s*")
_TITLE = "EIGENVALUEOUTPUT"
_NEXT_TITLE = "PARTICIPATIONFACTORS"
_END = " 9999"
_NUMBER_WIDTH = 12
"""Columns of a number in a .frd file."""


def read_dat(path: Path) -> SolvedModes:
    """Frequencies of the last table of eigenvalues of a .dat file.

    Raises
    ------
    FemtuneError : ``external.output`` in its variants
    """
    freq_hz: list[float] = []
    inside = complete = False
    for i, line in enumerate(lines_of(path), start=1):
        title = line.replace(" ", "").strip()
        if title == _TITLE:
            freq_hz, inside, complete = [], True, False
        elif title == _NEXT_TITLE:
            inside, complete = False, True
        elif inside and (row := _ROW.fullmatch(line)):
            freq_hz.append(_frequency(number(row[2], path, i), number(row[4], path, i), number(row[5], path, i)))
    if not freq_hz:
        raise no_modes(path, "E I G E N V A L U E   O U T P U T")
    if not complete:
        raise truncated(path, "P A R T I C I P A T I O N   F A C T O R S")
    return SolvedModes.of_frequencies(np.array(freq_hz))


def _frequency(eigenvalue: float, freq_hz: float, imaginary: float) -> float:
    """A negative eigenvalue is listed with an imaginary frequency."""
    return float("nan") if eigenvalue < 0.0 and imaginary > 0.0 else freq_hz


def read_frd(path: Path) -> SolvedModes:
    """Frequencies and shapes of a .frd file: ``*NODE FILE`` with U, for shells and beams with ``OUTPUT=2D``.

    With RF of solid elements there are participation factors as well, if the nodes in the file include all supports.

    Raises
    ------
    FemtuneError : ``external.output`` in its variants
    """
    lines = lines_of(path)
    if not lines or lines[-1].rstrip() != _END:
        raise truncated(path, "9999")
    freq_hz: list[float] = []
    blocks: dict[int, dict[int, Reals]] = {}
    forces: list[dict[int, Reals]] = []
    for i, line in enumerate(lines):
        if not line.startswith("  100CL") or "MODAL" not in line or i + 1 == len(lines):
            continue
        if lines[i + 1].split()[:2] == ["-4", "DISP"]:
            freq_hz.append(number(line[12:24], path, i + 1))
            blocks[len(freq_hz)] = dict(_shape(lines, i + 2, path))
        elif lines[i + 1].split()[:2] == ["-4", "FORC"]:
            forces.append(dict(_shape(lines, i + 2, path)))
    if not freq_hz:
        raise no_modes(path, "100CL … MODAL")
    modes = of_blocks(np.array(freq_hz), blocks, path, None)
    if len(forces) != len(freq_hz) or any(sorted(f) != modes.nodes.tolist() for f in forces):
        return modes
    start = next((i for i, line in enumerate(lines) if line.startswith("    2C")), len(lines))
    return replace(modes, participation=_participation(modes, dict(_shape(lines, start + 1, path)), forces))


def _participation(modes: SolvedModes, xyz: Mapping[int, Reals], forces: Sequence[Mapping[int, Reals]]) -> Reals | None:
    """(6, m) from the forces where nothing moves; None unless there are forces in all three directions.

    At nodes of beams and shells, whose section is tied to them, forces are missing.
    """
    held = (modes.shapes[:, :3] == 0.0).all(axis=2)
    if not all(int(n) in xyz for n in modes.nodes):
        return None
    places = np.array([xyz[int(n)][:3] for n in modes.nodes])
    at_supports = np.array([[held[i] * mode[int(n)][:3] for i, n in enumerate(modes.nodes)] for mode in forces])
    if not at_supports.any(axis=(0, 1)).all():
        return None
    pushed = np.concatenate([at_supports, np.cross(places, at_supports)], axis=2).sum(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(-pushed.T / (2.0 * np.pi * modes.freq_hz) ** 2)


def _shape(lines: list[str], at: int, path: Path) -> Iterator[tuple[int, Reals]]:
    """Node and components of one block, from the lines after its heading."""
    for i in range(at, len(lines)):
        key = lines[i][:3]
        if key == " -5":
            continue
        if key != " -1":
            return
        texts = [lines[i][13 + _NUMBER_WIDTH * k : 13 + _NUMBER_WIDTH * (k + 1)] for k in range(3)]
        values = [number(text, path, i + 1) for text in texts]
        yield int(number(lines[i][3:13], path, i + 1)), np.array([*values, np.nan, np.nan, np.nan])
