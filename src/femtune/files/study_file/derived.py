"""[[derived]]: quantities that follow from the parameters, shown with their standard deviations."""

from __future__ import annotations

import keyword
from collections.abc import Iterator
from typing import Any

from femtune.errors import FemtuneError, did_you_mean
from femtune.files.study_file.kinds import Expression, Text, TomlTable
from femtune.files.study_file.parameter import expression_names
from femtune.files.study_file.source import StudyLines, named_twice, tables

Data = dict[str, Any]


class DerivedEntry(TomlTable):
    """A quantity, such as the thickness of a slab computed from its stiffness."""

    name: Text
    """Name of the quantity: letters, digits and `_`; not the name of a parameter. Example: `"slab_thickness"`"""
    expression: Expression
    """Expression of parameters, in the form of `tie` of a parameter. Example: `"0.12*bending**(1/3)"`"""
    unit: str = ""
    """Unit shown in tables. Example: `"m"`"""


def derived_rules(data: Data, source: StudyLines) -> Iterator[FemtuneError]:
    """Names must be unique, and expressions must refer to existing parameters."""
    entries = list(tables(data, "derived"))
    yield from named_twice(entries, "parameter.duplicate/earlier", source)
    parameters = [p["name"] for _, p in tables(data, "parameter") if isinstance(p.get("name"), str)]
    for place, entry in entries:
        name = entry.get("name")
        if isinstance(name, str) and name and (not name.isidentifier() or keyword.iskeyword(name)):
            yield source.error((*place, "name"), "parameter.name/derived", {}, name=name)
        if name in parameters:
            yield source.error((*place, "name"), "parameter.duplicate/derived", {}, name=name)
        for used in expression_names(entry.get("expression")):
            if used not in parameters:
                hint = did_you_mean(used, parameters)
                yield source.error(
                    (*place, "expression"),
                    "tie.unknown/derived",
                    {"expression": entry["expression"]},
                    hint=hint,
                    name=used,
                )
