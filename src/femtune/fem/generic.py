"""Groups of elements whose stiffness is parameterised by its own eigenvalues and shapes (generic elements)."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Integers, Reals
from femtune.errors import FemtuneError
from femtune.fem.assemble import nominal_matrices
from femtune.fem.elements import pieces
from femtune.fem.fields import generic_ref
from femtune.fem.structure import ElementBatch, Structure

KIND = "generic"
MOST_DOFS = 3000
"""Largest number of DOFs of a group: its dense matrix (72 MB) is decomposed as a whole, with time ∝ n³."""

_RIGID_EIGENVALUE = 1e-11
"""Eigenvalues up to this fraction of the largest belong to rigid-body modes.

They are zero but for rounding, about n·1e-16 of the largest (3e-13 for `MOST_DOFS`); elastic ones below it would
have only a few correct digits.
"""
_REPEATED = 1e-6
"""Relative distance up to which eigenvalues are one repeated eigenvalue.

Shapes of eigenvalues this close have rounding errors amplified a million times, so they have no individual meaning.
"""
_NAME = re.compile(r"K([1-9][0-9]*)|S([1-9][0-9]*)-([1-9][0-9]*)")


@dataclass(frozen=True)
class GenericGroup:
    """A group of elements.

    Parameters
    ----------
    name : in capitals, as its fields are called: ``GENERIC JOINT K1``
    elements : numbers of its elements
    nodes : grid points onto which its stiffness is condensed; if empty, all of the group
    components : of these grid points, digits 1 to 6; the others are condensed too
    """

    name: str
    elements: frozenset[int]
    nodes: tuple[int, ...] = ()
    components: str = "123456"


@dataclass(frozen=True, eq=False)
class GenericModes:
    """Eigenvalues and shapes of a group's stiffness, as the deck has it.

    Parameters
    ----------
    dofs : (d,) g-set DOFs
    kappa : (n,) distinct eigenvalues above those of rigid-body modes, ascending; in the deck's units (force per
        displacement, moment per rotation)
    shapes : (d, r) orthonormal shapes
    owner : (r,) eigenvalue that a shape belongs to, from 0; copies of one joint in a group share it
    rigid : number of rigid-body modes
    """

    dofs: Integers
    kappa: Reals
    shapes: Reals
    owner: Integers
    rigid: int

    @cached_property
    def multiplicity(self) -> Integers:
        """(n,) how many shapes an eigenvalue has."""
        return np.bincount(self.owner, minlength=len(self.kappa))


def generic_modes(structure: Structure, group: GenericGroup) -> GenericModes:
    """Decompose the stiffness of a group, condensed onto the DOFs that it keeps: K = Φ₀ κ₀ Φ₀ᵀ.

    Raises
    ------
    FemtuneError : ``generic.empty`` where the group has no stiffness, ``generic.too-large``, ``model.unknown-node``
    """
    dofs, K = _group_matrix(structure, group)
    kept = _kept(structure, group, dofs)
    K = _condensed(K, kept)
    values, vectors = np.linalg.eigh(K) if K.size else (np.zeros(0), K)
    largest = values.max(initial=0.0)
    if largest <= 0.0:
        raise _error("generic.empty", group)
    elastic = values > _RIGID_EIGENVALUE * largest
    owner = np.cumsum(np.diff(values[elastic], prepend=-largest) > _REPEATED * values[elastic]) - 1
    kappa = np.bincount(owner, values[elastic]) / np.bincount(owner)
    return GenericModes(dofs[kept], kappa, vectors[:, elastic], owner, int((~elastic).sum()))


def _group_matrix(structure: Structure, group: GenericGroup) -> tuple[Integers, Reals]:
    """DOFs of the group's stiffness, ascending, and the matrix at the deck's values."""
    blocks = list(_matrices(structure, group.elements))
    every = np.unique(np.concatenate([np.zeros(0, np.int64), *(dofs.ravel() for dofs, _ in blocks)]))
    every = every[every >= 0]
    if len(every) > MOST_DOFS:
        raise _error("generic.too-large", group, dofs=len(every), largest=MOST_DOFS)
    K = np.zeros((len(every) + 1,) * 2)
    for dofs, matrices in blocks:
        # ground is the last row, which is dropped
        at = np.where(dofs >= 0, np.searchsorted(every, dofs), len(every))
        np.add.at(K, (at[:, :, None], at[:, None, :]), matrices)
    return every, K[:-1, :-1]


def _matrices(structure: Structure, elements: Collection[int]) -> Iterable[tuple[Integers, Reals]]:
    chosen = list(elements)
    for batch in structure.batches:
        if batch.kind == KIND or not np.isin(batch.ids, chosen).any():
            continue
        for part in (p for piece in pieces(batch, structure) for p in piece if p.matrix == "stiffness"):
            mine = np.isin(batch.ids[part.at], chosen)
            yield batch.dofs[part.at[mine]], nominal_matrices(batch, structure, part)[mine]


def _kept(structure: Structure, group: GenericGroup, dofs: Integers) -> NDArray[np.bool_]:
    nodes = structure.nodes
    keep = np.isin(dofs % 6, [int(c) - 1 for c in group.components]) | (dofs >= 6 * len(nodes.ids))
    if group.nodes:
        keep &= np.isin(dofs // 6, [nodes.position(n) for n in group.nodes])
    return np.asarray(keep)


def _condensed(K: Reals, kept: NDArray[np.bool_]) -> Reals:
    """The Schur complement; the other DOFs may have motions that need no force."""
    if kept.all():
        return K
    inner, across = K[np.ix_(~kept, ~kept)], K[np.ix_(~kept, kept)]
    out = K[np.ix_(kept, kept)] - across.T @ np.linalg.pinv(inner, rcond=_RIGID_EIGENVALUE, hermitian=True) @ across
    return np.asarray(0.5 * (out + out.T))


def with_generic(structure: Structure, group: GenericGroup, names: Sequence[str]) -> Structure:
    """The structure with eigenvalues and rotations of a group as entries of the value table.

    Parameters
    ----------
    names : "K1" is the smallest eigenvalue above zero; "S1-3" the angle in rad by which shape 1 turns towards shape 3,
        zero in the deck. Several rotations are applied in this order.

    Raises
    ------
    FemtuneError : ``generic.name``, ``generic.rigid-body``, ``generic.repeated``, ``generic.overlap``, and those of
        `generic_modes`
    """
    _check_overlap(structure, group)
    modes = generic_modes(structure, group)
    asked = [_parsed(group, modes, name) for name in names]
    angles = [numbers for numbers in asked if len(numbers) == 2]
    for name in {i for pair in angles for i in pair}:
        _check_simple(group, modes, name)
    used = sorted({i for numbers in asked for i in numbers})
    entries = {generic_ref(group.name, f"K{i}"): float(modes.kappa[i - 1]) for i in used}
    entries |= {generic_ref(group.name, f"S{p}-{q}"): 0.0 for p, q in angles}
    values = structure.values.extended(entries)
    at = [i for i in map(values.index, entries) if i is not None]
    batch = _batch(group, modes, used, angles, at)
    return replace(structure, values=values, batches=(*structure.batches, batch))


def _batch(
    group: GenericGroup, modes: GenericModes, used: list[int], angles: Sequence[tuple[int, ...]], at: list[int]
) -> ElementBatch:
    of = [np.flatnonzero(modes.owner == i - 1) for i in used]
    names = [*(f"K{i}" for i in range(len(used))), *(f"S{s}" for s in range(len(angles)))]
    roles = {name: np.array([i], np.int64) for name, i in zip(names, at)}
    columns = np.concatenate([np.zeros(0, np.int64), *of])
    facts = {
        "kappa": modes.kappa[np.array(used, int) - 1][None],
        "shapes": modes.shapes[:, columns][None],
        "owner": np.repeat(np.arange(len(used)), [len(c) for c in of])[None],
        "angles": np.array([[used.index(i) for i in pair] for pair in angles], np.int64).reshape(1, -1, 2),
        "members": np.array(sorted(group.elements), np.int64)[None],
    }
    one = np.full((1, 1), -1)
    # 0 is not the number of any element
    return ElementBatch(KIND, f"GENERIC {group.name}", np.zeros(1, np.int64), one, modes.dofs[None], roles, facts)


def _parsed(group: GenericGroup, modes: GenericModes, name: str) -> tuple[int, ...]:
    """Numbers of the eigenvalues that a name refers to."""
    if name == "K0":
        raise _error("generic.rigid-body", group, rigid=modes.rigid, eigenvalues=_listed(modes))
    match = _NAME.fullmatch(name)
    numbers = tuple(int(n) for n in match.groups() if n) if match else ()
    if not numbers or max(numbers) > len(modes.kappa) or len(set(numbers)) < len(numbers):
        facts = {"name": name, "rigid": modes.rigid, "count": len(modes.kappa), "eigenvalues": _listed(modes)}
        raise _error("generic.name", group, **facts)
    return numbers


def _listed(modes: GenericModes) -> str:
    shown = (f"K{i} = {k:.4g}" for i, k in enumerate(modes.kappa[:6], 1))
    return ", ".join(shown) + (", …" if len(modes.kappa) > 6 else "")


def _check_simple(group: GenericGroup, modes: GenericModes, number: int) -> None:
    if modes.multiplicity[number - 1] > 1:
        raise _error("generic.repeated", group, number=number, multiplicity=modes.multiplicity[number - 1])


def _check_overlap(structure: Structure, group: GenericGroup) -> None:
    for batch in structure.batches:
        both = group.elements & set(batch.facts["members"][0].tolist()) if batch.kind == KIND else set()
        if both:
            raise _error("generic.overlap", group, member=min(both), other=batch.card)


def check_untouched(structure: Structure, touched: Collection[int]) -> None:
    """Refuse parameters that change the stiffness of a group's elements other than by its κ, which start from the deck.

    Raises
    ------
    FemtuneError : ``generic.moved-elsewhere``
    """
    groups = [b for b in structure.batches if b.kind == KIND]
    for batch in structure.batches if groups else ():
        if batch.kind == KIND:
            continue
        for part in (p for piece in pieces(batch, structure) for p in piece if p.matrix == "stiffness"):
            at = np.stack([batch.roles[role][part.at] for role in part.roles])
            moved = set(batch.ids[part.at[np.isin(at, list(touched)).any(axis=0)]].tolist())
            for group in groups:
                _refuse_moved(group, moved)


def _refuse_moved(group: ElementBatch, moved: set[int]) -> None:
    both = sorted(moved & set(group.facts["members"][0].tolist()))
    if both:
        raise FemtuneError(
            "generic.moved-elsewhere",
            values={"elements": ", ".join(map(str, both[:10]))},
            member=both[0],
            group=group.card,
        )


def check_whole(structure: Structure, off: Collection[int]) -> None:
    """Refuse a state without some of a group's elements (error ``generic.switched-off``)."""
    for batch in structure.batches if off else ():
        both = sorted(set(batch.facts["members"][0].tolist()) & set(off)) if batch.kind == KIND else []
        if both:
            raise FemtuneError("generic.switched-off", member=both[0], group=batch.card)


def _error(code: str, group: GenericGroup, **facts: Any) -> FemtuneError:
    return FemtuneError(code, group=group.name, **facts)
