"""Stations of a beam: values that change linearly between them, and integrals over the length.

A role at station k of a tapered beam is called ``A@k``; station 0 is end A, the last one end B.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from femtune.arrays import Reals
from femtune.parameters.jet import Jet

GAUSS_POINTS = 24
"""Gauss points between two stations.

Flexibilities vary as 1/(a + b ξ): its integral has an error of 3e-11 for a change by a factor of 16, of 7e-5 for 100.
"""


@dataclass(frozen=True)
class LengthRule:
    """Points ξ (g,) from 0 to 1 with weights (g,), and the share (s, g) of each station in a value there."""

    xi: Reals
    weight: Reals
    share: Reals

    @property
    def count(self) -> int:
        """Number of stations."""
        return len(self.share)


def length_rule(stations: Reals) -> LengthRule:
    """Integration along a beam with stations (s,) ascending from 0 to 1."""
    points, weights = np.polynomial.legendre.leggauss(GAUSS_POINTS)
    width = np.diff(stations)
    xi = (stations[:-1, None] + width[:, None] * (points + 1.0) / 2.0).ravel()
    share = np.array([np.interp(xi, stations, hat) for hat in np.eye(len(stations))])
    return LengthRule(xi, (width[:, None] * weights / 2.0).ravel(), share)


def station_roles(names: Iterable[str], count: int) -> tuple[str, ...]:
    """``A@0``, ``A@1`` … of each name."""
    return tuple(f"{name}@{k}" for name in names for k in range(count))


def along(values: Mapping[str, Jet], name: str, rule: LengthRule) -> Jet:
    """(m, g) a value at the points of the rule."""
    out = values[f"{name}@0"][:, None] * rule.share[0]
    for k in range(1, rule.count):
        out = out + values[f"{name}@{k}"][:, None] * rule.share[k]
    return out


def integral(density: Jet, weight: Reals) -> Jet:
    """(m,) sums over the points of a density (m, g)."""
    return Jet(
        np.einsum("mg,g->m", density.value, weight),
        np.einsum("mgk,g->mk", density.grad, weight),
        np.einsum("mgkl,g->mkl", density.hess, weight),
    )
