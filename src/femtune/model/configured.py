"""ConfiguredModel: the terms of a parametric model on the free DOFs of one configuration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.dofs import Dof
from femtune.fem import Structure, join_constraints
from femtune.fem.contribution import MatrixKind
from femtune.fem.elimination import Elimination, eliminate
from femtune.fem.singularities import singular_dofs
from femtune.fem.values import TableJet
from femtune.model.configuration import Configuration, check_configuration, held_dofs, mass_terms
from femtune.model.digest import Part, digest
from femtune.model.parametric import ParametricModel
from femtune.model.terms import Term
from femtune.parameters.jet import Jet


@dataclass(frozen=True)
class ProjectedTerm:
    """A term on the free DOFs: matrix entries on the common pattern = `spread` @ coefficients.

    `spread` is sparse (nnz, n_columns); column c is vec(TᵀK_cT).
    """

    term: Term
    spread: sp.csc_array


@dataclass(frozen=True)
class ConfiguredModel:
    """K_c(p) = TᵀK(p)T and M_c(p) on the free DOFs of a configuration.

    Parameters
    ----------
    transformation : T, csr (g-set, free)
    free : (n_free,) the g-set DOF that each column of T carries
    held_singular : DOFs without stiffness that were held
    indptr, indices : common pattern of all matrices
    """

    model: ParametricModel
    configuration: Configuration
    transformation: sp.csr_array
    free: NDArray[np.int64]
    held_singular: tuple[Dof, ...]
    indptr: NDArray[np.int32]
    indices: NDArray[np.int32]
    projected: tuple[ProjectedTerm, ...] = field(repr=False)

    @property
    def n_free(self) -> int:
        """Number of free DOFs."""
        return int(self.transformation.shape[1])

    def free_dof(self, i: int) -> Dof:
        """Node and direction of a free DOF."""
        return self.model.structure.nodes.describe(int(self.free[i]))

    def at(self, x: NDArray) -> ModelPoint:
        """The model at one normalised parameter vector."""
        return ModelPoint(self, np.asarray(x))

    @cached_property
    def terms_digest(self) -> str:
        """Digest of the pattern and of every term on it; of a coefficient counts here only whether it is there."""
        parts: list[Part] = [self.n_free, self.indptr, self.indices]
        for p in self.projected:
            parts += [p.term.matrix, p.term.coefficient is None, p.spread]
        return digest(*parts)


@dataclass(frozen=True, eq=False)
class ModelPoint:
    """Matrices and their derivatives at one x (real, or complex for checks by complex step)."""

    configured: ConfiguredModel
    x: NDArray

    @cached_property
    def _table(self) -> TableJet:
        return self.configured.model.table(self.x)

    @cached_property
    def coefficients(self) -> list[Jet | None]:
        """Coefficients of each projected term; None for the constant 1."""
        table = self._table
        terms = (p.term for p in self.configured.projected)
        return [t.coefficient(table) if t.coefficient else None for t in terms]

    def _matrix(self, kind: MatrixKind, part: tuple[int, ...]) -> sp.csr_array:
        model = self.configured
        data = np.zeros(len(model.indices), dtype=self.x.dtype if np.iscomplexobj(self.x) else float)
        for projected, c in zip(model.projected, self.coefficients):
            if projected.term.matrix == kind:
                data += _part_of(projected, c, part)
        return sp.csr_array((data, model.indices, model.indptr), shape=(model.n_free, model.n_free))

    @cached_property
    def stiffness(self) -> sp.csr_array:
        """K."""
        return self._matrix("stiffness", ())

    @cached_property
    def mass(self) -> sp.csr_array:
        """M."""
        return self._matrix("mass", ())

    @cached_property
    def viscous(self) -> sp.csr_array:
        """C of dashpots; real."""
        return self._matrix("viscous", ())

    @cached_property
    def hysteretic(self) -> sp.csr_array:
        """H of K + iH: stiffness times loss factors of materials, elements and the whole structure; real."""
        eta = self.loss_factor
        own = self.element_hysteretic
        return own if eta is None else sp.csr_array(own + eta.value * self.stiffness)

    @cached_property
    def element_hysteretic(self) -> sp.csr_array:
        """The part of H that loss factors of materials and elements make."""
        return self._matrix("hysteretic", ())

    @cached_property
    def element_hysteretic_derivatives(self) -> tuple[sp.csr_array, ...]:
        """Derivatives of that part by every free parameter."""
        return tuple(self._matrix("hysteretic", (i,)) for i in range(self.n_parameters))

    @cached_property
    def viscous_derivatives(self) -> tuple[sp.csr_array, ...]:
        """∂C/∂x_i of every free parameter."""
        return tuple(self._matrix("viscous", (i,)) for i in range(self.n_parameters))

    @cached_property
    def hysteretic_derivatives(self) -> tuple[sp.csr_array, ...]:
        """∂H/∂x_i of every free parameter."""
        own = self.element_hysteretic_derivatives
        eta = self.loss_factor
        if eta is None:
            return own
        pairs = zip(own, self.stiffness_derivatives, eta.grad)
        return tuple(sp.csr_array(h + eta.value * k + d * self.stiffness) for h, k, d in pairs)

    @property
    def loss_factor(self) -> Jet | None:
        """Loss factor of all stiffness."""
        index = self.configured.model.structure.damping.loss_factor
        return None if index is None else self._table[index]

    @cached_property
    def stiffness_derivatives(self) -> tuple[sp.csr_array, ...]:
        """∂K/∂x_i of every free parameter."""
        return tuple(self._matrix("stiffness", (i,)) for i in range(self.n_parameters))

    @cached_property
    def mass_derivatives(self) -> tuple[sp.csr_array, ...]:
        """∂M/∂x_i of every free parameter."""
        return tuple(self._matrix("mass", (i,)) for i in range(self.n_parameters))

    def stiffness_second_derivative(self, i: int, j: int) -> sp.csr_array:
        """∂²K/∂x_i∂x_j."""
        return self._matrix("stiffness", (i, j))

    def mass_second_derivative(self, i: int, j: int) -> sp.csr_array:
        """∂²M/∂x_i∂x_j."""
        return self._matrix("mass", (i, j))

    def viscous_second_derivative(self, i: int, j: int) -> sp.csr_array:
        """∂²C/∂x_i∂x_j."""
        return self._matrix("viscous", (i, j))

    def hysteretic_second_derivative(self, i: int, j: int) -> sp.csr_array:
        """∂²H/∂x_i∂x_j."""
        own, eta = self._matrix("hysteretic", (i, j)), self.loss_factor
        if eta is None:
            return own
        k, second = self.stiffness_derivatives, self.stiffness_second_derivative(i, j)
        overall = eta.value * second + eta.grad[i] * k[j] + eta.grad[j] * k[i] + eta.hess[i, j] * self.stiffness
        return sp.csr_array(own + overall)

    @property
    def n_parameters(self) -> int:
        """Number of free parameters."""
        return len(self.configured.model.parameters.free)


def _part_of(projected: ProjectedTerm, c: Jet | None, part: tuple[int, ...]) -> NDArray | float:
    if c is None:
        return projected.spread @ np.ones(1) if not part else 0.0
    values = (c.value, c.grad, c.hess)[len(part)]
    for i in reversed(part):
        values = values[..., i]
    return np.asarray(projected.spread @ values)


def configure(model: ParametricModel, configuration: Configuration) -> ConfiguredModel:
    """Apply a configuration: switch elements, constrain, hold what has no stiffness, project the terms.

    Raises
    ------
    FemtuneError : codes ``configuration.*`` and ``constraint.*``
    """
    structure = model.structure
    check_configuration(structure, configuration)
    terms = [*_active(model.terms, configuration), *mass_terms(structure.nodes, configuration.masses)]
    held = held_dofs(structure, configuration)
    elimination = _eliminate(structure, configuration, held)
    singular = _without_stiffness(model, terms, elimination) if structure.hold_singular else []
    if singular:
        elimination = _eliminate(structure, configuration, np.union1d(held, singular))
    indptr, indices, projected = project(terms, elimination.T)
    dofs = tuple(structure.nodes.describe(i) for i in singular)
    return ConfiguredModel(model, configuration, elimination.T, elimination.free, dofs, indptr, indices, projected)


def grid_matrix(model: ParametricModel, configuration: Configuration, matrix: MatrixKind) -> sp.csr_array:
    """(n_g, n_g) matrix of a configuration at nominal values, before any constraint: for mass and rigid-body checks."""
    added = mass_terms(model.structure.nodes, configuration.masses)
    terms = [t for t in (*_active(model.terms, configuration), *added) if t.matrix == matrix]
    return _nominal(model, terms, sp.csr_array(sp.eye_array(model.structure.nodes.n_dofs)))


def _active(terms: Sequence[Term], configuration: Configuration) -> list[Term]:
    off = list(configuration.elements_off)
    if not off:
        return list(terms)
    return [_masked(t, ~np.isin(t.elements, off)) for t in terms]


def _masked(term: Term, keep: NDArray[np.bool_]) -> Term:
    return Term(
        term.matrix, term.label, term.elements[keep], term.dofs[keep], term.matrices[keep],
        term.columns[keep], term.n_columns, term.coefficient,
    )  # fmt: skip


def _eliminate(structure: Structure, configuration: Configuration, held: NDArray[np.int64]) -> Elimination:
    number = configuration.multipoint_set
    number = structure.default_multipoint_set if number is None else number
    rigid = structure.rigid.keep(~np.isin(structure.rigid.owner, list(configuration.elements_off)))
    equations = join_constraints([rigid, *([] if number is None else [structure.multipoint_sets[number]])])
    return eliminate(structure.nodes.n_dofs, equations, held, structure.nodes.describe)


def _without_stiffness(model: ParametricModel, terms: list[Term], elimination: Elimination) -> list[int]:
    """g-set DOFs whose node has no stiffness there at nominal values."""
    stiffness = _nominal(model, [t for t in terms if t.matrix == "stiffness"], elimination.T)
    return [int(i) for i in singular_dofs(stiffness, elimination.free, model.structure.nodes)]


def _nominal(model: ParametricModel, terms: Sequence[Term], T: sp.csr_array) -> sp.csr_array:
    """Σ TᵀK_cT at nominal values."""
    indptr, indices, projected = project(terms, T)
    table = model.table(np.zeros(len(model.parameters.free)))
    data = np.zeros(len(indices))
    for p in projected:
        data += _part_of(p, p.term.coefficient(table) if p.term.coefficient else None, ())
    return sp.csr_array((data, indices, indptr), shape=(T.shape[1], T.shape[1]))


def project(terms: Sequence[Term], T: sp.csr_array) -> tuple[NDArray, NDArray, tuple[ProjectedTerm, ...]]:
    """TᵀK_cT of every coefficient of every term, on the union of their patterns.

    Returns the pattern (indptr, indices) and the projected terms.
    """
    n = T.shape[1]
    grounded = sp.csr_array(sp.vstack([T, sp.csr_array((1, n))]))
    entries = [_entries(t, grounded) for t in terms]
    diagonal = np.arange(n, dtype=np.int64) * (n + 1)
    pattern = np.unique(np.concatenate([diagonal, *(e[0] for e in entries)]))
    indptr = np.searchsorted(pattern, np.arange(n + 1, dtype=np.int64) * n).astype(np.int32)
    projected = tuple(_spread(t, e, pattern) for t, e in zip(terms, entries))
    return indptr, (pattern % n if n else pattern).astype(np.int32), projected


def _spread(term: Term, entries: tuple[NDArray, NDArray, NDArray], pattern: NDArray) -> ProjectedTerm:
    key, values, columns = entries
    at = np.searchsorted(pattern, key)
    spread = sp.coo_array((values, (at, columns)), shape=(len(pattern), term.n_columns))
    return ProjectedTerm(term, spread.tocsc())


def _entries(term: Term, T: sp.csr_array) -> tuple[NDArray, NDArray, NDArray]:
    """Keys row·n + column, values and coefficient columns of all entries of Σ tᵢᵀ k_ij t_j."""
    m, d = term.dofs.shape
    rows = np.broadcast_to(term.dofs[:, :, None], (m, d, d)).ravel()
    cols = np.broadcast_to(term.dofs[:, None, :], (m, d, d)).ravel()
    values = term.matrices.ravel()
    columns = np.repeat(term.columns, d * d)
    some = (values != 0.0) & (rows >= 0) & (cols >= 0)
    return _expand(T, rows[some], cols[some], values[some], columns[some])


def _expand(T: sp.csr_array, rows: NDArray, cols: NDArray, values: NDArray, columns: NDArray) -> tuple:
    """Replace each g-set index by the free DOFs that it follows."""
    count = np.diff(T.indptr).astype(np.int64)
    total = count[rows] * count[cols]
    source = np.repeat(np.arange(len(rows)), total)
    local = np.arange(total.sum()) - np.repeat(np.cumsum(total) - total, total)
    i = T.indptr[rows[source]] + local // count[cols[source]]
    j = T.indptr[cols[source]] + local % count[cols[source]]
    key = T.indices[i].astype(np.int64) * T.shape[1] + T.indices[j]
    return key, values[source] * T.data[i] * T.data[j], columns[source]
