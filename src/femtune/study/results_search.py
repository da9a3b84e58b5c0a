"""Records of how the weight of a regularisation was found, and of many starts."""

from __future__ import annotations

from typing import Literal

from femtune.study.results_base import Record


class PathPoint(Record):
    """What the linear model of the first iteration gives for one weight of the side constraint."""

    weight: float
    """The weight (no unit)."""
    residual_norm: float
    """Norm of the residuals in their standard deviations (no unit)."""
    constraint_norm: float
    """Norm of the side constraint without its weight (no unit)."""
    curvature: float | None
    """Of the L-curve (no unit); None where it stands still."""
    cross_validation: float | None
    """Generalised cross-validation (no unit); None without residuals to spare."""
    parameters: tuple[float, ...]
    """Values of the free parameters, bounds left aside, each in its unit, as UpdateResults.history_parameters."""


class WeightChoiceResults(Record):
    """How the weight of the regularisation was found."""

    rule: Literal["l-curve", "gcv"]
    """The rule."""
    status: str
    """Name of the status: "CORNER"."""
    found: bool
    """False where there was no weight to find, and the update ran without the constraint."""
    sentence: str
    """What happened, in a sentence."""
    weight: float | None
    """The weight (no unit); None where none was found."""
    path: tuple[PathPoint, ...]
    """The whole path, weights rising."""


class StartFacts(Record):
    """One start of many."""

    number: int
    """Its number, from 1."""
    start: tuple[float, ...]
    """Free parameters where it set out, each in its unit, as UpdateResults.history_parameters."""
    end: tuple[float, ...]
    """Where it ended."""
    objective: float | None
    """Half the sum of squared residuals at the end, side constraint included (no unit); None where it failed."""
    outcome: str
    """Name of what became of it: "BEST"."""
    sentence: str
    """The same in words, with the reason where it failed."""
    tries: int
    """How many times it set out."""
    iterations: int
    """Of all tries."""


class OptimumFacts(Record):
    """Ends that are one point."""

    objective: float
    """Half the sum of squared residuals, side constraint included (no unit)."""
    parameters: tuple[float, ...]
    """Free parameters there, each in its unit, as UpdateResults.history_parameters."""
    starts: tuple[int, ...]
    """Numbers of the starts that ended there."""
    as_good: bool
    """True where the data cannot tell it from the best."""


class StartsResults(Record):
    """Many starts, each kept."""

    seed: int
    """Of the Latin hypercube."""
    unique: bool
    """False where another optimum is as good within the noise."""
    sentences: tuple[str, ...]
    """What the starts tell of the answer."""
    noise: float
    """By how much objectives may differ for the data not to tell their points apart (no unit)."""
    starts: tuple[StartFacts, ...]
    """In the order of their numbers."""
    optima: tuple[OptimumFacts, ...]
    """Distinct ends, the best first."""
