"""FRFs of several measurements as one set."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.dofs import Dof, DofSet
from femtune.errors import FemtuneError
from femtune.modal.frf_set import FrfSet

_SAME = 1e-9
"""Relative difference of lines that is rounding."""


def join_frfs(sets: Sequence[FrfSet]) -> FrfSet:
    """All functions at all lines, NaN where a set lacks them; where two sets have a value the earlier one counts.

    Raises
    ------
    FemtuneError : ``identify.kinds-differ`` for sets of different kinds or none at all
    """
    kinds = {frfs.kind for frfs in sets}
    if len(kinds) != 1:
        raise FemtuneError("identify.kinds-differ", values={"kinds": ", ".join(sorted(kinds))})
    lines = _lines(sets)
    responses, references = _union([frfs.responses for frfs in sets]), _union([frfs.references for frfs in sets])
    shape = len(responses), len(references), len(lines)
    values, coherence = np.full(shape, np.nan, dtype=complex), np.full(shape, np.nan)
    for frfs in reversed(sets):
        at, signed = _places(frfs, lines, responses, references)
        known = np.isfinite(signed)
        values[at] = np.where(known, signed, values[at])
        if frfs.coherence is not None:
            coherence[at] = np.where(known, frfs.coherence, coherence[at])
    whole = all(frfs.coherence is not None for frfs in sets)
    return FrfSet(
        lines, values, responses, references, sets[0].kind, coherence if whole else None, source=sets[0].source
    )


def join_ranges(sets: Sequence[FrfSet]) -> FrfSet:
    """As `join_frfs`, but of a later set only lines outside the range that an earlier one has for a pair.

    A second test adds its low frequencies to those of the first, and leaves the first as it is.
    """
    kept: list[FrfSet] = []
    for frfs in sets:
        values = frfs.values.copy()
        for before in kept:
            for (i, dof), (j, force) in product(enumerate(frfs.responses), enumerate(frfs.references)):
                low, high = _range(before, dof, force)
                values[i, j, (frfs.freq_hz >= low) & (frfs.freq_hz <= high)] = np.nan
        kept.append(replace(frfs, values=values))
    return join_frfs(kept)


def _range(frfs: FrfSet, dof: Dof, force: Dof) -> tuple[float, float]:
    """First and last line of a pair; an empty range where it has none."""
    if dof not in frfs.responses or force not in frfs.references:
        return np.inf, -np.inf
    i, j = DofSet([dof]).align(frfs.responses)[0][0], DofSet([force]).align(frfs.references)[0][0]
    known = frfs.freq_hz[np.isfinite(frfs.values[i, j])]
    return (float(known[0]), float(known[-1])) if len(known) else (np.inf, -np.inf)


def _lines(sets: Sequence[FrfSet]) -> Reals:
    """(k,) lines of all sets; those that differ by rounding are one."""
    lines = np.unique(np.concatenate([frfs.freq_hz for frfs in sets]))
    return lines[np.append(True, np.diff(lines) > _SAME * lines[1:])]


def _union(sets: Sequence[DofSet]) -> DofSet:
    seen: dict[tuple[int, str], int] = {}
    dofs = [dof for one in sets for dof in one]
    for i, dof in enumerate(dofs):
        seen.setdefault((dof.node, dof.direction), i)
    return DofSet(dofs[i] for i in seen.values())


def _places(
    frfs: FrfSet, lines: Reals, responses: DofSet, references: DofSet
) -> tuple[tuple[NDArray, ...], NDArray[np.complex128]]:
    """Where the values of a set are among all, and its values there with their signs."""
    rows, sign = frfs.responses.align(responses)
    columns, turn = frfs.references.align(references)
    at = np.ix_(rows, columns, np.searchsorted(lines, frfs.freq_hz * (1.0 - _SAME)))
    return at, np.asarray(frfs.values * sign[:, None, None] * turn[None, :, None], complex)
