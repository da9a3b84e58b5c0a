"""How large the errors of each kind of value are, estimated from the residuals: restricted maximum likelihood.

A factor s_k on the stated standard deviations of each kind fulfils s_k² = Σ_k r⊥²/tr P_kk, with r⊥ = P r and P of the
residuals that are weighted by these factors (Helmert's equations).

Source: C. R. Rao, J. Kleffe, Estimation of Variance Components and Applications, 1988, chapter 9; F. R. Helmert, Die
Ausgleichungsrechnung nach der Methode der kleinsten Quadrate, 1924.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals

FEWEST_DEGREES = 3.0
"""Degrees of freedom below which a kind tells nothing of its errors: the 95 % interval of its factor would reach from
a half to six times it."""
_TOLERANCE = 1e-6
"""Relative change of all factors at which the iteration ends: far below their standard deviations."""
_MOST_ITERATIONS = 200
"""Iterations at most."""
_LEAST = 1e-8
"""Least factor: residuals of a model that fits exactly are rounding."""

Project = Callable[[Mapping[str, float]], tuple[Reals, Mapping[str, float]]]
"""From the factors by kind: (n,) P r of the residuals divided by them, and tr P_kk of each kind."""


def estimated_factors(
    places: Mapping[str, NDArray[np.int64]], project: Project
) -> tuple[dict[str, float], dict[str, float]]:
    """The factor of each kind, and the degrees of freedom tr P_kk of its estimate.

    Parameters
    ----------
    places : rows of each kind
    project : see `Project`

    Returns
    -------
    factors : one for kinds with fewer than three degrees of freedom
    degrees : of all kinds

    Examples
    --------
    Ten values of the size 0.2, alternately positive and negative, and no parameters:

    >>> r = 0.2 * (-1.0) ** np.arange(10)
    >>> factors, degrees = estimated_factors({"a": np.arange(10)}, lambda s: (r / s["a"], {"a": 10.0}))
    >>> round(factors["a"], 6), degrees["a"]
    (0.2, 10.0)
    """
    factors = dict.fromkeys(places, 1.0)
    left, degrees = project(factors)
    for _ in range(_MOST_ITERATIONS):
        before = dict(factors)
        for kind, at in places.items():
            if degrees[kind] >= FEWEST_DEGREES:
                size = float(np.sqrt(np.sum(left[at] ** 2) / degrees[kind]))
                factors[kind] = max(factors[kind] * size, _LEAST)
        left, degrees = project(factors)
        if all(abs(factors[k] / before[k] - 1.0) < _TOLERANCE for k in places):
            break
    return {k: factors[k] if degrees[k] >= FEWEST_DEGREES else 1.0 for k in places}, dict(degrees)
