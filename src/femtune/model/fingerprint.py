"""What solutions at a model point depend on, as digests."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from femtune.fem.fields import MatrixKind
from femtune.model.configured import ModelPoint
from femtune.model.digests import Part, digest
from femtune.model.imported.model import factor_at


def matrices_digest(point: ModelPoint, *kinds: MatrixKind) -> str:
    """Digest of all that the matrices of some kinds are made of, without assembling them.

    How they depend on the parameters is no part of it: another choice of parameters splits the same sums in another
    way, and the last bits of the matrices may differ.
    """
    wanted = set(kinds)
    overall: Part = None
    if "hysteretic" in wanted and point.loss_factor is not None:
        # the whole structure's loss multiplies its stiffness
        wanted.add("stiffness")
        overall = np.asarray(point.loss_factor.value)
    names = sorted(wanted)
    tables: list[Part] = []
    if point.depends_on_frequency:
        tables = [p for t in point.configured.model.tables for p in (*map(str, t.fields), t.freq_hz, t.factor)]
    return digest(
        *names, point.configured.identity.elements, *_values(point, wanted), *_assembled(point, wanted), overall,
        *tables,
    )  # fmt: skip


def _values(point: ModelPoint, kinds: set[MatrixKind]) -> Iterator[Part]:
    """Of every element: the values at the point that its matrices need, and in the deck, which kernels look at."""
    model = point.configured.model
    needed, other = _used(point, kinds), _used(point, set(model.used) - kinds)
    here = np.where(needed, point.table, 0.0)
    # values that no matrix needs may have decided that
    deck = np.where(needed | ~other, model.structure.values.values, 0.0)
    for batch in model.structure.batches:
        for at in batch.roles.values():
            yield from (here[at], deck[at])


def _used(point: ModelPoint, kinds: set[MatrixKind]) -> NDArray[np.bool_]:
    """(n,) True for entries of the value table that matrices of some kinds need."""
    model = point.configured.model
    return np.any([np.zeros(len(point.table), bool), *(model.used[kind] for kind in kinds)], axis=0)


def _assembled(point: ModelPoint, kinds: set[MatrixKind]) -> Iterator[Part]:
    for matrix, matrix_digest in zip(point.configured.model.structure.assembled, point.configured.identity.assembled):
        if matrix.kind in kinds:
            yield from (matrix.kind, matrix_digest, factor_at(matrix, point.table))


def derivatives_digest(point: ModelPoint) -> str:
    """Digest of all matrices and their first derivatives: of the terms, and of their coefficients at the point.

    Much cheaper than the derivatives themselves, which are as many matrices as there are parameters.
    """
    coefficients = [part for c in point.coefficients if c is not None for part in (c.value, c.grad)]
    eta = point.loss_factor
    overall: tuple[Part, ...] = () if eta is None else (eta.value, eta.grad)
    return digest(point.configured.terms_digest, point.n_parameters, *coefficients, "overall", *overall)
