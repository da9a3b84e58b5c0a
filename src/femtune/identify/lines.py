"""Frequency lines that an identification uses: a band, without lines that some pair lacks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError
from femtune.modal import FrfSet


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
        what = f"no frequency line lies between {low:g} and {high:g} Hz"
        raise FemtuneError("identify.band", what, values={"lines": has})
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
            "identify.missing-pair",
            f"{len(empty)} pairs of response and reference have no values",
            values={"pairs": names + (" …" if len(empty) > 5 else "")},
            hint="leave these responses out, or identify the references apart",
        )
    keep = np.flatnonzero(known.all(axis=(0, 1)) & (frfs.freq_hz > 0.0))
    if not len(keep):
        raise FemtuneError("identify.missing-lines", "no frequency line has values of every pair")
    return at_lines(frfs, keep)


def enough_lines(lines: int, references: int, order: int, unknowns: int, equations: int) -> None:
    """Raise ``identify.few-lines`` where the equations do not exceed the unknowns."""
    if equations <= unknowns:
        raise FemtuneError(
            "identify.few-lines",
            f"{lines} frequency lines are too few for a model of order {order}",
            values={"references": references, "equations": equations, "unknowns": unknowns},
            hint="lower the order, or use a wider band or finer lines",
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
