"""[candidates] and [[candidate]]: sets of parameters that are updated one by one and compared."""

from __future__ import annotations

from typing import Annotated, Final, Literal

from pydantic import Field

from femtune.errors import did_you_mean
from femtune.files.study_file.kinds import Expression, Fraction, Seed, Text, TomlTable
from femtune.files.study_file.parameter import expression_names
from femtune.files.study_file.source import Data, Place, Problems, StudyLines, named_twice, number, table, tables, texts
from femtune.global_search.kinds import SearchWord

Names = tuple[Text, ...]

NOMINAL = "initial values"
"""Name of the study's own parameters as a candidate, which is compared as well."""
NO_SEARCH: Final = "none"
"""The starts of a candidate are not found by a search."""


class CandidateEntry(TomlTable):
    """[[candidate]]: the parameters that move, and those that follow them; all others keep their initial values."""

    name: Text
    """Name of the candidate. Example: `"M7"`"""
    parameters: Annotated[Names, Field(min_length=1)]
    """Free parameters of the study that are updated. Example: `["Icx1", "m1"]`"""
    ties: dict[Text, Expression] = Field(default_factory=dict)
    """Free parameters of the study that follow others, with the expression. Example: `{ Icx2 = "Icx1", Ibx2 =
    "0.5*Ibx1" }`"""
    note: str = ""
    """Remark that is shown with the result. Example: `"upper columns as built"`"""


class CandidatesTable(TomlTable):
    """[candidates]: subsets of the free parameters, and how candidates are compared."""

    subsets: Literal["none", "all", "nested"] = "none"
    """`"all"` subsets of the groups, or `"nested"` ones: the best set so far and one group more; `"none"`: only the
    listed candidates. Example: `"all"`"""
    groups: tuple[Annotated[Names, Field(min_length=1)], ...] = ()
    """Parameters that are updated together or not at all; empty: each free parameter alone. Example: `[["Icx1",
    "Icx2"], ["m1"]]`"""
    always: Names = ()
    """Parameters that are updated in all subsets. Example: `["m1", "m2"]`"""
    least: Annotated[int, Field(ge=1, le=10_000)] = 1
    """Smallest number of groups in a subset; for `"all"`. Example: `2`"""
    most: Annotated[int, Field(ge=1, le=10_000)] | None = None
    """Largest number of groups in a subset. Default: all. Example: `4`"""
    largest_number: Annotated[int, Field(ge=1, le=1_000_000)] = 300
    """A study with more subsets is refused. Example: `1000`"""
    starts: Annotated[int, Field(ge=1, le=100_000)] = 1
    """Number of starts of each candidate: the initial values, and points of a Latin hypercube within the bounds.
    Example: `5`"""
    search: Literal["none", SearchWord] = NO_SEARCH
    """Each start is the end of a search of the bounds on the model, from a random population of its own:
    `"differential-evolution"`, `"genetic"` or `"cma-es"`; `"none"`: the starts are those of `starts`. Example:
    `"genetic"`"""
    population: Annotated[int, Field(ge=4, le=100_000)] = 40
    """Points of a generation of this search. Example: `100`"""
    generations: Annotated[int, Field(ge=1, le=100_000)] = 25
    """Largest number of generations. Example: `60`"""
    seed: Seed = 0
    """Seed of the points, or of the first population. Example: `7`"""
    leave_one_out: bool = True
    """Each configuration is left out once and predicted, if there are several; not in a study of
    [specimens](guide/specimens.md). Example: `false`"""
    threshold: Annotated[float, Field(ge=1, le=1e6)] | None = None
    """Largest weighted mean error of an admissible model, relative to the smallest. Default: limit of the largest
    residual. Example: `1.1`"""
    probability: Fraction = 0.95
    """Probability with which a right model has no residual above the default of `threshold`. Example: `0.99`"""
    evidence: Literal["linear", "sampled"] = "linear"
    """Evidence of each candidate: of residuals that are linear near the optimum, or sampled as the
    [posterior](guide/posterior.md) is, with `draws`, `gradients` and `seed` of `[posterior]`; candidates whose linear
    evidence is off by more than 1 are named. Example: `"sampled"`"""
    instances: Annotated[int, Field(ge=0, le=1_000_000)] = 0
    """Number of [instances](guide/candidates.md#instances) of each candidate, drawn within the bounds, of which those
    with a residual above the limit are falsified; the others predict frequencies; 0: none. Example: `1000`"""
    cluster_distance: Annotated[float, Field(gt=0, le=100)] = 0.05
    """Clusters of admissible models are joined if the mean distance of their parameters is smaller, relative to the
    initial values. Example: `0.1`"""


# ----------------------------------------------------------------------------------------------------
# Rules between their keys.


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
