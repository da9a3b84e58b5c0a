"""Damping ratios of the modes of a model, refined by the measured FRFs, and what their errors add to the FRFs.

Where two close modes were identified as one, a ratio is wrong or missing. Inside a band the FRFs also depend a little
on the damping of modes outside it, at antiresonances by as much as the noise of many lines lets parameters be known.
The ratios follow from the FRFs together with the parameters, by steps of least squares. Where the FRFs say nothing,
they stay as they are, and their uncertainty counts.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, replace

import numpy as np

from femtune.arrays import Integers, Reals
from femtune.model import EigenSolution, damping_by_mode
from femtune.residuals.case import CaseState
from femtune.residuals.frf.on_reduced import ReducedFrfs
from femtune.residuals.frf.residual import FrfResidual
from femtune.residuals.weights import ResidualBlock

MOST = 40
"""Modes on each side of the band, the nearest ones. Ratios of which the FRFs say nothing stay as they are."""
_FARTHEST = 30.0
"""Factor on the ends of the band up to which modes are looked at."""
_STEP = 0.05
"""Relative change of a ratio by which derivatives are found."""
_STEPS = 3
"""Steps of least squares."""
_SHRINK = 0.5
"""Smallest factor on a ratio in a step."""
_GROW = 2.0
"""Largest factor on a ratio of a mode inside the band."""
_GROW_OUTSIDE = 10.0
"""The same outside it, where FRFs are linear in the ratio."""
_PAIRED = 0.1
"""Relative standard deviation of the ratio of a paired mode before the FRFs are used."""
_UNPAIRED = 1.0
"""The same of another mode, whose ratio is an assumption."""
_LEAST = 1e-6
"""Least ratio."""
_BlocksOf = Callable[[Reals, bool], list[ResidualBlock]]
"""Ratios, and whether derivatives are wanted -> blocks of the residual."""


@dataclass(frozen=True, eq=False)
class RefinedDamping:
    """Damping ratios by the measured FRFs.

    Parameters
    ----------
    ratios : (n,) of the modes
    modes : positions of those that were refined
    common : for each block of the residual, (values, q) change with q independent errors of unit variance of the ratios
    """

    ratios: Reals
    modes: Integers
    common: tuple[Reals, ...] = ()


def with_refined_damping(
    residual: FrfResidual, modes: EigenSolution, ratios: Reals, paired: Collection[int]
) -> RefinedDamping:
    """Ratios (n,) of the modes inside the band and near it by the measured FRFs.

    Parameters of the model are unknowns without a prior, so that what they explain is not ascribed to damping.

    Parameters
    ----------
    residual : the comparison of the measured FRFs, with their noise
    modes : of the model, as many as `ratios`
    paired : positions of modes whose ratios were identified
    """

    def blocks(of: Reals, derivatives: bool) -> list[ResidualBlock]:
        return _damped_by(residual, of).compare(modes, derivatives)

    return _refined(residual, modes.freq_hz[: modes.wanted], ratios, paired, blocks)


def refined_on_reduced(
    residual: ReducedFrfs, state: CaseState, ratios: Reals, paired: Collection[int]
) -> RefinedDamping:
    """As `with_refined_damping`, by the functions of a reduced model at a state of it.

    The ratios are those of as many modes as the reduced model damps; further ones stay.
    """
    count, hertz = residual.damped(state)

    def blocks(of: Reals, derivatives: bool) -> list[ResidualBlock]:
        return replace(residual, own=_damped_by(residual.own, of)).blocks(state, derivatives)

    found = _refined(residual.own, hertz, ratios[:count], paired, blocks)
    return replace(found, ratios=np.append(found.ratios, ratios[count:]))


def _damped_by(residual: FrfResidual, ratios: Reals) -> FrfResidual:
    return replace(residual, way=replace(residual.way, damping=damping_by_mode(ratios.tolist())))


def _refined(
    residual: FrfResidual, hertz: Reals, ratios: Reals, paired: Collection[int], blocks: _BlocksOf
) -> RefinedDamping:
    """Ratios of modes with the frequencies `hertz`, by the blocks that ratios give."""
    near = _near(residual, hertz)
    if not len(near) or residual.noise is None:
        return RefinedDamping(ratios, near[:0])
    first = blocks(ratios, True)
    weight = np.concatenate([_over_noise(b) for b in first])[:, None]
    jacobian = np.vstack([b.jacobian for b in first])
    # parameters are scaled so that rounding does not depend on their units
    scale = np.linalg.norm(jacobian * weight, axis=0)
    jacobian = jacobian / np.where(scale > 0.0, scale, 1.0)
    p, q = jacobian.shape[1], len(near)
    prior = np.where(np.isin(near, list(paired)), _PAIRED, _UNPAIRED)
    low, high = residual.measured.freq_hz[[0, -1]]
    inside = (hertz[near] >= low) & (hertz[near] <= high)
    most = np.where(inside, _GROW, _GROW_OUTSIDE)
    now = ratios.copy()
    for _ in range(_STEPS):
        before, columns = _columns(blocks, now, near)
        rows = np.hstack([jacobian, columns]) * weight
        priors = np.hstack([np.zeros((q, p)), np.diag(1.0 / prior)])
        right = np.append(-before * weight[:, 0], (ratios[near] / now[near] - 1.0) / prior)
        step = np.linalg.lstsq(np.vstack([rows, priors]), right, rcond=1e-12)[0][p:]
        now[near] = np.maximum(now[near] * np.clip(1.0 + step, _SHRINK, most), _LEAST)
    # rows, priors and columns are those of the last step
    information = np.vstack([rows, priors])
    covariance = np.linalg.pinv(information.T @ information, hermitian=True)[p:, p:]
    values, vectors = np.linalg.eigh(covariance)
    effect = columns @ (vectors * np.sqrt(np.maximum(values, 0.0)))
    ends = np.cumsum([len(b.values) for b in first])[:-1]
    return RefinedDamping(now, near, tuple(np.split(effect, ends)))


def _columns(blocks: _BlocksOf, ratios: Reals, near: Integers) -> tuple[Reals, Reals]:
    """Residuals, and (values, q) their change with relative changes of ratios."""
    before = np.concatenate([b.values for b in blocks(ratios, False)])
    columns = np.empty((len(before), len(near)))
    for k, j in enumerate(near.tolist()):
        moved = ratios.copy()
        moved[j] *= 1.0 + _STEP
        columns[:, k] = (np.concatenate([b.values for b in blocks(moved, False)]) - before) / _STEP
    return before, columns


def _near(residual: FrfResidual, hertz: Reals) -> Integers:
    """Positions of the modes inside the band and of those beside it, by ascending frequency."""
    low, high = residual.measured.freq_hz[[0, -1]]
    below = np.flatnonzero((hertz < low) & (hertz > low / _FARTHEST))[-MOST:]
    inside = np.flatnonzero((hertz >= low) & (hertz <= high))
    above = np.flatnonzero((hertz > high) & (hertz < high * _FARTHEST))[:MOST]
    return np.concatenate([below, inside, above])


def _over_noise(block: ResidualBlock) -> Reals:
    """(n,) stated standard deviations of the values over those of their noise."""
    noise = None if block.samples is None else block.samples.noise
    assert noise is not None
    return np.divide(1.0, noise, out=np.zeros(len(noise)), where=noise > 0.0)
