"""Term: element matrices, or one sparse matrix, times functions of the parameters."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.fem.contribution import MatrixKind
from femtune.fem.values import TableJet
from femtune.parameters.jet import Jet

Reals = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]

# elements whose full matrices are made at once
UNPACKED = 4096


@dataclass(frozen=True, eq=False)
class Layout:
    """Which elements a term has and where the entries of their matrices go; terms may share one.

    Parameters
    ----------
    elements : (m,) element numbers, 0 for masses that a configuration adds
    dofs : (m, d) g-set DOFs, −1 for ground
    pairs : (q, 2) rows and columns, row ≤ column, of the entries of the element matrices that are kept
    """

    elements: Integers
    dofs: Integers
    pairs: Integers

    def keep(self, mask: Flags) -> Layout:
        """The elements where the mask is true."""
        return Layout(self.elements[mask], self.dofs[mask], self.pairs)


@dataclass(frozen=True, eq=False)
class TermFunction:
    """What multiplies the matrices of a term.

    Parameters
    ----------
    matrix : "stiffness", "mass", "viscous" or "hysteretic"
    label : what it is, "shell-quad stiffness"
    n_columns : number of coefficients; one for a term that is a scalar times a matrix
    coefficient : jet of the value table -> jet of shape (n_columns,); None where it is the constant 1
    """

    matrix: MatrixKind
    label: str
    n_columns: int
    coefficient: Callable[[TableJet], Jet] | None


@dataclass(frozen=True, eq=False)
class Term(TermFunction):
    """Σ_e c[column_e](p) · matrix_e on the g-set.

    Parameters
    ----------
    layout : elements, DOFs and entries
    values : (m, q) entries of the symmetric element matrices at the layout's pairs
    columns : (m,) which coefficient an element uses
    """

    layout: Layout
    values: Reals
    columns: Integers

    @property
    def elements(self) -> Integers:
        """(m,) element numbers."""
        return self.layout.elements

    @property
    def dofs(self) -> Integers:
        """(m, d) g-set DOFs, −1 for ground."""
        return self.layout.dofs

    def keep(self, mask: Flags, layout: Layout) -> Term:
        """The elements where the mask is true; `layout` is the layout of these."""
        return replace(self, layout=layout, values=self.values[mask], columns=self.columns[mask])

    def matrices(self, part: slice = slice(None)) -> Reals:
        """(m, d, d) full matrices of some of the elements."""
        return unpacked(self.values[part], self.layout.pairs, self.dofs.shape[1])

    def parts(self) -> Iterator[slice]:
        """Slices of the elements whose full matrices take little memory."""
        return (slice(i, i + UNPACKED) for i in range(0, len(self.elements), UNPACKED))


def unpacked(values: Reals, pairs: Integers, d: int) -> Reals:
    """(m, d, d) symmetric matrices from their entries (m, q) at pairs (q, 2); zero elsewhere."""
    out = np.zeros((len(values), d, d))
    out[:, pairs[:, 0], pairs[:, 1]] = values
    out[:, pairs[:, 1], pairs[:, 0]] = values
    return out


def constant_term(matrix: MatrixKind, label: str, elements: Integers, dofs: Integers, matrices: Reals) -> Term:
    """A term without coefficient from full symmetric matrices (m, d, d)."""
    pairs = np.stack(np.triu_indices(dofs.shape[1]), axis=1)
    pairs = pairs[(matrices[:, pairs[:, 0], pairs[:, 1]] != 0.0).any(axis=0)]
    values = np.ascontiguousarray(matrices[:, pairs[:, 0], pairs[:, 1]])
    return Term(matrix, label, 1, None, Layout(elements, dofs, pairs), values, np.zeros(len(elements), np.int64))


@dataclass(frozen=True, eq=False)
class MatrixTerm(TermFunction):
    """c(p) · A with one sparse matrix that no elements made: `upper` (n_g, n_g), csr, with the diagonal."""

    upper: sp.csr_array
