"""Terms: element batches that share coefficient functions of the parameters; together they are the model."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.fem import Contribution, ElementBatch, Structure
from femtune.fem.contribution import MatrixKind
from femtune.fem.elements import contributions
from femtune.parameters import jet
from femtune.parameters.jet import Jet


@dataclass(frozen=True)
class Term:
    """Σ_e c[column_e](p) · matrix_e on the g-set.

    Parameters
    ----------
    matrix : "stiffness", "mass", "viscous" or "hysteretic"
    label : what it is, "bar axial"
    elements : (m,) element numbers, 0 for masses that a configuration adds
    dofs : (m, d) g-set DOFs, −1 for ground
    matrices : (m, d, d)
    columns : (m,) which coefficient an element uses
    n_columns : number of coefficients; one for a term that is a scalar times a matrix
    coefficient : jet of the value table -> jet of shape (n_columns,); None where it is the constant 1
    """

    matrix: MatrixKind
    label: str
    elements: NDArray[np.int64]
    dofs: NDArray[np.int64]
    matrices: NDArray[np.float64]
    columns: NDArray[np.int64]
    n_columns: int
    coefficient: Callable[[Jet], Jet] | None


def compile_terms(structure: Structure, touched: set[int]) -> tuple[Term, ...]:
    """Exact terms of a structure; elements that no touched value reaches fold into constant terms.

    `touched` are positions of the value table that parameters move, dependents included.
    """
    terms: list[Term] = []
    for batch in structure.batches:
        for part in contributions(batch, structure):
            terms += _terms_of(part, batch, structure, touched)
    return tuple(terms)


def _terms_of(part: Contribution, batch: ElementBatch, structure: Structure, touched: set[int]) -> list[Term]:
    at = np.stack([batch.roles[role][part.at] for role in part.roles], axis=1)
    moves = np.asarray(np.isin(at, list(touched)).any(axis=1)) & ~_lossless(part, batch, structure, touched)
    terms = [_constant(part, batch, structure, at, ~moves), _variable(part, batch, at, moves)]
    return [term for term in terms if term is not None]


def _lossless(part: Contribution, batch: ElementBatch, structure: Structure, touched: set[int]) -> NDArray[np.bool_]:
    """(m,) True where a loss factor is zero and no parameter moves it, so that its stiffness may move as it likes."""
    if part.matrix != "hysteretic":
        return np.zeros(len(part.at), bool)
    loss = batch.roles[part.loss][part.at]
    return np.asarray((structure.values.values[loss] == 0.0) & ~np.isin(loss, list(touched)))


def _constant(part: Contribution, batch: ElementBatch, structure: Structure, at: NDArray, mask: NDArray) -> Term | None:
    facts = {name: value[mask] for name, value in part.facts.items()}
    values = jet.constant(structure.values.values, 0)
    roles = {role: values[at[mask, i]] for i, role in enumerate(part.roles)}
    scale = part.coefficient(roles, facts).value if mask.any() else np.zeros(0)
    keep = np.flatnonzero(mask)[scale != 0.0]
    if not keep.size:
        return None
    matrices = part.matrices[keep] * scale[scale != 0.0, None, None]
    return _term(part, batch, keep, matrices, np.zeros(keep.size, np.int64), 1, None)


def _variable(part: Contribution, batch: ElementBatch, at: NDArray, mask: NDArray) -> Term | None:
    keep = np.flatnonzero(mask)
    if not keep.size:
        return None
    facts = [part.facts[name][keep] for name in part.facts]
    key = np.column_stack([at[keep].astype(float), *facts])
    _, first, columns = np.unique(key, axis=0, return_index=True, return_inverse=True)
    some = {name: part.facts[name][keep][first] for name in part.facts}
    places = {role: at[keep][first, i] for i, role in enumerate(part.roles)}

    def coefficient(table: Jet) -> Jet:
        return part.coefficient({role: table[i] for role, i in places.items()}, some)

    return _term(part, batch, keep, part.matrices[keep], columns.ravel(), len(first), coefficient)


def _term(
    part: Contribution,
    batch: ElementBatch,
    keep: NDArray,
    matrices: NDArray,
    columns: NDArray,
    n_columns: int,
    coefficient: Callable[[Jet], Jet] | None,
) -> Term:
    rows = part.at[keep]
    label = f"{batch.kind} {part.label}"
    return Term(part.matrix, label, batch.ids[rows], batch.dofs[rows], matrices, columns, n_columns, coefficient)
