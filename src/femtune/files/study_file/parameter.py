"""[[parameter]]: free and tied parameters with their fields, bounds and priors."""

from __future__ import annotations

import keyword
import re
from collections.abc import Iterator
from typing import Annotated, Any

from femtune.errors import FemtuneError, did_you_mean
from femtune.fem.fields import FieldRef
from femtune.files.study_file.kinds import (
    Elements,
    Expression,
    FieldText,
    NamesFile,
    Number,
    Positive,
    Text,
    TomlTable,
    Vector,
    field_reference,
)
from femtune.files.study_file.source import Place, StudyLines, named_twice, number, tables
from femtune.parameters import parse_expression

# ----------------------------------------------------------------------------------------------------
# `region` of a parameter: which elements it moves, by what they are made of and where they lie.


class NearTable(TomlTable):
    """A sphere about a point, a grid point, or the middle of an element (a joint)."""

    distance: Positive
    point: Vector | None = None
    node: Number | None = None
    element: Number | None = None


class RegionTable(TomlTable):
    """Conditions that an element must satisfy together; the centre of an element is its position."""

    elements: Elements | None = None
    properties: Elements | None = None
    materials: Elements | None = None
    set: Number | None = None
    box: tuple[Vector, Vector] | None = None
    near: NearTable | None = None


class ParameterEntry(TomlTable):
    """A free parameter (bounds) or a tied one (an expression of others)."""

    name: Text
    fields: tuple[FieldText, ...] = ()
    elements: Elements | None = None
    region: RegionTable | None = None
    lower: float | None = None
    upper: float | None = None
    nominal: float | None = None
    absolute: bool = False
    sd: Positive | None = None
    mean: float | None = None
    prior: Annotated[Text, NamesFile("catalogue of damping")] | None = None
    prior_name: Text | None = None
    tie: Expression | None = None
    individual: bool = False
    unit: str = ""

    @property
    def free(self) -> bool:
        """True for a parameter without a tie."""
        return self.tie is None

    @property
    def targets(self) -> tuple[FieldRef, ...]:
        """The fields that it changes; number 0 stands for all cards of the name."""
        return tuple(field_reference(text) for text in self.fields)

    @property
    def moves_damping(self) -> bool:
        """True where all that it changes are loss factors, dashpots or damping ratios."""
        return bool(self.targets) and all(_DAMPING.fullmatch(ref.name) for ref in self.targets)


_DAMPING = re.compile(r"GE\d?|B\d?|ZETA|G")


# ----------------------------------------------------------------------------------------------------
# Rules between the keys of the parameters of a study.


Data = dict[str, Any]
Problems = Iterator[FemtuneError]

_LEAST_PRIOR = 1e-9
"""Prior standard deviation over the width of the bounds, at least; its square stays clear of rounding."""
_OF_FREE_ONES = ("lower", "upper", "nominal", "sd", "mean", "prior")


def parameter_rules(data: Data, source: StudyLines) -> Problems:
    """Names, bounds and ties."""
    entries = list(tables(data, "parameter"))
    yield from named_twice(entries, "parameter.duplicate/earlier", source)
    names = [entry["name"] for _, entry in entries if isinstance(entry.get("name"), str)]
    for place, entry in entries:
        yield from _name(place, entry, source)
        if "tie" in entry:
            yield from _tied(place, entry, names, source)
        else:
            yield from _bounds(place, entry, source)
            yield from _prior_sd(place, entry, source)
            yield from _catalogue(place, entry, source)


def _name(place: Place, entry: Data, source: StudyLines) -> Problems:
    name = entry.get("name")
    if isinstance(name, str) and name and (not name.isidentifier() or keyword.iskeyword(name)):
        yield source.error((*place, "name"), "parameter.name/in-study", {}, name=name)


def _tied(place: Place, entry: Data, names: list[str], source: StudyLines) -> Problems:
    for key in _OF_FREE_ONES:
        if key in entry:
            yield source.error((*place, key), "parameter.tied", {key: entry[key]}, key=key)
    for name in expression_names(entry["tie"]):
        if name not in names:
            hint = did_you_mean(name, (n for n in names if n != entry.get("name")))
            yield source.error((*place, "tie"), "tie.unknown/in-study", {"tie": entry["tie"]}, hint=hint, name=name)


def expression_names(tie: object) -> tuple[str, ...]:
    """Names in a valid expression; errors of other expressions are reported by the models."""
    try:
        return parse_expression(tie).names if isinstance(tie, str) else ()
    except FemtuneError:
        return ()


def _catalogue(place: Place, entry: Data, source: StudyLines) -> Problems:
    """A prior from a catalogue excludes `mean` and `sd`, and is that of the field value."""
    if "prior_name" in entry and "prior" not in entry:
        yield source.error((*place, "prior_name"), "parameter.prior/no-catalogue", {})
    if "prior" not in entry:
        return
    for key in ("mean", "sd"):
        if key in entry:
            yield source.error((*place, key), "parameter.prior/given-twice", {key: entry[key]}, key=key)
    if entry.get("absolute") is not True:
        yield source.error((*place, "prior"), "parameter.prior/catalogue-of-factor", {})


def _bounds(place: Place, entry: Data, source: StudyLines) -> Problems:
    for key in ("lower", "upper"):
        if key not in entry:
            yield source.error((*place, key), "study.missing-key/bounds", {}, parameter=entry.get("name", ""), key=key)
    lower, upper = number(entry, "lower"), number(entry, "upper")
    if lower is None or upper is None:
        return
    if lower >= upper:
        yield _bad_bounds(place, entry, source)
    elif (start := _start(entry)) is not None and not lower <= start <= upper:
        shown = {"nominal": start, "lower": lower, "upper": upper}
        key = "nominal" if "nominal" in entry else "lower"
        own = "nominal" in entry or entry.get("absolute") is True
        code = "parameter.bounds/nominal-outside-in-study" if own else "parameter.bounds/factor-outside-in-study"
        yield source.error((*place, key), code, shown, parameter=entry.get("name", ""))


def _prior_sd(place: Place, entry: Data, source: StudyLines) -> Problems:
    """A prior whose width is out of numerical range relative to the bounds is an error."""
    lower, upper, sd = (number(entry, key) for key in ("lower", "upper", "sd"))
    if lower is None or upper is None or sd is None or not lower < upper or sd <= 0.0:
        return
    if not _LEAST_PRIOR <= sd / (upper - lower) <= 1.0 / _LEAST_PRIOR:
        shown = {"sd": sd, "lower": lower, "upper": upper}
        yield source.error((*place, "sd"), "study.value/prior-sd", shown, parameter=entry.get("name", ""))


def _start(entry: Data) -> float | None:
    """The nominal value if the study states it; that of an absolute parameter may come from the deck."""
    if "nominal" in entry:
        return number(entry, "nominal")
    return None if entry.get("absolute") else 1.0


def _bad_bounds(place: Place, entry: Data, source: StudyLines) -> FemtuneError:
    shown = {"lower": entry["lower"], "upper": entry["upper"]}
    code = (
        "parameter.bounds/equal-in-study" if entry["lower"] == entry["upper"] else "parameter.bounds/crossed-in-study"
    )
    return source.error((*place, "lower"), code, shown, parameter=entry.get("name", ""))
