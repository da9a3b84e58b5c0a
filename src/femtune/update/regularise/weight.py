"""How the weight μ of a side constraint is found: given, by the corner of the L-curve, or by cross-validation."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np

from femtune.update.regularise.choice import RegularisationPath, Weight, WeightChoice, WeightStatus
from femtune.update.regularise.path import regularisation_path
from femtune.update.regularise.side import LinearModel, SideConstraint

SHARP = 1.0
"""Curvature from which a bend is a corner: a radius of less than a factor e in both norms."""


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
