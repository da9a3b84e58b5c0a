"""[posterior]: a sampled distribution of the parameters."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from femtune.files.study_file.kinds import Seed, TomlTable
from femtune.sampling.kinds import Discrepancy, NoiseRule, Sampling


class PosteriorTable(TomlTable):
    """[posterior]: a sampled distribution of the parameters, weighted by the model itself."""

    noise: NoiseRule = "by-kind"
    """Size of the errors of the data: one unknown factor on the stated standard deviations for each kind of residual
    (`"by-kind"`), one for all residuals (`"common"`), or as `"stated"`. Kinds with fewer than three degrees of freedom
    are as stated. Example: `"stated"`"""
    discrepancy: Discrepancy = "properties"
    """Errors of the model in the intervals: unknown changes of all stiffnesses, masses and supports that no parameter
    represents (`"properties"`), whose sizes the data choose; or `"none"`. Both widths are in the results. Example:
    `"none"`"""
    sampling: Sampling = "automatic"
    """How the samples are drawn: from linearised residuals or a surrogate, as the model allows, with weights of the
    model (`"automatic"`); or by transitional Markov chain Monte Carlo (`"tmcmc"`), which takes ten to thirty times as
    many solutions, each without derivatives. Example: `"tmcmc"`"""
    draws: Annotated[int, Field(ge=100, le=100_000)] = 1000
    """Number of weighted samples, each a solution of the model; with `"tmcmc"` those of each stage. Example: `2000`"""
    gradients: Annotated[int, Field(ge=20, le=10_000)] = 150
    """Solutions with derivatives at most, from which a surrogate of the residuals is made where the linearised
    residuals do not hold. Example: `300`"""
    starts: Annotated[int, Field(ge=0, le=1000)] = 6
    """Updates from other points of the bounds, which look for further regions that explain the data as well; 0 for
    none. Starts of `[update]` are used where it has several. Example: `20`"""
    further_sd: Annotated[float, Field(gt=0, lt=1)] = 0.005
    """Standard deviation of the errors of a frequency, relative, in further tests: configurations of the study without
    a test, of which the results state what a test would teach. Example: `0.002`"""
    predictions: Annotated[int, Field(ge=0, le=10_000)] = 200
    """Samples at which the frequencies of all configurations and the FRFs of `[response]` are computed for their
    intervals, with errors of the model; 0 for none. Above 20,000 free DOFs none are computed unless the key is given.
    Example: `500`"""
    seed: Seed = 0
    """Seed of the random numbers. Example: `7`"""
