"""The text of a study file: lines of its keys, and their names in messages."""

from __future__ import annotations

import math
import re
import tomllib
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import accumulate
from typing import Any

from femtune.errors import FemtuneError, Where

# ----------------------------------------------------------------------------------------------------
# Lines of the keys and values of a TOML text.
#
# tomllib does not state lines. The scanner walks a text that tomllib has accepted, so it checks nothing itself.


Data = dict[str, Any]
Problems = Iterator[FemtuneError]
Place = tuple[str | int, ...]
"""Keys and positions (from 0) that lead to a value: ``("parameter", 1, "lower")``."""

_BLANK = re.compile(r"(?:[ \t\r\n]|#[^\n]*)*")
"""White space and comments."""
_STRING = re.compile(
    r'"""(?:[^\\]|\\.)*?"{3,5}|' r"'''.*?'{3,5}|" r'"(?:[^"\\\n]|\\.)*"|' r"'[^'\n]*'",
    re.DOTALL,
)
"""A string of TOML, of one or several lines."""
_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")
"""A key without quotes."""
_BARE_VALUE = re.compile(r"[^,\]}#\r\n]*")
"""A number, boolean or date."""


def line_numbers(text: str) -> dict[Place, int]:
    """Line (from 1) of every key, table, entry of an array and value, by its place in the data of tomllib."""
    return _Scanner(text).scan()


