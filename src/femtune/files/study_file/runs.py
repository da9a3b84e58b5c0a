"""[runs]: a model of the runs of another solver, as a table of results."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any

from pydantic import Field

from femtune.errors import FemtuneError
from femtune.files.study_file.kinds import Text, TomlTable
from femtune.files.study_file.source import StudyLines, table, tables


class RunsModelTable(TomlTable):
    """[runs]: the table, and the polynomials that are fitted to it."""

    file: Text
    degree: Annotated[int, Field(ge=1, le=6)] = 2
    crossed: bool = True
    tolerance: Annotated[float, Field(gt=0, lt=1)] = 0.005


Data = dict[str, Any]
_KINDS = ("frequency", "shape", "mac", "flexibility")
_OF_CONFIGURATIONS = (
    "elements_off", "components", "interface", "spc", "mpc", "supports_added", "supports_removed", "masses",
    "weighed_mass",
)  # fmt: skip


def is_of_runs(data: Data) -> bool:
    """True for a study whose model is made of runs."""
    return "runs" in data or "solver" in data


def runs_rules(data: Data, source: StudyLines) -> Iterator[FemtuneError]:
    """What a model of runs has no use for, and what its parameters are."""
    if not is_of_runs(data):
        return
    of_deck = "solver" in data and "deck" in table(data, "study")
    if "deck" in table(data, "study") and not of_deck:
        yield source.error(("study", "deck"), "runs.study/deck", {})
    without = ("matrix", "variable", "reduction", "component", "generic", "distribution", "frequency_table", "response")
    for name in (*without, "plan"):
        if name in data:
            yield source.error((name,), "runs.study/table", {}, name=name)
    if "max_hz" in table(data, "modes"):
        yield source.error(("modes", "max_hz"), "runs.study/max-hz", {})
    if not of_deck:
        yield from _parameters(data, source)
    yield from _configurations(data, source)
    for place, entry in tables(data, "residual"):
        if entry.get("kind") not in _KINDS:
            kinds = ", ".join(_KINDS)
            yield source.error((*place, "kind"), "runs.study/residual", {}, kind=entry.get("kind"), kinds=kinds)


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
    """What a configuration has of runs and solvers belongs to [runs] and [solver]."""
    if is_of_runs(data):
        return
    for place, entry in tables(data, "configuration"):
        for key in ("runs", "solver"):
            if key in entry:
                yield source.error((*place, key), "runs.study/alone", {}, key=key)
