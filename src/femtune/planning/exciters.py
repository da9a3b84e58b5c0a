"""Places of exciters: by driving-point residues, so that every target mode is excited by at least one of them.

The residue of mode j at a driving point with the mass-normalised shape φ is φ²/(2iω_j). Its size relative to that at
the best candidate, φ²/max φ², is the level at which the point excites the mode. The multivariate mode indicator
function (Williams, Crowley and Vold 1985) tells whether the responses at the sensors show a mode as a normal mode.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg as la
from numpy.typing import NDArray

from femtune.arrays import Reals

_MOST_ROUNDS = 20
"""Rounds of exchanges at most; they end with the first that changes nothing."""
_TINY = 1e-300
"""Divisor for entries that are all zero, near the smallest double."""


def driving_point_levels(shapes: Reals) -> Reals:
    """(k, m) level of each mode at each candidate: driving-point residue relative to that at the best candidate.

    Parameters
    ----------
    shapes : (k, m) mass-normalised target modes along the directions of the candidates
    """
    squares = shapes**2
    return np.asarray(squares / np.maximum(squares.max(axis=0, initial=0.0), _TINY))


def place_exciters(levels: Reals, count: int, given: Reals | None = None) -> NDArray[np.int64]:
    """(count,) candidates for which the least level over all modes is largest, a mode having that of its best exciter.

    One by one, then exchanged one by one while that improves; among equals those with the larger geometric mean.

    Parameters
    ----------
    levels : (k, m) from `driving_point_levels`
    given : (g, m) levels of exciters that are placed already

    Examples
    --------
    >>> import numpy as np
    >>> from femtune.planning import place_exciters
    >>> place_exciters(np.array([[1.0, 0.0, 0.2], [0.4, 0.4, 0.4], [0.0, 1.0, 0.9]]), 1)
    array([1])
    >>> place_exciters(np.array([[1.0, 0.0, 0.2], [0.4, 0.4, 0.4], [0.0, 1.0, 0.9]]), 2)
    array([0, 2])
    """
    none = np.zeros(levels.shape[1])
    start = none if given is None or not len(given) else given.max(axis=0)
    chosen: list[int] = []
    for _ in range(min(count, len(levels))):
        chosen.append(_best(levels, np.maximum(start, levels[chosen].max(axis=0, initial=0.0)), chosen))
    for _ in range(_MOST_ROUNDS):
        before = list(chosen)
        for place in range(len(chosen)):
            rest = chosen[:place] + chosen[place + 1 :]
            reached = np.maximum(start, levels[rest].max(axis=0, initial=0.0))
            best = _best(levels, reached, rest)
            if _worth(np.maximum(levels[[best]], reached))[0] > _worth(np.maximum(levels[[chosen[place]]], reached))[0]:
                chosen[place] = best
        if chosen == before:
            break
    return np.array(sorted(chosen), np.int64)


def _best(levels: Reals, reached: Reals, taken: list[int]) -> int:
    worth = _worth(np.maximum(levels, reached))
    worth[taken] = -np.inf
    return int(np.argmax(worth))


def _worth(levels: Reals) -> Reals:
    """(k,) least level, and a little of the mean logarithm, which decides between equals."""
    return np.asarray(levels.min(axis=1) + 1e-6 * np.log(np.maximum(levels, 1e-12)).mean(axis=1))


def mode_indicator(freq_hz: Reals, eigenvalues: Reals, damping_ratio: float, outputs: Reals, inputs: Reals) -> Reals:
    """(lines,) multivariate mode indicator: least part of the kinetic energy that is in phase with the forces.

    Of receptances H by modal superposition, min over real forces F of |Re H F|²/|H F|²: near 0 at a frequency where
    some combination of the inputs excites a normal mode, near 1 elsewhere.

    Parameters
    ----------
    freq_hz : (lines,)
    eigenvalues : (n,) λ of the modes in rad²/s²
    outputs, inputs : (o, n) and (i, n) mass-normalised shapes
    """
    indicators = []
    for omega in 2.0 * np.pi * np.asarray(freq_hz):
        poles = eigenvalues - omega**2 + 2j * damping_ratio * np.sqrt(np.maximum(eigenvalues, 0.0)) * omega
        H = (outputs / poles) @ inputs.T
        A, B = H.real.T @ H.real, H.imag.T @ H.imag
        total = A + B
        scale = 1.0 / np.sqrt(np.maximum(np.diag(total), _TINY))
        regular = total * np.outer(scale, scale) + 1e-12 * np.eye(len(total))
        values = la.eigh(A * np.outer(scale, scale), regular, eigvals_only=True)
        indicators.append(float(np.clip(values[0], 0.0, 1.0)))
    return np.array(indicators)
