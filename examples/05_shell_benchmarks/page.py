"""Tables of the page, in Markdown."""

from __future__ import annotations

from collections.abc import Iterable


def numbers(values: Iterable[float], digits: int = 2) -> str:
    """Numbers with a sign, one blank between them."""
    return " ".join(f"{value:+.{digits}f}".replace("-", "−") for value in values)


def table(head: Iterable[str], rows: Iterable[Iterable[object]]) -> str:
    """A Markdown table."""
    names = [str(name) for name in head]
    lines = [names, ["---"] * len(names), *([str(cell) for cell in row] for row in rows)]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines) + "\n"


def section(title: str, *parts: str) -> str:
    """A heading and what stands under it."""
    return "\n".join([f"## {title}\n", *parts])
