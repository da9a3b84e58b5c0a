"""Bars and beams whose end offsets are values: matrices as functions of W1A … W3B.

A rigid arm w carries the motion of its grid point to the end of the beam, u + θ × w, so that K = T(w)ᵀ K_end T(w) with
T = 1 + Σ w_i X_i. Where the axis stays, K_end does, and K is a polynomial of second degree: (1, a, a²) for one offset.
Where length or direction change, see `moving_axis`. Rigid-body motion is strain-free whatever the offsets are.
Source: Mottershead, Friswell, Ng and Brandon (1996), Mechanical Systems and Signal Processing 10(2), 171-182.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import NDArray

from femtune.fem.contribution import Contribution, times
from femtune.fem.elements import placement
from femtune.fem.elements.bar import skewed
from femtune.fem.elements.moving_axis import moving_axis
from femtune.fem.structure import ElementBatch, Structure

Reals = NDArray[np.float64]
Kernel = Callable[[ElementBatch, Structure], list[Contribution]]

COMPONENTS = {"A": ("W1A", "W2A", "W3A"), "B": ("W1B", "W2B", "W3B")}
"""Fields of the offsets at both ends."""


def has_offsets(batch: ElementBatch) -> bool:
    """True for a batch whose offsets are values."""
    return "W1A" in batch.roles


def may_turn(batch: ElementBatch, structure: Structure) -> NDArray[np.bool_]:
    """(e,) True for the elements whose axis may move: bars of constant section that are not skew."""
    if batch.kind != "bar":
        return np.zeros(len(batch), bool)
    return ~skewed(batch, structure)


def arms(batch: ElementBatch, end: str, table: NDArray) -> NDArray:
    """(e, 3) offsets of an end in the basic frame, of a value table (n,)."""
    w = np.stack([table[batch.roles[name]] for name in COMPONENTS[end]], axis=1)
    return np.einsum("eic,ec->ei", batch.facts[f"frame_{end.lower()}"], w)


def spans(batch: ElementBatch, structure: Structure, table: NDArray) -> NDArray:
    """(e, 3) vectors from end A to end B."""
    a, b = (placement.node_positions(batch, structure, k) + arms(batch, end, table) for k, end in enumerate("AB"))
    return np.asarray(b - a)


def with_moved_ends(kernel: Kernel, batch: ElementBatch, structure: Structure) -> list[Contribution]:
    """Contributions of a batch whose offsets are values; `kernel` is that of its kind."""
    if "still" in batch.facts or not may_turn(batch, structure).all():
        return list(_polynomial(kernel, batch, structure))
    return moving_axis(batch, structure, spans(batch, structure, structure.values.values))


def _polynomial(kernel: Kernel, batch: ElementBatch, structure: Structure) -> Iterator[Contribution]:
    """Each part A of the beam between its ends as A + Σ w_i (A X_i + X_iᵀ A) + Σ w_i w_j X_iᵀ A X_j."""
    turns = _turns(batch, structure)
    between = replace(batch, facts={**batch.facts, "at_ends": np.ones(len(batch), bool)})
    for part in kernel(between, structure):
        yield part
        X = {name: turn[part.at] for name, turn in turns.items()}
        for name, turn in X.items():
            once = part.matrices @ turn
            yield from _power(part, once + np.swapaxes(once, 1, 2), name)
        for i, j in combinations_with_replacement(X, 2):
            twice = np.swapaxes(X[i], 1, 2) @ part.matrices @ X[j]
            both = 0.5 * (twice + np.swapaxes(twice, 1, 2))
            yield from _power(part, both if i == j else 2.0 * both, i, j)


def _power(part: Contribution, matrices: Reals, *names: str) -> Iterator[Contribution]:
    if matrices.any():
        yield times(replace(part, matrices=matrices, label=f"{part.label}-{'-'.join(names)}"), *names)


def _turns(batch: ElementBatch, structure: Structure) -> dict[str, Reals]:
    """(e, 12, 12) what a unit of each offset adds to the displacements of the ends, in the frames of the nodes."""
    out = {}
    for k, end in enumerate("AB"):
        nodes, frame = placement.node_frames(batch, structure, k), batch.facts[f"frame_{end.lower()}"]
        for c, name in enumerate(COMPONENTS[end]):
            arm = np.einsum("eji,ej->ei", nodes, frame[:, :, c])
            turn = np.zeros((len(batch), 12, 12))
            turn[:, 6 * k : 6 * k + 3, 6 * k + 3 : 6 * k + 6] = -placement.cross_matrix(arm)
            out[name] = turn
    return out
