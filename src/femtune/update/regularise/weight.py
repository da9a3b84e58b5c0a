"""How the weight μ of a side constraint is found: given, by the corner of the L-curve, or by cross-validation."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum
from typing import Literal

import numpy as np

from femtune.update.regularise.path import RegularisationPath, regularisation_path
from femtune.update.regularise.side import LinearModel, SideConstraint

Weight = float | Literal["l-curve", "gcv"]
"""A number, or the rule by which it is found at the first iteration."""

SHARP = 1.0
"""Curvature from which a bend is a corner: a radius of less than a factor e in both norms."""


class WeightStatus(Enum):
    """How the weight was found, or why it was not; the update goes on without a constraint where it was not."""

    CORNER = "the weight is that of the L-curve's corner, where its curvature is largest"
    NO_CORNER = (
        "the L-curve bends evenly and has no corner, so that no weight balances data and constraint: the update ran "
        'without the constraint; give weight a number, or use weight = "gcv"'
    )
    MONOTONE = (
        "the curvature of the L-curve only rises towards one end of it, so that there is no corner: the update ran "
        'without the constraint; give weight a number, or use weight = "gcv"'
    )
    STANDS_STILL = (
        "data and constraint do not pull against each other, so that the weight means nothing: the update ran without "
        "the constraint"
    )
    LEAST = "the weight is that of the least generalised cross-validation"
    AT_END = (
        "generalised cross-validation falls towards one end of the weights and has no least value between: the update "
        "ran without the constraint; give weight a number"
    )
    NO_SPARE = (
        "there are no more residuals than parameters, and cross-validation needs some to spare: the update ran without "
        "the constraint; give weight a number, or measure more"
    )

    @property
    def found(self) -> bool:
        """True where there is a weight."""
        return self in (WeightStatus.CORNER, WeightStatus.LEAST)


@dataclass(frozen=True, eq=False)
class WeightChoice:
    """A weight that was found, or not, with the whole path.

    Parameters
    ----------
    rule : "l-curve" or "gcv"
    position : of the weight in the path; None where none was found
    """

    rule: Literal["l-curve", "gcv"]
    status: WeightStatus
    position: int | None
    path: RegularisationPath

    @property
    def weight(self) -> float:
        """μ, zero where none was found."""
        return 0.0 if self.position is None else float(self.path.weights[self.position])


def weighed(side: SideConstraint, weight: Weight, at: LinearModel) -> SideConstraint:
    """The side constraint with its weight, found at this point where a rule is given."""
    if not isinstance(weight, str):
        return replace(side, weight=float(weight))
    choice = choose_weight(side, weight, at)
    return replace(side, weight=choice.weight, choice=choice)


def reweighed(side: SideConstraint, at: LinearModel) -> SideConstraint:
    """The same constraint with the weight that its rule finds at another point; the old one where none is found."""
    if side.choice is None:
        return side
    fresh = choose_weight(side, side.choice.rule, at)
    return replace(side, weight=fresh.weight, choice=fresh) if fresh.status.found else side


def choose_weight(side: SideConstraint, rule: Literal["l-curve", "gcv"], at: LinearModel) -> WeightChoice:
    """The weight by a rule, on the linear model at a point."""
    path = regularisation_path(side, at)
    status, position = (_corner if rule == "l-curve" else _least)(path, len(at.residuals) - int(at.moving.sum()))
    return WeightChoice(rule, status, position if status.found else None, path)


def _corner(path: RegularisationPath, spare: int) -> tuple[WeightStatus, int]:
    known = np.flatnonzero(np.isfinite(path.curvature))
    if len(known) < 5:
        return WeightStatus.STANDS_STILL, 0
    top = int(known[np.argmax(path.curvature[known])])
    if path.curvature[top] < SHARP:
        return WeightStatus.NO_CORNER, top
    return (WeightStatus.MONOTONE if top in (known[0], known[-1]) else WeightStatus.CORNER), top


def _least(path: RegularisationPath, spare: int) -> tuple[WeightStatus, int]:
    if spare <= 0:
        return WeightStatus.NO_SPARE, 0
    values = path.cross_validation
    least = int(np.argmin(values))
    inside = 0 < least < len(values) - 1 and values[least] < (1.0 - 1e-6) * min(values[0], values[-1])
    return (WeightStatus.LEAST if inside else WeightStatus.AT_END), least
