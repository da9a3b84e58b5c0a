"""Doubts about a model that is valid: parts that nothing connects, doubled elements, normals that alternate."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from femtune.errors import Notice, Where
from femtune.fem.connectivity import (
    SHELLS,
    SOLIDS,
    Connectivity,
    alternating_normals,
    coincident_pairs,
    connectivity,
    far_ends,
    repeated_elements,
)
from femtune.fem.structure import Structure

_MOST_PARTS = 20
"""Number of parts up to which each is named; decks of more collect many small structures on purpose."""


def health_notices(
    structure: Structure, place_of_element: Callable[[int], Where], place_of_grid: Callable[[int], Where]
) -> list[Notice]:
    """Notices of what an analyst would doubt, each with its place and the smallest fix."""
    links = connectivity(structure)
    return [
        *_coincident(structure, links, place_of_grid),
        *_free_parts(structure, links, place_of_grid),
        *_repeated(structure, place_of_element),
        *_normals(structure, place_of_element),
        *_far_ends(structure, place_of_element),
    ]


def _coincident(structure: Structure, found: Connectivity, place: Callable[[int], Where]) -> Iterator[Notice]:
    pairs = coincident_pairs(structure, found)
    if len(pairs) == 0:
        return
    apart = found.part[pairs[:, 0]] != found.part[pairs[:, 1]]
    shown = pairs[apart] if apart.any() else pairs
    one, other = sorted(int(n) for n in structure.nodes.ids[shown[0]])
    yield Notice(
        "deck.coincident-points/parts" if apart.any() else "deck.coincident-points",
        where=place(other), count=len(shown), plural="s" if len(shown) > 1 else "", one=one, other=other,
    )  # fmt: skip


def _free_parts(structure: Structure, found: Connectivity, place: Callable[[int], Where]) -> Iterator[Notice]:
    """Parts with stiffness and without support, in a model whose other parts are supported."""
    grids = len(structure.nodes.ids)
    parts = np.unique(found.part[found.stiff])
    held = structure.support_sets.get(structure.default_support_set or 0, np.zeros(0, np.int64))
    supported = np.unique(found.part[held[held < 6 * grids] // 6])
    free = np.setdiff1d(parts, supported)
    if not len(free) or not len(np.intersect1d(parts, supported)) or len(parts) > _MOST_PARTS:
        return
    rows = np.flatnonzero(found.stiff[:grids] & np.isin(found.part[:grids], free))
    if len(rows):
        first = int(structure.nodes.ids[rows[0]])
        yield Notice(
            "deck.free-part", where=place(first), parts=len(parts), free=len(free),
            verb="have" if len(free) > 1 else "has", grid=first, points=len(rows),
        )  # fmt: skip


def _repeated(structure: Structure, place: Callable[[int], Where]) -> Iterator[Notice]:
    for batch in structure.batches:
        if batch.card not in (*SHELLS, *SOLIDS):
            continue
        pairs = list(repeated_elements(batch))
        alike = [pair for pair in pairs if pair[2]]
        if pairs:
            one, other, _ = (alike or pairs)[0]
            several = len(alike or pairs) > 1
            yield Notice(
                "deck.repeated-elements" if alike else "deck.repeated-elements/other-property",
                where=place(other), level="warning" if alike else "info", count=len(alike or pairs),
                plural="s" if several else "", verb="lie" if several else "lies", card=batch.card, one=one, other=other,
            )  # fmt: skip


def _normals(structure: Structure, place: Callable[[int], Where]) -> Iterator[Notice]:
    pairs = alternating_normals(structure)
    if pairs:
        one, other = pairs[0]
        yield Notice(
            "deck.alternating-normals", where=place(other), count=len(pairs), plural="s" if len(pairs) > 1 else "",
            one=one, other=other,
        )  # fmt: skip


def _far_ends(structure: Structure, place: Callable[[int], Where]) -> Iterator[Notice]:
    ends = far_ends(structure)
    if ends:
        card, number, one, other, distance = ends[0]
        ids = structure.nodes.ids
        yield Notice(
            "deck.far-ends", where=place(number), card=card, number=number, one=int(ids[one]), other=int(ids[other]),
            distance=distance, more=f" (and {len(ends) - 1} more)" if len(ends) > 1 else "",
        )  # fmt: skip
