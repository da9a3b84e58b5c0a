"""Order, titles and opening words of the sections, from text/report.toml."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from importlib.resources import files


@dataclass(frozen=True)
class SectionText:
    """One entry of the file."""

    id: str
    title: str
    intro: str = ""


def section_texts() -> tuple[SectionText, ...]:
    """All entries in their order."""
    text = files("femtune.report").joinpath("text/report.toml").read_text(encoding="utf-8")
    return tuple(SectionText(**entry) for entry in tomllib.loads(text)["section"])
