"""Redundant sensors: how much of a sensor's output another one already gives, by their joint output Gramian.

Let the target modes be excited to equal mean squares of their motion at all candidates. The outputs of two sensors with
rows Φ_a and Φ_b have the Gramian [[Φ_aΦ_aᵀ, Φ_aΦ_bᵀ], [Φ_bΦ_aᵀ, Φ_bΦ_bᵀ]]. What of the output a linear combination of
the outputs b cannot reproduce has the Gramian Φ_aΦ_aᵀ − Φ_aΦ_bᵀ(Φ_bΦ_bᵀ)⁺Φ_bΦ_aᵀ; the ratio of its trace to that of
Φ_aΦ_aᵀ is 0 for a repetition and 1 for independent outputs. For two uniaxial sensors it is 1 − ρ² with the correlation
ρ of their outputs.
"""

from __future__ import annotations

import numpy as np

from femtune.arrays import Reals

_RANK = 1e-9
"""Eigenvalue of the products of a sensor’s rows relative to the largest, at or below which rows are dependent."""


def unlike(candidates: Reals, sensor: Reals) -> Reals:
    """(s,) part of the output of each candidate that a sensor does not reproduce, from 0 to 1.

    Parameters
    ----------
    candidates : (s, d, m) rows of the target modes, in one scale for all modes
    sensor : (e, m) rows of the sensor

    Examples
    --------
    >>> import numpy as np
    >>> from femtune.planning import unlike
    >>> unlike(np.array([[[1.0, 0.0]], [[1.0, 1.0]], [[0.0, 2.0]]]), np.array([[3.0, 0.0]])).round(3)
    array([0. , 0.5, 1. ])
    """
    values, vectors = np.linalg.eigh(sensor @ sensor.T)
    some = values > _RANK * values.max(initial=0.0)
    # orthonormal rows of what the sensor sees
    basis = (vectors[:, some] / np.sqrt(values[some])).T @ sensor
    size = np.einsum("sdm,sdm->s", candidates, candidates)
    s, _, m = candidates.shape
    seen = (candidates.reshape(-1, m) @ basis.T).reshape(s, -1)
    shared = np.einsum("sk,sk->s", seen, seen)
    return np.clip(1.0 - np.divide(shared, size, out=np.ones(s), where=size > 0.0), 0.0, 1.0)
