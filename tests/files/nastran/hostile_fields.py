"""Decks with any field of their cards changed: what tests of single fields and of several at random share."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from femtune.errors import FemtuneError
from femtune.files.nastran import build_structure, read_deck
from femtune.files.nastran.write import plan_edits

VALUES = ("", "0", "-1.", "1", "2", "5", "11", ".5", "1.-30", "-1.+30", "1.+200", "1.7+308", "999999999999", "'<b>'")
Place = tuple[int, int]
Changes = Sequence[tuple[Place, str]]


def places(cards: Sequence[str]) -> list[Place]:
    """Line and number of all fields that the cards have."""
    return [(line, field) for line, text in enumerate(cards) for field in range(1, 10) if field <= text.count(",") + 1]


def changed(cards: Sequence[str], changes: Changes) -> str:
    """The deck with other values in some of its fields."""
    lines = [text.split(",") for text in cards]
    for (line, field), value in changes:
        lines[line] += [""] * (field + 1 - len(lines[line]))
        lines[line][field] = value
    return "".join(",".join(line) + "\n" for line in lines)


def check(path: Path, text: str) -> None:
    """The deck is a structure of finite values that can be written back, or an error of femtune."""
    path.write_text(text)
    try:
        model = build_structure(read_deck(path))
    except FemtuneError:
        return
    assert np.isfinite(model.structure.values.values).all()
    for ref in model.fields:
        index = model.structure.values.index(ref)
        assert index is not None
    plan_edits(model, dict.fromkeys(model.fields, 0.125))
