"""Solids (CHEXA, CPENTA, CTETRA, CPYRAM): the parts common to all shapes, assembled from a formulation.

The stiffness is a list of products of strain rows, each with one coefficient. The rows are computed in chunks that fit
in a core's cache. Only the checks need the whole batch, so that a part of a batch can be computed alone.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.fem.contribution import Contribution, product
from femtune.fem.elements.placement import ELEMENTS_PER_CHUNK
from femtune.fem.elements.solids.checks import check_solids
from femtune.fem.elements.solids.laws import SolidTerm, law_rows, nominal_poisson, place_frame, stiffness_terms
from femtune.fem.elements.solids.strains import Rows, SolidFormulation, SolidPlaces, StrainGroup, grid_points
from femtune.fem.structure import ElementBatch, Structure

# ----------------------------------------------------------------------------------------------------
# Mass of solids for a unit density: consistent, or lumped in proportion to the diagonal of the consistent one.
#
# Source of the lumping: Hinton, Rock and Zienkiewicz, Earthq. Engng Struct. Dyn. 4 (1976) 245-249.


def mass_matrices(shares: Reals, frames: Reals | None, structure: Structure) -> Reals:
    """(m, 3n, 3n) from the integrals (m, n, n) of products of shape functions and the nodes' frames (m, n, 3, 3)."""
    shares = shares * structure.mass_factor
    if not structure.consistent_mass:
        shares, frames = lumped(shares), None
    m, n = shares.shape[:2]
    if frames is None:
        return np.asarray((shares[:, :, None, :, None] * np.eye(3)[:, None, :]).reshape(m, 3 * n, 3 * n))
    turn = np.swapaxes(frames, 2, 3).reshape(m, 3 * n, 3)
    between = turn @ np.swapaxes(turn, 1, 2)
    spread = np.repeat(np.repeat(shares, 3, axis=1), 3, axis=2)
    return np.asarray(0.5 * (between + np.swapaxes(between, 1, 2)) * spread)


def lumped(shares: Reals) -> Reals:
    """(m, n, n) diagonal shares in proportion to the consistent ones, with the same sum."""
    diagonal = np.einsum("mii->mi", shares)
    whole = shares.sum(axis=(1, 2)) / diagonal.sum(axis=1)
    return np.asarray(np.eye(shares.shape[1]) * (diagonal * whole[:, None])[:, None, :])


def solid(batch: ElementBatch, structure: Structure, formulation: SolidFormulation) -> list[Contribution]:
    """Stiffness and mass of a batch of solids of one formulation; errors as of ``check_solids``."""
    check_solids(batch, structure, formulation)
    terms = stiffness_terms(batch, structure, formulation.laws)
    d = batch.dofs.shape[1]
    matrices, mass = [np.empty((len(term.at), d, d)) for term in terms], np.empty((len(batch), d, d))
    for part in _chunks(len(batch), d):
        frames = _node_frames(batch, structure, part)
        places = SolidPlaces(grid_points(batch, structure, part), nominal_poisson(batch, structure, part))
        if formulation.squares and frames is None and batch.facts["isotropic"][part].all():
            _fill_squares(terms, matrices, formulation.squares(places), part)
        else:
            groups = [_on_nodes(group, frames) for group in formulation.strains(places)]
            _fill_stiffness(batch, terms, matrices, groups, formulation.laws, part)
        mass[part] = mass_matrices(formulation.shares(places.xyz), frames, structure)
    inertia = Contribution("mass", "mass", np.arange(len(batch)), mass, ("rho",), product("rho"))
    return [*(_contribution(t, k) for t, k in zip(terms, matrices)), inertia]


def _chunks(count: int, d: int) -> Iterator[slice]:
    # as much memory as ELEMENTS_PER_CHUNK elements with 24 displacements
    size = max(ELEMENTS_PER_CHUNK * 24**2 // d**2, 1)
    return (slice(i, min(i + size, count)) for i in range(0, count, size))


def _contribution(term: SolidTerm, matrices: Reals) -> Contribution:
    return Contribution("stiffness", term.label, term.at, matrices, term.roles, term.coefficient, term.facts)


def _node_frames(batch: ElementBatch, structure: Structure, part: slice) -> Reals | None:
    """(m, n, 3, 3) displacement frames of the nodes; None if all are the basic one."""
    at = batch.nodes[part]
    return structure.nodes.frames[at] if structure.nodes.rotated[at].any() else None


def _on_nodes(group: StrainGroup, frames: Reals | None) -> StrainGroup:
    """The group on the nodes' displacements in their frames."""
    if frames is None:
        return group
    m, r, c, n, _ = group.rows.shape
    flat = np.swapaxes(group.rows.reshape(m, r * c, n, 3), 1, 2) @ frames
    return StrainGroup(np.swapaxes(flat, 1, 2).reshape(m, r, c, n, 3), group.frame)


def _fill_stiffness(
    batch: ElementBatch,
    terms: list[SolidTerm],
    matrices: list[Reals],
    groups: list[StrainGroup],
    laws: tuple[str, ...],
    part: slice,
) -> None:
    isotropic = batch.facts["isotropic"][part]
    rows = law_rows(laws, groups, isotropic, batch.facts["material_frame"][part])
    for term, out in zip(terms, matrices):
        lo, hi = np.searchsorted(term.at, [part.start, part.stop])
        if lo < hi:
            some = term.at[lo:hi] - part.start
            _put_squares(rows, term, some, out[lo:hi])
            place_frame(term, groups, some, batch.facts["material_frame"][part], slice(lo, hi))


def _fill_squares(terms: list[SolidTerm], matrices: list[Reals], squares: Rows, part: slice) -> None:
    for term, out in zip(terms, matrices):
        lo, hi = np.searchsorted(term.at, [part.start, part.stop])
        out[lo:hi] = squares.get(term.left, 0.0)


def _put_squares(rows: Rows, term: SolidTerm, some: NDArray[np.int64], out: Reals) -> None:
    """Put LᵀL or LᵀR + RᵀL into `out`, exactly symmetric."""
    left = rows[term.left] if len(some) == len(rows[term.left]) else rows[term.left][some]
    # LᵀL is ½ (LᵀL + LᵀL), so that one expression serves both cases
    right = (
        (rows[term.right] if len(some) == len(rows[term.right]) else rows[term.right][some])
        if term.right
        else 0.5 * left
    )
    half = np.swapaxes(left, 1, 2) @ right
    np.add(half, np.swapaxes(half, 1, 2), out=out)
