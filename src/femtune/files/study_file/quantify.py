"""[select] and [quantify]: selection of parameters, and their variability from repeated tests."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BeforeValidator, Field

from femtune.files.study_file.kinds import NamesFile, Text, TomlTable
from femtune.uncertainty.kinds import CovarianceEstimate, MissingValues, OutputWeighting, QuantifyMethod


class SelectTable(TomlTable):
    """[select]: additional measures for the selection of parameters."""

    energies: Literal["none", "parameters", "properties", "elements"] = "none"
    localise: bool = False
    noise: Annotated[float, Field(gt=0, lt=1)] = 0.01
    smoothness: bool = False


Fraction = Annotated[float, Field(gt=0, lt=1)]
RepeatsName = Annotated[Text, NamesFile("file of repeats")]
RepeatNumber = Annotated[int, Field(ge=1)]


def _listed(value: object) -> object:
    """A single file may be given without brackets."""
    return (value,) if isinstance(value, str) else value


class QuantifyTable(TomlTable):
    """[quantify]: repeated tests of one configuration, and the estimation of mean and covariance."""

    repeats: Annotated[tuple[RepeatsName, ...], BeforeValidator(_listed), Field(min_length=1)]
    columns: tuple[str, ...] = ()
    configuration: Text | None = None
    method: QuantifyMethod = "second-order"
    missing: MissingValues = "em"
    covariance: CovarianceEstimate = "sample"
    noise_sd: Fraction | Literal["test"] | dict[Text, Fraction] | None = None
    hold_out: Fraction | Annotated[tuple[RepeatNumber, ...], Field(min_length=1)] | None = None
    shapes: bool = False
    intervals: bool = False
    weighting: OutputWeighting = "relative"
    regularisation: Annotated[float, Field(ge=0, le=1e12)] = 0.0
    samples: Annotated[int, Field(ge=20, le=1_000_000)] = 200
    seed: Annotated[int, Field(ge=0, le=2**31)] = 1
