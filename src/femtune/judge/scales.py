"""How large the errors of each kind of value are, estimated from the residuals: restricted maximum likelihood.

A factor s_k on the stated standard deviations of each kind fulfils s_k² = Σ_k r⊥²/tr P_kk, with r⊥ and P of the
residuals that are weighted by these factors (Helmert's equations). A model that is wrong makes the factors larger, and
those of the kinds that a wrong parameter can hide in too small: they detect, they do not heal. They therefore widen
intervals and scale tests, and never narrow intervals.

Source: C. R. Rao, J. Kleffe, Estimation of Variance Components and Applications, 1988, chapter 9; F. R. Helmert, Die
Ausgleichungsrechnung nach der Methode der kleinsten Quadrate, 1924.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import stdtrit

from femtune.arrays import Reals
from femtune.judge.whitened import PRIOR, Whitened

FEWEST_DEGREES = 3.0
"""Degrees of freedom below which a kind tells nothing of its errors: the 95 % interval of its factor would reach from
a half to six times it."""
_TOLERANCE = 1e-6
_MOST_ITERATIONS = 200
_LEAST = 1e-8
"""Least factor: residuals of a model that fits exactly are rounding."""


@dataclass(frozen=True)
class KindScale:
    """Errors of one kind of value.

    Parameters
    ----------
    factor : actual over stated standard deviation; one where the kind has too few degrees of freedom to tell
    degrees : degrees of freedom of the estimate, tr P_kk
    """

    kind: str
    factor: float
    degrees: float

    @property
    def estimated(self) -> bool:
        """Whether the factor follows from the residuals."""
        return self.degrees >= FEWEST_DEGREES

    def coverage_factor(self, level: float = 0.95) -> float:
        """Half width of an interval in estimated standard deviations, of Student's t."""
        return float(stdtrit(self.degrees if self.estimated else np.inf, 0.5 + 0.5 * level))


@dataclass(frozen=True, eq=False)
class Scales:
    """The factors of all kinds.

    Parameters
    ----------
    kinds : those of the rows whose standard deviations are not stated; those of a prior are
    rows : (n,) factor of each row
    weighted : the record with rows of unit variance by these factors
    """

    kinds: tuple[KindScale, ...]
    rows: Reals
    weighted: Whitened

    def of(self, kind: str) -> KindScale | None:
        """The factor of a kind."""
        return next((k for k in self.kinds if k.kind == kind), None)


def scales(record: Whitened, stated: Collection[str] = ()) -> Scales:
    """The factor of each kind of the rows, and its degrees of freedom.

    Parameters
    ----------
    stated : kinds whose standard deviations are known, so that their factors are one

    Examples
    --------
    Ten values of the size 0.2, alternately positive and negative, and no parameters:

    >>> n, r = 10, 0.2 * (-1.0) ** np.arange(10)
    >>> labels = [("frequency",) * n, *[("",) * n] * 3]
    >>> rows = Whitened(r, np.zeros((n, 0)), (), np.zeros((n, 0)), *labels, ("data",) * n, np.ones(n), np.zeros((n, 0)))
    >>> found = scales(rows).of("frequency")
    >>> round(found.factor, 6), found.degrees
    (0.2, 10.0)
    """
    places = {k: record.of_kind(k) for k in dict.fromkeys(record.kinds) if k != PRIOR and k not in stated}
    factors, weighted = dict.fromkeys(places, 1.0), record
    degrees = {kind: record.degrees(at)[0] for kind, at in places.items()}
    for _ in range(_MOST_ITERATIONS):
        left, before = weighted.left, dict(factors)
        for kind, at in places.items():
            if degrees[kind] >= FEWEST_DEGREES:
                size = float(np.sqrt(np.sum(left[at] ** 2) / degrees[kind]))
                factors[kind] = max(factors[kind] * size, _LEAST)
        weighted = _weighted(record, _of_rows(record, factors))
        degrees = {kind: weighted.degrees(at)[0] for kind, at in places.items()}
        if all(abs(factors[k] / before[k] - 1.0) < _TOLERANCE for k in places):
            break
    kinds = tuple(KindScale(k, factors[k] if degrees[k] >= FEWEST_DEGREES else 1.0, degrees[k]) for k in places)
    rows = _of_rows(record, {k.kind: k.factor for k in kinds})
    return Scales(kinds, rows, _weighted(record, rows))


def _of_rows(record: Whitened, factors: dict[str, float]) -> Reals:
    return np.array([factors.get(kind, 1.0) for kind in record.kinds])


def _weighted(record: Whitened, rows: Reals) -> Whitened:
    """The record with rows divided by factors that are equal within each block, so that what is lost stays lost."""
    by = rows[:, None]
    return replace(record, r=record.r / rows, J=record.J / by, bounded=record.bounded / by, fixed=record.fixed / by)
