"""Neighbouring modes of the same shape, which may be one mode."""

from __future__ import annotations

import itertools

import numpy as np

from femtune.arrays import Reals
from femtune.errors import Notice
from femtune.identification.mode_checks import ModeRemark
from femtune.modal import ModeSet
from femtune.modal.shape_criteria import mac

SAME_SHAPE = 0.95
"""MAC from which two shapes are the same. Of two random shapes at four sensors, 0.5 % reach it."""
SAME_WITHOUT_LARGEST = 0.9
"""MAC that they must have without the sensor that moves most, so that one sensor alone does not decide: it may be a
channel of another quantity in larger numbers."""
LEAST_SENSORS = 4
"""Sensors from which shapes are compared: with fewer, different modes often have the same shape."""
NEIGHBOURS = 4.0
"""Distance of two modes up to which they may be one, in half-power bandwidths of the wider one."""
MOST_SHAPE_NOISE = 0.1
"""Share of noise in the square of a shape up to which its MAC is corrected for this noise."""
WEAKER = 3.0
"""Ratio of the standard deviations of the frequencies from which only the mode with the larger one is doubtful."""


def same_shape_remarks(modes: ModeSet) -> tuple[ModeRemark, ...]:
    """``identify.same-shape`` of neighbouring modes that have the same shape at the sensors.

    The doubtful mode of the two is that whose frequency is far less certain; both, where the standard deviations are
    alike or not known. Noise makes the MAC of equal shapes smaller by the factor (1 − s₁)(1 − s₂), where s is the share
    of the noise in the square of a shape; the MAC is corrected by it as far as the standard deviations are small.

    Parameters
    ----------
    modes : with damping ratios; without them there are no remarks
    """
    if modes.damping_ratio is None or len(modes.dofs) < LEAST_SENSORS:
        return ()
    freq, width = modes.freq_hz, 2.0 * modes.damping_ratio * modes.freq_hz
    remarks: list[ModeRemark] = []
    for i, j in itertools.combinations(np.argsort(freq).tolist(), 2):
        if not abs(freq[j] - freq[i]) <= NEIGHBOURS * max(width[i], width[j]):
            continue
        value, rest = _alike(modes, i, j)
        if not (value >= SAME_SHAPE and rest >= SAME_WITHOUT_LARGEST):
            continue
        distance = float(abs(freq[j] - freq[i]) / max(width[i], width[j]))
        notice = Notice(
            "identify.same-shape", first_hz=float(freq[i]), second_hz=float(freq[j]), mac=value, distance=distance
        )
        remarks += [ModeRemark(k, notice) for k in _weaker(modes, i, j)]
    return tuple(remarks)


def _alike(modes: ModeSet, i: int, j: int) -> tuple[float, float]:
    """MAC of two shapes, and that without the sensor that moves most, both corrected for noise."""
    pair = modes.shapes[:, [i, j]]
    sd = np.zeros(pair.shape) if modes.shapes_sd is None else modes.shapes_sd[:, [i, j]]
    size = np.abs(pair) / np.maximum(np.linalg.norm(pair, axis=0), np.finfo(float).tiny)
    others = np.arange(len(pair)) != int(size.sum(axis=1).argmax())
    return _corrected(pair, sd), _corrected(pair[others], sd[others])


def _corrected(pair: Reals, sd: Reals) -> float:
    square = (np.abs(pair) ** 2).sum(axis=0)
    if not (square > 0.0).all():
        return 0.0
    noise = (sd**2).sum(axis=0) / square
    noise = np.where(noise <= MOST_SHAPE_NOISE, noise, 0.0)
    return float(min(1.0, mac(pair[:, :1], pair[:, 1:])[0, 0] / np.prod(1.0 - noise)))


def _weaker(modes: ModeSet, i: int, j: int) -> tuple[int, ...]:
    if modes.freq_sd_hz is None:
        return (i, j)
    first, second = float(modes.freq_sd_hz[i]), float(modes.freq_sd_hz[j])
    if first > WEAKER * second > 0.0:
        return (i,)
    return (j,) if second > WEAKER * first > 0.0 else (i, j)
