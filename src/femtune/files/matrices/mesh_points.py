"""Coordinates of grid points for matrices: from a Nastran deck, or the *NODE blocks of an Abaqus or CalculiX file."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError, Where
from femtune.fem.structure import NodeTable
from femtune.files.matrices.text_blocks import line_blocks
from femtune.files.nastran.build import raise_distinct
from femtune.files.nastran.building import Building
from femtune.files.nastran.deck import read_deck
from femtune.files.nastran.grids import read_grids

_NODE = re.compile(rb"\s*\*NODE\s*(,|$)", re.IGNORECASE)
INPUT_SUFFIXES = (".inp", ".msh")


def read_points(path: Path) -> NodeTable:
    """Grid points (with displacement frames, where the file is a deck) and scalar points.

    Raises
    ------
    FemtuneError : ``matrices.points``, and ``deck.*`` for a deck
    """
    if path.suffix.lower() in INPUT_SUFFIXES:
        return _of_input(path)
    building = Building(read_deck(path))
    table = read_grids(building).table
    raise_distinct(building.errors)
    return table


def _of_input(path: Path) -> NodeTable:
    ids: list[int] = []
    xyz: list[list[float]] = []
    inside, number = False, 0
    for block in line_blocks(path):
        for text in block.content.splitlines():
            number += 1
            if text.startswith(b"**") or not text.strip():
                continue
            if text.lstrip().startswith(b"*"):
                inside = _NODE.match(text) is not None
            elif inside:
                node, place = _node(path, number, text)
                ids.append(node)
                xyz.append(place)
    return _table(path, np.array(ids, np.int64), np.array(xyz, float).reshape(-1, 3))


def _node(path: Path, line: int, text: bytes) -> tuple[int, list[float]]:
    try:
        node, *place = text.replace(b",", b" ").split()
        values = [float(x) for x in place[:3]]
        return int(node), [*values, *([0.0] * (3 - len(values)))]
    except ValueError as error:
        what = "this line of a *NODE block is no node"
        shown = {"line": f"'{text[:60].decode('latin-1')}'"}
        raise _error(path, line, what, shown, "write number, x, y, z") from error


def _table(path: Path, ids: NDArray[np.int64], xyz: NDArray[np.float64]) -> NodeTable:
    if not len(ids):
        raise _error(
            path, None, "the file has no *NODE block", {}, "name the file with the nodes, INCLUDEs are not read"
        )
    order = np.argsort(ids, kind="stable")
    ids, xyz = ids[order], xyz[order]
    twice = np.flatnonzero(np.diff(ids) == 0)
    if twice.size:
        raise _error(path, None, f"node {ids[twice[0]]} is given twice", {}, "keep one of them")
    return NodeTable(ids, xyz, np.tile(np.eye(3), (len(ids), 1, 1)))


def _error(path: Path, line: int | None, what: str, values: dict[str, str], hint: str) -> FemtuneError:
    return FemtuneError("matrices.points", what, where=Where(str(path), line), values=dict(values), hint=hint)
