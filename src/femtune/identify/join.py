"""Sets of functions of several bands and channels as one, and how well a model repeats each function."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.dofs import DofSet
from femtune.errors import FemtuneError
from femtune.modal import FrfSet, frac

Reals = NDArray[np.float64]


def join_frfs(sets: Sequence[FrfSet]) -> FrfSet:
    """All functions at all lines, NaN where a set lacks them; where two sets have a value the earlier one counts.

    Raises
    ------
    FemtuneError : ``identify.kinds-differ`` for sets of different kinds or none at all
    """
    kinds = {frfs.kind for frfs in sets}
    if len(kinds) != 1:
        raise FemtuneError(
            "identify.kinds-differ",
            "functions of one kind are put together",
            values={"kinds": ", ".join(sorted(kinds))},
            hint="convert them to one kind first",
        )
    lines = np.unique(np.concatenate([frfs.freq_hz for frfs in sets]))
    responses, references = (_union([getattr(frfs, name) for frfs in sets]) for name in ("responses", "references"))
    values = np.full((len(responses), len(references), len(lines)), np.nan, dtype=complex)
    for frfs in reversed(sets):
        _put(values, frfs, lines, responses, references)
    return FrfSet(lines, values, responses, references, sets[0].kind, source=sets[0].source)


def _union(sets: Sequence[DofSet]) -> DofSet:
    seen: dict[tuple[int, str], int] = {}
    dofs = [dof for one in sets for dof in one]
    for i, dof in enumerate(dofs):
        seen.setdefault((dof.node, dof.direction), i)
    return DofSet(dofs[i] for i in seen.values())


def _put(values: NDArray, frfs: FrfSet, lines: Reals, responses: DofSet, references: DofSet) -> None:
    rows, sign = frfs.responses.align(responses)
    columns, turn = frfs.references.align(references)
    at = np.ix_(rows, columns, np.searchsorted(lines, frfs.freq_hz))
    signed = frfs.values * sign[:, None, None] * turn[None, :, None]
    values[at] = np.where(np.isfinite(signed), signed, values[at])


@dataclass(frozen=True, eq=False)
class FitQuality:
    """How well a model repeats each function.

    Parameters
    ----------
    error : (n, u) |model − measured| over |measured|, norms over the lines; NaN without values
    frac : (n, u) frequency response assurance criterion
    """

    error: Reals
    frac: Reals

    def poor(self, limit: float = 0.3) -> list[int]:
        """Responses whose error, at the reference where it is largest, is above the limit: better for validation."""
        worst = np.nanmax(np.where(np.isnan(self.error), -1.0, self.error), axis=1)
        return [int(i) for i in np.flatnonzero(worst > limit)]


def fit_quality(model: FrfSet, measured: FrfSet) -> FitQuality:
    """Compare functions at the same lines, responses and references (error ``identify.lines-differ``)."""
    if model.values.shape != measured.values.shape or not np.allclose(model.freq_hz, measured.freq_hz):
        sizes = {"model": model.values.shape, "measured": measured.values.shape}
        raise FemtuneError("identify.lines-differ", "the two sets of functions are not at the same lines", values=sizes)
    known = np.isfinite(measured.values)
    miss = np.sum(np.where(known, np.abs(model.values - measured.values) ** 2, 0.0), axis=2)
    size = np.sum(np.where(known, np.abs(measured.values) ** 2, 0.0), axis=2)
    error = np.sqrt(miss / np.where(size > 0.0, size, np.nan))
    pairs = [[frac(a, b) for a, b in zip(x, y)] for x, y in zip(model.values, measured.values)]
    return FitQuality(error, np.array([[np.nan if v is None else v for v in row] for row in pairs]))
