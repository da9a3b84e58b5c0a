"""Modes in a table that a script of the user wrote: a line a mode, or a line a node and direction."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from femtune.dofs import DIRECTIONS, parse_dof
from femtune.errors import FemtuneError, Where
from femtune.files.modes.solved import SolvedModes, lines_of, no_modes, number

_END = "end"


def read_plain_table(path: Path) -> SolvedModes:
    """A text of numbers separated by blanks or commas; ``#`` begins a comment, ``end`` is the last line.

    The first line has the frequencies in Hz. Each further line has a node with direction (``12Z+``) and its
    displacement in each mode. ``mass 12.5`` is the mass of the model. ``participation X`` (Y, Z, RX, RY, RZ) and a
    value for each mode are participation factors of shapes of unit modal mass.

    Raises
    ------
    FemtuneError : ``external.output`` in its variants
    """
    rows = [(i, line.partition("#")[0].replace(",", " ").split()) for i, line in enumerate(lines_of(path), start=1)]
    rows = [(i, words) for i, words in rows if words]
    if not rows or rows[-1][1] != [_END]:
        raise FemtuneError("external.output/truncated", where=Where(str(path)), expected=_END)
    mass, freq_hz = None, np.zeros(0)
    shapes: dict[int, np.ndarray] = {}
    participation: np.ndarray | None = None
    for i, words in rows[:-1]:
        if words[0].lower() == "mass" and len(words) == 2:
            mass = number(words[1], path, i)
        elif not len(freq_hz):
            freq_hz = np.array([number(word, path, i) for word in words])
        elif words[0].lower() == "participation":
            if participation is None:
                participation = np.full((6, len(freq_hz)), np.nan)
            _add_participation(participation, words, path, i)
        else:
            _add_row(shapes, words, len(freq_hz), path, i)
    if not len(freq_hz):
        raise no_modes(path, "a line of frequencies")
    if not shapes:
        return SolvedModes.of_frequencies(freq_hz, mass)
    nodes = sorted(shapes)
    shapes_at_nodes = np.stack([shapes[n] for n in nodes])
    return SolvedModes(freq_hz, np.array(nodes, np.int64), shapes_at_nodes, mass, participation)


def _add_participation(participation: np.ndarray, words: list[str], path: Path, line: int) -> None:
    count, label = participation.shape[1], " ".join(words[:2])
    if len(words) < 2 or words[1].upper() not in DIRECTIONS[1:]:
        raise FemtuneError("external.output/no-dof", where=Where(str(path), line), text=label[:20])
    if len(words) != count + 2:
        raise FemtuneError(
            "external.output/row", where=Where(str(path), line), dof=label, found=len(words) - 2, expected=count
        )
    participation[DIRECTIONS.index(words[1].upper()) - 1] = [number(word, path, line) for word in words[2:]]


def _add_row(shapes: dict[int, np.ndarray], words: list[str], count: int, path: Path, line: int) -> None:
    try:
        dof = parse_dof(words[0] if words[0][-1:] in "+-" else f"{words[0]}+")
    except FemtuneError as error:
        raise FemtuneError("external.output/no-dof", where=Where(str(path), line), text=words[0][:20]) from error
    if len(words) != count + 1 or not 1 <= dof.component <= 6:
        raise FemtuneError(
            "external.output/row", where=Where(str(path), line), dof=words[0], found=len(words) - 1, expected=count
        )
    of_node = shapes.setdefault(dof.node, np.full((6, count), np.nan))
    of_node[dof.component - 1] = [dof.sign * number(word, path, line) for word in words[1:]]
