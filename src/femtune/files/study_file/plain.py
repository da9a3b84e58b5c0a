"""Careful looks at plain TOML data, whose types have not been checked yet."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from femtune.errors import FemtuneError
from femtune.files.study_file.kinds import is_number
from femtune.files.study_file.lines import Place
from femtune.files.study_file.source import Source

Data = dict[str, Any]


def table(data: Data, name: str) -> Data:
    """The table called `name`; empty where there is none."""
    found = data.get(name)
    return found if isinstance(found, dict) else {}


def tables(data: Data, name: str) -> Iterator[tuple[Place, Data]]:
    """Place and content of each entry of an array of tables."""
    found = data.get(name)
    for i, entry in enumerate(found if isinstance(found, tuple) else ()):
        if isinstance(entry, dict):
            yield (name, i), entry


def number(data: Data, key: str) -> float | None:
    """A finite number, or None for anything else."""
    value = data.get(key)
    if not is_number(value) or abs(value) > 1e300 or not math.isfinite(value):  # type: ignore[arg-type]
        return None
    return float(value)  # type: ignore[arg-type]


def texts(value: object) -> list[str]:
    """The texts among the entries of a list."""
    return [entry for entry in value if isinstance(entry, str)] if isinstance(value, tuple) else []


def named_twice(entries: list[tuple[Place, Data]], code: str, source: Source) -> Iterator[FemtuneError]:
    """An error for each entry that has the name of an earlier one."""
    seen: dict[str, Place] = {}
    for place, entry in entries:
        name = entry.get("name")
        if not isinstance(name, str):
            continue
        if name in seen:
            line = source.where((*seen[name], "name")).line
            what = f"'{name}' is already the name of the one on line {line}"
            yield source.error((*place, "name"), code, what, {}, "rename one of the two")
        seen.setdefault(name, place)
