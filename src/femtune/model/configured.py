"""ConfiguredModel: the terms of a parametric model on the free DOFs of one configuration."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.arrays import Integers, Reals
from femtune.dofs import Dof
from femtune.errors import FemtuneError
from femtune.fem import Structure, join_constraints
from femtune.fem.elimination import Elimination, eliminate
from femtune.fem.fields import MatrixKind
from femtune.fem.singularities import Spin, empty_dofs, singular_dofs, spinning_lines
from femtune.fem.values import TableJet
from femtune.model.configuration import Configuration, check_configuration, held_dofs, mass_terms
from femtune.model.digests import Identity, Part, digest, identity
from femtune.model.linear.memory import require_memory
from femtune.model.linear.symmetric import BothTriangles, SymmetricMatrix
from femtune.model.parametric import ParametricModel
from femtune.model.prestress import StaticStep, differential_terms
from femtune.model.projection import SORTED_AT_ONCE, FreeElements, ProjectedTerm, free_elements, project, upper_of
from femtune.model.terms import MatrixTerm, Term, TermFunction, TermLayout, combined
from femtune.parameters.jet import Jet


@dataclass(frozen=True)
class ConfiguredModel:
    """K_c(p) = TᵀK(p)T and M_c(p) on the free DOFs of a configuration.

    Parameters
    ----------
    transformation : T, csr (g-set, free)
    free : (n_free,) the g-set DOF that each column of T carries
    held_singular : DOFs without stiffness that were held; without AUTOSPC only those with neither stiffness nor mass
    indptr, indices : pattern of the upper triangle of all matrices, with its whole diagonal
    """

    model: ParametricModel
    configuration: Configuration
    transformation: sp.csr_array
    free: NDArray[np.int64]
    held_singular: tuple[Dof, ...]
    indptr: NDArray[np.int32]
    indices: NDArray[np.int32]
    projected: tuple[ProjectedTerm, ...] = field(repr=False)

    def __reduce__(self) -> tuple[Any, ...]:
        """Another process configures the model again."""
        return configure, (self.model, self.configuration)

    @property
    def n_free(self) -> int:
        """Number of free DOFs."""
        return int(self.transformation.shape[1])

    def free_dof(self, i: int) -> Dof:
        """Node and direction of a free DOF."""
        return self.model.structure.nodes.describe(int(self.free[i]))

    @cached_property
    def rows(self) -> NDArray[np.int32]:
        """(nnz,) row of each entry of the pattern."""
        return np.repeat(np.arange(self.n_free, dtype=np.int32), np.diff(self.indptr))

    @cached_property
    def both_triangles(self) -> BothTriangles:
        """The pattern of both triangles, made when a consumer asks for a full matrix."""
        return BothTriangles.of(self.indptr, self.indices)

    @cached_property
    def _spreads(self) -> dict[MatrixKind, sp.csr_array]:
        parts: dict[MatrixKind, list[sp.csr_array]] = {}
        for p in self.projected:
            if p.term.coefficient:
                parts.setdefault(p.term.matrix, []).append(p.spread)
        return {kind: sp.csr_array(sp.hstack(some, format="csr")) for kind, some in parts.items()}

    def spread(self, kind: MatrixKind) -> sp.csr_array:
        """(nnz, columns) what the coefficients of all terms of a matrix that have some are multiplied by."""
        return self._spreads[kind]

    def at(self, x: NDArray) -> ModelPoint:
        """The model at one normalised parameter vector."""
        return ModelPoint(self, np.asarray(x))

    @cached_property
    def identity(self) -> Identity:
        """Digests of what the matrices are made of, except the values in the table."""
        return identity(self.model.structure, self.configuration, self.transformation)

    @cached_property
    def terms_digest(self) -> str:
        """Digest of the pattern and of every term on it; coefficients count only as present or absent."""
        parts: list[Part] = [self.n_free, self.indptr, self.indices]
        for p in self.projected:
            parts += [p.term.matrix, p.term.coefficient is None, p.spread.indptr, p.spread.indices, p.spread.data]
        return digest(*parts)


_OF_MODES: tuple[MatrixKind, ...] = ("stiffness", "mass")
_MATRICES = (
    "stiffness", "mass", "viscous", "hysteretic", "element_hysteretic", "stiffness_derivatives", "mass_derivatives",
    "viscous_derivatives", "hysteretic_derivatives", "element_hysteretic_derivatives", "symmetric_stiffness",
    "symmetric_mass", "small_derivatives",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class ModelPoint:
    """Matrices and their derivatives at one x (real, or complex for checks by complex step).

    `at_hz` is the frequency at which tables over frequency are taken, where the model has some.
    """

    configured: ConfiguredModel
    x: NDArray
    at_hz: float | None = None

    def __getstate__(self) -> dict[str, Any]:
        """For another process, which assembles its own matrices."""
        return {"configured": self.configured, "x": self.x, "at_hz": self.at_hz}

    @property
    def depends_on_frequency(self) -> bool:
        """True where a table over frequency acts and no frequency is chosen; stiffness and damping are refused then."""
        return self.at_hz is None and bool(self.configured.model.tables)

    def at_frequency(self, freq_hz: float) -> ModelPoint:
        """The point with the stiffness and the damping of one frequency; itself without tables over frequency."""
        return replace(self, at_hz=float(freq_hz)) if self.configured.model.tables else self

    def by_frequency(self, kind: MatrixKind) -> sp.csr_array:
        """∂K/∂f, ∂C/∂f or ∂H/∂f at the chosen frequency, 1/Hz."""
        configured = self.configured
        assert self.at_hz is not None
        table = configured.model.table_by_frequency(self.x, self.at_hz)
        data = np.zeros(len(configured.indices), dtype=self.x.dtype if np.iscomplexobj(self.x) else float)
        for p in configured.projected:
            if p.term.matrix == kind and p.term.coefficient is not None:
                data += p.spread @ p.term.coefficient(table).grad[:, 0]
        of_elements = configured.both_triangles.matrix(data)
        eta = configured.model.structure.damping.loss_factor
        if kind != "hysteretic" or eta is None:
            return of_elements
        overall = table[eta]
        return sp.csr_array(
            of_elements + overall.value * self.by_frequency("stiffness") + overall.grad[0] * self.stiffness
        )

    @cached_property
    def _table(self) -> TableJet:
        model = self.configured.model
        return model.table(self.x, () if self.at_hz is None else model.factors(self.at_hz))

    @cached_property
    def coefficients(self) -> list[Jet | None]:
        """Coefficients of each projected term; None for the constant 1."""
        table = self._table
        terms = (p.term for p in self.configured.projected)
        return [t.coefficient(table) if t.coefficient else None for t in terms]

    @cached_property
    def _values(self) -> list[NDArray | None]:
        """Values of the coefficients: much less work than with derivatives if there are many parameters."""
        model = self.configured.model
        if np.iscomplexobj(self.x):
            table = self._table.without_derivatives()
        else:
            table = model.table_of_values(self.x, () if self.at_hz is None else model.factors(self.at_hz))
        terms = (p.term for p in self.configured.projected)
        return [t.coefficient(table).value if t.coefficient else None for t in terms]

    def _upper(self, kind: MatrixKind, part: tuple[int, ...] = ()) -> SymmetricMatrix:
        """A matrix, or its derivative by the parameters `part`."""
        model = self.configured
        self.check_frequency(kind)
        data = np.zeros(len(model.indices), dtype=self.x.dtype if np.iscomplexobj(self.x) else float)
        for i, projected in enumerate(model.projected):
            if projected.term.matrix == kind:
                c = self.weights(i, part)
                if c.any():
                    data += projected.spread @ c
        return SymmetricMatrix(data, model.indices, model.indptr)

    def check_frequency(self, kind: MatrixKind) -> None:
        """Refuse a matrix that depends on frequency where none is chosen (error ``table.no-frequency``)."""
        if self.depends_on_frequency and kind in self.configured.model.by_frequency:
            name = {"stiffness": "stiffness", "viscous": "viscous damping", "hysteretic": "structural damping"}[kind]
            raise FemtuneError("table.no-frequency", matrix=name)

    def weights(self, i: int, part: tuple[int, ...]) -> NDArray:
        """(n_columns,) coefficients of the projected term `i`, or their derivatives by the parameters `part`."""
        if not part:
            values = self._values[i]
            return np.ones(1) if values is None else values
        c = self.coefficients[i]
        if c is None:
            return np.zeros(1)
        return np.asarray(c.grad[:, part[0]] if len(part) == 1 else c.hess[:, part[0], part[1]])

    def _matrix(self, kind: MatrixKind, part: tuple[int, ...] = ()) -> sp.csr_array:
        return self.configured.both_triangles.matrix(self._upper(kind, part).data)

    def upper(self, kind: MatrixKind) -> SymmetricMatrix:
        """K, M, C, or H of materials and elements, as its upper triangle."""
        if kind in ("stiffness", "mass"):
            return self.symmetric_stiffness if kind == "stiffness" else self.symmetric_mass
        return self._upper(kind)

    @cached_property
    def stiffness(self) -> sp.csr_array:
        """K."""
        return self.configured.both_triangles.matrix(self.symmetric_stiffness.data)

    @cached_property
    def mass(self) -> sp.csr_array:
        """M."""
        return self.configured.both_triangles.matrix(self.symmetric_mass.data)

    @cached_property
    def viscous(self) -> sp.csr_array:
        """C of dashpots; real."""
        return self._matrix("viscous")

    @cached_property
    def hysteretic(self) -> sp.csr_array:
        """H of K + iH: stiffness times loss factors of materials, elements and the whole structure; real."""
        eta = self.loss_factor
        of_elements = self.element_hysteretic
        return of_elements if eta is None else sp.csr_array(of_elements + eta.value * self.stiffness)

    @cached_property
    def element_hysteretic(self) -> sp.csr_array:
        """The part of H that loss factors of materials and elements make."""
        return self._matrix("hysteretic")

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
        of_elements = self.element_hysteretic_derivatives
        eta = self.loss_factor
        if eta is None:
            return of_elements
        pairs = zip(of_elements, self.stiffness_derivatives, eta.grad)
        return tuple(sp.csr_array(h + eta.value * k + d * self.stiffness) for h, k, d in pairs)

    @property
    def loss_factor(self) -> Jet | None:
        """Loss factor of all stiffness."""
        index = self.configured.model.structure.damping.loss_factor
        return None if index is None else self._table[index]

    @cached_property
    def mode_ratios(self) -> dict[int, Jet]:
        """Damping ratios of modes that are values of the model, by number of the mode; see `OverallDamping`."""
        fields = self.configured.model.structure.damping.mode_ratios
        # a table with derivatives by many parameters costs as much as modes
        return {n: self._table[i] for n, i in fields.items()}

    @cached_property
    def stiffness_derivatives(self) -> tuple[sp.csr_array, ...]:
        """∂K/∂x_i of every free parameter."""
        return tuple(self._matrix("stiffness", (i,)) for i in range(self.n_parameters))

    @cached_property
    def mass_derivatives(self) -> tuple[sp.csr_array, ...]:
        """∂M/∂x_i of every free parameter."""
        return tuple(self._matrix("mass", (i,)) for i in range(self.n_parameters))

    @cached_property
    def small_derivatives(self) -> tuple[Reals, Reals]:
        """(k, n, n) ∂K/∂x and ∂M/∂x of a small model as arrays."""
        k, m = (self.configured.both_triangles.dense(self._all_derivatives(kind)) for kind in _OF_MODES)
        return k, m

    def _all_derivatives(self, kind: MatrixKind) -> Reals:
        """(k, nnz) derivatives of a matrix by all free parameters."""
        self.check_frequency(kind)
        chosen = [i for i, p in enumerate(self.configured.projected) if p.term.matrix == kind and p.term.coefficient]
        grads = [c.grad for c in (self.coefficients[i] for i in chosen) if c is not None]
        if not grads:
            return np.zeros((self.n_parameters, len(self.configured.indices)))
        return np.asarray((self.configured.spread(kind) @ np.concatenate(grads)).T)

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
        of_elements, eta = self._matrix("hysteretic", (i, j)), self.loss_factor
        if eta is None:
            return of_elements
        k, second = self.stiffness_derivatives, self.stiffness_second_derivative(i, j)
        overall = eta.value * second + eta.grad[i] * k[j] + eta.grad[j] * k[i] + eta.hess[i, j] * self.stiffness
        return sp.csr_array(of_elements + overall)

    @cached_property
    def symmetric_stiffness(self) -> SymmetricMatrix:
        """K as its upper triangle."""
        return self._upper("stiffness")

    @cached_property
    def symmetric_mass(self) -> SymmetricMatrix:
        """M as its upper triangle, on the pattern of K."""
        return self._upper("mass")

    def release(self) -> None:
        """Release the memory of all matrices; they are assembled again when they are next needed."""
        for name in _MATRICES:
            self.__dict__.pop(name, None)

    @property
    def table(self) -> NDArray:
        """(n,) value table at the point."""
        return self._table.value

    @property
    def structure(self) -> Structure:
        """The structure whose fields have the values at the point, for secondary models that are made of it."""
        structure = self.configured.model.structure
        return replace(structure, values=replace(structure.values, values=self.table))

    @property
    def n_parameters(self) -> int:
        """Number of free parameters."""
        return len(self.configured.model.parameters.free)


# ----------------------------------------------------------------------------------------------------
# The stiffness of each grid point's own translations and rotations, without the rest of the matrix.


Entries = tuple[NDArray, NDArray, Reals]


def node_blocks(terms: Sequence[TermFunction], elimination: Elimination, n_grid: int, table: TableJet) -> sp.csr_array:
    """(n, n) entries of TᵀKT between translations, and between rotations, of one grid point; scalar points' diagonals.

    `n_grid` DOFs are those of grid points.
    """
    free, n = elimination.free, len(elimination.free)
    # the three DOFs of a block share a number, a scalar point's has its own; the last stands for no DOF
    group = np.append(np.where(free < n_grid, free // 3, n_grid + free), -1)
    layouts: dict[TermLayout, list[tuple[Term, Reals]]] = {}
    entries: list[Entries] = [(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0))]
    for term in terms:
        c = term.coefficient(table).value if term.coefficient else np.ones(1)
        if isinstance(term, Term):
            layouts.setdefault(term.layout, []).append((term, c))
        elif isinstance(term, MatrixTerm):
            entries.append(_of_matrix(upper_of(term.upper, elimination.T), float(c[0]), group))
    for layout, same_layout in layouts.items():
        entries += [e for some in free_elements(layout, elimination.T) for e in _of_elements(some, same_layout, group)]
    rows, cols, values = (np.concatenate(parts) for parts in zip(*entries))
    upper = sp.csr_array((values, (rows, cols)), shape=(n, n))
    return sp.csr_array(upper + sp.triu(upper, 1).T)


def _of_elements(elements: FreeElements, terms: Sequence[tuple[Term, Reals]], group: Integers) -> Iterator[Entries]:
    """Of terms of one layout, with their coefficients."""
    whole = list(combined([(term.values, c[term.columns]) for term, c in terms]))
    for chunk in elements.chunks():
        groups = group[elements.dofs[chunk]]
        a, b = groups[:, elements.pairs[:, 0]], groups[:, elements.pairs[:, 1]]
        within_node = (a == b) & (a >= 0)
        used = np.flatnonzero(within_node.any(axis=0))
        within_node, values = within_node[:, used], np.zeros((len(within_node), len(used)))
        for own_values, factors in whole:
            values += elements.entries(own_values, chunk)[:, used] * factors[elements.rows[chunk], None]
        dofs, pairs = elements.dofs[chunk], elements.pairs[used]
        first, second = (dofs[:, column][within_node] for column in pairs.T)
        yield np.minimum(first, second), np.maximum(first, second), values[within_node]


def _of_matrix(upper: sp.csr_array, c: float, group: Integers) -> Entries:
    coo = upper.tocoo()
    within_node = group[coo.row] == group[coo.col]
    return coo.row[within_node], coo.col[within_node], c * coo.data[within_node]


# ----------------------------------------------------------------------------------------------------
# From a parametric model and a configuration to matrices on free DOFs.


SHARED_ENTRIES = 0.6
"""Entries in the pattern of a mesh over the entries of all element matrices: 0.55 for shells, less for solids."""
_NO_ENERGY = 1e-11
"""Energy of a motion, relative to what the diagonal entries alone would give, that is rounding of zero."""


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
    terms += _differential(model, configuration, terms)
    elimination = _eliminate(structure, configuration, held)
    singular = _without_stiffness(model, terms, elimination)
    if singular:
        elimination = _eliminate(structure, configuration, np.union1d(held, singular))
    dofs = tuple(structure.nodes.describe(i) for i in singular)
    require_memory(_forecast(terms, elimination.T), "model.memory/assembling", dofs=len(elimination.free))
    pattern, projected = project(terms, elimination.T)
    configured = ConfiguredModel(
        model, configuration, elimination.T, elimination.free, dofs, pattern.indptr, pattern.indices, projected
    )
    spinning = _without_energy(configured, spinning_lines(structure, elimination, configuration.elements_off))
    if not spinning:
        return configured
    elimination = _eliminate(structure, configuration, np.union1d(np.union1d(held, singular), spinning))
    dofs += tuple(structure.nodes.describe(i) for i in spinning)
    pattern, projected = project(terms, elimination.T)
    return ConfiguredModel(
        model, configuration, elimination.T, elimination.free, dofs, pattern.indptr, pattern.indices, projected
    )


def _differential(model: ParametricModel, configuration: Configuration, terms: Sequence[TermFunction]) -> list[Term]:
    """The differential stiffness of the preload, whose static step has constraints of its own."""
    preload = model.structure.preload
    if preload is None:
        return []
    if model.tables:
        raise FemtuneError("configuration.preload-tables", request=preload.request)
    sets = configuration.support_set, configuration.multipoint_set
    given = (preload.support_set, preload.multipoint_set)
    support, multipoint = (selected if selected is not None else other for selected, other in zip(sets, given))
    bare = replace(model.structure, preload=None, default_support_set=support, default_multipoint_set=multipoint)
    static = configure(replace(model, structure=bare), configuration)
    step = StaticStep(static.transformation, static.indptr, static.indices, static.projected)
    return differential_terms(bare, preload, terms, step, configuration.elements_off)


def _without_energy(configured: ConfiguredModel, lines: Sequence[Spin]) -> list[int]:
    """A g-set DOF of each line of bars that turns about itself with neither stiffness nor mass."""
    if not lines:
        return []
    point = configured.at(np.zeros(len(configured.model.parameters.free)))
    matrices = point.symmetric_stiffness, point.symmetric_mass
    diagonals = [np.abs(matrix.diagonal()) for matrix in matrices]
    out = []
    for line in lines:
        energies = (abs(float(line.motion @ (matrix @ line.motion))) for matrix in matrices)
        usual = [float(d @ line.motion**2) + 1e-9 * float(d.max(initial=0.0)) for d in diagonals]
        if all(energy <= _NO_ENERGY * size for energy, size in zip(energies, usual)):
            out.append(line.dof)
    return out


def _forecast(terms: Sequence[TermFunction], T: sp.csr_array) -> int:
    """Bytes that the projection takes at its peak: places of entries, and sums of all terms or room to sort.

    About SHARED_ENTRIES of the entries of a mesh's element matrices are left when those of neighbours are added.
    """
    element_terms = [t for t in terms if isinstance(t, Term)]
    layouts = {id(t.layout): len(t.elements) * len(t.layout.pairs) for t in element_terms}
    places = sum(layouts.values())
    sums = sum(len(t.elements) * len(t.layout.pairs) for t in element_terms) + sum(
        t.upper.nnz for t in terms if isinstance(t, MatrixTerm)
    )
    largest = max(layouts.values(), default=0)
    sorting = 24 * min(places, max(SORTED_AT_ONCE, SHARED_ENTRIES * places))
    return int(5 * places + max(sorting, 12 * SHARED_ENTRIES * (sums + largest)) + 8 * T.shape[1])


def grid_matrix(model: ParametricModel, configuration: Configuration, matrix: MatrixKind) -> sp.csr_array:
    """(n_g, n_g) matrix of a configuration at nominal values, before any constraint: for mass and rigid-body checks."""
    added = mass_terms(model.structure.nodes, configuration.masses)
    terms = model.kept.mass if matrix == "mass" else [t for t in model.terms if t.matrix == matrix]
    terms = [*_active(terms, configuration), *(t for t in added if t.matrix == matrix)]
    pattern, projected = project(terms, sp.csr_array(sp.eye_array(model.structure.nodes.n_dofs)))
    table, data = _nominal_table(model), np.zeros(len(pattern.indices))
    for p in projected:
        data += p.spread @ (p.term.coefficient(table).value if p.term.coefficient else np.ones(1))
    return BothTriangles.of(pattern.indptr, pattern.indices).matrix(data)


def _active(terms: Sequence[TermFunction], configuration: Configuration) -> list[TermFunction]:
    """The terms without the elements that are switched off; layouts that were shared stay so."""
    off = list(configuration.elements_off)
    if not off:
        return list(terms)
    layouts: dict[TermLayout, tuple[NDArray[np.bool_], TermLayout]] = {}
    out: list[TermFunction] = []
    for term in terms:
        if isinstance(term, Term):
            if term.layout not in layouts:
                keep = ~np.isin(term.elements, off)
                layouts[term.layout] = keep, term.layout if keep.all() else term.layout.keep(keep)
            keep, layout = layouts[term.layout]
            out.append(term if keep.all() else term.keep(keep, layout))
        else:
            out.append(term)
    return out


def _eliminate(structure: Structure, configuration: Configuration, held: NDArray[np.int64]) -> Elimination:
    number = configuration.multipoint_set
    number = structure.default_multipoint_set if number is None else number
    rigid = structure.rigid.keep(~np.isin(structure.rigid.owner, list(configuration.elements_off)))
    equations = join_constraints([rigid, *([] if number is None else [structure.multipoint_sets[number]])])
    return eliminate(structure.nodes.n_dofs, equations, held, structure.nodes.describe)


def _without_stiffness(model: ParametricModel, terms: Sequence[TermFunction], elimination: Elimination) -> list[int]:
    """g-set DOFs whose node has no stiffness there at nominal values; without AUTOSPC only those without mass as well.

    A DOF with neither takes part in no mode, but makes the eigenproblem singular.
    """
    nodes, table = model.structure.nodes, _nominal_table(model)

    def blocks(kind: MatrixKind) -> sp.csr_array:
        return node_blocks([t for t in terms if t.matrix == kind], elimination, 6 * len(nodes.ids), table)

    if model.structure.hold_singular:
        return [int(i) for i in singular_dofs(blocks("stiffness"), elimination.free, nodes)]
    return [int(i) for i in empty_dofs(blocks("stiffness"), blocks("mass"), elimination.free, nodes)]


def _nominal_table(model: ParametricModel) -> TableJet:
    return model.table_of_values(np.zeros(len(model.parameters.free)))
