"""Nastran DMIG cards of a punch file or deck as a matrix with named rows."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from femtune.errors import Where
from femtune.files.matrices.read_matrix import Entries, ReadMatrix, matrix_from
from femtune.files.nastran.deck import read_deck
from femtune.files.nastran.matrices import check_one_triangle, dmig_matrix


def read_dmig(path: Path, name: str | None = None) -> ReadMatrix:
    """A matrix of a punch file or deck; the first one where no name is asked for.

    Raises
    ------
    FemtuneError : ``matrices.no-such-matrix``, ``matrices.dmig``, ``matrices.not-square``, ``matrices.*``, and
        ``deck.*`` for what is wrong with the cards
    """
    dmig = dmig_matrix(read_deck(path), name)
    key = np.concatenate([dmig.row, dmig.col])
    names, at = np.unique(key[:, 0] * 8 + key[:, 1], return_inverse=True)
    rows = np.stack([names // 8, names % 8], axis=1)
    row, col = at.reshape(2, -1)
    entries = Entries(row, col, dmig.value, (len(rows), len(rows)), rows, lambda i: dmig.cards[i].where())
    check_one_triangle(dmig, row, col)
    return matrix_from(entries, dmig.header.name, Where(str(path), None, f"DMIG {dmig.header.name}"))
