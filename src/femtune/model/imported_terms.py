"""Terms of assembled matrices: one coefficient each, as sparse matrices on the g-set."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.fem import AssembledMatrix, Structure
from femtune.fem.values import TableJet
from femtune.model.term import MatrixTerm
from femtune.model.terms import CompiledTerms
from femtune.parameters import jet
from femtune.parameters.jet import Jet


def with_assembled(compiled: CompiledTerms, structure: Structure, touched: set[int]) -> CompiledTerms:
    """The terms of the elements with one term for each assembled matrix.

    `touched` are positions of the value table that parameters move, dependents included.
    """
    if not structure.assembled:
        return compiled
    used = {kind: flags.copy() for kind, flags in compiled.used.items()}
    for matrix in structure.assembled:
        used[matrix.kind][list(matrix.roles.values())] = True
    terms = [_term(matrix, structure, matrix.depends_on(touched)) for matrix in structure.assembled]
    return CompiledTerms((*compiled.terms, *terms), used)


def _term(matrix: AssembledMatrix, structure: Structure, moves: bool) -> MatrixTerm:
    coefficient = matrix.coefficient
    if coefficient is None or not moves:
        scale = factor_at(matrix, structure.values.values)
        return MatrixTerm(matrix.kind, matrix.label, 1, None, sp.csr_array(scale * matrix.upper))

    def moving_one(table: TableJet) -> Jet:
        return coefficient({name: table[np.array([i])] for name, i in matrix.roles.items()}, {})

    return MatrixTerm(matrix.kind, matrix.label, 1, moving_one, matrix.upper)


def factor_at(matrix: AssembledMatrix, table: NDArray) -> float | complex:
    """Coefficient of an assembled matrix at a value table (n,)."""
    if matrix.coefficient is None:
        return 1.0
    values = {name: jet.constant(table[[i]], 0) for name, i in matrix.roles.items()}
    found: float | complex = matrix.coefficient(values, {}).value[0].item()
    return found
