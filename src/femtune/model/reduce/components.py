"""Craig-Bampton components of a configured model: a basis of interface DOFs, static shapes and fixed-interface modes.

The basis V has a column for each DOF of the interface, with the static shapes of all components that it moves, and
columns that are zero outside the interior of one component: modes with the interface held, and what is added to them.
VᵀK_iV of all terms is the assembly of the reduced components, as exact in the parameters as any reduced model.

Source: Craig and Bampton 1968.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import scipy.sparse as sp

from femtune.arrays import Flags, Integers, Reals
from femtune.errors import FemtuneError
from femtune.model.configured import ConfiguredModel, ModelPoint
from femtune.model.digests import digest
from femtune.model.linear.symmetric import SymmetricMatrix, symmetric
from femtune.model.reduce.condensation import (
    Partition,
    fixed_interface_modes_up_to,
    slaves_factor,
    static_shapes,
)
from femtune.model.reduce.estimate import extend, orthonormal
from femtune.model.reduce.modes_in_basis import RIGID, reduced_modes
from femtune.model.reduce.reduced_model import ReducedModel, reduce_model
from femtune.model.response.basis import TIMES_HIGHEST_LINE
from femtune.model.solvers.interface import Factor
from femtune.model.terms import MatrixTerm, Term

# ----------------------------------------------------------------------------------------------------
# Which DOFs are of which component.


OTHERS = "other elements"
"""Name of the component of the elements that no component has."""


@dataclass(frozen=True)
class Components:
    """Components of a structure as sets of elements; elements in none of them form a component of their own.

    Parameters
    ----------
    elements : numbers of the elements of each component, by its name
    max_hz : by name, the frequency up to which fixed-interface modes of a component are kept; without it
        `TIMES_HIGHEST_LINE` times the highest frequency of interest

    Raises
    ------
    FemtuneError : ``reduce.component-empty``, ``reduce.components-overlap``

    Examples
    --------
    >>> Components({"front": frozenset({1, 2}), "rear": frozenset({3})}).limit("front", 100.0)
    200.0
    """

    elements: Mapping[str, frozenset[int]]
    max_hz: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        owner: dict[int, str] = {}
        for name, numbers in self.elements.items():
            if not numbers:
                raise FemtuneError("reduce.component-empty", component=name)
            shared = sorted(numbers & owner.keys())
            if shared:
                shown = ", ".join(map(str, shared[:10]))
                raise FemtuneError(
                    "reduce.components-overlap",
                    values={"elements": shown},
                    one=owner[shared[0]],
                    other=name,
                )
            owner |= dict.fromkeys(numbers, name)

    def limit(self, name: str, highest_hz: float) -> float:
        """Frequency up to which the modes of a component are kept, for a highest frequency of interest."""
        return self.max_hz.get(name, TIMES_HIGHEST_LINE * highest_hz)


@dataclass(frozen=True, eq=False)
class Part:
    """A component in one configuration, by positions of free DOFs.

    Parameters
    ----------
    interior : (n_o,) DOFs that no other component has
    boundary : (n_b,) its DOFs at the interface, as positions in `Division.interface`
    """

    name: str
    interior: Integers
    boundary: Integers


@dataclass(frozen=True, eq=False)
class Division:
    """The components of a configured model; `interface` are the free DOFs that several components have, or none."""

    parts: tuple[Part, ...]
    interface: Integers


def divide(configured: ConfiguredModel, components: Components) -> Division | None:
    """The components that a configuration has; None if it is one component as a whole.

    A free DOF belongs to the interface if elements of two components act on it. Rigid elements and multipoint
    constraints are eliminated before, so that a component acts on all DOFs that the motion of its grid points depends
    on. An element of no component that acts on DOFs of one component only (a mass, a spring to ground) belongs to it.

    Raises
    ------
    FemtuneError : ``reduce.component-alone``, ``configuration.preload-components``
    """
    off = configured.configuration.elements_off
    present = {name: numbers - off for name, numbers in components.elements.items() if numbers - off}
    has = _dofs_of_parts(configured, list(present.values()), off)
    count = has.sum(axis=0)
    shared = count != 1
    if int(has.any(axis=1).sum()) < 2:
        return None
    preload = configured.model.structure.preload
    if preload is not None:
        raise FemtuneError("configuration.preload-components", request=preload.request)
    interface = np.flatnonzero(shared)
    parts = tuple(
        Part(name, np.flatnonzero(acts & ~shared), np.flatnonzero(acts[interface]))
        for name, acts in zip((*present, OTHERS), has)
        if name != OTHERS or (acts & ~shared).any()
    )
    for part in parts:
        if part.name != OTHERS and not part.boundary.size:
            raise FemtuneError(
                "reduce.component-alone",
                values={"degrees of freedom": len(part.interior)},
                component=part.name,
                configuration=configured.configuration.name,
            )
    return Division(parts, interface)


@dataclass(frozen=True)
class Alone:
    """A configuration of some components without the others.

    Parameters
    ----------
    elements_off : elements that are absent
    interface : (node, components) of the grid points of these components at the interface
    """

    elements_off: frozenset[int]
    interface: tuple[tuple[int, str], ...]


def alone(whole: ConfiguredModel, components: Components, names: Sequence[str]) -> Alone:
    """What is absent if only some components are present, and their interface to the absent ones.

    Elements and rigid elements of no component are present if all that they act on belongs to the present components
    and to no other. Their own DOFs that depend on what absent elements act on too are the interface.

    Parameters
    ----------
    whole : the structure with all components
    """
    structure, T = whole.model.structure, whole.transformation
    here = frozenset().union(*(components.elements[name] for name in names))
    elsewhere = frozenset().union(*components.elements.values()) - here
    elements, dofs = _acting(whole)
    mine, others = (np.isin(elements, sorted(numbers)) for numbers in (here, elsewhere))
    only = _moved(T, dofs[mine]) & ~_moved(T, dofs[others])
    some = ~mine & ~others
    names_of, row = np.unique(elements[some], return_inverse=True)
    shape = len(names_of), T.shape[0]
    acts = sp.csr_array((np.ones(len(row)), (row, dofs[some])), shape=shape) @ abs(T)
    kept = ((acts @ only.astype(float)) > 0.0) & ((acts @ (~only).astype(float)) == 0.0)
    # grid points of absent components that have supports are not free, but they are absent too
    kept[row[np.isin(dofs[some], dofs[others])]] = False
    present = mine | np.isin(elements, names_of[kept])
    absent = _moved(T, dofs[~present])
    dofs_present = np.unique(dofs[present])
    held = dofs_present[(abs(T[dofs_present]) @ absent.astype(float)) > 0.0]
    off = frozenset(structure.element_kinds) - here - frozenset(map(int, names_of[kept]))
    # DOFs that depend on rigid elements that are present have no support of their own
    held = np.setdiff1d(held, structure.rigid.dependent[~np.isin(structure.rigid.owner, sorted(off))])
    return Alone(off, _by_node(whole, held))


def _acting(whole: ConfiguredModel) -> tuple[Integers, Integers]:
    """(z,) elements, rigid ones too, and (z,) g-set DOFs on which they act."""
    rigid = whole.model.structure.rigid
    owner = rigid.owner[rigid.row]
    elements, dofs = [owner[owner > 0]], [rigid.dof[owner > 0]]
    for of, numbers in _elements(whole):
        known = of.ravel() >= 0
        elements.append(np.repeat(numbers, of.shape[1])[known])
        dofs.append(of.ravel()[known])
    return np.concatenate(elements), np.concatenate(dofs)


def _by_node(whole: ConfiguredModel, dofs: Integers) -> tuple[tuple[int, str], ...]:
    """g-set DOFs as (node, components)."""
    nodes = whole.model.structure.nodes
    components: dict[int, str] = {}
    for i in dofs:
        dof = nodes.describe(int(i))
        components[dof.node] = components.get(dof.node, "") + (str(i % 6 + 1) if i < 6 * len(nodes.ids) else "0")
    return tuple(components.items())


def _dofs_of_parts(configured: ConfiguredModel, parts: Sequence[frozenset[int]], off: frozenset[int]) -> Flags:
    """(parts + 1, n_free) True for the free DOFs on which the elements of each part act; the last row is of no part."""
    T = configured.transformation
    has, left = np.zeros((len(parts) + 1, T.shape[1]), bool), []
    numbers = [np.array(sorted(p), np.int64) for p in parts]
    without = np.array(sorted(off), np.int64)
    for dofs, elements in _elements(configured):
        part_of = np.full(len(elements), -1)
        for i, some in enumerate(numbers):
            part_of[np.isin(elements, some)] = i
        for i in range(len(parts)):
            has[i] |= _moved(T, dofs[part_of == i])
        left.append(dofs[(part_of < 0) & ~np.isin(elements, without)])
    for dofs in left:
        _place_others(has, T, dofs)
    for term in configured.model.terms:
        if isinstance(term, MatrixTerm):
            entries = term.upper.tocoo()
            has[-1] |= _moved(T, np.concatenate([entries.row, entries.col]))
    return has


def _elements(configured: ConfiguredModel) -> Iterator[tuple[Integers, Integers]]:
    """g-set DOFs (m, d) and numbers (m,) of all elements, each layout once."""
    layouts = {id(t.layout): t.layout for t in configured.model.terms if isinstance(t, Term)}
    for layout in layouts.values():
        yield layout.dofs, layout.elements


def _moved(T: sp.csr_array, dofs: Integers) -> Flags:
    """(n_free,) free DOFs on which g-set DOFs depend; −1 is ground."""
    out = np.zeros(T.shape[1], bool)
    out[T[np.unique(dofs[dofs >= 0])].indices] = True
    return out


def _place_others(has: Flags, T: sp.csr_array, dofs: Integers) -> None:
    """Add elements of no component: to the only component on whose DOFs they act, else to the last row."""
    if not dofs.size:
        return
    m, d = dofs.shape
    owner = np.where(has[:-1].sum(axis=0) == 1, has[:-1].argmax(axis=0), len(has) - 1)
    rows = np.repeat(np.arange(m), d)[dofs.ravel() >= 0]
    acts = sp.csr_array((np.ones(len(rows)), (rows, dofs[dofs >= 0])), shape=(m, T.shape[0])) @ (T != 0.0).astype(float)
    entries = sp.csr_array(acts).tocoo()
    low, high = np.full(m, len(has)), np.full(m, -1)
    np.minimum.at(low, entries.row, owner[entries.col])
    np.maximum.at(high, entries.row, owner[entries.col])
    to = np.where(low == high, low, len(has) - 1)
    has[to[entries.row], entries.col] = True


# ----------------------------------------------------------------------------------------------------
# The basis of the components.


@dataclass(frozen=True, eq=False)
class PartBasis:
    """A component's own columns of the basis.

    Parameters
    ----------
    max_hz : its modes with the interface held are kept up to this frequency
    modes : their number where the basis began
    static : (n_o, n_b) static shapes of the interior there, for unit motions of the boundary
    metric : K_oo there
    columns : (c,) columns of the basis that are zero outside its interior
    built : digests of the component's matrices for which it has its modes and static shapes
    """

    part: Part
    max_hz: float
    modes: int
    static: Reals = field(repr=False)
    metric: SymmetricMatrix = field(repr=False)
    columns: Integers = field(repr=False)
    built: tuple[str, ...] = field(repr=False)


@dataclass(frozen=True, eq=False)
class ComponentBasis:
    """The basis V (n_free, r) of components: first a column for each DOF of the interface."""

    interface: Integers = field(repr=False)
    parts: tuple[PartBasis, ...]


@dataclass(frozen=True, eq=False)
class ComponentModel:
    """A model assembled from reduced components.

    Parameters
    ----------
    model : the terms on the basis
    basis : V (n_free, r)
    components : its parts
    """

    model: ReducedModel
    basis: Reals = field(repr=False)
    components: ComponentBasis


def component_model(
    configured: ConfiguredModel,
    components: Components,
    highest_hz: float,
    x: Reals | None = None,
    rows: Reals | sp.sparray | None = None,
) -> ComponentModel:
    """The model assembled from Craig-Bampton components; the full model is neither factorised nor solved.

    Parameters
    ----------
    highest_hz : highest frequency of interest
    x : (k,) point at which the components are computed; the nominal one without it
    rows : C (s, n_free) where the modes are wanted

    Raises
    ------
    FemtuneError : ``reduce.component-alone``, ``reduce.component-single`` where the configuration has one component
        only, ``reduce.component-loose``, ``reduce.too-many-terms``, ``model.memory``
    """
    division = divide(configured, components)
    if division is None:
        raise FemtuneError("reduce.component-single", configuration=configured.configuration.name)
    point = configured.at(np.zeros(len(configured.model.parameters.free)) if x is None else x)
    basis, parts = component_basis(point, division, components, highest_hz)
    model = reduce_model(configured, basis, rows)
    eigenvalues = reduced_modes(model.at(point.x), 1).eigenvalues
    elastic = eigenvalues[eigenvalues > RIGID * eigenvalues[: max(len(eigenvalues) // 4, 7)].max()]
    return ComponentModel(replace(model, shift=-float(elastic[0])), basis, parts)


def component_basis(
    point: ModelPoint, division: Division, components: Components, highest_hz: float
) -> tuple[Reals, ComponentBasis]:
    """V (n_free, r) of the components at a point, and its parts (error ``reduce.component-loose``)."""
    built, end = [], len(division.interface)
    for part in division.parts:
        block = _Block.of(point, division, part)
        limit = components.limit(part.name, highest_hz)
        vectors = fixed_interface_modes_up_to(block.parts, block.factor, limit)
        metric = symmetric(block.stiffness)
        W = orthonormal(vectors, metric)
        columns = np.arange(end, end + W.shape[1])
        end += W.shape[1]
        static = static_shapes(block.parts, block.factor)
        built.append((PartBasis(part, limit, W.shape[1], static, metric, columns, (block.digest,)), W))
    V = np.zeros((point.configured.n_free, end))
    V[division.interface, np.arange(len(division.interface))] = 1.0
    for basis, W in built:
        V[np.ix_(basis.part.interior, basis.part.boundary)] = basis.static
        V[np.ix_(basis.part.interior, basis.columns)] = W
    return V, ComponentBasis(division.interface, tuple(basis for basis, _ in built))


@dataclass(frozen=True, eq=False)
class _Block:
    """A component's interior and boundary at a point; masters of `parts` are the boundary."""

    parts: Partition
    stiffness: sp.csr_array
    factor: Factor | None
    digest: str

    @classmethod
    def of(cls, point: ModelPoint, division: Division, part: Part) -> _Block:
        """Cut out of the assembled matrices and factorised (error ``reduce.component-loose``)."""
        K, M, known = _cut(point, division, part)
        parts = Partition(K, M, np.arange(len(part.boundary)))
        inside = parts.block(K, parts.slaves, parts.slaves)
        try:
            factor = slaves_factor(parts)
        except FemtuneError as error:
            raise FemtuneError(
                "reduce.component-loose",
                component=part.name,
                configuration=point.configured.configuration.name,
            ) from error
        return cls(parts, inside, factor, known)


