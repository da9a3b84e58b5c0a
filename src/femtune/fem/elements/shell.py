"""Shells (CQUAD4, CTRIA3): the parts that all shapes share, put together from a formulation of the strains.

The stiffness is a list of products of rows, each with one coefficient; the rows come in chunks that fit a core's cache.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from femtune.fem.contribution import Contribution, joined
from femtune.fem.elements.placement import CHUNK
from femtune.fem.elements.quad import QUAD
from femtune.fem.elements.shell_checks import check_shells
from femtune.fem.elements.shell_laws import ShellTerm, couples, stiffness_terms
from femtune.fem.elements.shell_mass import ShellMass, lumped
from femtune.fem.elements.shell_normals import shared_normals
from femtune.fem.elements.shell_placement import ShellPlane, shell_plane
from femtune.fem.elements.shell_strains import Rows, ShellFormulation, ShellStrains, nodal_rows
from femtune.fem.elements.tri import TRI
from femtune.fem.structure import ElementBatch, Structure

Reals = NDArray[np.float64]

# Nastran's scale of K6ROT
DRILLING = 1e-6


def shell_quad(batch: ElementBatch, structure: Structure) -> list[Contribution]:
    """Stiffness and mass of CQUAD4.

    Raises
    ------
    FemtuneError : ``element.shell-shape``, ``element.shell-thickness``, ``element.material-direction``
    """
    return joined(shell_quad_pieces(batch, structure))


def shell_tri(batch: ElementBatch, structure: Structure) -> list[Contribution]:
    """Stiffness and mass of CTRIA3; errors as of ``shell_quad``."""
    return joined(shell_tri_pieces(batch, structure))


def shell_quad_pieces(batch: ElementBatch, structure: Structure) -> Iterator[list[Contribution]]:
    """The same as ``shell_quad``, some elements at a time."""
    return shell_pieces(batch, structure, QUAD)


def shell_tri_pieces(batch: ElementBatch, structure: Structure) -> Iterator[list[Contribution]]:
    """The same as ``shell_tri``, some elements at a time."""
    return shell_pieces(batch, structure, TRI)


def shell_pieces(
    batch: ElementBatch, structure: Structure, formulation: ShellFormulation
) -> Iterator[list[Contribution]]:
    """Stiffness and mass of shells of one formulation, some elements at a time; errors as of ``check_shells``."""
    check_shells(batch, structure)
    residual = formulation.residual and formulation.residual(structure.nodes.xyz[batch.nodes])
    terms = stiffness_terms(batch, structure, formulation.uniaxial, residual)
    normals, mass = shared_normals(batch, structure), _mass(batch)
    for part in _chunks(len(batch)):
        plane = shell_plane(batch, structure, normals, part)
        shares = formulation.shares(plane.corners) * structure.mass_factor
        stiffness = _stiffness(batch, structure, formulation, terms, plane, part)
        yield [*stiffness, *mass.contributions(plane, shares if structure.consistent_mass else lumped(shares), part)]


def _mass(batch: ElementBatch) -> ShellMass:
    """Where the mass is offset otherwise than the stiffness, it has a value of its own."""
    return ShellMass(np.flatnonzero(batch.facts["offset_given"]), "zm" if "zm" in batch.roles else "z0")


def _chunks(count: int) -> Iterator[slice]:
    return (slice(i, min(i + CHUNK, count)) for i in range(0, count, CHUNK))


def _stiffness(
    batch: ElementBatch,
    structure: Structure,
    formulation: ShellFormulation,
    terms: list[ShellTerm],
    plane: ShellPlane,
    part: slice,
) -> Iterator[Contribution]:
    strains = formulation.strains(plane)
    offsets, coupling = bool(batch.facts["offset_given"][part].any()), bool(couples(batch)[part].any())
    rows = nodal_rows(strains, plane, offsets, coupling)
    for name in [name for name in rows if name.startswith("drill")]:
        rows[name] = rows[name] * np.sqrt(DRILLING * structure.drilling)
    for term in terms:
        lo, hi = np.searchsorted(term.at, [part.start, part.stop])
        if lo < hi:
            own = term.at[lo:hi] - part.start
            facts = {name: fact[lo:hi] for name, fact in term.facts.items()} | _direction(term, strains, plane, own)
            matrices = _squares(rows, term, own)
            yield Contribution(
                "stiffness", term.label, term.at[lo:hi], matrices, term.roles, term.coefficient, facts, term.loss
            )


def _squares(rows: Rows, term: ShellTerm, own: NDArray[np.int64]) -> Reals:
    """LᵀL or LᵀR + RᵀL, exactly symmetric."""
    left = _together(rows, term.left, own)
    # LᵀL is half of itself twice, so that both cases are one pass
    right = _together(rows, term.right, own) if term.right else 0.5 * left
    half = np.swapaxes(left, 1, 2) @ right
    return np.asarray(half + np.swapaxes(half, 1, 2))


def _together(rows: Rows, names: tuple[str, ...], own: NDArray[np.int64]) -> Reals:
    """Rows of several names one after the other, of some elements of the chunk."""
    whole = np.concatenate([rows[name] for name in names], axis=1)
    return whole if len(own) == len(whole) else whole[own]


def _direction(term: ShellTerm, strains: ShellStrains, plane: ShellPlane, own: NDArray) -> dict[str, Reals]:
    """Cosine and sine of a uniaxial row's direction in material axes."""
    if not term.direction:
        return {}
    x, y = strains.along[own, term.direction - 1].T
    c, s = plane.material[own].T
    return {"cos": c * x + s * y, "sin": c * y - s * x}
