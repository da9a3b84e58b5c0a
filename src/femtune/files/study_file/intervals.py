"""[intervals]: frequencies of a box of parameters, or the box that gives frequencies between limits."""

from __future__ import annotations

from collections.abc import Iterator
from math import isfinite
from typing import Annotated, Any

from pydantic import Field

from femtune.errors import FemtuneError
from femtune.files.study_file.kinds import Positive, Text, TomlTable
from femtune.files.study_file.source import StudyLines, table


class IntervalsTable(TomlTable):
    """[intervals]: frequencies of a box of parameters, or the box that gives frequencies between limits."""

    limits_hz: tuple[tuple[Positive, Positive], ...] = ()
    """Lowest and highest value of each frequency in ascending order, Hz, beginning with the lowest elastic one: the box
    of the parameters is sought whose extreme frequencies these are. Default: none; the box is that of the bounds.
    Example: `[[10.2, 10.9], [33.1, 35.0]]`"""
    configuration: Text | None = None
    """Configuration that the limits belong to. Default: the first one. Example: `"as built"`"""
    count: Annotated[int, Field(ge=1, le=1000)] | None = None
    """Number of elastic frequencies of each configuration that are predicted. Default: those of the limits, or 6.
    Example: `4`"""


def interval_rules(data: dict[str, Any], source: StudyLines) -> Iterator[FemtuneError]:
    """Limits must be intervals, those of a lower frequency first."""
    limits = table(data, "intervals").get("limits_hz", ())
    before = (0.0, 0.0)
    for i, pair in enumerate(limits if isinstance(limits, list | tuple) else ()):
        numbers = isinstance(pair, list | tuple) and all(isinstance(v, int | float) and isfinite(v) for v in pair)
        if numbers and len(pair) == 2 and not pair[0] < pair[1]:
            yield source.error(("intervals", "limits_hz", i), "quantify.interval/limits", {"limits": list(pair)})
        elif numbers and len(pair) == 2:
            if pair[0] < before[0] or pair[1] < before[1]:
                values = {"limits": list(pair), "before": list(before)}
                yield source.error(("intervals", "limits_hz", i), "quantify.interval/order", values)
            before = pair[0], pair[1]
