"""[response] and [[load]]: frequency responses and static displacements of the model."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from femtune.files.study_file.kinds import DofLabel, Positive, Text
from femtune.files.study_file.table import Table

Labels = Annotated[tuple[DofLabel, ...], Field(min_length=1)]
Ratio = Annotated[float, Field(ge=0, lt=1)]
Hertz = Annotated[float, Field(ge=0, le=1e12)]
HertzAboveZero = Annotated[float, Field(gt=0, le=1e12)]
MethodWord = Literal["real modes", "complex modes", "direct"]

MOST_LINES = 1_000_000


class ResponseTable(Table):
    """[response]: which FRFs, on which lines, by which way, with which damping."""

    kind: Literal["receptance", "mobility", "accelerance"] = "accelerance"
    outputs: Labels | None = None
    inputs: Labels | None = None
    from_hz: Hertz | None = None
    to_hz: HertzAboveZero | None = None
    step_hz: Positive | None = None
    lines: Annotated[int, Field(ge=1, le=MOST_LINES)] | None = None
    method: MethodWord = "real modes"
    modes: Annotated[int, Field(ge=1, le=100_000)] | None = None
    max_hz: HertzAboveZero | None = None
    residual_vectors: bool = True
    damping: Literal["deck", "modal"] = "deck"
    ratio: Ratio | None = None
    ratios: Annotated[tuple[Ratio, ...], Field(min_length=1)] | None = None


class LoadEntry(Table):
    """[[load]]: forces whose static displacements are wanted."""

    name: Text
    forces: Annotated[dict[DofLabel, float], Field(min_length=1)]
    outputs: Labels | None = None
