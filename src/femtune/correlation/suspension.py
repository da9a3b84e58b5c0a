"""Modes of the suspension of a free structure: rigid-body motions on soft springs, which a free model has at 0 Hz."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import betaincc

from femtune.arrays import Reals
from femtune.correlation.pairing import Pairing, Unpaired, visible_modes
from femtune.errors import Notice
from femtune.modal import ModeSet
from femtune.modal.subspace import RANK_TOLERANCE, projection

RIGID_SHARE = 0.9
"""Share of a test shape in the span of the rigid-body modes at the sensors from which it is a rigid-body motion."""
ELASTIC_SHARE = 0.7
"""The same share of an elastic mode of the model above which the sensors do not tell the two kinds apart."""
_NEAR = 2.0
"""Elastic modes up to this multiple of the lowest elastic frequency could be mistaken for modes of a suspension."""
_BY_CHANCE = 0.01
"""Probability with which the share of a random shape may exceed RIGID_SHARE."""
_SOFT = 0.5
"""Frequency over the lowest elastic one up to which a mode that cannot be told is still named as a possible mode of the
suspension; test standards ask for less than 0.1 to 0.3."""


def with_suspension(test: ModeSet, model: ModeSet, pairing: Pairing, rigid: int) -> Pairing:
    """The pairing with unpaired test modes marked that are modes of the suspension.

    A test mode is one if it lies below all elastic modes of a free model and its shape is a rigid-body motion of this
    model. Nothing is marked if the sensors cannot tell: if elastic modes look like rigid-body motions at them, or
    random shapes do because there are too few. A notice says what was found.

    Parameters
    ----------
    rigid : number of rigid-body modes of the model, its first modes
    """
    seen = np.flatnonzero(visible_modes(model))
    bodies, elastic = seen[seen < rigid], seen[seen >= rigid]
    free = [u for u in pairing.unpaired_test if not u.left_out]
    if not len(bodies) or not len(elastic) or not free:
        return pairing
    lowest = float(model.freq_hz[elastic].min())
    motions = model.shapes[:, bodies]
    shares = projection(motions, test.shapes[:, [u.test for u in free]])
    rigid_share = {
        u.test: float(share)
        for u, share in zip(free, shares)
        if share >= RIGID_SHARE and test.freq_hz[u.test] < lowest
    }  # fmt: skip
    if not rigid_share:
        return pairing
    problem = _cannot_tell(test, model, motions, elastic[model.freq_hz[elastic] <= _NEAR * lowest])
    if problem:
        possible = [i for i in rigid_share if test.freq_hz[i] <= _SOFT * lowest]
        told = (Notice("correlate.suspension/unclear", modes=_named(test, possible), problem=problem),)
        return replace(pairing, notices=(*pairing.notices, *(told if possible else ())))
    facts: dict[str, Any] = {
        "modes": _named(test, list(rigid_share)),
        "percent": 100.0 * min(rigid_share.values()),
        "lowest": lowest,
    }
    notice = Notice("correlate.suspension", level="info", **facts)
    unpaired = tuple(_marked(u, rigid_share) for u in pairing.unpaired_test)
    return replace(pairing, unpaired_test=unpaired, notices=(*pairing.notices, notice))


def _cannot_tell(test: ModeSet, model: ModeSet, motions: Reals, near: NDArray[np.int64]) -> str:
    """Why the sensors do not tell rigid-body motions from elastic ones; "" if they do."""
    entries = int(np.sum(~np.isnan(test.shapes), axis=0).min())
    sizes = np.linalg.svd(motions, compute_uv=False)
    rank = int(np.sum(sizes > RANK_TOLERANCE * sizes[0]))
    chance = betaincc(0.5 * rank, 0.5 * (entries - rank), RIGID_SHARE) if entries > rank else 1.0
    if chance > _BY_CHANCE:
        return f"{entries} sensors are too few for {rank} independent rigid-body motions"
    shares = projection(motions, model.shapes[:, near])
    worst = int(np.argmax(shares))
    if shares[worst] > ELASTIC_SHARE:
        mode, percent = model.labels[int(near[worst])], 100.0 * shares[worst]
        return f"at the sensors, {percent:.0f} % of the elastic mode {mode} of the model is a rigid-body motion as well"
    return ""


def _marked(one: Unpaired, found: dict[int, float]) -> Unpaired:
    if one.test not in found:
        return one
    reason = f"mode of the suspension: {100.0 * found[one.test]:.1f} % of its shape is a rigid-body motion"
    return replace(one, reason=reason, suspension=True)


def _named(test: ModeSet, modes: Sequence[int]) -> str:
    return ", ".join(f"{test.labels[i]} ({test.freq_hz[i]:.4g} Hz)" for i in modes)
