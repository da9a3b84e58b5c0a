"""[runs]: a model of the runs of another solver, as a table of results."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, Literal

from pydantic import Field

from femtune.errors import FemtuneError
from femtune.files.study_file.kinds import Fraction, RunsName, TomlTable
from femtune.files.study_file.source import Place, StudyLines, number, table, tables
from femtune.files.study_file.validate import FRF_LIMITS
from femtune.surrogates.kinds import SurrogateMethod


class RunsModelTable(TomlTable):
    """[runs]: the table, and the polynomials or surrogates that are fitted to it."""

    file: RunsName
    """The table: a heading, and a line per run with parameters, `f1_hz`, `f2_hz` …, and shapes `shape1_12Z` … if there
    are any; text, or Parquet with the ending `.parquet` or `.pq` (`pip install "femtune[parquet]"`). Example:
    `"runs.csv"`"""
    method: Literal["polynomial", SurrogateMethod] = "polynomial"
    """`"polynomial"`, `"kriging"`, `"radial-basis"`, or `"chaos"` (polynomial chaos). Example: `"kriging"`"""
    degree: Annotated[int, Field(ge=0, le=20)] | None = None
    """Degree of the polynomials, 1 to 6 (default 2); of the trend of Kriging, 0 to 2 (default 2); the largest one of
    polynomial chaos, 1 to 20 (default 6). Example: `3`"""
    crossed: bool = True
    """Products of parameters up to the degree; for polynomials. Example: `false`"""
    correlation: Literal["gaussian", "matern-5/2"] = "gaussian"
    """Correlation of Kriging: `"gaussian"` or `"matern-5/2"`. Example: `"matern-5/2"`"""
    kernel: Literal["cubic", "quintic"] = "cubic"
    """Radial basis functions: `"cubic"` or `"quintic"`. Example: `"quintic"`"""
    tolerance: Fraction = 0.005
    """Relative error of a frequency of a run that is left out (standard deviation) from which a warning is given.
    Example: `0.001`"""

    @property
    def order(self) -> int:
        """Degree of the polynomials, of the trend of Kriging, or the largest one of polynomial chaos."""
        return (6 if self.method == "chaos" else 2) if self.degree is None else self.degree


Data = dict[str, Any]
_RESIDUAL_KINDS = ("frequency", "shape", "mac", "flexibility")
"""Kinds of residuals of a model of runs, whose results are frequencies and shapes only."""
_NEEDS_MATRICES = (
    "matrix", "variable", "reduction", "component", "generic", "distribution", "frequency_table", "response", "load",
    "equalise", "plan",
)  # fmt: skip
"""Tables that need the matrices of the structure, or shapes in its units."""
_OF_CONFIGURATIONS = (
    "elements_off", "components", "interface", "spc", "mpc", "supports_added", "supports_removed", "masses",
    "weighed_mass", "weighed_centre", "weighed_inertia",
)  # fmt: skip
"""Keys of a configuration that change the structure, which a model of runs does not have."""


def is_of_runs(data: Data) -> bool:
    """True for a study whose model is made of runs."""
    return "runs" in data or "solver" in data


def runs_rules(data: Data, source: StudyLines) -> Iterator[FemtuneError]:
    """Refuse tables and keys that a model of runs cannot use, and check its parameters."""
    if not is_of_runs(data):
        return
    by_deck = table(data, "solver").get("derivatives") == "deck"
    of_deck = "solver" in data and ("deck" in table(data, "study") or by_deck)
    if "deck" in table(data, "study") and not of_deck:
        yield source.error(("study", "deck"), "runs.study/deck", {})
    places: list[Place] = [(name,) for name in _NEEDS_MATRICES if name in data]
    if "solver" not in data and "vibration" in data:
        places.append(("vibration",))
    places += [("validate", key) for key in FRF_LIMITS if key in table(data, "validate")]
    for place in places:
        yield source.error(place, "runs.study/table", {}, name=place[-1])
    yield from _method(table(data, "runs"), source)
    if "max_hz" in table(data, "modes"):
        yield source.error(("modes", "max_hz"), "runs.study/max-hz", {})
    if not of_deck:
        yield from _parameters(data, source)
    yield from _configurations(data, source)
    for place, entry in tables(data, "residual"):
        if entry.get("kind") not in _RESIDUAL_KINDS:
            kinds = ", ".join(_RESIDUAL_KINDS)
            yield source.error((*place, "kind"), "runs.study/residual", {}, kind=entry.get("kind"), kinds=kinds)


_METHOD_OF_KEY = {"crossed": "polynomial", "correlation": "kriging", "kernel": "radial-basis"}
"""Method that a key belongs to."""
_DEGREES = {"polynomial": (1, 6), "kriging": (0, 2), "chaos": (1, 20)}
"""Smallest and largest degree of each method; the number of coefficients, and of the runs they need, grows steeply with
the degree."""


def _method(runs: Data, source: StudyLines) -> Iterator[FemtuneError]:
    """Check keys of one method only, and the degree."""
    # values of the wrong type are reported by the check of types
    method, degree = str(runs.get("method", "polynomial")), number(runs, "degree")
    wrong = [key for key, of in _METHOD_OF_KEY.items() if key in runs and method != of]
    if degree is not None and method not in _DEGREES:
        wrong.append("degree")
    for key in wrong:
        yield source.error(("runs", key), "runs.method", {}, key=key, method=method)
    low, high = _DEGREES.get(method, (0, 20))
    if degree is not None and not low <= degree <= high:
        place = ("runs", "degree")
        yield source.error(place, "runs.method/degree", {}, method=method, degree=int(degree), low=low, high=high)


def _parameters(data: Data, source: StudyLines) -> Iterator[FemtuneError]:
    for place, entry in tables(data, "parameter"):
        for key in ("fields", "elements", "region"):
            if key in entry:
                yield source.error((*place, key), "runs.study/fields", {}, name=entry.get("name"), key=key)
        if "tie" not in entry and entry.get("absolute") is not True:
            yield source.error(place, "runs.study/absolute", {}, name=entry.get("name"))


def _configurations(data: Data, source: StudyLines) -> Iterator[FemtuneError]:
    of_solver = "solver" in data
    for place, entry in tables(data, "configuration"):
        for key in _OF_CONFIGURATIONS:
            if key in entry:
                yield source.error((*place, key), "runs.study/overlay", {}, key=key)
        other = "runs" if of_solver else "solver"
        if other in entry:
            yield source.error((*place, other), "runs.study/other", {}, key=other)


def configuration_rules(data: Data, source: StudyLines) -> Iterator[FemtuneError]:
    """Keys of a configuration about runs and solvers require [runs] and [solver]."""
    if is_of_runs(data):
        return
    for place, entry in tables(data, "configuration"):
        for key in ("runs", "solver"):
            if key in entry:
                yield source.error((*place, key), "runs.study/alone", {}, key=key)
