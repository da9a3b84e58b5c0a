"""Profiles of acceptance criteria, by their words in [validate]."""

from __future__ import annotations

from typing import Literal

from femtune.kinds import Kind, Kinds

ProfileWord = Literal["all", "NASA", "MIL", "ECSS", "own"]
PROFILES = Kinds(
    ProfileWord,
    Kind("all", "all standards", function="femtune.validation.criteria:all_standards"),
    Kind("NASA", "NASA-STD-5002", function="femtune.validation.criteria:of_standard"),
    Kind("MIL", "MIL-STD-1540C", function="femtune.validation.criteria:of_standard"),
    Kind("ECSS", "ECSS-E-ST-32-11C", function="femtune.validation.criteria:of_standard"),
    Kind("own", "own", function="femtune.validation.criteria:no_standard"),
)
