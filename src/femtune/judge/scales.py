"""How large the errors of each kind of value are: the factors of `estimated_factors` for the judge's record.

A model that is wrong makes the factors larger, and those of the kinds that a wrong parameter can hide in too small:
they detect, they do not heal. They therefore widen intervals and scale tests.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import stdtrit

from femtune.arrays import Reals
from femtune.judge.whitened import PRIOR, Whitened
from femtune.updating.error_scales import FEWEST_DEGREES, estimated_factors


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

    def project(factors: Mapping[str, float]) -> tuple[Reals, dict[str, float]]:
        weighted = _weighted(record, _of_rows(record, factors))
        return weighted.left, {kind: weighted.degrees(at)[0] for kind, at in places.items()}

    factors, degrees = estimated_factors(places, project)
    kinds = tuple(KindScale(k, factors[k], degrees[k]) for k in places)
    rows = _of_rows(record, factors)
    return Scales(kinds, rows, _weighted(record, rows))


def _of_rows(record: Whitened, factors: Mapping[str, float]) -> Reals:
    return np.array([factors.get(kind, 1.0) for kind in record.kinds])


def _weighted(record: Whitened, rows: Reals) -> Whitened:
    """The record with rows divided by factors that are equal within each block, so that what is lost stays lost."""
    by = rows[:, None]
    return replace(record, r=record.r / rows, J=record.J / by, bounded=record.bounded / by, fixed=record.fixed / by)
