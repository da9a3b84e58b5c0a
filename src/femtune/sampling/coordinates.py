"""Coordinates in which a uniform distribution between bounds is a standard normal one.

A parameter x between l and u is x = l + (u − l) Φ(v) with the normal distribution function Φ. What the data leave open
is then a standard normal variable, and a bound is at infinity: sampling knows no bounds.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr, ndtri

from femtune.arrays import Reals

_EDGE = 1e-12
"""Distance from a bound, relative to the width, at which a point on it is placed."""
_LOG_2PI = float(np.log(2.0 * np.pi))


@dataclass(frozen=True, eq=False)
class NormalBox:
    """Bounds (k,) of the sampled parameters.

    Examples
    --------
    >>> box = NormalBox(np.zeros(2), np.array([1.0, 4.0]))
    >>> box.inside(np.zeros((1, 2))).tolist(), box.normal(np.array([[0.5, 2.0]])).round(12).tolist()
    ([[0.5, 2.0]], [[0.0, 0.0]])
    """

    lower: Reals
    upper: Reals

    def inside(self, v: Reals) -> Reals:
        """(n, k) x of standard normal variables."""
        return self.lower + (self.upper - self.lower) * ndtr(v)

    def slope(self, v: Reals) -> Reals:
        """(n, k) ∂x/∂v."""
        return (self.upper - self.lower) * np.exp(-0.5 * (v**2 + _LOG_2PI))

    def normal(self, x: Reals) -> Reals:
        """(n, k) v of points between the bounds; a point on a bound is moved inside by rounding."""
        return np.asarray(ndtri(np.clip((x - self.lower) / (self.upper - self.lower), _EDGE, 1.0 - _EDGE)))


def log_normal(v: Reals) -> Reals:
    """(n,) logarithm of the density of independent standard normal variables (n, k)."""
    return np.asarray(-0.5 * (np.sum(v**2, axis=-1) + v.shape[-1] * _LOG_2PI))
