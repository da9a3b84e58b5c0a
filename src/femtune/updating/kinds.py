"""Searches, regularisations and rules for their weight, by their words in [update]."""

from __future__ import annotations

from typing import Literal, get_args

from femtune.kinds import Kind, Kinds

SearchMethod = Literal["levenberg-marquardt", "line-search", "gauss-newton"]
SEARCH_METHODS = Kinds(
    SearchMethod,
    Kind("levenberg-marquardt", function="femtune.updating.search:LevenbergMarquardt"),
    Kind("line-search", function="femtune.updating.search:LineSearch"),
    Kind("gauss-newton", function="femtune.updating.search:GaussNewton"),
)

RegularisationMethod = Literal["none", "minimum-change", "distance", "link", "prior", "identical", "truncated"]
REGULARISATIONS = Kinds(
    RegularisationMethod,
    Kind("none", function="femtune.updating.asked:none"),
    Kind("minimum-change", function="femtune.updating.asked:minimum_change"),
    Kind("distance", function="femtune.updating.asked:distance"),
    Kind("link", function="femtune.updating.asked:link"),
    Kind("prior", function="femtune.updating.asked:prior"),
    Kind("identical", function="femtune.updating.asked:identical"),
    Kind("truncated", function="femtune.updating.asked:truncated"),
)

WeightRule = Literal["l-curve", "gcv"]
WEIGHT_RULES: tuple[WeightRule, ...] = get_args(WeightRule)
"""Rules by which the weight of a side constraint is chosen: corner of the L-curve, generalised cross-validation."""

WeightTarget = Literal["whole-change", "each-step"]
"""What the weight of a side constraint acts on: the change from the initial values, or every step alone."""

IntervalKind = Literal["", "normal", "Student's t", "truncated", "bounds"]
"""Why an interval has its limits; "bounds": the data hardly narrow what the bounds leave open."""

TrialKind = Literal["pairing", "start"]
"""What is tried at the end of an update: test modes with other partners, or other initial values."""
