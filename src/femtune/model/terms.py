"""Terms: element batches that share coefficient functions of the parameters; together they are the model."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from femtune.fem import Contribution, ElementBatch, Structure
from femtune.fem.contribution import MatrixKind
from femtune.fem.elements import contributions
from femtune.fem.values import TableJet
from femtune.parameters import jet
from femtune.parameters.jet import Jet

Flags = NDArray[np.bool_]


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
    coefficient: Callable[[TableJet], Jet] | None


@dataclass(frozen=True)
class CompiledTerms:
    """The terms of a structure, and (n,) True for the entries of the value table that some coefficient depends on."""

    terms: tuple[Term, ...]
    used: Flags


def compile_terms(structure: Structure, touched: set[int]) -> CompiledTerms:
    """Exact terms of a structure; what no touched value reaches folds into one constant term a batch and matrix.

    `touched` are positions of the value table that parameters move, dependents included.
    """
    terms: list[Term] = []
    moving = np.zeros(len(structure.values.values), bool)
    moving[list(touched)] = True
    used = np.zeros(len(moving), bool)
    for batch in structure.batches:
        constant = _Constant(batch)
        for part in contributions(batch, structure):
            at = np.stack([batch.roles[role][part.at] for role in part.roles], axis=1)
            used[at] = True
            moves = np.asarray(moving[at].any(axis=1)) & ~_lossless(part, batch, structure, moving)
            constant.add(part, structure, at, ~moves)
            terms += [term for term in [_variable(part, batch, at, moves)] if term is not None]
        terms += constant.terms()
    return CompiledTerms(tuple(terms), used)


@dataclass
class _Constant:
    """Sums of the constant contributions of a batch, by kind of matrix."""

    batch: ElementBatch
    sums: dict[MatrixKind, NDArray[np.float64]] = field(default_factory=dict)

    def add(self, part: Contribution, structure: Structure, at: NDArray, mask: Flags) -> None:
        """The elements of a contribution where the mask is true."""
        facts = {name: value[mask] for name, value in part.facts.items()}
        values = jet.constant(structure.values.values, 0)
        roles = {role: values[at[mask, i]] for i, role in enumerate(part.roles)}
        scale = part.coefficient(roles, facts).value if mask.any() else np.zeros(0)
        keep = np.flatnonzero(mask)[scale != 0.0]
        if keep.size:
            shape = (len(self.batch), *part.matrices.shape[1:])
            total = self.sums.setdefault(part.matrix, np.zeros(shape))
            total[part.at[keep]] += part.matrices[keep] * scale[scale != 0.0, None, None]

    def terms(self) -> list[Term]:
        """One term a kind of matrix, of the elements that have one."""
        return [self._term(matrix, total) for matrix, total in self.sums.items()]

    def _term(self, matrix: MatrixKind, total: NDArray[np.float64]) -> Term:
        some = np.flatnonzero(total.any(axis=(1, 2)))
        ids, dofs = self.batch.ids[some], self.batch.dofs[some]
        return Term(
            matrix, f"{self.batch.kind} constant", ids, dofs, total[some], np.zeros(some.size, np.int64), 1, None
        )


def _lossless(part: Contribution, batch: ElementBatch, structure: Structure, moving: Flags) -> Flags:
    """(m,) True where a loss factor is zero and no parameter moves it, so that its stiffness may move as it likes."""
    if part.matrix != "hysteretic":
        return np.zeros(len(part.at), bool)
    loss = batch.roles[part.loss][part.at]
    return np.asarray((structure.values.values[loss] == 0.0) & ~moving[loss])


def _variable(part: Contribution, batch: ElementBatch, at: NDArray, mask: NDArray) -> Term | None:
    keep = np.flatnonzero(mask)
    if not keep.size:
        return None
    facts = [part.facts[name][keep] for name in part.facts]
    first, columns = _distinct([*at[keep].T, *facts])
    some = {name: part.facts[name][keep][first] for name in part.facts}
    places = {role: at[keep][first, i] for i, role in enumerate(part.roles)}

    def coefficient(table: TableJet) -> Jet:
        return part.coefficient({role: table[i] for role, i in places.items()}, some)

    rows, label = part.at[keep], f"{batch.kind} {part.label}"
    matrices = part.matrices[keep]
    return Term(
        part.matrix, label, batch.ids[rows], batch.dofs[rows], matrices, columns, len(first), coefficient
    )  # fmt: skip


def _distinct(columns: list[NDArray]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """First of the rows that are alike in all columns, for each kind of row; and the kind of each row."""
    kinds = np.zeros(len(columns[0]), np.int64)
    for column in (part for c in columns for part in np.atleast_2d(c.T)):
        _, found = np.unique(column, return_inverse=True)
        _, kinds = np.unique(kinds * (found.max(initial=0) + 1) + found, return_inverse=True)
    _, first = np.unique(kinds, return_index=True)
    return first, kinds