@dataclass
class _Scanner:
    text: str
    at: int = 0
    lines: dict[Place, int] = field(default_factory=dict)
    counts: dict[Place, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._starts = [0, *accumulate(len(line) + 1 for line in self.text.split("\n"))]

    def scan(self) -> dict[Place, int]:
        table: Place = ()
        self._skip()
        while self.at < len(self.text):
            if self.text[self.at] == "[":
                table = self._header()
            else:
                self._pair(table)
            self._skip()
        return self.lines

    def _skip(self) -> None:
        match = _BLANK.match(self.text, self.at)
        self.at = match.end() if match else self.at

    def _take(self, pattern: re.Pattern[str]) -> str:
        match = pattern.match(self.text, self.at)
        self.at = match.end() if match else self.at + 1
        return match[0] if match else ""

    def _note(self, place: Place, at: int) -> None:
        for length in range(1, len(place) + 1):
            self.lines.setdefault(place[:length], bisect_right(self._starts, at))

    def _header(self) -> Place:
        start, double = self.at, self.text.startswith("[[", self.at)
        self.at += 1 + double
        keys = self._keys()
        self.at += 1 + double
        place = self._resolved(keys[:-1]) + keys[-1:]
        if double:
            self.counts[place] = self.counts.get(place, 0) + 1
        place = self._resolved(keys)
        self._note(place, start)
        return place

    def _resolved(self, keys: Place) -> Place:
        """Keys of a header; each array of tables is followed by the position of its last entry."""
        place: Place = ()
        for key in keys:
            place = (*place, key)
            if place in self.counts:
                place = (*place, self.counts[place] - 1)
        return place

    def _keys(self) -> Place:
        """Parts of a dotted key, up to the character that ends it."""
        keys = [self._key()]
        while self.text.startswith(".", self.at):
            self.at += 1
            keys.append(self._key())
        return tuple(keys)

    def _key(self) -> str:
        self._skip()
        quoted = self.text[self.at : self.at + 1] in ('"', "'")
        raw = self._take(_STRING if quoted else _BARE_KEY)
        self._skip()
        return str(tomllib.loads(f"key = {raw}")["key"]) if quoted else raw

    def _pair(self, table: Place) -> None:
        start = self.at
        place = table + self._keys()
        self.at += 1
        self._note(place, start)
        self._value(place)

    def _value(self, place: Place) -> None:
        self._skip()
        opening = self.text[self.at : self.at + 1]
        if opening == "[":
            self._array(place)
        elif opening == "{":
            self._inline_table(place)
        else:
            self._take(_STRING if opening in ('"', "'") else _BARE_VALUE)

    def _array(self, place: Place) -> None:
        position = 0
        while self._goes_on("]"):
            self._note((*place, position), self.at)
            self._value((*place, position))
            position += 1

    def _inline_table(self, place: Place) -> None:
        while self._goes_on("}"):
            self._pair(place)

    def _goes_on(self, closing: str) -> bool:
        """Skip the opening bracket or comma; False after the closing bracket."""
        self._skip()
        if self.text[self.at : self.at + 1] in ("[", "{", ","):
            self.at += 1
            self._skip()
        if self.at < len(self.text) and self.text[self.at] != closing:
            return True
        self.at += 1
        return False


@dataclass(frozen=True)
class StudyLines:
    """Name of the study file and the line of every place in it.

    `page` of the documentation explains its keys, and `whole` is what messages call all of it.
    """

    file: str
    lines: dict[Place, int] = field(default_factory=dict)
    page: str = "docs/study-file.md"
    whole: str = "the study file"

    def where(self, place: Place) -> Where:
        """The place itself, or the innermost table around it that exists in the file."""
        for length in range(len(place), 0, -1):
            if place[:length] in self.lines:
                return Where(self.file, self.lines[place[:length]], dotted(place))
        return Where(self.file, None, dotted(place))

    def error(
        self, place: Place, code: str, values: dict[str, Any], *, hint: str | None = None, **facts: Any
    ) -> FemtuneError:
        """An error at a place of this file; values are shown as TOML spells them."""
        shown = {name: spelled(value) for name, value in values.items()}
        return FemtuneError(code, where=self.where(place), values=shown, hint=hint, **facts)


def dotted(place: Place) -> str:
    """``parameter[2].lower``: the key `lower` of the second [[parameter]]."""
    parts = [f"[{part + 1}]" if isinstance(part, int) else f".{part}" for part in place]
    return "".join(parts).removeprefix(".")


def spelled(value: object, longest: int = 300) -> str:
    """A value as TOML spells it; long ones are cut."""
    if isinstance(value, dict):
        text = "{ " + ", ".join(f"{k} = {spelled(v)}" for k, v in list(value.items())[:20]) + " }"
    elif isinstance(value, list | tuple):
        text = "[" + ", ".join(spelled(v) for v in value[:20]) + "]"
    elif isinstance(value, bool):
        text = str(value).lower()
    elif isinstance(value, int) and abs(value) >= 10**longest:
        text = f"an integer of {value.bit_length()} bits"
    else:
        text = f'"{value}"' if isinstance(value, str) else str(value)
    return text if len(text) <= longest else text[: longest - 1] + "…"


# ----------------------------------------------------------------------------------------------------
# Access to plain TOML data whose types have not been checked yet.


def is_integer(value: object) -> bool:
    """True for an integer of TOML; booleans, which are integers in Python, are excluded."""
    return isinstance(value, int) and not isinstance(value, bool)


def is_number(value: object) -> bool:
    """True for an integer or float of TOML, whatever its size."""
    return is_integer(value) or isinstance(value, float)


def table(data: Data, name: str) -> Data:
    """The table called `name`; empty if there is none."""
    value = data.get(name)
    return value if isinstance(value, dict) else {}


def tables(data: Data, name: str) -> Iterator[tuple[Place, Data]]:
    """Place and content of each entry of an array of tables."""
    value = data.get(name)
    for i, entry in enumerate(value if isinstance(value, tuple) else ()):
        if isinstance(entry, dict):
            yield (name, i), entry


def falls(band: object) -> bool:
    """True for two numbers of which the second is not larger; types are checked elsewhere."""
    ends = [b for b in band if isinstance(b, int | float)] if isinstance(band, tuple | list) else []
    return isinstance(band, tuple | list) and len(band) == len(ends) == 2 and ends[0] >= ends[1]


def number(data: Data, key: str) -> float | None:
    """A finite number, or None for anything else."""
    value = data.get(key)
    if not is_number(value) or abs(value) > 1e300 or not math.isfinite(value):  # type: ignore[arg-type]
        return None
    return float(value)  # type: ignore[arg-type]


def texts(value: object) -> list[str]:
    """The texts among the entries of a list."""
    return [entry for entry in value if isinstance(entry, str)] if isinstance(value, tuple) else []


def named_twice(entries: list[tuple[Place, Data]], code: str, source: StudyLines) -> Iterator[FemtuneError]:
    """An error for each entry that has the name of an earlier one."""
    seen: dict[str, Place] = {}
    for place, entry in entries:
        name = entry.get("name")
        if not isinstance(name, str):
            continue
        if name in seen:
            line = source.where((*seen[name], "name")).line
            earlier = dotted(seen[name]) if line is None else f"the entry on line {line}"
            yield source.error((*place, "name"), code, {}, name=name, earlier=earlier)
        seen.setdefault(name, place)
