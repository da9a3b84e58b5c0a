"""[screen] and [search]: designed runs of the model, a surrogate of them, and a search of the whole box."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, Literal

from pydantic import Field

from femtune.errors import FemtuneError
from femtune.files.study_file.kinds import Text, TomlTable
from femtune.files.study_file.source import StudyLines, table
from femtune.global_search.kinds import SearchWord
from femtune.surrogates.kinds import CorrelationKind, Infill, Noise, RadialKernel, RunsOn, SurrogateMethod, Trend

Seed = Annotated[int, Field(ge=0, le=2**63 - 1)]


class ScreenTable(TomlTable):
    """[screen]: which parameters matter for which mode, by designed runs."""

    design: Literal["orthogonal", "factorial", "plackett-burman", "morris", "sobol"] = "orthogonal"
    array: Text | None = None
    levels: Annotated[int, Field(ge=2, le=12)] | None = None
    trajectories: Annotated[int, Field(ge=2, le=10_000)] = 10
    points: Annotated[int, Field(ge=64, le=1 << 20)] = 1024
    on: RunsOn = "surrogate"
    runs: Annotated[int, Field(ge=4, le=100_000)] | None = None
    seed: Seed = 0
    configuration: Text | None = None


class SearchTable(TomlTable):
    """[search]: a search of the whole box, on a surrogate of the residuals or on the model itself."""

    on: RunsOn = "surrogate"
    runs: Annotated[int, Field(ge=4, le=100_000)] | None = None
    fresh_runs: Annotated[int, Field(ge=0, le=10_000)] = 5
    infill: Annotated[int, Field(ge=0, le=10_000)] = 5
    infill_by: Infill = "improvement"
    infill_until: Annotated[float, Field(gt=0.0)] | None = None
    surrogate: SurrogateMethod = "kriging"
    trend: Trend = "linear"
    correlation: CorrelationKind = "gaussian"
    kernel: RadialKernel = "cubic"
    degree: Annotated[int, Field(ge=1, le=20)] = 6
    noise: Noise = "estimate"
    method: SearchWord = "differential-evolution"
    population: Annotated[int, Field(ge=4, le=100_000)] = 60
    generations: Annotated[int, Field(ge=1, le=100_000)] = 300
    seeds: Annotated[int, Field(ge=1, le=1000)] = 3
    front: Annotated[int, Field(ge=0, le=1000)] = 0
    seed: Seed = 0


_ONLY_OF = {
    "trend": ("kriging",),
    "correlation": ("kriging",),
    "kernel": ("radial-basis",),
    "degree": ("chaos",),
    "noise": ("kriging", "radial-basis"),
}
"""Surrogates that a key of [search] applies to."""


_OF_DESIGNS = {
    "array": ("orthogonal",),
    "levels": ("orthogonal", "factorial", "plackett-burman", "morris"),
    "trajectories": ("morris",),
    "points": ("sobol",),
    "on": ("sobol",),
    "runs": ("sobol",),
    "seed": ("morris", "sobol"),
}
"""Designs that a key of [screen] applies to."""


def experiment_rules(data: dict[str, Any], source: StudyLines) -> Iterator[FemtuneError]:
    """A design and its levels fit each other, a surrogate and its keys."""
    screen = table(data, "screen")
    design = screen.get("design", "orthogonal")
    if design == "plackett-burman" and screen.get("levels", 2) != 2:
        yield source.error(("screen", "levels"), "screen.design", {"levels": screen["levels"]})
    for key, designs in _OF_DESIGNS.items():
        if key in screen and design not in designs:
            needed = " or ".join(f'"{name}"' for name in designs)
            yield source.error(("screen", key), "screen.design/key", {key: screen[key]}, key=key, needed=needed)
    if "runs" in screen and screen.get("on") == "model":
        yield source.error(("screen", "runs"), "screen.design/runs", {"runs": screen["runs"]})
    search = table(data, "search")
    if "infill_until" in search and search.get("infill_by") != "error":
        yield source.error(("search", "infill_until"), "search.infill", {"infill_until": search["infill_until"]})
    if "infill_by" in search and search.get("on") == "model":
        yield source.error(("search", "infill_by"), "search.infill/model", {"infill_by": search["infill_by"]})
    surrogate = search.get("surrogate", "kriging")
    for key, methods in _ONLY_OF.items():
        if key in search and surrogate not in methods:
            yield source.error(("search", key), "search.surrogate", {}, key=key, surrogate=surrogate)
