"""[[residual]] of measured FRFs: the functions themselves, and their antiresonances."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from femtune.files.study_file.kinds import FrequencySd, NotNegative, Positive, Text
from femtune.files.study_file.response import Hertz, HertzAboveZero, Labels, MethodWord, Ratio
from femtune.files.study_file.table import Table


class MeasuredFunctionsTable(Table):
    """Some of the test's functions in a band, and the modes that the model's are made of."""

    configuration: Text | None = None
    outputs: Labels | None = None
    inputs: Labels | None = None
    from_hz: Hertz = 0.0
    to_hz: HertzAboveZero | None = None
    count: Annotated[int, Field(ge=1, le=100_000)] | None = None
    max_hz: HertzAboveZero | None = None


class FrfResidualEntry(MeasuredFunctionsTable):
    """FRFs, line by line."""

    kind: Literal["frf"]
    modes: Annotated[tuple[Text, ...], Field(min_length=1)] | None = None
    form: Literal["linear", "log-magnitude", "log-complex"] = "log-complex"
    around: Literal["band", "resonances"] = "band"
    most: Annotated[int, Field(ge=1, le=1_000_000)] | None = None
    bandwidths: Positive = 2.0
    lines: Annotated[int, Field(ge=1, le=1000)] = 3
    aligned: bool = False
    region_ratio: Annotated[float, Field(gt=0, lt=1)] | None = None
    sd: NotNegative | None = None
    floor: NotNegative = 0.0
    averages: Annotated[int, Field(ge=1, le=1_000_000)] | None = None
    method: MethodWord = "real modes"
    residual_vectors: bool = True
    ratio: Ratio | None = None
    ratios: Annotated[tuple[Ratio, ...], Field(min_length=1)] | None = None


class AntiresonanceResidualEntry(MeasuredFunctionsTable):
    """Antiresonances; "test" takes the scatter with which each is found."""

    kind: Literal["antiresonance"]
    sd: FrequencySd = 0.01
    frequency_gate: Annotated[float, Field(gt=0, le=1)] = 0.30
    mac_gate: Annotated[float, Field(ge=0, le=1)] = 0.50
    depth: Annotated[float, Field(gt=0, lt=1)] = 0.5
    half_width: Annotated[int, Field(ge=2, le=1000)] = 4
    most_damping: Annotated[float, Field(gt=0, lt=1)] = 0.05
