"""Sets of functions of several bands and channels as one, and how well a model repeats each function."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.dofs import Dof, DofSet
from femtune.errors import FemtuneError
from femtune.modal import FrfSet, frac


def join_frfs(sets: Sequence[FrfSet]) -> FrfSet:
    """All functions at all lines, NaN where a set lacks them; where two sets have a value the earlier one counts.

    Raises
    ------
    FemtuneError : ``identify.kinds-differ`` for sets of different kinds or none at all
    """
    kinds = {frfs.kind for frfs in sets}
    if len(kinds) != 1:
        raise FemtuneError("identify.kinds-differ", values={"kinds": ", ".join(sorted(kinds))})
    lines = np.unique(np.concatenate([frfs.freq_hz for frfs in sets]))
    responses, references = _union([frfs.responses for frfs in sets]), _union([frfs.references for frfs in sets])
    values = np.full((len(responses), len(references), len(lines)), np.nan, dtype=complex)
    for frfs in reversed(sets):
        _put(values, frfs, lines, responses, references)
    return FrfSet(lines, values, responses, references, sets[0].kind, source=sets[0].source)


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

    def transposed(self) -> FitQuality:
        """With responses and references exchanged."""
        return FitQuality(self.error.T, self.frac.T)

    def poor(self, limit: float = 0.3) -> list[int]:
        """Responses whose error, at the reference where it is largest, is above the limit: better for validation."""
        worst = np.nanmax(np.where(np.isnan(self.error), -1.0, self.error), axis=1)
        return [int(i) for i in np.flatnonzero(worst > limit)]


def fit_quality(model: FrfSet, measured: FrfSet) -> FitQuality:
    """Compare functions at the same lines, responses and references (error ``identify.lines-differ``)."""
    if model.values.shape != measured.values.shape or not np.allclose(model.freq_hz, measured.freq_hz):
        sizes = {"model": model.values.shape, "measured": measured.values.shape}
        raise FemtuneError("identify.lines-differ/fit", values=sizes)
    known = np.isfinite(measured.values)
    miss = np.sum(np.where(known, np.abs(model.values - measured.values) ** 2, 0.0), axis=2)
    size = np.sum(np.where(known, np.abs(measured.values) ** 2, 0.0), axis=2)
    error = np.sqrt(miss / np.where(size > 0.0, size, np.nan))
    pairs = [[frac(a, b) for a, b in zip(x, y)] for x, y in zip(model.values, measured.values)]
    return FitQuality(error, np.array([[np.nan if v is None else v for v in row] for row in pairs]))


# ----------------------------------------------------------------------------------------------------
# Frequency lines that an identification uses: a band, without lines that some pair lacks.


def in_band(frfs: FrfSet, from_hz: float | None = None, to_hz: float | None = None) -> FrfSet:
    """The functions at the lines of a band, ends included.

    Raises
    ------
    FemtuneError : ``identify.band`` where the band holds no line
    """
    low = -np.inf if from_hz is None else from_hz
    high = np.inf if to_hz is None else to_hz
    keep = np.flatnonzero((frfs.freq_hz >= low) & (frfs.freq_hz <= high))
    if not len(keep):
        has = f"{frfs.freq_hz[0]:g} to {frfs.freq_hz[-1]:g} Hz" if len(frfs.freq_hz) else "none"
        raise FemtuneError("identify.band", values={"lines": has}, low=low, high=high)
    return at_lines(frfs, keep)


def at_lines(frfs: FrfSet, keep: np.ndarray) -> FrfSet:
    """The functions at some of their lines (ascending positions)."""
    coherence = None if frfs.coherence is None else frfs.coherence[:, :, keep]
    return replace(frfs, freq_hz=frfs.freq_hz[keep], values=frfs.values[:, :, keep], coherence=coherence)


def complete_lines(frfs: FrfSet) -> FrfSet:
    """The functions at the lines that every pair has; a line at 0 Hz is left out.

    Raises
    ------
    FemtuneError : ``identify.missing-pair`` for pairs without any value, ``identify.missing-lines`` where no line is
        common to all
    """
    known = np.isfinite(frfs.values)
    empty = np.argwhere(~known.any(axis=2))
    if len(empty):
        names = ", ".join(f"{frfs.responses[i]}/{frfs.references[j]}" for i, j in empty[:5])
        raise FemtuneError(
            "identify.missing-pair", values={"pairs": names + (" …" if len(empty) > 5 else "")}, n_empty=len(empty)
        )
    keep = np.flatnonzero(known.all(axis=(0, 1)) & (frfs.freq_hz > 0.0))
    if not len(keep):
        raise FemtuneError("identify.missing-lines")
    return at_lines(frfs, keep)


def enough_lines(lines: int, references: int, order: int, unknowns: int, equations: int) -> None:
    """Raise ``identify.few-lines`` where the equations do not exceed the unknowns."""
    if equations <= unknowns:
        raise FemtuneError(
            "identify.few-lines",
            values={"references": references, "equations": equations, "unknowns": unknowns},
            lines=lines,
            order=order,
        )


def line_weights(frfs: FrfSet, sd: NDArray[np.float64] | None) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Weights of lines (k,) and scales of responses (n,): a channel of small motion counts like the others.

    Parameters
    ----------
    sd : (n, u, k) standard deviations of the functions at the same lines, or None
    """
    if sd is None:
        scale = np.sqrt(np.mean(np.abs(frfs.values) ** 2, axis=(1, 2)))
        return np.ones(len(frfs.freq_hz)), np.where(scale > 0.0, scale, 1.0)
    variance = sd**2
    scale = np.sqrt(np.mean(variance, axis=(1, 2)))
    line = np.sqrt(np.mean(variance / scale[:, None, None] ** 2, axis=(0, 1)))
    return 1.0 / line, scale
