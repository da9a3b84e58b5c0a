"""The cell of a verdict."""

from __future__ import annotations

from femtune.report.document import Cell, Tone

_TONES: dict[str, Tone] = {"pass": "good", "fail": "poor", "not tested": "muted"}


def verdict_cell(verdict: str) -> Cell:
    """Pass, fail or not tested, in its tone."""
    return Cell(verdict, tone=_TONES[verdict])
