"""[[generic]]: groups of elements whose stiffness is parameterised by its own eigenvalues and shapes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from femtune.errors import FemtuneError, did_you_mean
from femtune.files.study_file.kinds import Components, Elements, GroupName, Number
from femtune.files.study_file.plain import named_twice, tables, texts
from femtune.files.study_file.source import Source
from femtune.files.study_file.table import Table

Data = dict[str, Any]


class GenericEntry(Table):
    """A group of elements; its fields are ``GENERIC NAME K1`` … and ``GENERIC NAME S1-2``."""

    name: GroupName
    elements: Elements
    nodes: tuple[Number, ...] = ()
    components: Components = "123456"


def generic_rules(data: Data, source: Source) -> Iterator[FemtuneError]:
    """Names once; each group named by a parameter, and each name that of a group."""
    entries = list(tables(data, "generic"))
    yield from named_twice(entries, "study.duplicate-name", source)
    groups = [entry["name"] for _, entry in entries if isinstance(entry.get("name"), str)]
    used = set()
    for place, parameter in tables(data, "parameter"):
        for text in texts(parameter.get("fields")):
            words = text.split()
            if len(words) < 2 or words[0] != "GENERIC":
                continue
            used.add(words[1])
            if words[1] not in groups:
                hint = did_you_mean(words[1], groups) or f'add [[generic]] name = "{words[1]}" with its elements'
                what = f"'{words[1]}' is no [[generic]] of this study"
                yield source.error((*place, "fields"), "generic.unknown", what, {}, hint)
    for place, entry in entries:
        name = entry.get("name")
        if isinstance(name, str) and name not in used:
            what = f"no parameter moves the generic element '{name}'"
            hint = f'name one of its values: fields = ["GENERIC {name} K1"]'
            yield source.error((*place, "name"), "generic.unused", what, {}, hint)
