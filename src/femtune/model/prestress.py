"""Prestress: the differential stiffness of a static state, as a term whose coefficients are the internal forces.

K_g(p) = Σ S_j(p) G_j with the constant matrices G_j of `femtune.fem.elements.differential`. The internal forces are
S = P k(p) u of every element, with the displacements u of the static step, K(p) u = f(p). Loads are fixed; weight
follows the mass. Derivatives are exact: K u' = f' − K'u, and likewise for the second ones.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.arrays import Integers, Reals
from femtune.errors import FemtuneError
from femtune.fem.elements import KINDS
from femtune.fem.elements.moving_ends import has_offsets
from femtune.fem.preload import Preload
from femtune.fem.structure import ElementBatch, Structure
from femtune.fem.values import TableJet
from femtune.model.linear.memory import require_memory
from femtune.model.linear.symmetric import SymmetricMatrix
from femtune.model.projection import ProjectedTerm
from femtune.model.solvers.factorise import factorise
from femtune.model.solvers.interface import SingularMatrixError
from femtune.model.terms import MatrixTerm, Term, TermFunction, constant_term
from femtune.parameters.jet import Jet

Weights = Callable[[TermFunction], NDArray]

_ENTRIES_AT_ONCE = 1_000_000
"""Entries of the element matrices whose differential stiffness is computed together: 8 MB."""
_FORCES_OF_QUADRATIC_SOLID = 24
"""Internal forces of a solid with mid-side nodes: six stresses at four points."""
_FORCES_OF_OTHERS = 6
"""Internal forces of other solids and of shells."""
_ROWS_OF_A_FORCE = 4
"""Rows that are kept for each internal force: one for every term of the stiffness that contributes to it."""
_LARGEST_RESIDUAL = 1e-7
"""Residual of the static solution relative to the load, after one refinement; above, a motion is not held."""


@dataclass(frozen=True, eq=False)
class StaticStep:
    """The static step of a preload: what is configured for it, and what the loads are made of.

    Parameters
    ----------
    transformation : T (n_g, n), from the free DOFs of the step
    indptr, indices : pattern of its matrices
    projected : its terms on that pattern
    """

    transformation: sp.csr_array
    indptr: NDArray[np.int32]
    indices: NDArray[np.int32]
    projected: tuple[ProjectedTerm, ...]

    def stiffness(self, weights: Weights) -> SymmetricMatrix:
        """Σ weight · matrix of the terms of the stiffness; `weights` gives (n_columns,) of a term."""
        parts = [p.spread @ weights(p.term) for p in self.projected if p.term.matrix == "stiffness"]
        return SymmetricMatrix(np.sum([np.zeros(len(self.indices)), *parts], axis=0), self.indices, self.indptr)


@dataclass(frozen=True, eq=False)
class _Rows:
    """What a term gives to some results: Σ of columns c[column] · (rows · u), added up at places `at`."""

    function: TermFunction
    columns: Integers
    at: Integers
    rows: sp.csr_array

    def add(self, out: NDArray, weights: NDArray, u: NDArray) -> None:
        """Add to (s,) results."""
        np.add.at(out, self.at, weights[self.columns] * (self.rows @ u))


@dataclass(frozen=True, eq=False)
class InternalForces:
    """The internal forces (s,) as a coefficient of the parameters.

    Parameters
    ----------
    step : the static step
    loads : (n,) fixed forces on its free DOFs
    weight : terms of the mass with the forces (n, n_columns) of the acceleration on each of their columns
    rows : what the terms of the stiffness give to the internal forces
    count : s
    request : what asks for the preload, for messages
    """

    step: StaticStep
    loads: Reals
    weight: tuple[tuple[TermFunction, sp.csr_array], ...]
    rows: tuple[_Rows, ...]
    count: int
    request: str

    def __call__(self, table: TableJet) -> Jet:
        n = table.moving.n_variables
        require_memory(8 * self.count * (n + 2) ** 2, "model.memory/preload", count=self.count)
        jets = _Jets(table)
        solve, u = self._solved(jets)
        value = self._forces(jets.value, u)
        h = table.moving.n_curved
        grad, hess = np.zeros((self.count, n), value.dtype), np.zeros((self.count, h, h), value.dtype)
        by = [jets.by(i) for i in range(n)]
        slopes = [self.step.stiffness(weights) for weights in by]
        firsts = [solve(self._weight(weights, u.dtype) - slope @ u) for weights, slope in zip(by, slopes)]
        for i in range(n):
            grad[:, i] = self._forces(by[i], u) + self._forces(jets.value, firsts[i])
            for j in range(i, h):
                both = jets.by(i, j)
                load = self._weight(both, u.dtype) - self.step.stiffness(both) @ u
                load = load - slopes[i] @ firsts[j] - slopes[j] @ firsts[i]
                second = self._forces(both, u) + self._forces(jets.value, solve(load))
                second += self._forces(by[i], firsts[j]) + self._forces(by[j], firsts[i])
                hess[:, i, j] = hess[:, j, i] = second
        return Jet(value, grad, hess)

    def _solved(self, jets: _Jets) -> tuple[Callable[[NDArray], NDArray], NDArray]:
        K = self.step.stiffness(jets.value)
        load = self.loads + self._weight(jets.value, K.data.dtype)
        try:
            factor = factorise(K)
        except SingularMatrixError as error:
            raise FemtuneError("configuration.preload-not-held", request=self.request) from error

        def solve(b: NDArray) -> NDArray:
            x = np.asarray(factor.solve(b))
            return np.asarray(x + factor.solve(b - K @ x))

        # a load on every DOF shows whether something moves freely
        probe = np.random.default_rng(4).standard_normal(len(load)).astype(K.data.dtype)
        for b in (probe, load):
            x = solve(b)
            if not np.linalg.norm(b - K @ x) <= _LARGEST_RESIDUAL * np.linalg.norm(b):
                raise FemtuneError("configuration.preload-not-held", request=self.request)
        return solve, x

    def _weight(self, weights: Weights, kind: np.dtype) -> NDArray:
        out = np.zeros(len(self.loads), kind)
        for term, forces in self.weight:
            out += forces @ weights(term)
        return out

    def _forces(self, weights: Weights, u: NDArray) -> NDArray:
        out = np.zeros(self.count, u.dtype)
        for part in self.rows:
            part.add(out, weights(part.function), u)
        return out


class _Jets:
    """Coefficients of terms at one point, each made once."""

    def __init__(self, table: TableJet) -> None:
        self._table = table
        self._known: dict[TermFunction, Jet] = {}

    def _of(self, term: TermFunction) -> Jet:
        if term not in self._known:
            assert term.coefficient is not None
            self._known[term] = term.coefficient(self._table)
        return self._known[term]

    def value(self, term: TermFunction) -> NDArray:
        return np.ones(1) if term.coefficient is None else self._of(term).value

    def by(self, *variables: int) -> Weights:
        """The first derivative by one variable, the second one by two."""

        def weights(term: TermFunction) -> NDArray:
            if term.coefficient is None:
                return np.zeros(1)
            jets = self._of(term)
            first, *second = variables
            return np.asarray(jets.hess[:, first, second[0]] if second else jets.grad[:, first])

        return weights


# ----------------------------------------------------------------------------------------------------
# From a structure and its static step to the term.


def differential_terms(
    structure: Structure, preload: Preload, terms: Sequence[TermFunction], step: StaticStep, off: frozenset[int]
) -> list[Term]:
    """The differential stiffness of the elements on the g-set; all terms have one coefficient, the internal forces.

    Parameters
    ----------
    terms : those of the elements that are present in the static step, on the g-set
    off : elements that are switched off

    Raises
    ------
    FemtuneError : ``configuration.preload-offsets`` where parameters move the ends of bars
    """
    geometric: list[Term] = []
    batches = [b for b in (_present(b, off) for b in structure.batches) if len(b) and KINDS[b.kind].differential]
    patterns: list[tuple[ElementBatch, int, Reals]] = []
    count = 0
    for batch in batches:
        if has_offsets(batch):
            raise FemtuneError("configuration.preload-offsets", request=preload.request, card=batch.card)
        kernel = KINDS[batch.kind].differential
        assert kernel is not None
        _check_memory(batch)
        size = max(_ENTRIES_AT_ONCE // batch.dofs.shape[1] ** 2, 1)
        for first in range(0, len(batch), size):
            some = batch.some(slice(first, first + size))
            result = kernel(some, structure)
            k = result.patterns.shape[1]
            patterns.append((some, count, result.patterns))
            for j in range(k):
                one = constant_term("stiffness", "differential stiffness", some.ids, some.dofs, result.matrices[:, j])
                geometric.append(replace(one, columns=count + j + k * np.arange(len(some))))
            count += k * len(some)
    rows = tuple(_rows_of(terms, patterns, step.transformation))
    loads = np.asarray(step.transformation.T @ preload.forces)
    forces = InternalForces(step, loads, tuple(_weights(structure, preload, terms, step)), rows, count, preload.request)
    return [replace(term, n_columns=count, coefficient=forces) for term in geometric]


def _check_memory(batch: ElementBatch) -> None:
    """Error ``model.memory`` where the element matrices of a batch, and those of the forces, have no room."""
    kind, d = KINDS[batch.kind], batch.dofs.shape[1]
    forces = len(batch) * (
        _FORCES_OF_QUADRATIC_SOLID if kind.volume else _FORCES_OF_OTHERS if kind.faces or kind.sides else 1
    )
    # directions of displacement are apart, and one row of each force is kept for every term of the stiffness
    needed = 8 * forces * (d * d // 6 + 3 * _ROWS_OF_A_FORCE * d)
    require_memory(needed, "model.memory/preload", count=forces)


def _present(batch: ElementBatch, off: frozenset[int]) -> ElementBatch:
    keep = ~np.isin(batch.ids, list(off)) if off else np.ones(len(batch), bool)
    return batch if keep.all() else batch.some(np.flatnonzero(keep))


def _rows_of(
    terms: Sequence[TermFunction], patterns: Sequence[tuple[ElementBatch, int, Reals]], T: sp.csr_array
) -> list[_Rows]:
    """What each term of the stiffness gives to the internal forces of the elements, on the free DOFs."""
    out = []
    grounded = sp.csr_array(sp.vstack([T, sp.csr_array((1, T.shape[1]))], format="csr"))
    for term in terms:
        if not isinstance(term, Term) or term.matrix != "stiffness":
            continue
        for batch, start, pattern in patterns:
            shared, mine, theirs = np.intersect1d(term.elements, batch.ids, return_indices=True)
            if not len(shared) or term.dofs.shape[1] != batch.dofs.shape[1]:
                continue
            forces = pattern[theirs] @ _matrices(term, mine)
            m, k, d = forces.shape
            dofs = np.repeat(term.dofs[mine], k, axis=0)
            local = sp.csr_array(
                (forces.ravel(), (np.repeat(np.arange(m * k), d), dofs.ravel() % grounded.shape[0])),
                shape=(m * k, grounded.shape[0]),
            )
            at = start + (k * theirs[:, None] + np.arange(k)).ravel()
            out.append(_Rows(term, np.repeat(term.columns[mine], k), at, sp.csr_array(local @ grounded)))
    return out


def _matrices(term: Term, rows: Integers) -> Reals:
    keep = np.zeros(len(term.elements), bool)
    keep[rows] = True
    order = np.argsort(np.argsort(rows))
    return term.keep(keep, term.layout.keep(keep)).matrices()[order]


def _weights(
    structure: Structure, preload: Preload, terms: Sequence[TermFunction], step: StaticStep
) -> list[tuple[TermFunction, sp.csr_array]]:
    """The terms of the mass with the forces of each of their columns."""
    if not preload.acceleration.any():
        return []
    n = structure.nodes.n_dofs
    field = np.zeros(n + 1)
    count = len(structure.nodes.ids)
    moved = np.swapaxes(structure.nodes.frames, 1, 2) @ preload.acceleration
    field[: 6 * count].reshape(count, 6)[:, :3] = moved
    out: list[tuple[TermFunction, sp.csr_array]] = []
    for term in terms:
        if term.matrix != "mass":
            continue
        if isinstance(term, MatrixTerm):
            whole = term.upper @ field[:n] + sp.triu(term.upper, 1).T @ field[:n]
            forces = sp.csr_array(whole[:, None])
        else:
            assert isinstance(term, Term)
            element_forces = np.concatenate(
                [np.einsum("mij,mj->mi", term.matrices(part), field[term.dofs[part]]) for part in term.parts()]
            )
            columns = np.repeat(term.columns[:, None], element_forces.shape[1], axis=1)
            there = term.dofs >= 0
            forces = sp.csr_array(
                (element_forces[there], (term.dofs[there], columns[there])), shape=(n, term.n_columns)
            )
        out.append((term, sp.csr_array(step.transformation.T @ forces)))
    return out
