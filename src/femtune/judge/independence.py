"""Whether two tests contain the same measured data: the same file, a copy, or a part of one.

Contents are compared, not names: a copy under another name, with some modes or channels removed, is found. Two
measurements of one structure differ by the repeatability of the test. Copies differ by the rounding of their files.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from femtune.arrays import Reals
from femtune.dofs import DofSet
from femtune.modal import FrfSet, ModeSet

SAME_FREQUENCY = 5e-5
"""Relative difference up to which two frequencies may be one number, rounded differently: half a unit in the fifth
digit. Repeated tests agree to about 1e-4 at best, so that a frequency alone does not show that two modes are one."""
SAME_SHAPE = 5e-4
"""Relative difference of two shapes, after scaling, up to which they may be one: rounding to four digits. Repeated
measurements of a shape differ by 1e-3 at best."""
SAME_FUNCTION = 1e-4
"""Relative difference of two FRFs up to which they may be one: single precision and rounding of text files. Even a
repeated measurement without a change of the set-up differs by more than 1e-3."""
_FEWEST_LINES = 8
"""Common lines for a comparison of two FRFs."""
_FEWEST_FREQUENCIES = 3
"""Modes whose frequencies must all agree if no common channels show their shapes."""


@dataclass(frozen=True)
class SharedModes:
    """Modes that two sets have in common.

    Parameters
    ----------
    pairs : positions in the first and in the second set
    by_shape : True if their shapes were compared, False for tests without two common channels, whose frequencies agree
    """

    pairs: tuple[tuple[int, int], ...]
    by_shape: bool


def shared_modes(first: ModeSet, second: ModeSet) -> SharedModes:
    """Modes that are the same measured data in both sets.

    Shapes are compared at the common channels after scaling, since files may have other units or normalisations.
    Without two common channels all frequencies of the smaller set must agree, at least three.

    Examples
    --------
    >>> import numpy as np
    >>> import femtune as ft
    >>> from femtune.judge.independence import shared_modes
    >>> dofs = ft.DofSet.parse(["1Z+", "2Z+", "3Z+"])
    >>> test = ft.ModeSet(np.array([10.0, 21.0]), np.array([[1.0, 1], [2, -1], [3, 0.5]]), dofs)
    >>> copy = ft.ModeSet(np.array([21.0]), np.array([[2.0], [-2], [1]]), dofs)
    >>> shared_modes(test, copy).pairs
    ((1, 0),)
    """
    close = np.abs(np.subtract.outer(first.freq_hz, second.freq_hz)) <= SAME_FREQUENCY * second.freq_hz
    pairs = [(int(i), int(j)) for i, j in np.argwhere(close)]
    rows, columns, signs = _common(first.dofs, second.dofs)
    a, b = first.shapes[rows], second.shapes[columns] * signs[:, None]
    known = {(i, j): np.isfinite(a[:, i]) & np.isfinite(b[:, j]) for i, j in pairs}
    if any(both.sum() > 1 for both in known.values()):
        same = (p for p in pairs if known[p].sum() > 1 and _same_shape(a[known[p], p[0]], b[known[p], p[1]]))
        return SharedModes(tuple(same), by_shape=True)
    fewer = min(len(first), len(second))
    all_agree = fewer >= _FEWEST_FREQUENCIES and len({i for i, _ in pairs}) >= fewer <= len({j for _, j in pairs})
    return SharedModes(tuple(pairs) if all_agree else (), by_shape=False)


def _common(first: DofSet, second: DofSet) -> tuple[list[int], list[int], Reals]:
    """Positions of the DOFs that both sets have, and the sign that turns the second into the first."""
    at: Mapping[tuple[int, str], int] = {(d.node, d.direction): k for k, d in enumerate(first)}
    places = [(at[key], k) for k, d in enumerate(second) if (key := (d.node, d.direction)) in at]
    rows, columns = [i for i, _ in places], [k for _, k in places]
    signs = np.array([first[i].sign * second[k].sign for i, k in places], dtype=float)
    return rows, columns, signs


def _same_shape(a: Reals, b: Reals) -> bool:
    size = np.vdot(a, a).real
    scale = np.vdot(a, b) / size if size > 0.0 else 0.0
    return bool(np.linalg.norm(b - scale * a) <= SAME_SHAPE * np.linalg.norm(b) and np.any(b))


def shared_functions(first: FrfSet, second: FrfSet) -> tuple[tuple[int, int], ...]:
    """Response and reference, as positions in the second set, of the FRFs that the first set has too.

    NaN marks FRFs that are not to be compared. Sets of different kinds of motion have none in common.
    """
    lines, i, j = np.intersect1d(np.round(first.freq_hz, 6), np.round(second.freq_hz, 6), return_indices=True)
    if first.kind != second.kind or len(lines) < _FEWEST_LINES:
        return ()
    out = []
    responses, references = _common(first.responses, second.responses), _common(first.references, second.references)
    for r, s, sign in zip(*responses):
        for p, q, turn in zip(*references):
            a, b = first.values[r, p][i], sign * turn * second.values[s, q][j]
            both = np.isfinite(a) & np.isfinite(b)
            if both.sum() >= _FEWEST_LINES and np.any(b[both]):
                difference = np.linalg.norm(b[both] - a[both])
                if difference <= SAME_FUNCTION * np.linalg.norm(b[both]):
                    out.append((s, q))
    return tuple(out)
