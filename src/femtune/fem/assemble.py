"""Matrices on the whole g-set at the values of the deck, for checks."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.arrays import Integers, Reals
from femtune.fem.contribution import Contribution
from femtune.fem.elements import pieces
from femtune.fem.elements.tapered_beam import TAPERED_BEAM
from femtune.fem.fields import MatrixKind
from femtune.fem.structure import ElementBatch, Structure
from femtune.parameters import jet


def nominal_matrices(batch: ElementBatch, structure: Structure, term: Contribution) -> NDArray[np.float64]:
    """(m, d, d) coefficient times matrix of each element at the deck's values."""
    values = structure.values.values
    roles = {r: jet.constant(values[batch.roles[r][term.at]], 0) for r in term.roles}
    return np.asarray(term.coefficient(roles, term.facts).value[:, None, None] * term.matrices)


def assemble(structure: Structure, matrix: MatrixKind) -> sp.csr_array:
    """(n_g, n_g) stiffness or mass matrix before any constraint."""
    n = structure.nodes.n_dofs
    empty = np.zeros(0, np.int64)
    parts = [(empty, empty, np.zeros(0))]
    for batch in structure.batches:
        for term in (part for piece in pieces(batch, structure) for part in piece):
            if term.matrix == matrix:
                parts.append(_entries(batch.dofs[term.at], nominal_matrices(batch, structure, term)))
    rows, cols, values = (np.concatenate(arrays) for arrays in zip(*parts))
    return sp.csr_array((values, (rows, cols)), shape=(n, n))


def offset_mass(structure: Structure, absent: Collection[int] = ()) -> tuple[sp.csr_array, int]:
    """Part of the mass matrix (n_g, n_g) due to neutral axes off the shear centres, and the number of such elements.

    Subtracted from the mass matrix, it leaves that of a model whose beams have their structural mass on the line of
    their shear centres. Elements whose numbers are in `absent` are left out.
    """
    n, offset = structure.nodes.n_dofs, sp.csr_array((structure.nodes.n_dofs,) * 2)
    elements: set[int] = set()
    for batch in structure.batches:
        if batch.kind != TAPERED_BEAM.key:
            continue
        for term in (part for piece in pieces(batch, structure) for part in piece):
            if term.matrix != "mass" or not any(role.startswith(("N1@", "N2@")) for role in term.roles):
                continue
            matrices = nominal_matrices(batch, structure, term)
            there = ~np.isin(batch.ids[term.at], list(absent)) & matrices.any(axis=(1, 2))
            rows, cols, values = _entries(batch.dofs[term.at[there]], matrices[there])
            offset = offset + sp.csr_array((values, (rows, cols)), shape=(n, n))
            elements.update(batch.ids[term.at[there]].tolist())
    return offset, len(elements)


def _entries(dofs: Integers, matrices: Reals) -> tuple[Integers, Integers, Reals]:
    rows = np.broadcast_to(dofs[:, :, None], matrices.shape).ravel()
    cols = np.broadcast_to(dofs[:, None, :], matrices.shape).ravel()
    some = (rows >= 0) & (cols >= 0)
    return rows[some], cols[some], matrices.ravel()[some]
