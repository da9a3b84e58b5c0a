"""The table of cards in the guide, from the catalogue of the package.

A page has the table between the comments ``<!-- cards -->`` and ``<!-- end of cards -->``.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from itertools import groupby
from pathlib import Path

from femtune.files.nastran.catalogue import CATALOGUE, CardKind

PAGE = "guide/deck.md"
_MARKED = re.compile(r"(<!-- cards -->\n).*?(<!-- end of cards -->)", re.DOTALL)
_NUMBERED = re.compile(r"(.*?)(\d+)(\D?)")


def write_card_table(docs: Path) -> None:
    """Write the table of the page."""
    page = docs / PAGE
    text = page.read_text(encoding="utf-8")
    if (new := with_table(text)) != text:
        page.write_text(new, encoding="utf-8")


def with_table(text: str) -> str:
    """The text of a page with the table as it is now."""
    return _MARKED.sub(lambda mark: mark[1] + _table() + mark[2], text)


def _table() -> str:
    groups: dict[str, list[CardKind]] = {}
    for card in CATALOGUE.values():
        groups.setdefault(card.description, []).append(card)
    rows = [["cards", "description", "fields that can be updated"], ["---"] * 3]
    rows += [[", ".join(shortened(c.name for c in cards)), text, _fields(cards)] for text, cards in groups.items()]
    return "\n" + "".join(f"| {' | '.join(row)} |\n" for row in rows) + "\n"


def _fields(cards: Sequence[CardKind]) -> str:
    """Fields by card; cards with the same fields together."""
    by_fields: dict[str, list[str]] = {}
    for card in cards:
        if card.values:
            by_fields.setdefault(_values(card), []).append(card.name)
    return "; ".join(f"{', '.join(shortened(names))}: {fields}" for fields, names in by_fields.items())


def _values(card: CardKind) -> str:
    plies = [name.removesuffix("1") for name in card.values if card.has_plies and name.endswith("1")]
    others = [name for name in card.values if name.removesuffix("1") not in plies]
    return ", ".join([*shortened(others), *(f"{name} of each ply" for name in plies)])


def shortened(names: Iterable[str]) -> list[str]:
    """Names with runs of three or more numbers as ``K1 to K6``."""
    parts = [(match[1], int(match[2]), match[3]) if (match := _NUMBERED.fullmatch(n)) else (n, -1, "") for n in names]
    texts: list[str] = []
    for _, members in groupby(enumerate(parts), key=lambda item: (item[1][0], item[1][2], item[1][1] - item[0])):
        run = [f"{stem}{number if number >= 0 else ''}{tail}" for _, (stem, number, tail) in members]
        texts += [f"{run[0]} to {run[-1]}"] if len(run) > 2 else run
    return texts
