"""Offsets of the ends of bars and beams as values that parameters move.

The fields W1A … W3B of a card are components along the displacement frame of the grid point, or along a frame of the
element's line (OFFT). Elements whose offsets are parameters form a separate batch; the offsets of all others are
constants.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Flags, Reals
from femtune.fem.elements import KINDS, placement
from femtune.fem.elements.moving_ends import COMPONENTS, has_offsets, may_turn, spans
from femtune.fem.elements.placement import element_error
from femtune.fem.fields import FieldRef
from femtune.fem.structure import ElementBatch, Structure

_SPAN_ROUNDING = 1e-12
"""Change of a span, relative to its coordinates and length, that is rounding of offsets that move together.

A few roundings of 1e-16 in each coordinate; a parameter that turns a beam changes its span by far more.
"""
_SHORTEST_SPAN = 1e-3
"""Smallest length of a beam along its original axis, as a fraction of its original length.

Bending stiffness grows with 1/L³, by 1e9 here; any smaller value refuses the same bounds in practice.
"""


def with_offsets(structure: Structure, elements: Collection[int]) -> Structure:
    """The structure in which the offsets of some bars and beams are entries of the value table.

    Parameters
    ----------
    elements : numbers of CBAR and CBEAM elements; others are left as they are
    """
    batches: list[ElementBatch] = []
    for batch in structure.batches:
        chosen = np.isin(batch.ids, list(elements)) & KINDS[batch.kind].end_offsets & (not has_offsets(batch))
        if not chosen.any():
            batches.append(batch)
            continue
        if not chosen.all():
            batches.append(_rows(batch, ~chosen))
        structure, movable = _with_entries(structure, _rows(batch, chosen))
        batches.append(movable)
    return replace(structure, batches=tuple(batches))


def _rows(batch: ElementBatch, keep: Flags) -> ElementBatch:
    roles, facts = ({name: a[keep] for name, a in arrays.items()} for arrays in (batch.roles, batch.facts))
    return replace(batch, ids=batch.ids[keep], nodes=batch.nodes[keep], dofs=batch.dofs[keep], roles=roles, facts=facts)


def _with_entries(structure: Structure, batch: ElementBatch) -> tuple[Structure, ElementBatch]:
    """The batch with roles W1A … W3B and the frames of their components."""
    frames = {end: _frames(batch, structure, k) for k, end in enumerate("AB")}
    entries: dict[FieldRef, float] = {}
    roles: dict[str, NDArray[np.int64]] = {}
    for end, names in COMPONENTS.items():
        arms = np.einsum("eic,ei->ec", frames[end], batch.facts[f"offset_{end.lower()}"])
        for c, name in enumerate(names):
            entries |= {FieldRef(batch.card, int(n), name): float(w) for n, w in zip(batch.ids, arms[:, c])}
    values = structure.values.extended(entries)
    for name in (n for names in COMPONENTS.values() for n in names):
        positions = (values.index(FieldRef(batch.card, int(n), name)) for n in batch.ids)
        roles[name] = np.array([i for i in positions if i is not None], np.int64)
    facts = {**batch.facts, **{f"frame_{end.lower()}": frame for end, frame in frames.items()}}
    return replace(structure, values=values), replace(batch, roles={**batch.roles, **roles}, facts=facts)


def _frames(batch: ElementBatch, structure: Structure, k: int) -> Reals:
    """(e, 3, 3) axes of the components of an end's offset, columns in the basic frame."""
    displacement = placement.node_frames(batch, structure, k)
    of_line = batch.facts.get("offset_of_line")
    if of_line is None or not of_line[:, k].any():
        return displacement
    a, b = (placement.node_positions(batch, structure, end) for end in (0, 1))
    x, _ = placement.line_axes(batch, a, b)
    along = placement.oriented_axes(batch, x, batch.facts["orientation"])
    return np.where(of_line[:, k, None, None], along, displacement)


def settled(structure: Structure, samples: Reals) -> Structure:
    """The structure with a note of the movable offsets that leave the axes of their elements parallel.

    If both ends move by the same vector, matrices are quadratic polynomials in the offsets; otherwise length and
    direction change, and the matrices are rational functions.

    Parameters
    ----------
    samples : (s, n) value tables at points of the parameters

    Raises
    ------
    FemtuneError : ``parameter.offset-axis`` if a tapered or skew beam would turn or change its length
    """
    if not any(has_offsets(b) for b in structure.batches):
        return structure
    return replace(structure, batches=tuple(_settled(structure, samples)))


def _settled(structure: Structure, samples: Reals) -> Iterator[ElementBatch]:
    for batch in structure.batches:
        if not has_offsets(batch):
            yield batch
            continue
        lines = np.array([spans(batch, structure, table) for table in (structure.values.values, *samples)])
        size = np.abs(structure.nodes.xyz[batch.nodes]).max(axis=(1, 2)) + np.linalg.norm(lines[0], axis=1)
        still = np.asarray(np.abs(lines - lines[0]).max(axis=(0, 2)) <= _SPAN_ROUNDING * size)
        _refuse(batch, ~still & ~may_turn(batch, structure))
        for part in (still, ~still):
            if part.any():
                some = _rows(batch, part)
                yield replace(some, facts={**some.facts, "still": part[part]} if part is still else some.facts)


def check_spans(structure: Structure, tables: Iterable[Reals]) -> None:
    """Refuse bounds within which a beam would shrink to zero length or reverse its direction.

    Parameters
    ----------
    tables : value tables (n,) at the bounds of the parameters

    Raises
    ------
    FemtuneError : ``parameter.offset-range``
    """
    batches = [b for b in structure.batches if has_offsets(b) and "still" not in b.facts]
    for table in tables if batches else ():
        for batch in batches:
            now, start = spans(batch, structure, table), spans(batch, structure, structure.values.values)
            along = np.einsum("ei,ei->e", now, start) / np.einsum("ei,ei->e", start, start)
            for i in np.flatnonzero(along <= _SHORTEST_SPAN)[:1]:
                values = {"length along its axis": float(along[i] * np.linalg.norm(start[i]))}
                raise element_error(batch, int(i), "parameter.offset-range", values=values)


def _refuse(batch: ElementBatch, bad: Flags) -> None:
    for i in np.flatnonzero(bad):
        raise element_error(batch, int(i), "parameter.offset-axis")
