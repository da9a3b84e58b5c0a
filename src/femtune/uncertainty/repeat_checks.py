"""Checks of repeated tests before they are used: dependence on their order, and outliers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from femtune.arrays import Integers, Reals
from femtune.errors import Notice
from femtune.uncertainty.order_tests import OrderDependence, order_dependence
from femtune.uncertainty.robust import RobustMoments, WhyNot, robust_moments


@dataclass(frozen=True)
class RepeatChecks:
    """Checks of n repeats of m outputs.

    Parameters
    ----------
    labels : (m,) names of the outputs
    sd : (m,) their standard deviations, robust ones where they can be computed
    order : test of dependence on the order; None for fewer than eight repeats
    whole : positions of the repeats without missing values
    robust : their robust moments, or why there are none
    """

    labels: tuple[str, ...]
    sd: Reals
    order: OrderDependence | None
    whole: Integers
    robust: RobustMoments | WhyNot

    @property
    def outliers(self) -> tuple[int, ...]:
        """Numbers of the outlying repeats, from 1."""
        if isinstance(self.robust, str):
            return ()
        return tuple(int(self.whole[i]) + 1 for i in self.robust.outliers)

    @property
    def notices(self) -> tuple[Notice, ...]:
        """Notices of the checks; none for checks without findings."""
        return (*self.of_order(), *self.of_outliers())

    def of_order(self) -> tuple[Notice, ...]:
        """The notice of a dependence on order, if there is one."""
        dependence = self.order
        if dependence is None or dependence.kind is None:
            return ()
        if dependence.kind == "serial correlation":
            return (Notice("quantify.order-dependence/serial", p=dependence.p_value),)
        changes = [f"{self.labels[i]} {dependence.change[i] / self.sd[i]:+.2g}" for i in dependence.outputs]
        said = ", ".join(changes) or "no single output significantly"
        if dependence.kind == "drift":
            return (Notice("quantify.order-dependence/drift", p=dependence.p_value, changes=said),)
        return (
            Notice("quantify.order-dependence/jump", p=dependence.p_value, changes=said, after=dependence.jump_after),
        )

    def of_outliers(self) -> tuple[Notice, ...]:
        """The notice of outliers, if there are any."""
        if not self.outliers or isinstance(self.robust, str):
            return ()
        which = ", ".join(map(str, self.outliers))
        return (Notice("quantify.outlier", repeats=which, p=self.robust.p_value),)


def check_repeats(table: Reals, labels: Sequence[str]) -> RepeatChecks:
    """Checks of repeats (n, m) in the order of the tests; NaN where a value was not measured.

    Examples
    --------
    >>> import numpy as np
    >>> from femtune.uncertainty import check_repeats
    >>> table = np.random.default_rng(3).normal(size=(20, 2))
    >>> check_repeats(table, ("a", "b")).notices
    ()
    >>> table[11] += 20.0
    >>> check_repeats(table, ("a", "b")).outliers
    (12,)
    """
    whole = np.flatnonzero(np.isfinite(table).all(axis=1))
    robust = robust_moments(table[whole])
    sd = np.sqrt(np.diag(robust.covariance)) if isinstance(robust, RobustMoments) else np.nanstd(table, axis=0, ddof=1)
    return RepeatChecks(tuple(labels), sd, order_dependence(table), whole, robust)
