"""Channels that are late by samples: found by the phases of their entries in the shapes of several modes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import comb

import numpy as np
from scipy.special import fdtrc

from femtune.arrays import Complexes, Reals
from femtune.errors import Notice

LEVEL = 1e-3
"""Probability with which channels that are on time are called late, over all channels and delays that are tried."""
MOST_DELAYS = 400
"""Delays that are tried: of up to one period of the lowest mode, and not more than these."""
MOST_LATE = 4
"""Late channels that are looked for, and always less than half of all."""
LEAST_MODES = 3
"""Modes that tell a delay, whose phase grows with the frequency, from a complex shape."""
LEAST_CHANNELS = 3
"""Channels that tell which one is late."""


@dataclass(frozen=True)
class LateChannel:
    """Position of a channel, its delay against the others in s (negative: it is early), and the probability that
    channels on time look like this."""

    channel: int
    delay_s: float
    probability: float


def late_channels(shapes: Complexes, freq_hz: Reals, step_s: float) -> tuple[LateChannel, ...]:
    """Channels whose phases in all modes are those of delays.

    A structure with light damping has nearly real shapes. The entry of a channel that is late by τ is turned by
    −2πfτ in the mode of frequency f. One channel after the other gets the delay that makes all shapes most nearly real.
    What this gains is compared with what is left of their imaginary parts (F test with Bonferroni's correction for all
    channels and delays). Shapes that are complex for other reasons leave much of these, and then nothing is named.

    Parameters
    ----------
    shapes : (s, m) complex
    freq_hz : (m,)
    step_s : delays are multiples of it
    """
    s, m = shapes.shape
    size = np.linalg.norm(shapes, axis=0)
    if s < LEAST_CHANNELS or m < LEAST_MODES or not (np.isfinite(shapes).all() and (size > 0.0).all()):
        return ()
    # the smaller eigenvalue of the real and imaginary parts of a shape of unit norm is (1 − |Σφ²|)/2
    squares = (shapes / size) ** 2
    most = int(min(np.ceil(1.0 / (freq_hz.min() * step_s)), MOST_DELAYS // 2))
    delays_s = step_s * np.concatenate([np.arange(-most, 0), np.arange(1, most + 1)])
    turns = np.exp(4j * np.pi * np.outer(delays_s, freq_hz))
    # a channel of another quantity is turned by 90 degrees in all modes, and has no delay
    turns = np.vstack([turns, np.full(m, -1.0)])
    at_first = float(_imaginary(squares.sum(axis=0)))
    late: list[tuple[int, float]] = []
    best: tuple[LateChannel, ...] = ()
    least = LEVEL
    for count in range(1, min((s - 1) // 2, MOST_LATE) + 1):
        tried = _imaginary(squares.sum(axis=0) + squares[:, None, :] * (turns - 1.0))
        tried[[i for i, _ in late]] = np.inf
        i, k = (int(x) for x in np.unravel_index(tried.argmin(), tried.shape))
        if k == len(delays_s):
            break
        late.append((i, float(delays_s[k])))
        freedom = (s - 1) * m - count
        left = max(float(tried[i, k]), np.finfo(float).tiny)
        ratio = max((at_first - left) / count / (left / freedom), 0.0)
        ways = comb(s, count) * float(len(turns)) ** count
        probability = min(1.0, ways * float(fdtrc(count, freedom, ratio)))
        if probability < least:
            least, best = probability, tuple(LateChannel(*one, probability) for one in late)
        squares[i] *= turns[k]
    return best


def _imaginary(sums: Complexes) -> Reals:
    """(…,) imaginary parts that are left of shapes (…, m) of unit norm, by their Σφ²."""
    return np.asarray(np.maximum(1.0 - np.abs(sums), 0.0).sum(axis=-1) / 2.0)


def late_notices(
    shapes: Complexes, freq_hz: Reals, names: Sequence[str], step_s: float, *, counted: bool
) -> tuple[Notice, ...]:
    """``identify.late-channel``, with the delays in samples too where `step_s` is `counted` as the step of a record."""
    said = []
    for one in late_channels(shapes, freq_hz, step_s):
        samples = abs(round(one.delay_s / step_s))
        in_samples = f", {samples} sample{'s' if samples > 1 else ''}" if counted else ""
        word = "late" if one.delay_s > 0.0 else "early"
        said.append(f"{names[one.channel]} ({abs(one.delay_s):.4g} s{in_samples} {word})")
    return (Notice("identify.late-channel", channels=", ".join(said)),) if said else ()
