"""Alerts as boxes: if there are many of one kind, the first is shown in full, and the others are folded."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from femtune.document.document import AlertBox, Details

if TYPE_CHECKING:
    from femtune.document.document import Block
    from femtune.study.record import Alert

MOST_OF_A_KIND = 3
"""Boxes of one code that are all shown; of more, only the first is, and the others are listed on demand."""


def alert_boxes(alerts: Iterable[Alert]) -> list[Block]:
    """The boxes of alerts in their order, equal ones once."""
    kinds: dict[tuple[str, str], list[AlertBox]] = {}
    for a in alerts:
        same = kinds.setdefault((a.level, a.code), [])
        box = AlertBox(a.level, a.code, a.sentence, a.where)
        if box not in same:
            same.append(box)
    blocks: list[Block] = []
    for same in kinds.values():
        blocks += same if len(same) <= MOST_OF_A_KIND else _folded(same)
    return blocks


def _folded(same: list[AlertBox]) -> list[Block]:
    first, others = same[0], same[1:]
    box = AlertBox(first.level, first.code, f"{first.sentence}; and {len(others)} more of this kind", first.where)
    lines = (f"{one.sentence}{f' ({one.where})' if one.where else ''}" for one in others)
    return [box, Details(f"The other {len(others)} of the kind {first.code}", "\n".join(lines))]
