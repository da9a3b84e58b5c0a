"""[[stage]]: one part of a bottom-up study; stages run one after another, in the order of the file."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from femtune.files.study_file.kinds import NotNegative, Positive, Text
from femtune.files.study_file.table import Table

Names = Annotated[tuple[Text, ...], Field(min_length=1)]


class StageEntry(Table):
    """What moves, what it is compared with, and from where else it starts."""

    name: Text
    parameters: Names
    residuals: Names
    configurations: Names | None = None
    seeds: tuple[dict[Text, float], ...] = ()
    frf_sd: Positive = 0.05
    frf_floor: NotNegative = 0.0
    prior: bool = True
    max_iterations: Annotated[int, Field(ge=1, le=1_000_000)] | None = None
    tolerance: Annotated[float, Field(gt=0, lt=1)] | None = None
