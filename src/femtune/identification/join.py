"""How well a model repeats each function, and which lines an identification uses."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.modal import FrfSet, frac


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
