"""From a parametric model and a configuration to matrices on free DOFs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.fem import Structure, join_constraints
from femtune.fem.contribution import MatrixKind
from femtune.fem.elimination import Elimination, eliminate
from femtune.fem.singularities import singular_dofs
from femtune.fem.values import TableJet
from femtune.model.configuration import Configuration, check_configuration, held_dofs, mass_terms
from femtune.model.configured import ConfiguredModel
from femtune.model.memory import require_memory
from femtune.model.node_blocks import node_blocks
from femtune.model.parametric import ParametricModel
from femtune.model.pattern import SORTED
from femtune.model.projection import project
from femtune.model.symmetric import BothTriangles
from femtune.model.term import Layout, MatrixTerm, Term, TermFunction

# part of the entries of all element matrices that is left in the pattern of a mesh: shells .55, solids less
SHARED = 0.6


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
    dofs = tuple(structure.nodes.describe(i) for i in singular)
    require_memory(_forecast(terms, elimination.T), f"assembling {len(elimination.free):,} DOF")
    pattern, projected = project(terms, elimination.T)
    return ConfiguredModel(
        model, configuration, elimination.T, elimination.free, dofs, pattern.indptr, pattern.indices, projected
    )


def _forecast(terms: Sequence[TermFunction], T: sp.csr_array) -> int:
    """Bytes that the projection takes at its peak: pattern, places of entries, sums of all terms, and room to sort.

    About SHARED of the entries of a mesh's element matrices are left when those of neighbours are added.
    """
    own = [t for t in terms if isinstance(t, Term)]
    layouts = {id(t.layout): len(t.elements) * len(t.layout.pairs) for t in own}
    places = sum(layouts.values())
    sums = sum(t.values.size for t in own) + sum(t.upper.nnz for t in terms if isinstance(t, MatrixTerm))
    largest = max(layouts.values(), default=0)
    return int(4 * places + SHARED * (12 * sums + 12 * largest) + 24 * min(places, SORTED) + 8 * T.shape[1])


def grid_matrix(model: ParametricModel, configuration: Configuration, matrix: MatrixKind) -> sp.csr_array:
    """(n_g, n_g) matrix of a configuration at nominal values, before any constraint: for mass and rigid-body checks."""
    added = mass_terms(model.structure.nodes, configuration.masses)
    terms = [t for t in (*_active(model.terms, configuration), *added) if t.matrix == matrix]
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
    layouts: dict[Layout, tuple[NDArray[np.bool_], Layout]] = {}
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
    """g-set DOFs whose node has no stiffness there at nominal values."""
    stiffness = [t for t in terms if t.matrix == "stiffness"]
    blocks = node_blocks(stiffness, elimination, 6 * len(model.structure.nodes.ids), _nominal_table(model))
    return [int(i) for i in singular_dofs(blocks, elimination.free, model.structure.nodes)]


def _nominal_table(model: ParametricModel) -> TableJet:
    return model.table(np.zeros(len(model.parameters.free))).without_derivatives()
