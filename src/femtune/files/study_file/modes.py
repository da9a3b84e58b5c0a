"""[modes]: the modes that are computed."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from femtune.files.study_file.kinds import HertzAboveZero, TomlTable
from femtune.files.study_file.source import Data, Problems, StudyLines, table


class ModesTable(TomlTable):
    """[modes]: number of modes, or highest frequency."""

    count: Annotated[int, Field(ge=1, le=100_000)] | None = None
    """Number of modes, including the rigid-body modes. Give at most one of `count` and `max_hz`. Example: `8`"""
    max_hz: HertzAboveZero | None = None
    """All modes up to this frequency, Hz. Example: `200.0`"""


def modes_rules(data: Data, source: StudyLines) -> Problems:
    """Number and highest frequency exclude each other."""
    modes = table(data, "modes")
    if "count" in modes and "max_hz" in modes:
        yield source.error(("modes", "max_hz"), "study.modes", modes)
