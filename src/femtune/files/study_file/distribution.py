"""[[distribution]]: fields that vary over a region by functions of position."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field

from femtune.errors import FemtuneError, did_you_mean
from femtune.fem.fields import AMPLITUDE
from femtune.fem.random_field import FieldKernel
from femtune.files.study_file.kinds import Elements, Expression, FieldText, GroupName, TomlTable
from femtune.files.study_file.parameter import RegionTable
from femtune.files.study_file.source import Data, Place, Problems, StudyLines, named_twice, tables, texts
from femtune.parameters import parse_expression

POSITION = ("x", "y", "z", "u", "v", "w")
"""Variables of the functions: the position of an element, and the same scaled to −1 … 1 over the region."""


class RandomFieldTable(TomlTable):
    """[distribution.random]: the functions are those of the Karhunen-Loève expansion of a random field."""

    length: Annotated[float, Field(gt=0, lt=1e12)]
    """Correlation length, in units of the deck. Example: `0.25`"""
    kernel: FieldKernel = "exponential"
    """Correlation over the distance d of two elements: `"exponential"`, exp(−d/l), or `"gaussian"`, exp(−½(d/l)²).
    Example: `"gaussian"`"""
    terms: Annotated[int, Field(ge=1, le=20)] = 4
    """Number of functions (1 to 20), the largest variance first. Example: `6`"""


class DistributionEntry(TomlTable):
    """Fields that are multiplied by 1 + the sum of amplitude times function; see docs/study-file.md."""

    name: GroupName
    """Name of the distribution in fields: capital letters and digits. Example: `"THIN"`"""
    fields: Annotated[tuple[FieldText, ...], Field(min_length=1)]
    """Fields that vary, as in `[[parameter]]`. Example: `["PSHELL 3 T"]`"""
    functions: Annotated[tuple[Expression, ...], Field(max_length=20)] = ()
    """Expressions (1 to 20) of the middle of an element: `x`, `y`, `z` in the basic coordinate system, or `u`, `v`,
    `w`, which are the same from −1 to 1 over the region. Example: `["1", "u", "1 - v**2"]`"""
    random: RandomFieldTable | None = None
    """In place of `functions`: those of a [random field](theory/parameterisation.md#random-fields) of unit variance, so
    that the amplitudes are independent and have the relative standard deviation of the field. Example: `{ length =
    0.25, terms = 6 }`"""
    elements: Elements | None = None
    """Elements for which the fields vary: a text with THRU, BY and EXCEPT, or a list. Default: all that use them.
    Example: `"1 THRU 400"`"""
    region: RegionTable | None = None
    """Restricts the elements by properties, materials or position, [as for parameters](#region). Example: `{ box = [[0,
    0, 0], [0.5, 1, 1]] }`"""


def distribution_rules(data: Data, source: StudyLines) -> Problems:
    """Names must be unique, functions depend on position, and amplitudes must exist and be used."""
    entries = list(tables(data, "distribution"))
    yield from named_twice(entries, "study.duplicate-name/earlier", source)
    counts = {str(e.get("name")): _count(e) for _, e in entries}
    for place, entry in entries:
        if bool(texts(entry.get("functions"))) == ("random" in entry):
            yield source.error(place, "distribution.one-kind", {}, name=entry.get("name"))
    named = [(place, p, text.split()) for place, p in tables(data, "parameter") for text in texts(p.get("fields"))]
    named = [(place, p, words) for place, p, words in named if words[:1] == [AMPLITUDE] and len(words) == 3]
    for place, parameter, words in named:
        yield from _amplitude(place, words, counts, source)
        if "tie" not in parameter and parameter.get("absolute") is not True:
            shown: dict[str, Any] = {key: parameter[key] for key in ("lower", "upper") if key in parameter}
            yield source.error(place, "distribution.factor", shown, parameter=parameter.get("name", ""))
    used = {words[1] for _, _, words in named}
    for place, entry in entries:
        if isinstance(entry.get("name"), str) and entry["name"] not in used:
            yield source.error((*place, "name"), "distribution.unused", {}, name=entry["name"])
        yield from _functions(place, entry, source)


def _count(entry: Data) -> int:
    """Number of functions of a distribution."""
    field = entry.get("random")
    if isinstance(field, dict):
        terms = field.get("terms", RandomFieldTable.model_fields["terms"].default)
        return terms if isinstance(terms, int) else 0
    return len(texts(entry.get("functions")))


def _amplitude(place: Place, words: list[str], counts: dict[str, int], source: StudyLines) -> Problems:
    name, number = words[1], words[2][1:]
    if name not in counts:
        hint = did_you_mean(name, counts) or f'add [[distribution]] name = "{name}"'
        yield source.error((*place, "fields"), "distribution.unknown", {}, hint=hint, name=name)
    elif number.isdigit() and int(number) > counts[name]:
        yield source.error((*place, "fields"), "distribution.unknown/function", {}, name=name, count=counts[name])


def _functions(place: Place, entry: Data, source: StudyLines) -> Problems:
    for i, text in enumerate(texts(entry.get("functions"))):
        for name in _names(text):
            if name not in POSITION:
                yield source.error((*place, "functions", i), "distribution.function", {}, name=name)
    for i, text in enumerate(texts(entry.get("fields"))):
        if text.split()[:1] == [AMPLITUDE]:
            yield source.error((*place, "fields", i), "distribution.function/field", {}, field=text)


def _names(text: str) -> tuple[str, ...]:
    """Names in an expression; invalid expressions are reported by the model."""
    try:
        return parse_expression(text).names
    except FemtuneError:
        return ()
