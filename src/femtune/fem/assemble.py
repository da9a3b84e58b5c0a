"""Matrices on the whole g-set at the values of the deck, for checks."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.fem.contribution import Contribution, MatrixKind
from femtune.fem.elements import contributions
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
    out = sp.csr_array((n, n))
    for batch in structure.batches:
        for term in contributions(batch, structure):
            if term.matrix == matrix:
                out = out + _scatter(batch.dofs[term.at], nominal_matrices(batch, structure, term), n)
    return sp.csr_array(out)


def _scatter(dofs: NDArray[np.int64], matrices: NDArray[np.float64], n: int) -> sp.csr_array:
    rows = np.broadcast_to(dofs[:, :, None], matrices.shape).ravel()
    cols = np.broadcast_to(dofs[:, None, :], matrices.shape).ravel()
    some = (rows >= 0) & (cols >= 0)
    return sp.csr_array((matrices.ravel()[some], (rows[some], cols[some])), shape=(n, n))
