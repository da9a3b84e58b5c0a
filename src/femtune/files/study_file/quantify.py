"""[select] and [quantify]: selection of parameters, and their variability from repeated tests."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BeforeValidator, Field, WithJsonSchema

from femtune.files.study_file.kinds import Fraction, NamesFile, Text, TomlTable
from femtune.uncertainty.kinds import CovarianceEstimate, MissingValues, OutputWeighting, QuantifyMethod

RepeatsName = Annotated[Text, NamesFile("file of repeats")]
RepeatNumber = Annotated[int, Field(ge=1)]


def _listed(value: object) -> object:
    """A single file may be given without brackets."""
    return (value,) if isinstance(value, str) else value


Repeats = Annotated[
    tuple[RepeatsName, ...],
    BeforeValidator(_listed),
    Field(min_length=1),
    WithJsonSchema({"anyOf": [{"type": "string"}, {"type": "array", "items": {"type": "string"}, "minItems": 1}]}),
]


class QuantifyTable(TomlTable):
    """[quantify]: repeated tests of one configuration, and the estimation of mean and covariance."""

    repeats: Repeats
    """A table (CSV) with one line per repeat and one column per mode, Hz; or one Universal File per repeat, whose modes
    are paired by their shapes. Example: `"repeats.csv"`"""
    columns: tuple[str, ...] = ()
    """The test mode of each column of the table, `""` for a column without one. Default: the header line has the
    labels. Example: `["", "1", "2"]`"""
    configuration: Text | None = None
    """Configuration of the repeated test; required if several have modes. Example: `"as built"`"""
    method: QuantifyMethod = "second-order"
    """`"perturbation"`, `"second-order"` (including the second derivatives of the frequencies), or the Monte Carlo
    methods `"cross-covariance"` and `"output-difference"`; [their formulas](theory/stochastic.md). Example:
    `"perturbation"`"""
    missing: MissingValues = "em"
    """Treatment of missing values: maximum likelihood (`"em"`), `"pairwise"`, or `"complete"`: repeats with missing
    values are not used. Example: `"complete"`"""
    covariance: CovarianceEstimate = "sample"
    """Covariance of the repeats: `"sample"`, or `"robust"`, to which
    [outliers](guide/stochastic.md#tests-of-the-repeats) do not contribute. Example: `"robust"`"""
    noise_sd: Fraction | Literal["test"] | dict[Text, Fraction] | None = None
    """Relative standard deviation of the [measurement errors](guide/stochastic.md#measurement-errors) of a frequency in
    one repeat, which is subtracted: one number, one for each mode label, or `"test"`: those of the test, also of its
    shapes. Default: errors are neglected. Example: `{ "1" = 0.001, "2" = 0.002 }`"""
    hold_out: Fraction | Annotated[tuple[RepeatNumber, ...], Field(min_length=1)] | None = None
    """Repeats that the update does not use and that [test its prediction](guide/stochastic.md#tests-of-the-repeats): a
    random fraction, or their numbers from 1. Example: `0.3`"""
    population: bool = False
    """Also sample the [population](guide/stochastic.md#uncertainty-of-the-population): mean, standard deviations and
    correlations of the parameters with intervals, the parameters of each repeat, and of a further structure. Requires
    `noise_sd`. Example: `true`"""
    shapes: bool = False
    """The shapes of the repeats are outputs beside their frequencies; repeats are Universal Files. Example: `true`"""
    intervals: bool = False
    """Also compute the [intervals of the parameters](guide/stochastic.md#intervals) that give the smallest and largest
    frequencies of the repeats. Example: `true`"""
    weighting: OutputWeighting = "relative"
    """Frequencies are weighted by their relative error, or by the inverse of the measured `"covariance"`. Example:
    `"covariance"`"""
    regularisation: Annotated[float, Field(ge=0, le=1e12)] = 0.0
    """Weight μ of the regularisation, with parameters in units of their prior standard deviation. Example: `0.02`"""
    samples: Annotated[int, Field(ge=20, le=1_000_000)] = 200
    """Sample size of the forward check and of the Monte Carlo methods. Example: `1000`"""
    seed: Annotated[int, Field(ge=0, le=2**31)] = 1
    """Seed of the random numbers. Example: `7`"""
