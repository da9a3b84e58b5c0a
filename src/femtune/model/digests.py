"""Digests of arrays: equal digests mean equal arrays, to the last bit."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields
from typing import Any, TypeAlias

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.fem import ElementBatch, Structure
from femtune.model.configuration import Configuration

Part: TypeAlias = "NDArray[Any] | sp.sparray | str | float | None"


def digest(*parts: Part) -> str:
    """SHA-256, in hexadecimal digits, of texts, numbers and arrays with their types, shapes and order."""
    sha = hashlib.sha256()
    for part in parts:
        for piece in _pieces(part):
            sha.update(piece)
    return sha.hexdigest()


def _pieces(part: Part) -> Iterable[bytes | memoryview]:
    if isinstance(part, np.ndarray):
        yield f"[{part.dtype.str}{part.shape}]".encode()
        yield np.ascontiguousarray(part).data
    elif sp.issparse(part):
        rows = sp.csr_array(part)
        for array in (np.array(rows.shape), rows.indptr, rows.indices, rows.data):
            yield from _pieces(array)
    else:
        plain = part.item() if isinstance(part, np.generic) else part
        yield f"[{type(plain).__name__} {plain!r}]".encode()


# ----------------------------------------------------------------------------------------------------
# What matrices are made of, as digests: everything but the values that parameters may move.


_NO_SETTINGS = frozenset({
    "nodes", "values", "batches", "assembled", "rigid", "multipoint_sets", "support_sets", "permanent",
    "default_support_set", "default_multipoint_set", "hold_singular", "element_kinds", "damping", "dof_sets",
    "preload",
})  # fmt: skip
"""Fields of a structure that act through others here, or on no matrix. All others, also those that are added later, are
settings that kernels may read, and count."""


@dataclass(frozen=True)
class Identity:
    """Digests of a structure in one configuration (`elements`), and of each of its assembled matrices."""

    elements: str
    assembled: tuple[str, ...]


def identity(structure: Structure, configuration: Configuration, transformation: sp.csr_array) -> Identity:
    """Of all that element kernels are given but values, of what is switched off and added, and of the constraints.

    How parameters split the values among elements is no part of it.
    """
    nodes = structure.nodes
    parts: list[Part] = [nodes.xyz, nodes.frames, len(nodes.scalar_points), transformation]
    for name in sorted({f.name for f in fields(structure)} - _NO_SETTINGS):
        parts += [name, getattr(structure, name)]
    for batch in structure.batches:
        parts += _of_batch(batch)
    preload = structure.preload
    if preload is not None:
        parts += ["preload", preload.forces, preload.acceleration, preload.support_set, preload.multipoint_set]
    parts += ["off", *sorted(configuration.elements_off)]
    for mass in configuration.masses:
        parts += [mass.node, nodes.position(mass.node), mass.mass, np.array(mass.offset), np.array(mass.inertia)]
    return Identity(digest(*parts), tuple(digest(m.upper) for m in structure.assembled))


def _of_batch(batch: ElementBatch) -> Iterator[Part]:
    yield from ("batch", batch.kind, batch.ids, batch.nodes, batch.dofs)
    for name, fact in batch.facts.items():
        yield from (name, fact)
    yield from ("roles", *batch.roles, _shared(batch))
    for setting, value in batch.settings.items():
        yield from (setting, value)


def _shared(batch: ElementBatch) -> NDArray[np.uint16]:
    """(k, e) the first role that has an element's value too: kernels look at what is one value."""
    columns = np.array(list(batch.roles.values()), np.int64).reshape(len(batch.roles), len(batch))
    return np.array([(columns == role).argmax(axis=0) for role in columns], np.uint16)
