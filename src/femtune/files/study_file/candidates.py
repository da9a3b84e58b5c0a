"""[candidates] and [[candidate]]: sets of parameters that are updated one by one and compared."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, Final, Literal

from pydantic import Field

from femtune.errors import FemtuneError, did_you_mean
from femtune.files.study_file.kinds import Expression, Text, TomlTable
from femtune.files.study_file.parameter import expression_names
from femtune.files.study_file.source import Place, StudyLines, named_twice, number, table, tables, texts

Names = tuple[Text, ...]

NOMINAL = "initial values"
"""Name of the model of the study as it is, which is compared too."""
NO_SEARCH: Final = "none"


class CandidateEntry(TomlTable):
    """[[candidate]]: the parameters that move, and those that follow them; all others keep their initial values."""

    name: Text
    parameters: Annotated[Names, Field(min_length=1)]
    ties: dict[Text, Expression] = Field(default_factory=dict)
    note: str = ""


class CandidatesTable(TomlTable):
    """[candidates]: subsets of the free parameters, and how candidates are compared."""

    subsets: Literal["none", "all", "nested"] = "none"
    groups: tuple[Annotated[Names, Field(min_length=1)], ...] = ()
    always: Names = ()
    least: Annotated[int, Field(ge=1, le=10_000)] = 1
    most: Annotated[int, Field(ge=1, le=10_000)] | None = None
    largest_number: Annotated[int, Field(ge=1, le=1_000_000)] = 300
    starts: Annotated[int, Field(ge=1, le=100_000)] = 1
    search: Literal["none", "differential-evolution", "genetic", "cma-es"] = NO_SEARCH
    population: Annotated[int, Field(ge=4, le=100_000)] = 40
    generations: Annotated[int, Field(ge=1, le=100_000)] = 25
    seed: Annotated[int, Field(ge=0, le=2**63 - 1)] = 0
    leave_one_out: bool = True
    threshold: Annotated[float, Field(ge=1, le=1e6)] | None = None
    probability: Annotated[float, Field(gt=0, lt=1)] = 0.95
    cluster_distance: Annotated[float, Field(gt=0, le=100)] = 0.05


# ----------------------------------------------------------------------------------------------------
# Rules between their keys.


Data = dict[str, Any]
Problems = Iterator[FemtuneError]


def candidate_rules(data: Data, source: StudyLines) -> Problems:
    """Names of candidates, and of the free parameters in them."""
    entries = list(tables(data, "candidate"))
    yield from named_twice(entries, "study.duplicate-name/earlier", source)
    free = [e["name"] for _, e in tables(data, "parameter") if isinstance(e.get("name"), str) and "tie" not in e]
    for place, entry in entries:
        if entry.get("name") == NOMINAL:
            yield source.error((*place, "name"), "candidates.name", {}, name=NOMINAL)
        moving = texts(entry.get("parameters"))
        yield from _known((*place, "parameters"), moving, free, source)
        for name in sorted({name for name in moving if moving.count(name) > 1}):
            yield source.error((*place, "parameters"), "candidates.twice/parameters", {}, name=name)
        yield from _ties(place, entry, free, source)
    asked = table(data, "candidates")
    yield from _known(("candidates", "always"), texts(asked.get("always")), free, source)
    groups = asked.get("groups")
    seen = list(texts(asked.get("always")))
    for k, group in enumerate(groups if isinstance(groups, tuple) else ()):
        place = ("candidates", "groups", k)
        yield from _known(place, texts(group), free, source)
        for name in texts(group):
            if name in seen:
                yield source.error(place, "candidates.twice", {}, name=name)
            seen.append(name)
    least, most = number(asked, "least"), number(asked, "most")
    if least is not None and most is not None and most < least:
        yield source.error(("candidates", "most"), "candidates.sizes", {"least": least, "most": most})


def _known(place: Place, names: list[str], free: list[str], source: StudyLines) -> Problems:
    for name in names:
        if name not in free:
            yield source.error(place, "candidates.unknown", {}, hint=did_you_mean(name, free), name=name)


def _ties(place: Place, entry: Data, free: list[str], source: StudyLines) -> Problems:
    ties = entry.get("ties")
    moving = texts(entry.get("parameters"))
    for name, tie in ties.items() if isinstance(ties, dict) else ():
        where = (*place, "ties", name)
        yield from _known(where, [name], free, source)
        if name in moving:
            yield source.error(where, "candidates.tied", {}, name=name)
        for used in expression_names(tie):
            if used not in free:
                yield source.error(where, "candidates.unknown", {}, hint=did_you_mean(used, free), name=used)
