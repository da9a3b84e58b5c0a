"""[[component]]: a component of the structure, as a set of elements."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from femtune.errors import FemtuneError, did_you_mean
from femtune.files.study_file.kinds import Elements, Positive, Text, TomlTable
from femtune.files.study_file.parameter import RegionTable
from femtune.files.study_file.source import StudyLines, named_twice, tables, texts


class ComponentEntry(TomlTable):
    """Elements of a component, and the frequency up to which its modes are kept in reduced models."""

    name: Text
    """Name of the component, unique. Example: `"front"`"""
    elements: Elements | None = None
    """Elements of the component: a text with THRU, BY and EXCEPT, or a list; an element can belong to one component
    only. Example: `"1 THRU 300"`"""
    region: RegionTable | None = None
    """Elements by properties, materials, a SET or position, [as for parameters](#region); `elements` or `region` is
    required. Example: `{ properties = [1, 2] }`"""
    max_hz: Positive | None = None
    """Modes of the component with fixed interface are computed up to this frequency, Hz. Default: twice the highest
    frequency of the modes that are compared. Example: `800.0`"""


Data = dict[str, Any]


def component_rules(data: Data, source: StudyLines) -> Iterator[FemtuneError]:
    """Names must be unique, each component needs elements and a use, and configurations must name existing ones."""
    entries = list(tables(data, "component"))
    yield from named_twice(entries, "study.duplicate-name/earlier", source)
    for place, entry in entries:
        if "elements" not in entry and "region" not in entry:
            yield source.error(place, "study.component/no-elements", {}, name=entry.get("name", ""))
    configurations = list(tables(data, "configuration"))
    if entries and "matrix" in data:
        yield source.error(("component",), "study.component/imported", {})
    elif entries and "reduction" not in data and not any("components" in c for _, c in configurations):
        yield source.error(("component",), "study.component/unused", {})
    known = [str(entry.get("name")) for _, entry in entries]
    for place, entry in configurations:
        if "interface" in entry and "components" not in entry:
            yield source.error((*place, "interface"), "study.component/interface", {})
        for i, name in enumerate(texts(entry.get("components"))):
            if name not in known:
                hint = did_you_mean(name, known) or "define it in a [[component]] table"
                yield source.error((*place, "components", i), "study.component/unknown", {}, hint=hint, name=name)
