"""Labels that fit."""

from __future__ import annotations

from collections.abc import Sequence

_WIDE_FROM = 0x2E80
"""From here on letters are as wide as they are high."""


def cut(text: str, length: int = 24) -> str:
    """A label that fits: long ones are cut, line breaks and control characters removed."""
    clean = "".join(c if c.isprintable() else " " for c in text)
    return clean if len(clean) <= length else clean[: length - 1] + "…"


def room(labels: Sequence[str]) -> float:
    """Points that labels of eight points take in a wide sans-serif, with the space beside them."""
    return max([sum(map(_width, cut(t))) for t in labels], default=4.0) + 8.0


def _width(letter: str) -> float:
    if ord(letter) > _WIDE_FROM:
        return 8.2
    return 6.4 if letter.isupper() or letter in "+−mw%≤≥" else 3.2 if letter in "ijl.,:;'| " else 5.2
