"""[search]: a search of the whole box, on a surrogate of the residuals or on the model itself."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, Literal

from pydantic import Field

from femtune.errors import FemtuneError
from femtune.experiments.kinds import SampleWord
from femtune.files.study_file.kinds import Seed, TomlTable
from femtune.files.study_file.source import StudyLines, table
from femtune.global_search.kinds import SearchWord
from femtune.surrogates.kinds import CorrelationKind, Infill, Noise, RadialKernel, RunsOn, SurrogateMethod, Trend


class SearchTable(TomlTable):
    """[search]: a search of the whole box, on a surrogate of the residuals or on the model itself."""

    on: RunsOn = "surrogate"
    """Search on a `"surrogate"` of the residuals, or on the `"model"` itself. Example: `"model"`"""
    runs: Annotated[int, Field(ge=4, le=100_000)] | None = None
    """Runs of the model for the surrogate, at points of a Latin hypercube. Default: ten per parameter. Example: `60`"""
    sample: SampleWord = "latin-hypercube"
    """Points of these runs: `"latin-hypercube"`, `"nested-latin-hypercube"` (whose first half is a Latin hypercube
    itself), `"sobol"` (a sequence), or `"central-composite"` (`runs` does not apply). Example: `"sobol"`"""
    fresh_runs: Annotated[int, Field(ge=0, le=10_000)] = 5
    """Further runs that check the surrogate before they are added to it. Example: `10`"""
    infill: Annotated[int, Field(ge=0, le=10_000)] = 5
    """Further runs, added after that; at most, with `infill_until`. Example: `20`"""
    infill_by: Infill = "improvement"
    """Further runs where an `"improvement"` of the objective is expected, or where the `"error"` of the surrogate is
    expected to be the largest. Example: `"error"`"""
    infill_until: Annotated[float, Field(gt=0.0)] | None = None
    """For `infill_by = "error"`: error of left-out runs, in standard deviations of the data, at which no further runs
    are made. Example: `0.1`"""
    surrogate: SurrogateMethod = "kriging"
    """`"kriging"`, `"radial-basis"`, or `"chaos"` (polynomial chaos). Example: `"chaos"`"""
    trend: Trend = "linear"
    """Trend of Kriging: `"constant"`, `"linear"` or `"quadratic"`. Example: `"quadratic"`"""
    correlation: CorrelationKind = "gaussian"
    """Correlation of Kriging: `"gaussian"`, `"matern-5/2"`, `"matern-3/2"`; `"none"`: a response surface by least
    squares. Example: `"matern-5/2"`"""
    kernel: RadialKernel = "cubic"
    """Radial basis functions: `"cubic"`, `"thin-plate"` (both with a linear trend) or `"quintic"` (with a quadratic
    trend). Example: `"quintic"`"""
    degree: Annotated[int, Field(ge=1, le=20)] = 6
    """Largest degree of polynomial chaos. Example: `4`"""
    noise: Noise = "estimate"
    """Noise of Kriging and of radial basis functions; `"none"`: the surrogate passes through all runs. Example:
    `"none"`"""
    method: SearchWord = "differential-evolution"
    """`"differential-evolution"`, `"genetic"` or `"cma-es"` (extra `search`). Example: `"cma-es"`"""
    population: Annotated[int, Field(ge=4, le=100_000)] = 60
    """Points of a generation. Example: `100`"""
    generations: Annotated[int, Field(ge=1, le=100_000)] = 300
    """Largest number of generations. Example: `50`"""
    crossover: Annotated[float, Field(ge=0, le=1)] | None = None
    """Of `"genetic"` and of the front: probability that two points are crossed. Default: 0.9. Example: `0.8`"""
    mutation: Annotated[float, Field(ge=0, le=1)] | None = None
    """Of `"genetic"` and of the front: probability that a parameter of a point is changed. Default: one over the number
    of parameters. Example: `0.005`"""
    seeds: Annotated[int, Field(ge=1, le=1000)] = 3
    """Number of searches, each from another seed. Example: `20`"""
    front: Annotated[int, Field(ge=0, le=1000)] = 0
    """Number of points of the front of frequency errors against other errors that are shown and confirmed by a run of
    the model; 0: no front. Example: `10`"""
    front_objectives: Literal[2, 3] = 2
    """Objectives of the front: 2: errors of frequencies, and of all else that is compared; 3: of frequencies, of shapes
    (1 − MAC where the study has MAC residuals), and of the rest. Example: `3`"""
    seed: Seed = 0
    """The first seed, of the searches and of the Latin hypercube. Example: `7`"""


_SURROGATES_OF_KEYS = {
    "trend": ("kriging",),
    "correlation": ("kriging",),
    "kernel": ("radial-basis",),
    "degree": ("chaos",),
    "noise": ("kriging", "radial-basis"),
}
"""Surrogates that a key of [search] applies to."""


def search_rules(data: dict[str, Any], source: StudyLines) -> Iterator[FemtuneError]:
    """Keys must fit the surrogate and the kind of further runs."""
    search = table(data, "search")
    if "infill_until" in search and search.get("infill_by") != "error":
        yield source.error(("search", "infill_until"), "search.infill", {"infill_until": search["infill_until"]})
    if "infill_by" in search and search.get("on") == "model":
        yield source.error(("search", "infill_by"), "search.infill/model", {"infill_by": search["infill_by"]})
    if "runs" in search and search.get("sample") == "central-composite":
        yield source.error(("search", "runs"), "search.surrogate/composite", {"runs": search["runs"]})
    surrogate = search.get("surrogate", "kriging")
    for key, methods in _SURROGATES_OF_KEYS.items():
        if key in search and surrogate not in methods:
            yield source.error(("search", key), "search.surrogate", {}, key=key, surrogate=surrogate)
