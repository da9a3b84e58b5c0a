"""[screen]: designed runs of the model."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, Literal

from pydantic import Field

from femtune.errors import FemtuneError
from femtune.files.study_file.kinds import Text, TomlTable
from femtune.files.study_file.source import StudyLines, table


class ScreenTable(TomlTable):
    """[screen]: which parameters matter for which mode, by runs at a few levels of each."""

    design: Literal["orthogonal", "factorial", "plackett-burman"] = "orthogonal"
    array: Text | None = None
    levels: Annotated[int, Field(ge=2, le=12)] = 3
    configuration: Text | None = None


def experiment_rules(data: dict[str, Any], source: StudyLines) -> Iterator[FemtuneError]:
    """A design and its levels fit each other."""
    screen = table(data, "screen")
    two = screen.get("design") == "plackett-burman"
    if two and screen.get("levels", 2) != 2:
        yield source.error(("screen", "levels"), "screen.design", {"levels": screen["levels"]})
    if "array" in screen and screen.get("design", "orthogonal") != "orthogonal":
        yield source.error(("screen", "array"), "screen.design/array", {"array": screen["array"]})
