"""The front of frequency errors against shape errors and others, from the residuals of a study.

The objectives are sums over all paired modes: squared relative errors of frequencies, and 1 − MAC where the study has
MAC residuals, otherwise the squared errors of what else is compared. The sum of both is the fitness of Eq. (9) of the
rack paper, which gives them the same weight. With three objectives, what is neither frequency nor shape is the third.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from femtune.arrays import Flags, Reals
from femtune.errors import FemtuneError
from femtune.residuals import ByMode, FrequencyResidual, MacResidual, OfModes, ShapeResidual

if TYPE_CHECKING:
    from collections.abc import Iterator

    from femtune.residuals import Evaluation, Residual, UpdateProblem


@dataclass(frozen=True, eq=False)
class ErrorParts:
    """Residuals (…, n) → the objectives (…, 2), or (…, 3).

    Parameters
    ----------
    sd : (n,) standard deviations of the residuals
    frequency : (n,) True for those of frequencies
    form : of the MAC residuals; None without any
    third : (n,) True for those of the third objective; none without a third
    """

    sd: Reals
    frequency: Flags
    form: str | None
    third: Flags

    @classmethod
    def of(cls, problem: UpdateProblem, at: Evaluation, objectives: int = 2) -> ErrorParts:
        """Of a study that compares frequencies, and shapes or something else.

        Raises
        ------
        FemtuneError : ``search.front`` if it compares frequencies alone or none, MACs beside other quantities with two
            objectives, or with three no shapes or nothing beside frequencies and shapes
        """
        counts = [len(block.values) for block in at.blocks]
        kinds = np.repeat([block.kind for block in at.blocks], counts)
        frequency = kinds == FrequencyResidual.label
        others = sorted(set(kinds[~frequency]))
        if not frequency.any() or not others:
            raise FemtuneError("search.front", kinds=", ".join(sorted(set(kinds))))
        third = np.zeros(len(kinds), bool)
        if objectives == 3:
            shapes = MacResidual.label if MacResidual.label in others else ShapeResidual.label
            third = ~frequency & (kinds != shapes)
            if shapes not in others or not third.any():
                raise FemtuneError("search.front/third", kinds=", ".join(sorted(set(kinds))))
            others = [shapes]
        form = None
        if MacResidual.label in others:
            every = (*problem.residuals, *(r for case in problem.cases for r in case.residuals))
            forms = sorted({form for r in every for form in _forms(r)})
            if len(others) > 1 or len(forms) > 1:
                raise FemtuneError("search.front/mac", kinds=", ".join(others), forms=", ".join(forms))
            form = forms[0]
        return cls(np.repeat([block.sd for block in at.blocks], counts), frequency, form, third)

    @property
    def label(self) -> str:
        """What the second objective is."""
        if self.form is not None:
            return "sum of 1 − MAC"
        return "sum of squared errors of the shapes" if self.third.any() else _REST

    @property
    def third_label(self) -> str:
        """What the third objective is; "" without one."""
        return _REST if self.third.any() else ""

    def __call__(self, residuals: Reals) -> Reals:
        error = residuals * self.sd
        rest = error[..., ~self.frequency & ~self.third]
        shapes = np.sum(rest**2, axis=-1) if self.form is None else np.sum(one_less_mac(rest, self.form), axis=-1)
        parts = [np.sum(error[..., self.frequency] ** 2, axis=-1), shapes]
        if self.third.any():
            parts.append(np.sum(error[..., self.third] ** 2, axis=-1))
        return np.stack(parts, axis=-1)


_REST = "sum of squared errors of the rest"


def _forms(residual: Residual) -> Iterator[str]:
    """Forms of the MAC residuals that a residual consists of."""
    if isinstance(residual, MacResidual):
        yield residual.form
    elif isinstance(residual, ByMode):
        for part in residual.parts:
            yield from _forms(part)
    elif isinstance(residual, OfModes):
        yield from _forms(residual.residual)


def one_less_mac(value: Reals, form: str) -> Reals:
    """1 − MAC from a function of it, see `mac_residual`; predicted values below zero give zero."""
    value = np.maximum(value, 0.0)
    if form == "root":
        return np.asarray(1.0 - (1.0 + value) ** -2.0)
    return np.asarray(value / (1.0 + value) if form == "ratio" else value)
