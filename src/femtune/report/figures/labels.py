"""Labels that fit."""

from __future__ import annotations


def cut(text: str, length: int = 24) -> str:
    """A label that fits: long ones are cut, line breaks and control characters removed."""
    clean = "".join(c if c.isprintable() else " " for c in text)
    return clean if len(clean) <= length else clean[: length - 1] + "…"
