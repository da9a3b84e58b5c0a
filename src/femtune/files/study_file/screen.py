"""[screen]: which parameters matter for which mode, by designed runs."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, Literal

from pydantic import Field

from femtune.errors import FemtuneError
from femtune.experiments.kinds import SampleWord
from femtune.files.study_file.kinds import Seed, Text, TomlTable
from femtune.files.study_file.source import StudyLines, table
from femtune.surrogates.kinds import RunsOn

LevelCount = Annotated[int, Field(ge=2, le=12)]


class ScreenTable(TomlTable):
    """[screen]: which parameters matter for which mode, by designed runs."""

    design: Literal["orthogonal", "factorial", "plackett-burman", "morris", "sobol", "table"] = "orthogonal"
    """`"orthogonal"` array, full `"factorial"`, `"plackett-burman"` (two levels), elementary effects of `"morris"`,
    indices of `"sobol"`; or `"table"`: the finished runs of `[runs]` as they are, by the values that occur in them,
    without a fit. Default: `"table"` for `[runs]` of a design by levels, else `"orthogonal"`. Example: `"morris"`"""
    array: Text | None = None
    """Name of the orthogonal array. Default: the smallest one that leaves degrees of freedom for the error. Example:
    `"L18"`"""
    levels: LevelCount | dict[Text, LevelCount] | None = None
    """Number of levels of each parameter, evenly spaced from its lower to its upper bound; or of single parameters, the
    others having the default. Default: 3, of `"morris"` 4 (an even number). Example: `{ E = 2, t = 4 }`"""
    trajectories: Annotated[int, Field(ge=2, le=10_000)] = 10
    """Number of trajectories of `"morris"`, each with one run more than there are parameters. Example: `20`"""
    points: Annotated[int, Field(ge=64, le=1 << 20)] = 1024
    """Number of points of `"sobol"`, a power of two of at least 64 (with fewer, errors of the indices exceed 0.1); each
    takes an evaluation for every parameter and two more. Example: `4096`"""
    on: RunsOn = "surrogate"
    """Evaluations of `"sobol"`: of a `"surrogate"` (Kriging), or of the `"model"` itself. Example: `"model"`"""
    runs: Annotated[int, Field(ge=4, le=100_000)] | None = None
    """Runs of the model for the surrogate of `"sobol"`, at points of a Latin hypercube. Default: ten per parameter.
    Example: `60`"""
    sample: SampleWord = "latin-hypercube"
    """Points of the runs for the surrogate of `"sobol"`: `"latin-hypercube"`, `"nested-latin-hypercube"` (whose first
    half is a Latin hypercube itself), `"sobol"` (a sequence), or `"central-composite"` (`runs` does not apply).
    Example: `"central-composite"`"""
    responses: tuple[Text, ...] = ()
    """Further columns of the table of `[runs]` that are analysed beside its frequencies. Example: `["rms_g"]`"""
    seed: Seed = 0
    """Seed of `"morris"` and `"sobol"`. Example: `7`"""
    configuration: Text | None = None
    """The only configuration whose modes are compared. Default: all. Example: `"BC"`"""


_DESIGNS_OF_KEYS = {
    "array": ("orthogonal",),
    "levels": ("orthogonal", "factorial", "plackett-burman", "morris"),
    "trajectories": ("morris",),
    "points": ("sobol",),
    "on": ("sobol",),
    "runs": ("sobol",),
    "sample": ("sobol",),
    "responses": ("table",),
    "seed": ("morris", "sobol"),
}
"""Designs that a key of [screen] applies to."""


def screen_rules(data: dict[str, Any], source: StudyLines) -> Iterator[FemtuneError]:
    """A design must fit its levels and keys."""
    screen = table(data, "screen")
    design = screen.get("design", "orthogonal")
    if design == "plackett-burman" and screen.get("levels", 2) != 2:
        yield source.error(("screen", "levels"), "screen.design", {"levels": screen["levels"]})
    if design == "morris" and isinstance(screen.get("levels"), dict):
        yield source.error(("screen", "levels"), "screen.design/one-level", {})
    for key, designs in _DESIGNS_OF_KEYS.items():
        if key in screen and design not in designs:
            needed = " or ".join(f'"{name}"' for name in designs)
            yield source.error(("screen", key), "screen.design/key", {key: screen[key]}, key=key, needed=needed)
    if "runs" in screen and screen.get("sample") == "central-composite":
        yield source.error(("screen", "runs"), "screen.design/composite", {"runs": screen["runs"]})
    if "runs" in screen and screen.get("on") == "model":
        yield source.error(("screen", "runs"), "screen.design/runs", {"runs": screen["runs"]})
