"""[solver]: a model that is a command line with templates, which gives out modes and nothing else."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from femtune.errors import FemtuneError
from femtune.files.formats import ModesFormatKey
from femtune.files.study_file.kinds import (
    Command,
    NotNegative,
    Positive,
    SolverFileName,
    TemplateName,
    Text,
    TomlTable,
)
from femtune.files.study_file.source import StudyLines, table, tables


class SolverTable(TomlTable):
    """[solver]: command, input and output files, and when a run is tried again."""

    only_configuration: ClassVar[str] = "as imported"
    """Name of the configuration of a study without [[configuration]]."""

    command: Command
    templates: tuple[TemplateName, ...] = ()
    deck_name: Annotated[str, Field(pattern=r"^[A-Za-z0-9_][A-Za-z0-9_.-]{0,99}$")] = "model.bdf"
    files: tuple[SolverFileName, ...] = ()
    result: Text
    format: ModesFormatKey
    timeout_s: Positive = 3600.0
    retries: Annotated[int, Field(ge=0, le=100)] = 1
    error_texts: tuple[Text, ...] = ()
    licence_texts: tuple[Text, ...] = ()
    licence_wait_s: NotNegative = 60.0
    licence_tries: Annotated[int, Field(ge=1, le=100_000)] = 60
    environment: dict[str, str] = Field(default_factory=dict)
    version: str = ""
    keep: Literal["none", "failed", "all"] = "failed"
    keep_most: Annotated[int, Field(ge=0, le=1_000_000)] = 20
    mass: Positive | None = None
    mass_tolerance: Annotated[float, Field(gt=0, lt=1)] = 0.01
    step: Annotated[float, Field(gt=0, le=0.5)] | None = None
    repeat_tolerance: Annotated[float, Field(gt=0, lt=1)] = 1e-6
    moves: Annotated[int, Field(ge=1, le=1000)] = 20
    derivatives: Literal["differences", "deck"] = "differences"


Data = dict[str, Any]


def solver_rules(data: Data, source: StudyLines) -> Iterator[FemtuneError]:
    """A solver has no table of runs beside it, a number of modes, and free parameters alone."""
    if "solver" not in data:
        return
    if "runs" in data:
        yield source.error(("runs",), "external.study/runs", {})
    yield from _inputs(data, source)
    if "count" not in table(data, "modes"):
        yield source.error(("solver",), "external.study/count", {})
    for place, entry in tables(data, "parameter"):
        if "tie" in entry:
            yield source.error((*place, "tie"), "external.study/tie", {}, name=entry.get("name"))
    update = table(data, "update")
    for key in ("starts", "first", "hops"):
        if key in update:
            yield source.error(("update", key), "external.study/update", {}, key=key)
    if "stage" in data:
        yield source.error(("stage",), "external.study/update", {}, key="[[stage]]")


def _inputs(data: Data, source: StudyLines) -> Iterator[FemtuneError]:
    """Every configuration has a deck or templates, of its own or those of all."""
    solver = table(data, "solver")
    deck = table(data, "study").get("deck")
    derivatives = solver.get("derivatives", "differences")
    by_deck = derivatives == "deck"
    for place, entry in list(tables(data, "configuration")) or [((), {})]:
        own = table(entry, "solver")
        at = (*place, "solver") if own else ("solver",)
        templates, known = bool(own.get("templates", solver.get("templates"))), bool(own.get("deck", deck))
        if by_deck and not known:
            yield source.error(at, "external.study/no-deck", {})
        elif templates == known and not (templates and derivatives != "differences"):
            yield source.error(at, "external.study/input", {})
    if by_deck:
        for place, entry in tables(data, "parameter"):
            if not entry.get("fields"):
                yield source.error(place, "external.study/fields", {}, name=entry.get("name"))
