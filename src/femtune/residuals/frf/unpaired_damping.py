"""Damping ratios of the modes of a model near a band that have no partner in the test.

The measured FRFs inside a band depend little on the damping of modes outside it, but at antiresonances by as much as
the noise of many lines lets parameters be known. The ratios follow from these FRFs together with the parameters, by one
step of least squares; where the FRFs say nothing, they stay at the median of the measured ratios.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from femtune.arrays import Integers, Reals
from femtune.model import EigenSolution, damping_by_mode
from femtune.residuals.frf.residual import FrfResidual
from femtune.residuals.weights import ResidualBlock

MOST = 4
"""Modes on each side of the band, the nearest ones."""
_FARTHEST = 2.0
"""Factor on the ends of the band up to which modes are looked at."""
_STEP = 0.1
"""Relative change of a ratio by which derivatives are found; functions far from a resonance are linear in it."""
_RANGE = (0.1, 10.0)
"""Factors on the median within which a ratio stays."""


def with_unpaired_damping(
    residual: FrfResidual, modes: EigenSolution, ratios: Reals, paired: Collection[int]
) -> tuple[Reals, Integers]:
    """Ratios (n,) with those of unpaired modes near the band by the measured FRFs, and the positions of these modes.

    Each has a normal prior about its present ratio with a standard deviation as large as this. Parameters of the model
    are unknowns without a prior, so that what they explain is not ascribed to damping.

    Parameters
    ----------
    residual : the comparison of the measured FRFs, with their noise
    modes : of the model, as many as `ratios`
    paired : positions of modes whose ratios are measured
    """
    near = _near(residual, modes, paired)
    if not len(near) or residual.noise is None:
        return ratios, near

    def blocks(of: Reals, *, derivatives: bool = False) -> list[ResidualBlock]:
        way = replace(residual.way, damping=damping_by_mode(of.tolist()))
        return replace(residual, way=way).compare(modes, derivatives)

    start = blocks(ratios, derivatives=True)
    weight = np.concatenate([_over_noise(b) for b in start])
    before = np.concatenate([b.values for b in start])
    columns = [np.vstack([b.jacobian for b in start])]
    for j in near.tolist():
        moved = ratios.copy()
        moved[j] *= 1.0 + _STEP
        after = np.concatenate([b.values for b in blocks(moved)])
        columns.append(((after - before) / _STEP)[:, None])
    rows = np.hstack(columns) * weight[:, None]
    parameters = rows.shape[1] - len(near)
    # parameters are scaled so that rounding does not depend on their units
    scale = np.append(np.linalg.norm(rows[:, :parameters], axis=0), np.ones(len(near)))
    scale[scale == 0.0] = 1.0
    priors = np.hstack([np.zeros((len(near), parameters)), np.eye(len(near))])
    right = np.append(-before * weight, np.zeros(len(near)))
    step = np.linalg.lstsq(np.vstack([rows / scale, priors]), right, rcond=1e-12)[0][parameters:]
    fitted = ratios.copy()
    fitted[near] *= np.clip(1.0 + step, *_RANGE)
    return fitted, near


def _near(residual: FrfResidual, modes: EigenSolution, paired: Collection[int]) -> Integers:
    """Positions of the unpaired modes beside the band, by ascending frequency."""
    low, high = residual.measured.freq_hz[[0, -1]]
    hertz = modes.freq_hz[: modes.wanted]
    free = np.setdiff1d(np.arange(modes.wanted), list(paired))
    below = free[(hertz[free] < low) & (hertz[free] > low / _FARTHEST)][-MOST:]
    above = free[(hertz[free] > high) & (hertz[free] < high * _FARTHEST)][:MOST]
    return np.concatenate([below, above])


def _over_noise(block: ResidualBlock) -> Reals:
    """(n,) stated standard deviations of the values over those of their noise."""
    noise = None if block.samples is None else block.samples.noise
    assert noise is not None
    return np.divide(1.0, noise, out=np.zeros(len(noise)), where=noise > 0.0)
