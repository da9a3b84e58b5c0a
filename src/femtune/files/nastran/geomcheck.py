"""GEOMCHECK statements of executive control: limits of the shape of elements."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

from femtune.fem.element_shapes import TESTS
from femtune.files.nastran.lines import parse_integer, parse_real
from femtune.files.nastran.source import SourceLine

_STATEMENT = re.compile(r"\s*GEOMCHECK(?=[\s,]|$)(.*)", re.IGNORECASE)
_ENTRY = re.compile(r"([A-Z0-9_]+)(?:\s*=\s*([^\s,=]+))?")
_SETTINGS = ("MSGLIMIT", "MSGTYPE", "SUMMARY", "FATAL", "WARN", "INFORM", "ADVNLELM")
"""Words that control the messages of a solver, and for which elements it prints them."""


@dataclass(frozen=True)
class GeometryChecks:
    """Requests of a deck.

    Parameters
    ----------
    limits : limits by key of the test
    off : True after GEOMCHECK NONE
    unknown : words that are not known tests, as written in the deck
    """

    limits: dict[str, float] = field(default_factory=dict)
    off: bool = False
    unknown: tuple[str, ...] = ()


def geometry_checks(lines: Iterable[SourceLine]) -> GeometryChecks:
    """Limits in lines of executive control; a later one replaces an earlier one.

    A statement that ends with a comma continues in the next line.

    Examples
    --------
    >>> from types import SimpleNamespace as Line
    >>> found = geometry_checks([Line(text="GEOMCHECK Q4_SKEW=15.0,"), Line(text=" T3_SKEW=5., MSGLIMIT=50")])
    >>> found.limits
    {'Q4_SKEW': 15.0, 'T3_SKEW': 5.0}
    """
    limits: dict[str, float] = {}
    unknown: list[str] = []
    off = False
    for word, value in (entry for text in _statements(lines) for entry in _entries(text)):
        number = _number(value)
        if word == "NONE":
            limits, off = {}, True
        elif word in TESTS and ((number is not None and number >= 0.0) or not value):
            off = False
            limits |= {} if number is None else {word: number}
        elif word not in _SETTINGS:
            unknown.append(f"{word}={value}" if value else word)
    return GeometryChecks(limits, off, tuple(dict.fromkeys(unknown)))


def _number(text: str) -> float | None:
    real, integer = parse_real(text), parse_integer(text)
    return real if integer is None else float(integer)


def _statements(lines: Iterable[SourceLine]) -> Iterator[str]:
    """Text after the word GEOMCHECK, with the continuations."""
    going = ""
    for line in lines:
        text = line.text.partition("$")[0].rstrip()
        match = _STATEMENT.match(text)
        if match is None and not going:
            continue
        going += match[1] if match else text
        if not going.rstrip().endswith(","):
            yield going
            going = ""
    if going:
        yield going


def _entries(text: str) -> Iterator[tuple[str, str]]:
    for match in _ENTRY.finditer(text.upper()):
        yield match[1], match[2] or ""