def _cut(point: ModelPoint, division: Division, part: Part) -> tuple[sp.csr_array, sp.csr_array, str]:
    """K and M of boundary and interior, and the digest of the rows of the interior, which make the vectors."""
    at = np.concatenate([division.interface[part.boundary], part.interior])
    K, M = (sp.csr_array(A[at][:, at]) for A in (point.stiffness, point.mass))
    inside = slice(len(part.boundary), None)
    return K, M, digest(K[inside], M[inside])


# ----------------------------------------------------------------------------------------------------
# Vectors that are added to a component's own.


@dataclass(frozen=True, eq=False)
class Motions:
    """Motions of the whole model whose parts in the components matter.

    Parameters
    ----------
    shapes : (n_free, m)
    energy : (m,) φᵀ(K − σM)φ, to which the error of a part is relative
    """

    shapes: Reals
    energy: Reals


def with_parts_of(
    basis: Reals, components: ComponentBasis, motions: Motions, negligible: float
) -> tuple[Reals, ComponentBasis]:
    """The basis with the parts of motions in each component's interior that it does not contain yet."""
    added: dict[str, tuple[tuple[Reals, Reals | None], ...]] = {}
    for component in components.parts:
        boundary = motions.shapes[components.interface[component.part.boundary]]
        missing = motions.shapes[component.part.interior] - component.static @ boundary
        added[component.part.name] = ((missing, motions.energy),)
    return _grown(basis, components, added, negligible)


