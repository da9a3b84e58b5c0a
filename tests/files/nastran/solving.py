"""Dense solution of a built deck, with nothing but its matrices: the reference for tests of small models."""

from __future__ import annotations

import numpy as np
import scipy.linalg
import scipy.sparse as sp
import scipy.sparse.linalg
from numpy.typing import NDArray

from femtune.fem.assemble import assemble
from femtune.fem.elimination import Elimination, eliminate
from femtune.fem.singularities import singular_dofs
from femtune.fem.structure import Structure, join_constraints

Reals = NDArray[np.float64]


def reduced(structure: Structure) -> tuple[Reals, Reals, Reals]:
    """K and M on the free DOFs of the selected supports and equations, and T from them to the g-set."""
    one, stiffness, mass = _free(structure)
    return (one.T.T @ stiffness @ one.T).toarray(), (one.T.T @ mass @ one.T).toarray(), one.T.toarray()


def lowest(structure: Structure, n: int) -> Reals:
    """The n lowest natural frequencies in Hz of a larger model, rigid motions as zero."""
    one, stiffness, mass = _free(structure)
    K, M = (one.T.T @ matrix @ one.T for matrix in (stiffness, mass))
    shift = -1e-8 * K.diagonal().max() / M.diagonal().max()
    eigenvalues = np.sort(scipy.sparse.linalg.eigsh(K.tocsc(), n, M.tocsc(), sigma=shift, return_eigenvectors=False))
    return np.asarray(np.sqrt(np.maximum(eigenvalues, 0.0)) / (2 * np.pi))


def _free(s: Structure) -> tuple[Elimination, sp.csr_array, sp.csr_array]:
    """The free DOFs of the selected supports and equations, with K and M on the g-set."""
    stiffness, mass = (assemble(s, kind) + _given(s, kind) for kind in ("stiffness", "mass"))
    held = set(s.permanent.tolist())
    held |= set(s.support_sets[s.default_support_set].tolist()) if s.default_support_set is not None else set()
    mpc = [s.multipoint_sets[s.default_multipoint_set]] if s.default_multipoint_set is not None else []
    rows = join_constraints([s.rigid, *mpc])
    one = eliminate(s.nodes.n_dofs, rows, held, s.nodes.describe)
    if s.hold_singular:
        more = singular_dofs((one.T.T @ stiffness @ one.T).tocsr(), one.free, s.nodes)
        one = eliminate(s.nodes.n_dofs, rows, held | set(more.tolist()), s.nodes.describe)
    return one, stiffness, mass


def _given(s: Structure, kind: str) -> sp.csr_array:
    """Sum of the matrices that no element made, each with its factor."""
    found = sp.csr_array((s.nodes.n_dofs,) * 2)
    for matrix in (m for m in s.assembled if m.kind == kind):
        factor = s.values.values[matrix.roles["FACTOR"]] if matrix.roles else 1.0
        found = found + factor * (matrix.upper + sp.triu(matrix.upper, 1).T)
    return sp.csr_array(found)


def frequencies(structure: Structure) -> Reals:
    """Natural frequencies in Hz, ascending; DOFs that neither resist nor weigh are left out."""
    K, M, _ = reduced(structure)
    used = (np.abs(K).max(axis=1) > 0.0) | (np.abs(M).max(axis=1) > 0.0)
    K, M = K[np.ix_(used, used)], M[np.ix_(used, used)]
    # 1/(λ + shift) are the eigenvalues of M in the metric K + shift·M: massless DOFs give zero, not infinity
    shift = 1e-6 * np.trace(K) / np.trace(M)
    inverse = scipy.linalg.eigh(M, K + shift * M, eigvals_only=True)[::-1]
    inverse = inverse[inverse > 1e-12 * inverse[0]]
    return np.sqrt(np.maximum(1.0 / inverse - shift, 0.0)) / (2 * np.pi)
