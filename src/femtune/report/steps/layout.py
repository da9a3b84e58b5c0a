"""How much fits a terminal of 100 columns."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

WIDTH = 100
GAP = 2
"""Between two columns."""


def column_groups(titles: Sequence[str], taken: int, least: int) -> list[tuple[str, ...]]:
    """Columns side by side as far as they fit.

    Parameters
    ----------
    titles : heads of the columns
    taken : width of what every group begins with
    least : width of the numbers, for heads that are shorter
    """
    groups: list[tuple[str, ...]] = []
    room = 0
    for title in titles:
        width = max(len(title), least) + GAP
        if width > room:
            groups.append(())
            room = WIDTH - taken
        groups[-1] += (title,)
        room -= width
    return groups


def widest(texts: Iterable[str]) -> int:
    """Length of the longest text; 0 where there is none."""
    return max(map(len, texts), default=0)
