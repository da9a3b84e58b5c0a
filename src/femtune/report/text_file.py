"""Order, titles and opening words of the sections, from the files in text/."""

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


def section_texts(page: str = "report") -> tuple[SectionText, ...]:
    """All entries of a page, "report", "modes" or "responses", in their order."""
    text = files("femtune.report").joinpath(f"text/{page}.toml").read_text(encoding="utf-8")
    return tuple(SectionText(**entry) for entry in tomllib.loads(text)["section"])
