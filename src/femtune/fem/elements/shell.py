"""Shells (CQUAD4, CTRIA3): the parts that all shapes share, put together from a formulation of the strains.

The stiffness is a list of products of rows, each with one coefficient; the rows come in chunks that fit a core's cache.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from femtune.fem.contribution import Contribution
from femtune.fem.elements.placement import CHUNK
from femtune.fem.elements.quad import QUAD
from femtune.fem.elements.shell_checks import check_shells
from femtune.fem.elements.shell_laws import ShellTerm, stiffness_terms
from femtune.fem.elements.shell_mass import ShellMass, fill_mass, lumped
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
    return shell(batch, structure, QUAD)


def shell_tri(batch: ElementBatch, structure: Structure) -> list[Contribution]:
    """Stiffness and mass of CTRIA3; errors as of ``shell_quad``."""
    return shell(batch, structure, TRI)


def shell(batch: ElementBatch, structure: Structure, formulation: ShellFormulation) -> list[Contribution]:
    """Stiffness and mass of a batch of shells of one formulation; errors as of ``check_shells``."""
    check_shells(batch, structure)
    residual = formulation.residual and formulation.residual(structure.nodes.xyz[batch.nodes])
    terms = stiffness_terms(batch, structure, formulation.uniaxial, residual)
    d = batch.dofs.shape[1]
    matrices = [np.empty((len(term.at), d, d)) for term in terms]
    mass, normals = ShellMass.empty(batch), shared_normals(batch, structure)
    for part in _chunks(len(batch)):
        plane = shell_plane(batch, structure, normals, part)
        _fill_stiffness(batch, structure, formulation, terms, matrices, plane, part)
        shares = formulation.shares(plane.corners) * structure.mass_factor
        fill_mass(mass, plane, shares if structure.consistent_mass else lumped(shares), part)
    return [*(_contribution(t, k) for t, k in zip(terms, matrices)), *mass.contributions()]


def _chunks(count: int) -> Iterator[slice]:
    return (slice(i, min(i + CHUNK, count)) for i in range(0, count, CHUNK))


def _contribution(term: ShellTerm, matrices: Reals) -> Contribution:
    return Contribution("stiffness", term.label, term.at, matrices, term.roles, term.coefficient, term.facts, term.loss)


def _fill_stiffness(
    batch: ElementBatch,
    structure: Structure,
    formulation: ShellFormulation,
    terms: list[ShellTerm],
    matrices: list[Reals],
    plane: ShellPlane,
    part: slice,
) -> None:
    strains = formulation.strains(plane)
    rows = nodal_rows(strains, plane, bool(batch.facts["offset_given"][part].any()))
    for name in [name for name in rows if name.startswith("drill")]:
        rows[name] = rows[name] * np.sqrt(DRILLING * structure.drilling)
    for term, out in zip(terms, matrices):
        lo, hi = np.searchsorted(term.at, [part.start, part.stop])
        if lo < hi:
            own = term.at[lo:hi] - part.start
            _put_squares(rows, term, own, out[lo:hi])
            _put_direction(term, strains, plane, own, slice(lo, hi))


def _put_squares(rows: Rows, term: ShellTerm, own: NDArray[np.int64], out: Reals) -> None:
    """Put LᵀL or LᵀR + RᵀL into `out`, exactly symmetric."""
    left = _together(rows, term.left, own)
    # LᵀL is half of itself twice, so that both cases are one pass
    right = _together(rows, term.right, own) if term.right else 0.5 * left
    half = np.swapaxes(left, 1, 2) @ right
    np.add(half, np.swapaxes(half, 1, 2), out=out)


def _together(rows: Rows, names: tuple[str, ...], own: NDArray[np.int64]) -> Reals:
    """Rows of several names one after the other, of some elements of the chunk."""
    whole = np.concatenate([rows[name] for name in names], axis=1)
    return whole if len(own) == len(whole) else whole[own]


def _put_direction(term: ShellTerm, strains: ShellStrains, plane: ShellPlane, own: NDArray, place: slice) -> None:
    """Cosine and sine of a uniaxial row's direction in material axes."""
    if not term.direction:
        return
    x, y = strains.along[own, term.direction - 1].T
    c, s = plane.material[own].T
    for name, value in (("cos", c * x + s * y), ("sin", c * y - s * x)):
        term.facts.setdefault(name, np.empty(len(term.at)))[place] = value
