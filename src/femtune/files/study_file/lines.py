"""On which line each key and value of a TOML text stands.

tomllib says nothing about places. The scanner walks a text that tomllib has accepted, so it checks nothing itself.
"""

from __future__ import annotations

import re
import tomllib
from bisect import bisect_right
from dataclasses import dataclass, field
from itertools import accumulate

Place = tuple[str | int, ...]
"""Keys and positions (from 0) that lead to a value: ``("parameter", 1, "lower")``."""

_BLANK = re.compile(r"(?:[ \t\r\n]|#[^\n]*)*")
_STRING = re.compile(
    r'"""(?:[^\\]|\\.)*?"{3,5}|' r"'''.*?'{3,5}|" r'"(?:[^"\\\n]|\\.)*"|' r"'[^'\n]*'",
    re.DOTALL,
)
_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")
_BARE_VALUE = re.compile(r"[^,\]}#\r\n]*")


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
        """Keys of a header with the position of the last entry behind each array of tables."""
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
        """Step over the opening bracket or comma; False once the closing bracket is behind."""
        self._skip()
        if self.text[self.at : self.at + 1] in ("[", "{", ","):
            self.at += 1
            self._skip()
        if self.at < len(self.text) and self.text[self.at] != closing:
            return True
        self.at += 1
        return False
