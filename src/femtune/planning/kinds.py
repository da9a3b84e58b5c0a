"""Methods and criteria of sensor placement, by their words in [plan]."""

from __future__ import annotations

from typing import Literal

from femtune.kinds import Kind, Kinds

PlacementMethod = Literal["expansion", "elimination"]
PLACEMENT_METHODS = Kinds(
    PlacementMethod,
    Kind(
        "expansion",
        text="sensors were placed one by one, where they increase the determinant of the information most",
        citations=("kammer2005",),
    ),
    Kind(
        "elimination",
        text="the candidate with the least effective independence was removed until all others were wanted",
        citations=("kammer1991",),
    ),
)

Weighting = Literal["none", "kinetic-energy"]
WEIGHTINGS = Kinds(
    Weighting,
    Kind("none", text="All candidates have equal weight."),
    Kind(
        "kinetic-energy",
        text="Candidates are weighted by kinetic energy: shapes are multiplied by the square root of the mass at the "
        "grid point.",
    ),
)

Criterion = Literal["D", "A"]
CRITERIA = Kinds(
    Criterion,
    Kind("D", text="determinant of the information on"),
    Kind("A", text="sum of the variances of"),
)
"""D-optimal and A-optimal designs (Atkinson, Donev and Tobias 2007)."""

Average = Literal["mean", "worst"]
"""Over the points within the bounds: the mean of the criterion, or its worst value."""