def rebuilt(
    basis: Reals, components: ComponentBasis, point: ModelPoint, motions: Motions, negligible: float
) -> tuple[Reals, ComponentBasis]:
    """The basis with fixed-interface modes and static shapes at another point.

    Components whose matrices are those of an earlier point are left as they are. Of the static shapes, the differences
    from those of the beginning are added as far as they take part in `motions`.
    """
    division = Division(tuple(p.part for p in components.parts), components.interface)
    added: dict[str, tuple[tuple[Reals, Reals | None], ...]] = {}
    parts = []
    for component in components.parts:
        known = _cut(point, division, component.part)[2]
        if known in component.built:
            parts.append(component)
            continue
        block = _Block.of(point, division, component.part)
        modes = fixed_interface_modes_up_to(block.parts, block.factor, component.max_hz)
        change = static_shapes(block.parts, block.factor) - component.static
        boundary = motions.shapes[components.interface[component.part.boundary]]
        added[component.part.name] = ((modes, None), (change @ boundary, motions.energy))
        parts.append(replace(component, built=(*component.built, known)))
    return _grown(basis, replace(components, parts=tuple(parts)), added, negligible)


def _grown(
    basis: Reals,
    components: ComponentBasis,
    added: Mapping[str, Sequence[tuple[Reals, Reals | None]]],
    negligible: float,
) -> tuple[Reals, ComponentBasis]:
    """The basis with vectors (n_o, m) added to some components; energies None stand for the vectors' own."""
    end, parts, columns = basis.shape[1], [], []
    for component in components.parts:
        if not component.part.interior.size or component.part.name not in added:
            parts.append(component)
            continue
        W = basis[np.ix_(component.part.interior, component.columns)]
        before = W.shape[1]
        for vectors, energy in added[component.part.name]:
            W = extend(W, vectors, component.metric, negligible, energy)
        new = np.zeros((len(basis), W.shape[1] - before))
        new[component.part.interior] = W[:, before:]
        columns.append(new)
        parts.append(replace(component, columns=np.append(component.columns, np.arange(end, end + new.shape[1]))))
        end += new.shape[1]
    return np.hstack([basis, *columns]), replace(components, parts=tuple(parts))
